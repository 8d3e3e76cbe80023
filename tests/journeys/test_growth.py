"""A process that opens, solves, renders and drops many shots does not grow."""

from __future__ import annotations

import ctypes
import gc
import sys
import threading
import weakref
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from kit.stage_parts import StageBuilder, rectangle
from pxr import Gf, UsdLux

import usdslf
from usdslf import cache, paint_stroke
from usdslf.render.live.paths import PathQueue

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
    held, after = list[weakref.ref[Any]](), list[float]()
    for _ in range(MORE):
        held += once(stage)
        after.append(resident())
    print(f"{before:.1f} MB, then", *(f"{x:.1f}" for x in after))
    assert min(after[MORE // 2 :]) < (1 + GROWTH) * before  # some megabytes come and go
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


class _Stop(Exception):
    """Ends a frame half-way."""


@pytest.mark.parametrize("is_kept", [False, True])
def test_pictures_go_with_who_holds_them(is_kept: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Final ones, live ones, and such that were cancelled while rays waited to be followed; and the device with them.

    What waits for the collector of circles may wait for long: half a gigabyte a picture.  Of a shot whose light is kept
    from an earlier start some is never asked for.
    """
    import_module("pyopencl.invoker")  # asks once for the folder of its own
    monkeypatch.setenv("POCL_CACHE_DIR", str(cache.cache_folder().parent / "pocl" / "kcache"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv(cache.SWITCH, "all" if is_kept else "off")
    stage = str(build(tmp_path))
    if is_kept:
        usdslf.open(stage, elements=100, bounces=1).render(size=(16, 9), samples=1)
    session = usdslf.open(stage, elements=100, bounces=1)
    gc.collect()
    gc.disable()
    try:
        session.render(size=(16, 9), samples=1)
        live = usdslf.live_picture(session.shot, size=(48, 27))
        live.gather_frame(1)
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(PathQueue, "follow", _stop)
            with pytest.raises(_Stop):
                live.gather_frame(2)
        assert live._room.queue.waiting
        held = [weakref.ref(x) for x in (live, live._room, session.shot, session.tracer, session.device)]
        del live, session
        assert [ref() for ref in held if ref() is not None] == []
    finally:
        gc.enable()


def _stop(queue: PathQueue, *_: Any) -> None:
    if queue.waiting:
        raise _Stop
