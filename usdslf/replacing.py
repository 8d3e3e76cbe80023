"""Files that are whole or not there: written beside their place and renamed into it.

    replacing(path, error) -> context manager of a temporary Path     renamed to `path` if the block ends well
    beside(path) -> Path                                              a name for it that nobody else has
    put_in_place(temporary, path) -> None                             on the disk, then renamed
    check_place(path, error) -> None                                  whether a file can be written there
    is_file(path, error), is_folder(path, error) -> bool              no, or a sentence where nobody may look

A path that may not be looked at (a locked folder on the way, a name that is too long) is another matter than one where
nothing is: Path.is_file and its kin raise for some and say no to others, from one Python to the next.

A run that fails, is interrupted or is killed leaves the earlier file untouched; only one that is killed (or lost its
power) leaves the temporary file too, whose name begins with a dot.  All files that people keep go this way.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import stat
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
    check_folder(path, error)
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


def check_place(path: str | os.PathLike[str], error: type[UsdslfError] = InputError) -> None:
    """Raises `error` where no file can be written at `path`; a long run should not find out at its end."""
    path = Path(path)
    check_folder(path, error)
    if not os.access(path.parent, os.W_OK | os.X_OK) or (is_file(path, error) and not os.access(path, os.W_OK)):
        raise error(f"{path} cannot be written: permission denied; choose another place")


def check_folder(path: Path, error: type[UsdslfError]) -> None:
    """Raises `error` where there is no folder for a file, or the file is a folder."""
    if not is_folder(path.parent, error):
        raise error(f"{path} cannot be written: there is no folder {path.parent}; create it first")
    if is_folder(path, error):
        raise error(f"{path} cannot be written: it is a folder; give the name of a file")


def is_file(path: str | os.PathLike[str], error: type[UsdslfError] = InputError) -> bool:
    """Tells whether there is a file.  Raises: `error` where that cannot be told."""
    return stat.S_ISREG(_mode(path, error))


def is_folder(path: str | os.PathLike[str], error: type[UsdslfError] = InputError) -> bool:
    """Tells whether there is a folder.  Raises: `error` where that cannot be told."""
    return stat.S_ISDIR(_mode(path, error))


def _mode(path: str | os.PathLike[str], error: type[UsdslfError]) -> int:
    """What stands at a path, as the system says it; 0: nothing."""
    try:
        return os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # a name with a null in it is none
        return 0
    except OSError as failed:
        reason = str(failed.strerror or failed).lower()
        raise error(f"{os.fspath(path)} cannot be looked at: {reason}; check its folders' rights or its name") from None


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
