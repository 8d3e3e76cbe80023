"""The folder of a process's temporary files: it goes when the process ends, or else when another one makes its own.

Files inside .usdz packages and tiled copies of large images lie there, gigabytes on some shots, and a process that is
killed leaves them.  So each folder holds a file that its process keeps locked; who makes a folder removes those of its
own host whose lock is free.  A lock and not a process's number, which is another one in another container with the
same $TMPDIR; of its own host, since locks of some network drives are not seen by others.  A folder without that file is
nobody's to remove: where a drive has no locks, what a killed process leaves stays.
"""

from __future__ import annotations

import atexit
import os
import platform
import re
import shutil
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

try:
    import fcntl
except ImportError:  # not on Windows: what a killed process leaves stays there
    fcntl = None  # type: ignore[assignment]

PREFIX = f"usdslf_images_{re.sub('[^A-Za-z0-9-]', '', platform.node())}_"
_LOCK = "in_use"
_FRESH = 60.0  # seconds; a folder that was made just now may not be locked yet
_guard = threading.Lock()
_folders: dict[int, tuple[Path, IO[bytes] | None]] = {}  # by process, since a fork must not remove its parent's


def folder() -> Path:
    """Returns the folder of this process's temporary files, in $TMPDIR; made at the first call."""
    with _guard:
        if os.getpid() not in _folders:
            _remove_abandoned(Path(tempfile.gettempdir()))
            made = Path(tempfile.mkdtemp(prefix=PREFIX))
            _folders[os.getpid()] = made, _locked(made / _LOCK)
        return _folders[os.getpid()][0]


def _locked(path: Path) -> IO[bytes] | None:
    """A file that others find locked until it is closed or this process ends; None where there are no locks."""
    if not fcntl:
        return None
    file = path.open("wb")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        with suppress(OSError):
            path.unlink()
        return None
    return file


def _remove_abandoned(root: Path) -> None:
    """Removes the folders whose process has ended without doing so."""
    if not fcntl:
        return
    for made in root.glob(PREFIX + "*"):
        try:
            if time.time() - made.stat().st_mtime < _FRESH:
                continue
            with (made / _LOCK).open("r+b") as file:  # some drives lock only what may be written
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(made, ignore_errors=True)
        except OSError:  # in use, another user's, or gone meanwhile
            continue


@atexit.register
def _remove() -> None:
    made, file = _folders.pop(os.getpid(), (None, None))
    if file:
        file.close()
    if made:
        shutil.rmtree(made, ignore_errors=True)
