"""Two Hydra viewports at once, in a process of its own: `python kit/hydra_two.py FOLDER` writes FOLDER/two.npz.

Each call of an engine is noted, and made longer by a pause without Python's lock, so that two threads that are not kept
apart would be in it together.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from usdslf import choose_pxr

CHOICE = choose_pxr()

from kit.hydra_pictures import lit, shot_of  # noqa: E402

from hydra_viewer.hydra.engine import Engine  # noqa: E402
from hydra_viewer.ui.application import make_application  # noqa: E402
from hydra_viewer.ui.hydra_renderer import HydraRenderer  # noqa: E402
from hydra_viewer.ui.viewport import Shown  # noqa: E402

PAUSE = 0.02  # seconds
ENOUGH = 6  # pictures of each
PATIENCE = 120.0  # seconds

within: Counter[int] = Counter()  # calls that a thread is in
calls: Counter[int] = Counter()  # that a thread made
most = [0]  # threads in a call at once
noting = threading.Lock()


def noted(call: Callable[..., Any]) -> Callable[..., Any]:
    """Notes who is in a call."""

    def noted_call(*arguments: Any, **more: Any) -> Any:
        own = threading.get_ident()
        with noting:
            within[own] += 1
            calls[own] += 1
            most[0] = max(most[0], sum(1 for n in within.values() if n))
        try:
            time.sleep(PAUSE)
            return call(*arguments, **more)
        finally:
            with noting:
                within[own] -= 1

    return noted_call


def main(folder: Path) -> None:
    app = make_application()
    for name in ("__init__", "draw", "release"):
        setattr(Engine, name, noted(getattr(Engine, name)))
    drawn, failed = Counter[int](), list[str]()
    renderers = [HydraRenderer(), HydraRenderer()]
    for number, renderer in enumerate(renderers):
        shot = shot_of(lit, folder / str(number))
        renderer.drawn.connect(lambda _, n=number: drawn.update([n]))
        renderer.failed.connect(failed.append)
        wish = {"shown": Shown(shot, shot), "camera": shot.camera(), "size": (96, 54)}
        renderer.ask(lambda old, wish=wish: replace(old, **wish))  # type: ignore[misc]
    until = time.monotonic() + PATIENCE
    while min(drawn[0], drawn[1]) < ENOUGH and not failed and time.monotonic() < until:
        app.processEvents()
        for renderer in renderers:  # a camera that moves: there is always something to draw
            renderer.ask(lambda old: replace(old, camera=replace(old.camera), is_moving=not old.is_moving))  # type: ignore[type-var]
        time.sleep(0.01)
    for renderer in renderers:
        renderer.finish()
    np.savez(folder / "two.npz", most=most[0], drawn=[drawn[0], drawn[1]], threads=len(calls), failed=failed)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
