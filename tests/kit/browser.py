"""A page in Debian's Chromium without a window, driven through the DevTools protocol."""

from __future__ import annotations

import asyncio
import base64
import itertools
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

from tornado.websocket import WebSocketClientConnection, websocket_connect

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 60.0  # seconds for the browser to answer
LARGEST = 1 << 28  # bytes of an answer


def find_browser() -> str:
    """Returns the program, "" where there is none."""
    return next((found for name in PROGRAMS if (found := shutil.which(name))), "")


class Page:
    """A page that is open."""

    def __init__(self, loop: asyncio.AbstractEventLoop, address: str) -> None:
        self._loop, self._number = loop, itertools.count(1)
        self.events: list[dict[str, Any]] = []  # errors that the page had
        self._socket = loop.run_until_complete(self._connect(address))
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    @staticmethod
    async def _connect(address: str) -> WebSocketClientConnection:
        return await websocket_connect(address, max_message_size=LARGEST)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Calls a method of the protocol; keeps what the page says meanwhile."""
        number = next(self._number)

        async def talk() -> dict[str, Any]:
            await self._socket.write_message(json.dumps({"id": number, "method": method, "params": parameters}))
            while True:
                text = await asyncio.wait_for(self._socket.read_message(), PATIENCE)
                answer = json.loads(text or "{}")
                if answer.get("id") == number:
                    return answer
                self.events.append(answer)

        answer = self._loop.run_until_complete(talk())
        assert "error" not in answer, answer
        return answer.get("result", {})

    def close(self) -> None:
        """Ends the connection, and waits for its end: one that Python finds open later is an error of any test."""

        async def end() -> None:
            self._socket.close()
            while await asyncio.wait_for(self._socket.read_message(), PATIENCE) is not None:
                pass
            others = asyncio.all_tasks() - {asyncio.current_task()}
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

        self._loop.run_until_complete(end())

    def run(self, script: str) -> Any:
        """Evaluates a script, waiting for its promise; what it throws fails."""
        found = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait(self, script: str) -> None:
        """Waits until a script is true."""
        end = time.monotonic() + PATIENCE
        while not self.run(script):
            assert time.monotonic() < end, script
            time.sleep(0.02)

    def resize(self, width: int, height: int) -> None:
        """Gives what is seen of the page another size [pixels]."""
        shape = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **shape)

    def screenshot(self, file: Path) -> bytes:
        """Takes what is seen as a PNG."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        file.write_bytes(data)
        return data

    def drag(self, *places: tuple[float, float]) -> None:
        """Presses the mouse at the first place, moves it through the others and lets it go at the last [pixels]."""
        kinds = ["mousePressed", *["mouseMoved"] * (len(places) - 1), "mouseReleased"]
        for kind, (x, y) in zip(kinds, [*places, places[-1]], strict=True):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    @property
    def troubles(self) -> list[str]:
        """What went wrong in the page: exceptions, refused or failed loads, and addresses that it asked for."""
        bad = [e for e in self.events if e.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded")]
        asked = [e for e in self.events if e.get("method") == "Network.requestWillBeSent"]
        urls = [e["params"]["request"]["url"] for e in asked]
        return [json.dumps(e["params"])[:300] for e in bad] + [u[:80] for u in urls if u.startswith(("http", "ws"))]


@contextmanager
def opened(file: Path, folder: Path, size: tuple[int, int] = (1500, 1000)) -> Iterator[Page]:
    """Opens a file as a page; what it saves goes to `folder`."""
    profile = folder / "profile"
    (profile / "DevToolsActivePort").unlink(missing_ok=True)  # of an earlier browser
    command = [
        find_browser(), "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
        "--remote-debugging-port=0", f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}",
        "--disable-background-networking", "--disable-extensions", "about:blank",
    ]  # fmt: skip
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    loop, ended = asyncio.new_event_loop(), ExitStack()
    try:
        port = _port(profile, process)
        new = Request(f"http://127.0.0.1:{port}/json/new?about:blank", method="PUT")
        with urlopen(new, timeout=PATIENCE) as answer:
            address = json.load(answer)["webSocketDebuggerUrl"]
        page = Page(loop, address)
        ended.callback(page.close)
        page.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(folder))
        page.resize(*size)
        page.call("Page.navigate", url=file.resolve().as_uri())
        page.wait("document.readyState === 'complete'")
        yield page
    finally:
        ended.close()
        process.terminate()
        process.wait(PATIENCE)
        loop.run_until_complete(asyncio.sleep(0))
        loop.close()


def _port(profile: Path, process: subprocess.Popen[bytes]) -> int:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and process.poll() is None:
        file = profile / "DevToolsActivePort"
        if file.is_file() and (text := file.read_text().split()):
            return int(text[0])
        time.sleep(0.05)
    raise AssertionError("the browser does not start")
