"""A Dask scheduler and workers on the loopback, as processes that tests may end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Cluster:
    """A scheduler at a port, and its workers."""

    folder: Path  # of their logs and local files
    port: int = field(default_factory=lambda: _free_port())
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    @property
    def address(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    def start_scheduler(self) -> None:
        options = ["--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard", "--no-show"]
        self._start("scheduler", "distributed.cli.dask_scheduler", options)

    def start_worker(self, name: str) -> None:
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(self.folder)]
        self._start(name, "distributed.cli.dask_worker", [self.address, *options, "--death-timeout", "60"])

    def _start(self, name: str, module: str, options: list[str]) -> None:
        self.end(name)
        with (self.folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", module, *options], stdout=log, stderr=log, start_new_session=True
            )

    def jobs_of(self, name: str) -> list[int]:
        """Processes that a worker started."""
        found = []
        for thread in Path(f"/proc/{self.processes[name].pid}/task").glob("*"):
            found += [int(p) for p in (thread / "children").read_text().split()]
        return found

    @staticmethod
    def has_ended(process: int) -> bool:
        """Whether a process computes no more; who inherited it may not have asked yet how it ended."""
        try:
            state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        return state in "ZX"

    def kill(self, name: str) -> None:
        """kill -9"""
        self.processes[name].send_signal(signal.SIGKILL)
        self.processes[name].wait()

    def end(self, name: str) -> None:
        process = self.processes.pop(name, None)
        if process is not None and process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def end_all(self) -> None:
        for name in list(self.processes):
            self.end(name)


def _free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])
