"""Autosave: strokes are on the disk after each change, beside their layer, and come back after a crash.

Written on a thread of its own, the latest state only, and removed once the strokes are saved or given up.  Where the
folder of the stroke layer cannot be written to, or there is no layer yet, they go to the user's own state folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from platformdirs import user_state_path

from hydra_viewer.model.document import Document, Files, Strokes
from usdslf import Shot, UsdslfError, read_strokes, write_strokes

REST = 0.03  # seconds in which a stroke is shown first


def autosave_path(files: Files) -> Path:
    """Returns where the strokes of files are kept until they are saved."""
    if files.strokes:
        layer = Path(files.strokes).absolute()
        if os.access(layer.parent, os.W_OK):
            return layer.with_name(f".{layer.stem}.autosave.usda")
    name = hashlib.sha256("\n".join((os.path.abspath(files.stage), files.strokes)).encode()).hexdigest()[:24]
    return user_state_path("usdslf") / "autosave" / f"{name}.usda"


@dataclass(frozen=True)
class Recovered:
    """Strokes that were painted and not saved, and when they were kept [seconds since 1970]."""

    strokes: Strokes
    kept_at: float


def recovered(files: Files) -> Recovered | None:
    """Returns what a session that did not end well left of strokes; None: nothing that can be read."""
    path = autosave_path(files)
    if not path.is_file():
        return None
    with contextlib.suppress(UsdslfError, OSError):
        return Recovered(tuple(read_strokes(path)), path.stat().st_mtime)
    return None


class Autosave:
    """Keeps the strokes of a document on the disk.

    Attributes:
        is_held: nothing is written for now: the shot is read anew.
        is_writing: the shot is read to write what was wanted before.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        self._wanted: tuple[Shot, Files, Strokes] | None = None
        self._is_working, self._is_paused, self._is_stopped = False, True, False
        self.is_held = self.is_writing = False
        self._thread: threading.Thread | None = None
        self._condition = threading.Condition()
        document.strokes_changed.connect(self.keep)

    def begin(self) -> None:
        """Keeps strokes from now on: what an earlier session left was looked at."""
        self._is_paused = False
        if self._thread is None:  # not at the first stroke: a thread takes its time to start
            self._thread = threading.Thread(target=self._work, name="viewer-autosave", daemon=True)
            self._thread.start()

    def hold(self, is_held: bool) -> None:
        """Writes nothing for now, or what is wanted since."""
        with self._condition:
            self.is_held = is_held
            self._condition.notify_all()

    def stop(self) -> None:
        """Keeps none any more, once all that was asked for is on the disk."""
        self.flush()
        with self._condition:
            self._is_stopped = self._is_paused = True
            self._condition.notify_all()
        if self._thread is not None:
            self._thread.join(timeout=10)

    def pause(self) -> None:
        """Keeps none until `begin`; what is there stays."""
        self._is_paused = True

    def forget(self) -> None:
        """Removes what is kept: the strokes are saved, or given up."""
        self.flush()
        files = self._document.files
        if files.stage:
            with contextlib.suppress(OSError):
                autosave_path(files).unlink(missing_ok=True)

    def flush(self) -> None:
        """Waits until all that was asked for is on the disk."""
        self.hold(False)
        with self._condition:
            self._condition.wait_for(lambda: not self._is_working, timeout=10)

    def keep(self) -> None:
        """Keeps the strokes as they are, unless paused."""
        document = self._document
        if document.shot is None or self._is_paused:
            return
        with self._condition:
            self._wanted = document.shot, document.files, document.strokes
            self._is_working = True
            self._condition.notify_all()

    def _work(self) -> None:
        while True:
            with self._condition:
                is_due = lambda: self._is_stopped or (self._wanted is not None and not self.is_held)  # noqa: E731
                self._condition.wait_for(is_due)
                wanted, self._wanted = self._wanted, None
                self.is_writing = wanted is not None
            if wanted is None:
                return
            time.sleep(REST)
            shot, files, strokes = wanted
            path = autosave_path(files)
            with contextlib.suppress(UsdslfError, OSError):  # a disk that is full is said when the layer is saved
                path.parent.mkdir(parents=True, exist_ok=True)
                write_strokes(path, strokes, shot.source)
            with self._condition:
                self._is_working, self.is_writing = self._wanted is not None, False
                self._condition.notify_all()
