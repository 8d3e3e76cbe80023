"""Batches that are gathered side by side: what comes of them is the same, whatever is done first."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
from kit.live_pictures import after, lit_scene, live
from kit.scene_pictures import camera_at, ground
from kit.scene_records import make_scene, sphere

import usdslf.render.live.gather as gather_module
import usdslf.render.live.rooms as rooms_module
from usdslf.gpu.device import Device
from usdslf.progress import Cancelled, hearing
from usdslf.rays import RayTracer
from usdslf.render.picture import LitScene, PictureOptions, render
from usdslf.scene.records import Light, Material, constant

CAMERA = camera_at((0, 1.4, 4.2), (0, 0.4, 0))


@pytest.fixture(scope="module")
def lit(device: Device) -> LitScene:
    """A mirror, which sends rays that are followed, on a dull ground under a dome."""
    materials = [
        Material("/ground", diffuse_color=constant(0.5, 0.45, 0.4), roughness=constant(0.8)),
        Material("/metal", diffuse_color=constant(0.9, 0.7, 0.3), roughness=constant(0.05), metallic=constant(1.0)),
    ]
    scene = make_scene(
        ground(3.0), sphere(0.5, (0, 0.5, 0), material=1), materials=materials,
        lights=[Light("/dome", "dome", (0.2, 0.25, 0.3), np.eye(4))],
    )  # fmt: skip
    return lit_scene(scene, device, 200)


def in_small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets a picture of kit.live_pictures.SIZE be many batches."""
    for module, name in ((gather_module, "BATCH"), (rooms_module, "BATCH")):
        monkeypatch.setattr(module, name, 100)
    monkeypatch.setattr(rooms_module, "FEWEST", 20)


def test_pictures_do_not_depend_on_batches_and_who_is_first(lit: LitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    options = PictureOptions(samples=8, elements=200)
    expected = after(live(lit, CAMERA), 3), render(lit, CAMERA, (24, 16), options=options)["color"]
    in_small_batches(monkeypatch)
    gather, threads, turn = rooms_module.gather_batch, set(), [0]

    def sometimes_late(*args: Any) -> None:
        threads.add(threading.get_ident())
        turn[0] += 1
        time.sleep(0.002 * (turn[0] % 3))
        gather(*args)

    monkeypatch.setattr(rooms_module, "gather_batch", sometimes_late)
    np.testing.assert_array_equal(after(live(lit, CAMERA), 3), expected[0])
    np.testing.assert_array_equal(render(lit, CAMERA, (24, 16), options=options)["color"], expected[1])
    assert turn[0] > 50 and len(threads) >= min(lit.tracer.threads, 2)


def test_batches_under_way_count_where_others_are_cancelled(lit: LitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = after(live(lit, CAMERA), 2)
    in_small_batches(monkeypatch)
    picture, begun = live(lit, CAMERA), []
    gather = rooms_module.gather_batch

    def note(*args: Any) -> None:
        begun.append(len(args[3]))
        gather(*args)

    monkeypatch.setattr(rooms_module, "gather_batch", note)

    def cancel(_: object) -> None:
        raise Cancelled

    with hearing(cancel), pytest.raises(Cancelled):
        picture.gather_frame(1)
    groups = [g for share in picture._shares.values() for g in share.groups]
    assert 0 < sum(begun) < sum(len(g.rows) for g in groups)
    assert sum(g.begun + g.frames * len(g.rows) for g in groups) == sum(begun)
    np.testing.assert_array_equal(after(picture, 2), expected)


def test_an_error_in_a_batch_is_raised_and_leaves_the_rooms_free(
    lit: LitScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_small_batches(monkeypatch)
    occluded = RayTracer.intersect_into
    picture = live(lit, CAMERA)

    def fail(*_: Any) -> None:
        raise ValueError("no rays today")

    monkeypatch.setattr(RayTracer, "intersect_into", fail)
    for _ in range(5):  # more often than there are rooms
        with pytest.raises(ValueError, match="no rays today"):
            picture.gather_frame(1)
    monkeypatch.setattr(RayTracer, "intersect_into", occluded)
    np.testing.assert_array_equal(after(picture, 2), after(live(lit, CAMERA), 2))
