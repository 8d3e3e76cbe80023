"""How long does somebody hold Python's lock while a large shot is opened?  A window's main thread waits that long.

    python tests/bench/lock_holds.py [--triangles N]

A plane of N triangles under a lamp is opened up to its light field on one thread, with nothing kept from before, while
another one sleeps for a millisecond at a time.  Printed are the longest times that it waited beyond that, with the step
that went on.  Cores that others use make it wait too: it is for idle ones.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, Vt

import usdslf

SLEEP = 0.001  # [s]
TOLD = 0.015  # [s] that is printed


def write_plane(path: Path, triangles: int) -> None:
    """Writes a wavy plane of about as many triangles, as quads, under a rect light and before a camera."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    side = max(1, int((triangles / 2) ** 0.5))
    x, z = np.meshgrid(np.linspace(-1, 1, side + 1), np.linspace(-1, 1, side + 1))
    points = np.stack([x, 0.05 * np.sin(9 * x * z), z], -1).reshape(-1, 3).astype(np.float32)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    quads = np.stack([first, first + side + 1, first + side + 2, first + 1], 1).reshape(-1).astype(np.int32)
    mesh = UsdGeom.Mesh.Define(stage, "/shot/plane")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(side * side, 4, np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    lamp = UsdLux.RectLight.Define(stage, "/shot/lamp")
    lamp.AddTranslateOp().Set(Gf.Vec3d(0, 3, 0))
    lamp.AddRotateXOp().Set(-90.0)
    UsdGeom.Camera.Define(stage, "/shot/cam").AddTranslateOp().Set(Gf.Vec3d(0, 1, 4))
    stage.GetRootLayer().Save()


def waits(work: Callable[[Callable[[str], None]], None]) -> list[tuple[float, str]]:
    """Returns how long [s] a thread that sleeps waited beyond that, longest first, and in which step of the work."""
    found: list[tuple[float, str]] = []
    step, is_done = [""], threading.Event()

    def watch() -> None:
        last = time.perf_counter()
        while not is_done.is_set():
            time.sleep(SLEEP)
            now = time.perf_counter()
            found.append((now - last - SLEEP, step[0]))
            last = now

    def say(name: str) -> None:
        step[0] = name

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        work(say)
    finally:
        is_done.set()
        watcher.join()
    return sorted(found, reverse=True)


def main() -> None:
    """Prints seconds and the longest waits."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--triangles", type=int, default=1_000_000)
    triangles = parser.parse_args().triangles
    os.environ["USDSLF_CACHE"] = "off"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plane.usda"
        write_plane(path, triangles)

        def open_it(say: Callable[[str], None]) -> None:
            say("read")
            shot = usdslf.open(str(path), elements=4000).shot
            for name in ("scene", "tracer", "elements", "light_field"):
                say(name)
                getattr(shot, name)

        start = time.perf_counter()
        found = waits(open_it)
        print(f"{triangles} triangles, {time.perf_counter() - start:.1f} s")
        print(", ".join(f"{wait:.3f} s in {step}" for wait, step in found if wait > TOLD) or "no wait")


if __name__ == "__main__":
    main()
