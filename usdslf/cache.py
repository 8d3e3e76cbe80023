"""Cache: arrays that are slow to compute, kept between runs in the user's cache folder.

    address(kind, version, *parts) -> str                 names an entry by all that it is computed from
    arrays(name, compute) -> {name: array}                read, or computed and kept
    Cache(folder, limit).entries() / .size() / .clear()   what is kept

An entry is a file that is named by its content's origin, so it never has to be invalidated: other code, other text of
a kernel or other parameters have another name.  Files are written beside their place and renamed into it, so processes,
also on several machines that share a home, see whole entries or none; two that compute the same write the same.  What
is read is marked as used, and the least recently used go when all of it is larger than its limit.  An entry that is
damaged (its checksum is wrong) is computed anew, and that is said once in the log.  Files and not a database, as a
home on a network drive has no reliable locks.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import NDArray
from platformdirs import user_cache_dir

from usdslf.array_file import Room, new_room, read_arrays, write_arrays
from usdslf.errors import InputError

LIMIT = 4 << 30  # bytes of all entries; a shot of 10000 elements is 0.07 of it, the weights of both models 0.01
SWITCH = "USDSLF_CACHE"  # environment variable: all (default) | weights: nothing of shots | off
TRIMMED = 0.9  # of the limit is left when something had to go
ABANDONED = 3600.0  # seconds after which a file that was never renamed is nobody's any more
SUFFIX = ".arrays"
_FORMAT = 2  # raise it when entries are stored otherwise
_log = logging.getLogger(__name__)
_said: set[Path] = set()  # damaged entries that were spoken of

Arrays = Mapping[str, NDArray]


def address(kind: str, version: int, *parts: str | bytes | int | float) -> str:
    """Names an entry by what it is computed from.

    Args:
        kind: a word for people who look into the folder.
        version: of the code that computes it; raise it when that computes something else.
        parts: all else that it depends on, e.g. the text of a kernel, parameters.

    Returns: `kind` and 24 hexadecimal digits.
    """
    code = hashlib.sha256(f"{_FORMAT} {version}".encode())
    for part in parts:
        data = part if isinstance(part, bytes) else repr(part).encode()
        code.update(f"{len(data)} ".encode() + data)
    return f"{kind}-{code.hexdigest()[:24]}"


def cache_folder() -> Path:
    """Returns the folder of this user's entries; it need not be there."""
    return Path(user_cache_dir("usdslf", appauthor=False))


def arrays(
    name: str, compute: Callable[[], Arrays], of_shot: bool = False, room: Room = new_room
) -> dict[str, NDArray]:  # fmt: skip
    """Returns the arrays of an entry of the user's cache, computed where it has none.

    Args:
        name: of `address`.
        compute: gives the arrays by name, of numbers.
        of_shot: it serves one shot, and is large.
        room: memory that arrays which are there are read to.
    """
    if not keeps(of_shot):
        return dict(compute())
    return Cache(cache_folder()).arrays(name, compute, room)


def has(name: str) -> bool:
    """Tells whether the user's cache has an entry, be it whole or not."""
    return (cache_folder() / (name + SUFFIX)).exists()


def keeps(of_shot: bool) -> bool:
    """Tells whether anything is kept between runs (`USDSLF_CACHE`).

    Args:
        of_shot: what serves one shot.

    Raises: InputError for a value that there is not.
    """
    switch = os.environ.get(SWITCH) or "all"
    if switch not in ("all", "weights", "off"):
        raise InputError(f"{SWITCH}={switch} is not known; set all, weights or off")
    return switch == "all" or (switch == "weights" and not of_shot)


@contextlib.contextmanager
def switched(switch: str) -> Iterator[None]:
    """Sets what is kept, all | weights | off, for this process meanwhile."""
    before = os.environ.get(SWITCH)
    os.environ[SWITCH] = switch
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(SWITCH, None)
        else:
            os.environ[SWITCH] = before


@dataclass(frozen=True)
class Entry:
    """A file of the cache."""

    path: Path
    size: int  # bytes
    used: float  # seconds since the epoch


@dataclass(frozen=True)
class Cache:
    """The entries of one folder."""

    folder: Path
    limit: int = LIMIT  # bytes

    def arrays(self, name: str, compute: Callable[[], Arrays], room: Room = new_room) -> dict[str, NDArray]:
        """Returns the arrays of an entry, computed and kept where there is none, or none that is whole.

        Args:
            name, compute, room: as of `arrays`.
        """
        file = self.folder / (name + SUFFIX)
        found = _read(file, room)
        if found is None:
            found = dict(compute())
            self._keep(file, found)
        return found

    def entries(self) -> list[Entry]:
        """Returns all files of the folder, the least recently used first."""
        found = []
        for path in self.folder.glob("*") if self.folder.is_dir() else ():
            try:
                state = path.stat()
            except OSError:  # another process was quicker
                continue
            if path.is_file():
                found.append(Entry(path, state.st_size, state.st_mtime))
        return sorted(found, key=lambda entry: (entry.used, entry.path.name))

    def size(self) -> int:
        """Returns the bytes of all entries."""
        return sum(entry.size for entry in self.entries())

    def clear(self) -> int:
        """Removes all entries; returns how many went."""
        return sum(_remove(entry) for entry in self.entries())

    def _keep(self, file: Path, found: Arrays) -> None:
        """Writes an entry; a cache that cannot be written is no error."""
        temporary = None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self.folder, prefix=".", suffix=SUFFIX, delete=False) as out:
                temporary = Path(out.name)
                write_arrays(out, found)
            os.replace(temporary, file)
            temporary = None
            self._trim()
        except OSError as error:
            _log.debug("%s is not kept: %s", file, error)
        finally:  # also where it was interrupted
            if temporary is not None:
                temporary.unlink(missing_ok=True)

    def _trim(self) -> None:
        """Removes what was used least recently where all is too large, and what a killed run left unfinished."""
        entries = self.entries()
        old = time.time() - ABANDONED
        left = [e for e in entries if not (e.path.name.startswith(".") and e.used < old and _remove(e))]
        size = sum(e.size for e in left)
        if size <= self.limit:
            return
        for entry in left:
            if size <= TRIMMED * self.limit:
                return
            size -= entry.size * _remove(entry)


def _remove(entry: Entry) -> bool:
    try:
        entry.path.unlink()
    except OSError:
        return False
    return True


def _read(file: Path, room: Room) -> dict[str, NDArray] | None:
    """The arrays of an entry, which is marked as used; None where there is none that is whole."""
    try:
        found = read_arrays(file, room)
    except OSError:
        return None
    except ValueError as error:
        if file not in _said:
            _said.add(file)
            _log.warning("the cache entry %s is damaged (%s); it is made anew", file, error)
        return None
    with contextlib.suppress(OSError):  # of a folder that can only be read
        os.utime(file)
    return found
