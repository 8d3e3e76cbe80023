"""Array files: arrays by name in one file, read about as quickly as memory is copied, and damage is seen.

    write_arrays(stream, arrays)
    read_arrays(path, room) -> {name: array}       ValueError where the file is not whole

A head in JSON says what there is and the sum of each array; what follows are the arrays as they lie in memory, each
from a multiple of ALIGNED bytes on.  A sum is a hash of the sums, modulo 2^64, of the columns and of the rows of each
block of ROWS x WORDS words: at a fifth of a CRC's time any change of a byte, of a row or of a page is seen, and no
Python is run for most of it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

MAGIC = b"usdslf a"
ALIGNED = 64  # bytes
WORDS = 2048  # of a row, eight bytes each: 16 KiB
ROWS = 64  # of a block: 1 MiB, which stays in the second-level cache
_DIGEST = 16  # bytes
_KINDS = "biuf"  # of dtypes that are kept

Room = Callable[[str, tuple[int, ...], np.dtype[Any]], NDArray[Any]]
"""Name, shape and dtype of an array -> memory that it is read to, contiguous."""


def new_room(_: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Returns fresh memory."""
    return np.empty(shape, dtype)


def write_arrays(stream: IO[bytes], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Writes arrays of numbers.

    Raises: OSError, ValueError for an array of another kind.
    """
    listed: dict[str, list[Any]] = {}
    contents: list[tuple[int, NDArray[Any]]] = []
    at = 0
    for name, array in arrays.items():
        if array.dtype.kind not in _KINDS:
            raise ValueError(f"arrays of {array.dtype} are not kept")
        whole = np.asarray(array, order="C")
        at = _up(at)
        listed[name] = [whole.dtype.str, list(whole.shape), at, _sum_of(_bytes_of(whole))]
        contents.append((at, whole))
        at += whole.nbytes
    head = json.dumps({"arrays": listed, "size": at}).encode()
    stream.write(MAGIC + len(head).to_bytes(8, "little") + hashlib.blake2b(head, digest_size=_DIGEST).digest() + head)
    written = len(MAGIC) + 8 + _DIGEST + len(head)
    first = _up(written)
    for at, whole in contents:
        stream.write(b"\0" * (first + at - written))
        stream.write(_bytes_of(whole).data)
        written = first + at + whole.nbytes


def read_arrays(path: Path, room: Room = new_room) -> dict[str, NDArray[Any]]:
    """Reads the arrays of a file.

    Args:
        room: where each is read to.

    Raises: OSError, ValueError where it is not whole.
    """
    with path.open("rb", buffering=0) as stream:
        start = len(MAGIC) + 8 + _DIGEST
        begin = stream.read(start)
        length = int.from_bytes(begin[len(MAGIC) : len(MAGIC) + 8], "little")
        if len(begin) < start or begin[: len(MAGIC)] != MAGIC or length > 1 << 24:
            raise ValueError("it does not begin as such files do")
        text = stream.read(length)
        if hashlib.blake2b(text, digest_size=_DIGEST).digest() != begin[-_DIGEST:]:
            raise ValueError("its head is not whole")
        head, first = json.loads(text), _up(start + length)
        if path.stat().st_size != first + head["size"]:
            raise ValueError("it has another size than its head says")
        found = {}
        for name, (dtype, shape, at, expected) in head["arrays"].items():
            array = room(name, tuple(shape), np.dtype(dtype))
            assert array.nbytes == prod(shape) * np.dtype(dtype).itemsize and array.flags.c_contiguous
            content = _bytes_of(array)
            stream.seek(first + at)
            _fill(stream, content)
            if _sum_of(content) != expected:
                raise ValueError(f"the sum of '{name}' is wrong")
            found[name] = array
    return found


def _fill(stream: Any, content: NDArray[np.uint8]) -> None:
    """Reads as many bytes as there is room for."""
    view, done = content.data, 0
    while done < len(content):  # a call reads 2 GiB at most
        count = stream.readinto(view[done:])
        if not count:
            raise ValueError("it ends too early")
        done += count


def _bytes_of(array: NDArray[Any]) -> NDArray[np.uint8]:
    return array.reshape(-1).view(np.uint8)


def _sum_of(content: NDArray[np.uint8]) -> str:
    code = hashlib.blake2b(digest_size=_DIGEST)
    whole = len(content) // (8 * WORDS * ROWS) * (8 * WORDS * ROWS)
    blocks = content[:whole].view(np.uint64).reshape(-1, ROWS, WORDS)
    for axis in (1, 2) if whole else ():  # all at once: each call may have to wait for Python's lock
        code.update(_bytes_of(blocks.sum(axis)).data)
    code.update(content[whole:].data)
    return code.hexdigest()


def _up(at: int) -> int:
    return -(-at // ALIGNED) * ALIGNED
