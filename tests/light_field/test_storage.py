"""Light within a budget of memory: the same to the last bit when streamed, within .1 % in half floats, else refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kit.light_field_scenes import Lit, lit, material
from kit.lit_plane import write_plane
from kit.scene_records import box, lamp, sphere

import usdslf
from usdslf.errors import MemoryError_
from usdslf.gpu.device import Device
from usdslf.light_field.light_field import LightField
from usdslf.light_field.renewal import renew
from usdslf.light_field.storage import ERROR, USUAL, Storage, half_error, storage_within
from usdslf.sampling.hemisphere import D

N = 70  # more than four blocks, the last one not full
GIB = 2**30


@pytest.fixture(scope="module")
def room(device: Device) -> Lit:
    """Elements of a box with a coloured ball in it, under a lamp."""
    meshes = [
        box((0, 0, 0), (2, 2, 2), inward=True, path="/room"),
        sphere(0.4, (1, 1, 0.8), rows=8, path="/ball", material=1),
    ]
    materials = [material(0.6, roughness=0.7), material((0.5, 0.2, 0.1), 0.1, 0.3, emission=0.2)]
    return lit(device, meshes, materials, (lamp(1.9, (1, 1), 0.6),), N, "preview_surface", 0)


def stored(room: Lit, storage: Storage, bounces: int = 3) -> LightField:
    """The light field of the room after some bounces, stored in a way."""
    field = LightField(
        room.field.device, room.elements, room.lookup, room.visibility, room.fixed, "preview_surface", storage
    )
    for _ in range(bounces):
        field.bounce()
    return field


def edited(field: LightField) -> LightField:
    """The same after the ball became red, renewed where it changed."""
    ball = field.elements.material == 1
    other = field.with_surface(field.surface.with_rows(ball, diffuse=(0.7, 0.05, 0.05)))
    renew(other, 4, 1e-3)
    return other


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_streamed_blocks_give_the_same_bytes(room: Lit, dtype: type) -> None:
    resident, streamed = stored(room, Storage(dtype)), stored(room, Storage(dtype, is_streamed=True))
    assert resident.radiance().max() > 0
    np.testing.assert_array_equal(streamed.radiance(), resident.radiance())
    some = np.array([3, 40, 0])
    np.testing.assert_array_equal(streamed.incident(some), resident.incident(some))
    np.testing.assert_array_equal(edited(streamed).radiance(), edited(resident).radiance())
    weights, roughness = np.full((2, 4, 3), 0.3, np.float32), np.array([0.31, 0.72])
    of_both = [f.device.download(f.respond(some[:2], weights, roughness)) for f in (streamed, resident)]
    assert of_both[0].any()
    np.testing.assert_array_equal(*of_both)


def test_half_floats_change_light_by_less_than_is_stated(room: Lit) -> None:
    whole, half = stored(room, USUAL), stored(room, Storage(np.float16))
    for field, like in ((half, whole), (edited(half), edited(whole))):
        off = np.abs(field.radiance() - like.radiance()).sum() / like.radiance().sum()
        assert 1e-6 < off < ERROR
    assert half.outgoing_d.nbytes + half.fixed_d.nbytes == 2 * len(room.elements) * D * 3 * 2


def test_a_bounce_moves_nothing_but_how_much_it_changed(room: Lit) -> None:
    field = stored(room, USUAL, 1)
    before = field.device.moved
    field.bounce()
    assert field.device.moved - before == 2 * 4 * len(room.elements)  # two sums of each element, at its end
    streamed = stored(room, Storage(is_streamed=True), 1)
    before = field.device.moved
    streamed.bounce()
    assert field.device.moved - before > len(room.elements) * D * (4 + 12)


@pytest.mark.parametrize(
    ("bytes_of_element", "dtype", "is_streamed"),
    [(40960, np.float32, False), (40959, np.float16, False), (22527, np.float16, True), (16384, np.float16, True)],
)
def test_a_smaller_budget_takes_half_floats_and_then_streams(
    bytes_of_element: int, dtype: type, is_streamed: bool
) -> None:
    fixed = np.random.default_rng(0).uniform(0, 5, (N, D, 3)).astype(np.float32)
    found = storage_within(bytes_of_element * N / GIB, fixed, np.zeros((N, 3)))
    assert (found.dtype, found.is_streamed) == (dtype, is_streamed)
    assert (found.error > 0) == (dtype is np.float16)
    assert found.error < 5e-4


def test_light_that_half_floats_cannot_hold_is_streamed_instead() -> None:
    fixed = np.ones((N, D, 3), np.float32)
    for value in (1e5, 1e-9):  # beyond their end, below their steps
        assert half_error(fixed * value) > ERROR
        found = storage_within(30000 * N / GIB, fixed * value, np.zeros((N, 3)))
        assert (found.dtype, found.is_streamed) == (np.float32, True)
        with pytest.raises(
            MemoryError_, match=r"of 70 elements needs 0\.002 GiB .*; lower --elements or raise --memory"
        ):
            storage_within(28671 * N / GIB, fixed * value, np.zeros((N, 3)))


def test_a_shot_within_a_budget_looks_the_same(tmp_path: Path, device: Device) -> None:
    stage = str(write_plane(tmp_path))
    usual, small = (usdslf.open(stage, elements=N, bounces=2, device=device, memory=m) for m in (None, 18000 * N / GIB))
    picture, same = (s.render(size=(24, 16), samples=4)["color"] for s in (usual, small))
    assert abs(same - picture).sum() < 1e-3 * picture.sum()
    (said,) = [w for w in small.warnings if "--memory" in w]
    assert "as float16, which changes it by 0.0" in said and "streamed through the device by blocks" in said
    assert not [w for w in usual.warnings if "--memory" in w]


def test_less_than_any_way_needs_is_refused_before_anything_is_made(tmp_path: Path, device: Device) -> None:
    session = usdslf.open(str(write_plane(tmp_path)), elements=10000, device=device, memory=0.1)
    with pytest.raises(
        MemoryError_, match=r"^the light field of 10000 elements needs 0\.153 GiB of the device at least, but"
    ):
        _ = session.elements
