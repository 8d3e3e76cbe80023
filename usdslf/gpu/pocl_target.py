"""Gives PoCL a processor that its compiler knows, where it knows none.

PoCL 3.0 asks its LLVM for the processor's name. A processor that is younger than that LLVM comes out as "generic"
(AMD's Zen 5, family 26, does), which LLVM's front end refuses, so that no kernel builds; or as its elder (Zen 4 as
"znver3"), which lacks the AVX-512 of the library that PoCL takes for it, so that LLVM dies while it builds; or as a
relative (Emerald Rapids as "icelake-client") that lacks a small thing which the library's processor has: then LLVM
puts no function of the library into a kernel, each `sqrt`, `max` and `vload3` is a call, no loop becomes vectors,
and kernels take up to twice as long. PoCL has no option for it: the name is a pointer in the device's record, and
is replaced there, before the first context, by the processor that PoCL's own library of built-in functions was
compiled for.

Source: PoCL 3.0, lib/CL/pocl_llvm_utils.cc (kernellib_feature_map).
"""

from __future__ import annotations

import ctypes
import os
import platform
from pathlib import Path

UNKNOWN = b"generic\0"
NARROW = (b"znver3\0", b"icelake-client\0", b"rocketlake\0", b"cannonlake\0")
"""Names that are too small for a processor that is able to do all of the first of KNOWN."""
RECORD = 2048  # bytes of PoCL's device record that are looked at
# The processor of each variant of PoCL's library, most able first, and what PoCL asks of the host for it.
KNOWN = (
    ("skylake-avx512", {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}),
    ("haswell", {"avx2", "fma", "f16c"}),
    ("ivybridge", {"avx", "f16c"}),
    ("sandybridge", {"avx"}),
    ("penryn", {"sse4_1"}),
    ("core2", {"ssse3"}),
)
_names: dict[int, ctypes.Array[ctypes.c_char]] = {}  # by record; PoCL keeps the pointer


def name_processor(record: int, abilities: set[str] | None = None) -> str:
    """Replaces a processor's wrong name in a PoCL device's record; returns the name that it has now, "" if untouched.

    Args:
        record: address of the device (pyopencl's `int_ptr`).
        abilities: of the processor; None: those of this machine.
    """
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return ""
    if record in _names:
        return _names[record].value.decode()
    able = _abilities() if abilities is None else abilities
    name = next((known for known, needed in KNOWN if needed <= able), "x86-64")
    wrong = (UNKNOWN, *NARROW) if name == KNOWN[0][0] else (UNKNOWN,)
    with open("/proc/self/mem", "rb", buffering=0) as memory:  # reads of what is no address fail, and do no harm
        for at in range(record, record + RECORD, ctypes.sizeof(ctypes.c_void_p)):
            found = _read(memory.fileno(), _pointer(memory.fileno(), at), max(map(len, wrong)))
            if any(found.startswith(w) for w in wrong):
                _names[record] = ctypes.create_string_buffer(name.encode())
                ctypes.c_void_p.from_address(at).value = ctypes.addressof(_names[record])
                return name
    return ""


def _abilities() -> set[str]:
    flags = [line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags")]
    return set(flags[0].split(":")[1].split()) if flags else set()


def _pointer(memory: int, at: int) -> int:
    return int.from_bytes(_read(memory, at, ctypes.sizeof(ctypes.c_void_p)), "little")


def _read(memory: int, at: int, count: int) -> bytes:
    try:
        return os.pread(memory, count, at)
    except (OSError, OverflowError):
        return b""
