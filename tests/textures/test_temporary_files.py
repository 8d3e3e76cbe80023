"""Temporary files of a process go when it ends, and when it was killed, as soon as another one needs some."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from usdslf.textures import temporary_files

pytest.importorskip("fcntl", reason="abandoned folders are told from others by locks that Windows does not have")

MAKES_ONE = "from usdslf.textures.temporary_files import folder; print(folder(), flush=True)"
LONG_AGO = (1.0, 1.0)  # seconds since the epoch


@contextmanager
def running(tmp: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A process that has made its folder, and waits."""
    environment = {**os.environ, "TMPDIR": str(tmp)}
    code = MAKES_ONE + "; input()"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], env=environment, text=True, **pipes) as process:
        assert process.stdout
        made = Path(process.stdout.readline().strip())
        os.utime(made, LONG_AGO)
        yield process, made


def test_a_killed_process_folder_goes_with_the_next_one_and_a_living_one_stays(tmp_path: Path) -> None:
    with running(tmp_path) as (killed, abandoned), running(tmp_path) as (living, in_use):
        assert abandoned.is_dir(), "it was in use when the second one was made"
        killed.send_signal(signal.SIGKILL)
        killed.wait()
        assert abandoned.is_dir()
        environment = {**os.environ, "TMPDIR": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", MAKES_ONE], env=environment, text=True, capture_output=True, check=True
        )
        assert not Path(done.stdout.strip()).exists(), "its own goes when it ends"
        assert not abandoned.exists()
        assert in_use.is_dir()
        living.communicate("\n")
    assert list(tmp_path.iterdir()) == []


def test_a_drive_without_locks_serves_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(temporary_files, "_folders", {})
    monkeypatch.setattr("fcntl.flock", refuse)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    made = temporary_files.folder()
    assert made.parent == tmp_path and made == temporary_files.folder() and list(made.iterdir()) == []
    os.utime(made, LONG_AGO)
    monkeypatch.undo()
    monkeypatch.setattr(temporary_files, "_folders", {})
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    temporary_files.folder()
    assert made.is_dir(), "nobody's to remove"
    temporary_files._remove()
