"""Files that are whole or not there: written beside their place and renamed into it.

    replacing(path, error) -> context manager of a temporary Path     renamed to `path` if the block ends well
    beside(path) -> Path                                              a name for it that nobody else has
    put_in_place(temporary, path) -> None                             on the disk, then renamed

A run that fails, is interrupted or is killed leaves the earlier file untouched; only one that is killed (or lost its
power) leaves the temporary file too, whose name begins with a dot.  All files that people keep go this way.
"""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterator
from pathlib import Path

from usdslf.errors import InputError, UsdslfError
from usdslf.progress import undisturbed

_numbers = itertools.count()  # so that two threads of a process do not share a name


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], error: type[UsdslfError] = InputError) -> Iterator[Path]:
    """Yields a temporary name beside `path`, and renames it to `path` when the block ends without error.

    Args:
        path: where the file goes; what is there is replaced.
        error: what is raised where it cannot be written, also for an OSError of the block.

    Raises:
        UsdslfError: of the kind `error`: the folder is missing, `path` is a folder, or the file cannot be written.
    """
    path = Path(path)
    if not os.path.isdir(path.parent):
        raise error(f"{path} cannot be written: there is no folder {path.parent}; create it first")
    if os.path.isdir(path):
        raise error(f"{path} cannot be written: it is a folder; give the name of a file")
    temporary = beside(path)
    with undisturbed():
        try:
            yield temporary
            put_in_place(temporary, path)
        except OSError as failed:
            reason = " ".join(str(failed.strerror or failed).split())
            raise error(f"{path} cannot be written: {reason}; choose another place") from None
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def beside(path: Path) -> Path:
    """Returns a hidden name in the folder of `path`; its suffix stays last, since it decides the format."""
    return path.parent / f".{path.stem}.{os.getpid()}.{next(_numbers)}{path.suffix}"


def put_in_place(temporary: Path, path: Path) -> None:
    """Renames a written file to `path` once its content is on the disk.

    Raises: OSError.
    """
    with temporary.open("rb") as written:
        os.fsync(written.fileno())
    temporary.replace(path)
