"""A process that opens, solves, renders and drops many shots does not grow."""

from __future__ import annotations

import ctypes
import gc
import sys
import threading
import weakref
from pathlib import Path
from typing import Any

import pytest
from kit.stage_parts import StageBuilder, rectangle
from pxr import Gf, UsdLux

import usdslf
from usdslf import paint_stroke

WARM, MORE = 4, 8
GROWTH = 0.05


def build(folder: Path) -> Path:
    """Two quads under a lamp."""
    b = StageBuilder(folder)
    b.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), b.material("floor", diffuseColor=(0.4, 0.3, 0.2)))
    b.mesh("back", rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0)), b.material("back", diffuseColor=(0.2, 0.4, 0.6)))
    lamp = UsdLux.SphereLight.Define(b.stage, "/World/lamp")
    lamp.CreateRadiusAttr(0.2)
    lamp.CreateIntensityAttr(30.0)
    lamp.AddTranslateOp().Set(Gf.Vec3d(0, 1.5, 0.5))
    b.camera((0, 1.0, 3), (0, 0.5, 0))
    return b.save()


def once(stage: Path) -> list[weakref.ref[Any]]:
    """A session from its opening to its end; what it held."""
    session = usdslf.open(str(stage), elements=100, bounces=1)
    stroke = paint_stroke(
        session.scene, session.tracer, session.camera(), [[(0.5, 0.8)]], 0.03, (0.5, 0.1, 0.1), aspect=16 / 9
    )
    session.add_stroke(stroke)
    session.solve()
    session.render(size=(16, 9), samples=1)
    held = session, session.shot, session.scene, session.tracer, session.light_field, session.device
    return [weakref.ref(x) for x in held]


def resident() -> float:
    """Resident memory [MB] of this process, without what could be given back."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20


@pytest.mark.skipif(sys.platform != "linux", reason="resident memory is read as Linux tells it")
def test_many_sessions_leave_nothing(tmp_path: Path) -> None:
    stage = build(tmp_path)
    for _ in range(WARM):
        once(stage)
    before = resident()
    held = [ref for _ in range(MORE) for ref in once(stage)]
    after = resident()
    print(f"{before:.1f} MB, then {after:.1f} MB after {MORE} more")
    assert after < (1 + GROWTH) * before
    assert [ref() for ref in held if ref() is not None] == []


def test_the_threads_of_a_tracer_end_with_it(tmp_path: Path) -> None:
    names = lambda: {t for t in threading.enumerate() if t.name.startswith("usdslf-rays")}  # noqa: E731
    gc.collect()
    gc.disable()
    try:
        there = names()
        session = usdslf.open(str(build(tmp_path)), elements=100)
        tracer = session.tracer
        assert list(tracer.map_ahead(lambda i: i, range(4))) == [(i, i) for i in range(4)]
        mine, held = names() - there, weakref.ref(tracer)
        assert mine
        del session, tracer
        assert held() is None  # at once, as nothing goes round in it
        for thread in mine:
            thread.join(10)
        assert not any(thread.is_alive() for thread in mine)
    finally:
        gc.enable()
