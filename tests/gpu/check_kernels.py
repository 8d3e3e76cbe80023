"""Runs every kernel of kernels/ in oclgrind, a simulator of a device that reports what is wrong in kernels.

    python tests/gpu/check_kernels.py [--sizes 64 16] [--data-races]

takes tiny shots through all steps, by the program's own paths, once for each size of work-groups, side by side, and
fails where oclgrind reports a read or write outside of an array, or with --data-races a data race (five times as
slow), and where a kernel of the sources was never launched.  First a kernel that is wrong on purpose shows that
oclgrind is watching.  Its device has memory of its own: what is shared with the host elsewhere is copied, as on a GPU.
oclgrind's search for values that nobody wrote is not asked: version 21.10 dies of it, and takes what the host filled
for unwritten.

oclgrind comes from Debian (`apt-get install oclgrind`); where it lies elsewhere, OCLGRIND names liboclgrind-rt-icd.so.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path[:0] = [str(REPOSITORY), str(REPOSITORY / "tests")]

LIBRARY = Path(os.environ.get("OCLGRIND", "/usr/lib/oclgrind/liboclgrind-rt-icd.so"))
USUAL = 64  # work-items of a group, in most launches
MEMORY = 1 << 30  # bytes of the device
OPTIMIZED = ("light_field", "element_solve", "visibility", "links")  # of others LLVM makes what oclgrind does not know
SHOWN = 12  # lines of a log
KERNEL = re.compile(r"^\s*__kernel\s+(?:__attribute__\(\(.*?\)\)\s+)?void\s+(\w+)", re.MULTILINE)
WRONG = "__kernel void spill(__global float *x) { x[get_global_id(0) + 1] = 0.0f; }"
Name = tuple[str, str]  # stem of the file, function


def kernels_of_sources() -> set[Name]:
    """Returns all kernels of kernels/, by the files that they stand in."""
    files = sorted((REPOSITORY / "kernels").glob("*.cl"))
    return {(file.stem, name) for file in files for name in KERNEL.findall(file.read_text(encoding="utf-8"))}


# ── in a process under oclgrind ──────────────────────────────────────────────────────────────────


@contextmanager
def watched(size: int) -> Iterator[tuple[Counter[Name], Counter[Name]]]:
    """Counts launches, and lets work-groups of USUAL items have another size.

    Yields: launches and seconds by kernel.
    """
    from usdslf.gpu.device import Device, Kernel

    launched: Counter[Name] = Counter()
    seconds: Counter[Name] = Counter()
    names: dict[int, Name] = {}
    fetch, make, call = Device.kernel, Device._build, Kernel.__call__

    def kernel(self: Device, stem: str, function: str, **constants: Any) -> Kernel:
        found = fetch(self, stem, function, **constants)
        names[id(found)] = stem, function
        return found

    def build(self: Device, stem: str, constants: dict[str, Any]) -> Any:
        os.environ["PYOPENCL_BUILD_OPTIONS"] = "-DCALLS" + ("" if stem in OPTIMIZED else " -cl-opt-disable")
        return make(self, stem, constants)

    def launch(self: Kernel, global_size: tuple[int, ...], local: tuple[int, ...] | None, *args: Any) -> None:
        if min(global_size) > 0:
            launched[names[id(self)]] += 1
        if local is not None and local[0] == USUAL:
            local = (size, *local[1:])
        began = time.perf_counter()
        call(self, global_size, local, *args)
        self._queue.finish()
        seconds[names[id(self)]] += time.perf_counter() - began

    Device.kernel, Device._build, Kernel.__call__ = kernel, build, launch  # type: ignore[method-assign]
    try:
        yield launched, seconds
    finally:
        Device.kernel, Device._build, Kernel.__call__ = fetch, make, call  # type: ignore[method-assign]


def open_simulator() -> Any:
    """Opens oclgrind's device."""
    from usdslf.gpu.device import open_device

    return open_device("oclgrind")


def spill() -> None:
    """Writes behind the end of an array."""
    import numpy as np
    import pyopencl as cl

    device = open_simulator()
    array_d = device.zeros((4,), np.float32)
    cl.Kernel(cl.Program(device.context, WRONG).build(), "spill")(device.queue, (4,), None, array_d.base_data)
    device.finish()


def launch_all(size: int) -> int:
    """Takes the tiny shot through all steps; returns the exit code."""
    from kit.every_kernel import all_steps, few_work_items

    began = time.process_time()
    with few_work_items(), watched(size) as (launched, seconds), tempfile.TemporaryDirectory() as folder:
        for step in all_steps(open_simulator(), Path(folder)):
            print(f"  {step}: {time.process_time() - began:.1f} s", flush=True)
    missed = sorted(kernels_of_sources() - set(launched))
    for stem, name in missed:
        print(f"kernels/{stem}.cl: {name} was never launched")
    dear = ", ".join(f"{stem}.{name} {s:.1f} s" for (stem, name), s in seconds.most_common(6))
    print(
        f"work-groups of {size}: {len(launched)} kernels, {sum(launched.values())} launches, "
        f"{time.process_time() - began:.0f} CPU seconds; {dear}"
    )
    return 1 if missed else 0


# ── the processes ────────────────────────────────────────────────────────────────────────────────


def begin(argument: str, folder: Path, races: bool) -> tuple[subprocess.Popen[str], Path]:
    """Starts this program under oclgrind; returns the process and the log of what oclgrind reports."""
    log = folder / f"{argument}.log"
    vendors = folder / "vendors"
    vendors.mkdir(exist_ok=True)
    (vendors / "oclgrind.icd").write_text(f"{LIBRARY}\n", encoding="utf-8")
    oclgrind = {
        "OCLGRIND_LOG": str(log), "OCLGRIND_GLOBAL_MEM_SIZE": str(MEMORY), "OCLGRIND_NUM_THREADS": "1",
        **({"OCLGRIND_DATA_RACES": "1"} if races else {}),
    }  # fmt: skip
    here = {"OCL_ICD_VENDORS": str(vendors), "USDSLF_CACHE": "weights", "USDSLF_THREADS": "1"}  # it dies of two
    environment = {**os.environ, **oclgrind, **here}
    command = [sys.executable, __file__, "--launch", argument]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8"
    )
    return process, log


def end(argument: str, process: subprocess.Popen[str], log: Path) -> bool:
    """Waits for one of them, and says what it said; returns whether all was well."""
    said, _ = process.communicate()
    print(said, end="")
    reports = log.read_text(encoding="utf-8", errors="replace").strip() if log.is_file() else ""
    if argument == "spill":
        if "Invalid write" not in reports:
            print(f"oclgrind does not watch: no write outside of an array is reported; exit code {process.returncode}")
        return "Invalid write" in reports
    if reports:
        print(f"oclgrind reports, work-groups of {argument}:", *reports.splitlines()[:SHOWN], sep="\n  ")
    elif process.returncode:
        print(f"work-groups of {argument}: exit code {process.returncode}")
    return not reports and process.returncode == 0


def main() -> int:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", default=["64", "16"], help="of work-groups")
    parser.add_argument("--data-races", action="store_true")
    parser.add_argument("--launch", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.launch:
        if asked.launch == "spill":
            spill()
            return 0
        return launch_all(int(asked.launch))
    if not LIBRARY.is_file():
        print(f"oclgrind is missing: there is no {LIBRARY}; apt-get install oclgrind, or name the library in OCLGRIND")
        return 1
    from kit.every_kernel import keep_weights

    from usdslf.gpu.device import open_device

    keep_weights(open_device())
    with tempfile.TemporaryDirectory(prefix="usdslf_oclgrind_") as name:
        folder = Path(name)
        begun = {argument: begin(argument, folder, asked.data_races) for argument in ("spill", *asked.sizes)}
        fine = [end(argument, *parts) for argument, parts in begun.items()]
    return 0 if all(fine) else 1


if __name__ == "__main__":
    sys.exit(main())
