"""Finds an LLVM that Mitsuba 3 works with, and chooses the variant.

Mitsuba's LLVM variants abort the whole process with LLVM 14 and 15, so the library is chosen here before
Dr.Jit looks for one; without a good one `why_no_pathtracer` says so and tests are skipped.
"""

from __future__ import annotations

import importlib.util
import os
import re
from pathlib import Path

OLDEST_LLVM = 16
VARIANT = "llvm_ad_rgb"


def find_llvm() -> str:
    """Returns the path of the newest usable libLLVM, or an empty string."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH", "")
    if named:
        return named
    best: tuple[int, str] = (0, "")
    folders = [
        Path(p) for p in ("/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib64", "/usr/lib")
    ]
    folders += [*sorted(Path("/usr/lib").glob("llvm-*/lib")), Path("/opt/homebrew/opt/llvm/lib")]
    for folder in folders:
        for file in folder.glob("libLLVM*") if folder.is_dir() else ():
            found = re.search(r"libLLVM(?:-|\.so\.|\.)(\d+)", file.name)
            if found and int(found[1]) >= OLDEST_LLVM and int(found[1]) > best[0]:
                best = (int(found[1]), str(file))
    return best[1]


def why_no_pathtracer() -> str:
    """Returns why the path tracer cannot run here, or an empty string."""
    if importlib.util.find_spec("mitsuba") is None:
        return "mitsuba is not installed (it is in the test extra)"
    if not find_llvm():
        return f"no libLLVM {OLDEST_LLVM} or newer, which Mitsuba needs (set DRJIT_LIBLLVM_PATH)"
    return ""


def set_variant() -> None:
    """Chooses Mitsuba's vectorized CPU variant.  Raises RuntimeError where it cannot run."""
    reason = why_no_pathtracer()
    if reason:
        raise RuntimeError(reason)
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", find_llvm())
    import mitsuba as mi

    if mi.variant() != VARIANT:
        mi.set_variant(VARIANT)
