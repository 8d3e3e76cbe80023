"""A processor that PoCL's compiler does not know is given a name, in the device's record and nowhere else."""

from __future__ import annotations

import ctypes
import platform

import pytest

from usdslf.gpu.pocl_target import RECORD, name_processor

pytestmark = pytest.mark.usefixtures("device")


_alive: list = []  # a record at the address of one that is gone would be taken for it


def record_of(*texts: bytes | None) -> ctypes.Array:
    """A record of pointers to texts (None: no pointer but a small number)."""
    kept = [ctypes.create_string_buffer(t) if t is not None else None for t in texts]
    record = (ctypes.c_uint64 * (RECORD // 8))()
    for i, text in enumerate(kept):
        record[i] = ctypes.addressof(text) if text is not None else 17 + i
    _alive.append((record, kept))
    return record


@pytest.mark.parametrize(
    ("able", "named"),
    [
        ({"avx2", "fma", "f16c", "avx"}, "haswell"),
        ({"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2"}, "skylake-avx512"),
        ({"avx"}, "sandybridge"),
        (set(), "x86-64"),
    ],
)
def test_an_unknown_processor_gets_the_name_of_the_library_that_fits(able: set[str], named: str) -> None:
    assert platform.system() == "Linux", "PoCL comes for Linux"
    record = record_of(b"x86_64-unknown-linux-gnu", None, b"generic", b"kernel")
    before = list(record)
    assert name_processor(ctypes.addressof(record), able) == named
    changed = [i for i, (a, b) in enumerate(zip(before, record)) if a != b]
    assert changed == [2]
    assert ctypes.string_at(record[2]) == named.encode()


@pytest.mark.parametrize("name", [b"znver3", b"icelake-client", b"rocketlake", b"cannonlake"])
def test_wide_vectors_need_a_processor_that_has_them(name: bytes) -> None:
    """A Zen 4 that goes by the name of Zen 3 gets the library of AVX-512, and so a name that has all of it."""
    record = record_of(b"x86_64-unknown-linux-gnu", name)
    able = {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2"}
    assert name_processor(ctypes.addressof(record), able) == "skylake-avx512"
    assert ctypes.string_at(record[1]) == b"skylake-avx512"


def test_a_known_processor_keeps_its_name() -> None:
    record = record_of(b"x86_64-unknown-linux-gnu", b"znver3", b"generically", None)
    before = list(record)
    assert name_processor(ctypes.addressof(record), {"avx2", "fma", "f16c"}) == ""
    assert list(record) == before
