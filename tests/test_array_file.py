"""Array files: what was written is read, to the memory that is asked for, and no damage is overlooked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from usdslf.array_file import ALIGNED, ROWS, WORDS, read_arrays, write_arrays

BLOCK = 8 * WORDS * ROWS  # bytes that are summed up at once


def written(path: Path, **arrays: NDArray[Any]) -> Path:
    with path.open("wb") as stream:
        write_arrays(stream, arrays)
    return path


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6, dtype=np.int16).reshape(2, 3), np.zeros((0, 3), np.float32), np.array(2.5),
        np.array([True, False]), np.arange(24.0).reshape(4, 6)[:, ::2], np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.array([1, 2], ">u4"), np.full(BLOCK + 3, 7, np.uint8), np.array([np.nan, -0.0], np.float16),
    ],
)  # fmt: skip
def test_an_array_is_read_as_it_was(array: NDArray[Any], tmp_path: Path) -> None:
    found = read_arrays(written(tmp_path / "a", first=np.arange(3), second=array))
    assert list(found) == ["first", "second"]
    assert found["second"].dtype == array.dtype and found["second"].shape == array.shape
    assert found["second"].tobytes() == array.tobytes()


def test_arrays_lie_in_the_file_as_in_memory_and_aligned(tmp_path: Path) -> None:
    """Read by numpy alone."""
    a, b = np.arange(5, dtype=np.uint8), np.linspace(0, 1, 11)
    content = written(tmp_path / "a", a=a, b=b).read_bytes()
    at = len(content) - b.nbytes
    assert at % ALIGNED == 0
    np.testing.assert_array_equal(np.frombuffer(content, np.float64, offset=at), b)
    np.testing.assert_array_equal(np.frombuffer(content, np.uint8, 5, at - ALIGNED), a)


def test_arrays_are_read_to_the_room_that_is_given(tmp_path: Path) -> None:
    light = np.random.default_rng(0).random((40, 3)).astype(np.float32)
    path, room = written(tmp_path / "a", light=light), np.zeros((40, 3), np.float32)
    asked = []

    def give(name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        asked.append((name, shape, dtype))
        return room

    assert read_arrays(path, give)["light"] is room
    assert asked == [("light", (40, 3), np.dtype(np.float32))]
    np.testing.assert_array_equal(room, light)


def flip(content: bytearray) -> None:
    content[BLOCK] ^= 16


def add_and_take(content: bytearray) -> None:
    """The sum of all words stays."""
    words = np.frombuffer(content, np.uint64, 16, BLOCK // 2)
    words[5:6] += np.uint64(1)
    words[9:10] -= np.uint64(1)


def swap(content: bytearray) -> None:
    """Two rows, of the same length as those that are summed up."""
    a, b = (slice(BLOCK // 2 + i * 8 * WORDS, BLOCK // 2 + (i + 1) * 8 * WORDS) for i in (0, 3))
    content[a], content[b] = content[b], content[a]


def turn_over(content: bytearray) -> None:
    """Two blocks of a page, as where a disk mixed them up."""
    content[4096:8192], content[8192:12288] = content[8192:12288], content[4096:8192]


def blank(content: bytearray) -> None:
    content[65536 : 65536 + 4096] = bytes(4096)


def cut(content: bytearray) -> None:
    del content[-1:]


def lengthen(content: bytearray) -> None:
    content += b"\0"


def flip_name(content: bytearray) -> None:
    content[content.index(b"light")] ^= 1


def flip_end(content: bytearray) -> None:
    content[-1] ^= 1


@pytest.mark.parametrize(
    "damage", [flip, add_and_take, swap, turn_over, blank, cut, lengthen, flip_name, flip_end, bytearray.clear]
)
def test_damage_is_seen(damage: Callable[[bytearray], Any], tmp_path: Path) -> None:
    values = np.random.default_rng(1).integers(0, 256, 2 * BLOCK + 100, np.uint8)
    path = written(tmp_path / "a", light=values)
    content = bytearray(path.read_bytes())
    damage(content)
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"^it |^its |^the sum of 'light' is wrong"):
        read_arrays(path)


def test_any_byte_counts(tmp_path: Path) -> None:
    values = np.random.default_rng(2).random(3 * WORDS * ROWS // 2)
    path = written(tmp_path / "a", light=values)
    content = path.read_bytes()
    first = content.index(values[:2].tobytes())
    for at in [*np.random.default_rng(3).integers(0, len(content), 60).tolist(), 0, 9, 20, first, len(content) - 1]:
        if first - ALIGNED <= at < first:
            continue  # what lies between head and values may be anything
        changed = bytearray(content)
        changed[at] ^= 1 << at % 8
        path.write_bytes(changed)
        with pytest.raises(ValueError, match=r"^it |^its |^the sum of"):
            read_arrays(path)


def test_objects_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="arrays of object are not kept"):
        written(tmp_path / "a", a=np.array([None]))
