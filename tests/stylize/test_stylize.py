"""Stylize: the masking against direct sums, and the laws of a stylized scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from kit.light_field_scenes import Lit, lit, lone_elements, material, world_bins
from kit.scene_records import quad, sphere
from kit.stage_parts import StageBuilder, box, rectangle
from reference.stylize import masked_light, near_weights

from usdslf.errors import AuthorError, InputError
from usdslf.gpu.device import Device
from usdslf.light_field.links import ESCAPES
from usdslf.light_field.surface import Surface
from usdslf.sampling.hemisphere import D
from usdslf.scene.records import Light
from usdslf.shot import Shot
from usdslf.solution import find_style
from usdslf.stylize.surroundings import Surroundings, find_surroundings
from usdslf.stylize.unsharp_mask import (
    Stylized,
    check_numbers,
    check_surroundings,
    editable_materials,
    mask_light,
    stylize_light,
)

N = 45


# ---- masking ---------------------------------------------------------------------------------
def _field(device: Device, radiance: Callable[[int, np.ndarray], np.ndarray], emission: float = 0.0) -> SimpleNamespace:
    """Elements of a bumpy patch that send out a given light, which is smooth over directions."""
    rng = np.random.default_rng(8)
    elements = lone_elements(N, seed=4, area=rng.uniform(0.5, 2, N), position=rng.uniform(0, 1, (N, 3)) * [1, 1, 0.1])
    w = world_bins(elements)
    light = np.stack([radiance(i, w[i]) for i in range(N)]) + emission
    upload = lambda a: device.upload(np.ascontiguousarray(a, np.float32))  # noqa: E731
    return SimpleNamespace(
        device=device, elements=elements, frames_d=upload(elements.frame), outgoing_d=upload(light),
        emission_d=upload(np.full((N, 3), emission)), hit_d=device.upload(np.full((N, D), ESCAPES, np.uint32)),
    )  # fmt: skip


def _surroundings(weights: np.ndarray) -> Surroundings:
    here, there = np.nonzero(weights)
    first = np.searchsorted(here, np.arange(len(weights) + 1))
    return Surroundings(
        0.5, first.astype(np.int32), there.astype(np.int32), weights[here, there].astype(np.float32)
    )


def _lobes(seed: int) -> Callable[[int, np.ndarray], np.ndarray]:
    rng = np.random.default_rng(seed)
    color, axis = rng.uniform(0.2, 1, (N, 3)), rng.normal(size=(N, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    return lambda i, w: color[i] * (1.2 + w @ axis[i])[..., None]


@pytest.mark.parametrize("amount", [0.3, 1.0, 4.0])
def test_masking_is_that_of_direct_sums(device: Device, amount: float) -> None:
    radiance = _lobes(2)
    field = _field(device, radiance)
    e = field.elements
    weights = near_weights(e.position.astype(float), e.area.astype(float), 0.5)
    expected = masked_light(radiance, weights, e.normal.astype(float), world_bins(e), amount)
    found = device.download(mask_light(field, _surroundings(weights), amount))
    error = np.abs(found - expected)
    assert error.mean() < 0.012 * amount  # bins of 4.5 degrees
    detail = np.abs(expected - device.download(field.outgoing_d))
    assert error.mean() < 0.05 * detail.mean()


def test_beside_a_step_it_is_the_closed_form(device: Device) -> None:
    """A flat patch, bright on one side of a line and dark on the other, the same in all directions.

    At t radii from the line the share of the surroundings beyond it is 16 / (5 pi) int_t^1 (1 - x^2)^(5/2) dx, the
    integral of (1 - r^2)^2 over a segment of the disk.
    """
    side, radius, amount, dark, bright = 28, 0.22, 0.5, 0.4, 0.6
    at = (np.stack(np.meshgrid(*2 * [np.arange(side)]), -1).reshape(-1, 2) + 0.5) / side
    n = len(at)
    elements = lone_elements(
        n, position=np.concatenate([at, np.zeros((n, 1))], 1), frame=np.tile(np.eye(3), (n, 1, 1)),
        normal=np.tile([0.0, 0.0, 1.0], (n, 1)),
    )  # fmt: skip
    own = np.where(at[:, 0] < 0.5, dark, bright)
    upload = lambda a: device.upload(np.ascontiguousarray(a, np.float32))  # noqa: E731
    field = SimpleNamespace(
        device=device, elements=elements, frames_d=upload(elements.frame), emission_d=upload(np.zeros((n, 3))),
        outgoing_d=upload(np.broadcast_to(own[:, None, None], (n, D, 3))),
        hit_d=device.upload(np.full((n, D), ESCAPES, np.uint32)),
    )  # fmt: skip
    weights = near_weights(elements.position.astype(float), np.ones(n), radius)
    found = device.download(mask_light(field, replace(_surroundings(weights), radius=radius), amount))
    x = np.linspace(0, 1, 4001)
    whole = np.concatenate([[0], np.cumsum((1 - ((x[1:] + x[:-1]) / 2) ** 2) ** 2.5) / 4000]) * 16 / (5 * np.pi)
    beyond = np.interp(np.abs(at[:, 0] - 0.5) / radius, x, whole[-1] - whole)
    other = np.where(own == dark, bright, dark)
    expected = own + amount * beyond * (own - other)
    inside = (np.abs(at - 0.5) < 0.5 - radius).all(1)
    assert inside.sum() > 150 and whole[-1] == pytest.approx(0.5, abs=1e-4)
    np.testing.assert_allclose(found[inside] - expected[inside, None, None], 0, atol=2e-3)


def test_emission_is_neither_masked_nor_counted(device: Device) -> None:
    radiance = _lobes(2)
    near = _surroundings(np.ones((N, N)))
    plain = device.download(mask_light(_field(device, radiance), near, 1.0))
    shining = device.download(mask_light(_field(device, radiance, emission=40.0), near, 1.0))
    np.testing.assert_allclose(shining, plain, atol=2e-4)


def test_light_that_is_the_same_everywhere_stays(device: Device) -> None:
    field = _field(device, lambda i, w: np.full((len(w), 3), 0.7))
    found = device.download(mask_light(field, _surroundings(np.ones((N, N))), 1.0))
    np.testing.assert_allclose(found, 0.7, atol=1e-5)


# ---- surroundings ----------------------------------------------------------------------------
def _dense(near: Surroundings, n: int) -> np.ndarray:
    out = np.zeros((n, n))
    out[np.repeat(np.arange(n), near.count), near.other] = near.weight
    return out


@pytest.fixture(scope="module")
def room(device: Device) -> Lit:
    """A floor of bright and dark stripes with a ball on it, and a wall behind which there is more floor."""
    greys = [material(0.2), material(0.55), material((0.5, 0.2, 0.1), 0.2, 0.3), material(0.4)]
    stripes = [quad((x - 2.0, -2, 0), (1, 0, 0), (0, 3, 0), material=x % 2, path=f"/stripe{x}") for x in range(4)]
    meshes = [
        *stripes,
        sphere(0.5, (0, -0.5, 0.5), material=2, path="/ball"),
        quad((-2, 1, 0), (4, 0, 0), (0, 0, 1.5), material=3, path="/wall"),
        quad((-2, 1, 0), (4, 0, 0), (0, 2, 0), material=1, path="/behind"),
    ]
    lights = (Light("/sky", "dome", (1.0, 1.0, 1.0), np.eye(4)),)
    return lit(device, meshes, greys, lights, count=700, model="preview_surface", bounces=8, tolerance=2e-3)


@pytest.fixture(scope="module")
def near(room: Lit) -> Surroundings:
    return find_surroundings(room.elements, room.tracer, 0.7)


def test_weights_fall_with_distance_and_walls_hide(room: Lit, near: Surroundings) -> None:
    e = room.elements
    plain = near_weights(e.position.astype(float), e.area.astype(float), 0.7)
    found = _dense(near, len(e))
    seen = found > 0
    np.testing.assert_allclose(found[seen], plain[seen], rtol=1e-3)
    mesh = np.array([m.path for m in room.scene.meshes])[e.mesh]
    stripe = np.char.startswith(mesh, "/stripe") & (e.side > 0)
    behind = (mesh == "/behind") & (e.side > 0)
    assert not seen[np.ix_(stripe, behind)].any() and plain[np.ix_(stripe, behind)].any()
    floor = np.flatnonzero(stripe & (np.abs(e.position[:, :2] - [0, -0.5]).max(1) > 1.3))
    np.testing.assert_array_equal(seen[np.ix_(floor, floor)], plain[np.ix_(floor, floor)] > 0)
    assert seen[np.ix_(stripe, mesh == "/ball")].any() and seen[np.ix_(stripe, mesh == "/wall")].any()


def test_a_part_of_many_places_stands_for_all(room: Lit, near: Surroundings) -> None:
    some = find_surroundings(room.elements, room.tracer, 0.7, most=20)
    assert 5 < some.count.mean() < 0.6 * near.count.mean()
    whole, part = _dense(near, len(room.elements)), _dense(some, len(room.elements))
    bright = room.elements.diffuse[:, 0] > 0.5
    mean = lambda w: (w @ bright) / np.maximum(w.sum(1), 1e-9)  # noqa: E731
    inside = (near.count > 12) & (some.count > 5)
    assert np.abs(mean(part) - mean(whole))[inside].mean() < 0.1


# ---- the scene -------------------------------------------------------------------------------
def _stylized(room: Lit, near: Surroundings, amount: float) -> tuple[Stylized, np.ndarray]:
    """What becomes of the room, and its light then; the room is left as it was."""
    field = room.field
    as_it_was = field.radiance()
    try:
        *_, found = stylize_light(field, near, amount, 0.1, (0, 1, 2, 3), 8)
        return found, field.device.download(field.outgoing_d)
    finally:
        field.set_surface(Surface.of(room.elements))
        field.outgoing_d, field.waits[:] = field.device.upload(as_it_was), 0


def _contrast(room: Lit, near: Surroundings, light: np.ndarray) -> float:
    """Mean of |L - B| over what the mean light was before."""
    e = room.elements
    field = replace_light(room, light)
    more = room.field.device.download(mask_light(field, near, 0.01))
    return float((e.area[:, None, None] * np.abs(more - light)).sum() / 0.01)


def replace_light(room: Lit, light: np.ndarray) -> SimpleNamespace:
    """The room's field with another light."""
    f = room.field
    return SimpleNamespace(
        device=f.device, elements=f.elements, frames_d=f.frames_d, emission_d=f.emission_d,
        outgoing_d=f.device.upload(light), hit_d=f.hit_d,
    )  # fmt: skip


@pytest.fixture(scope="module")
def by_amount(room: Lit, near: Surroundings) -> dict[float, tuple[Stylized, np.ndarray]]:
    return {a: _stylized(room, near, a) for a in (0.3, 0.6, 1.0)}


def test_local_contrast_grows_by_about_the_amount(room: Lit, near: Surroundings, by_amount: dict) -> None:
    """The change of light is the detail that was there, times the amount, as far as reflectances can."""
    device, before, area = room.field.device, room.outgoing, room.elements.area[:, None, None]
    detail = (device.download(mask_light(room.field, near, 0.01)) - before) / 0.01
    growth = {
        a: (area * (light - before) * detail).sum() / (area * detail * detail).sum()
        for a, (_, light) in by_amount.items()
    }
    assert 0 < growth[0.3] < growth[0.6] < growth[1.0]
    for amount, achieved in growth.items():
        assert 0.5 * amount < achieved < 1.1 * amount, growth
    contrast = {a: _contrast(room, near, light) / _contrast(room, near, before) for a, (_, light) in by_amount.items()}
    assert 1 < contrast[0.3] < contrast[0.6] < contrast[1.0], contrast


def test_energy_stays(room: Lit, by_amount: dict) -> None:
    area = room.elements.area[:, None, None]
    before = (area * room.outgoing).sum()
    for _, light in by_amount.values():
        assert 0.8 < (area * light).sum() / before < 1.25


def test_the_result_is_a_valid_reflectance_that_explains_more(room: Lit, by_amount: dict) -> None:
    for found, _ in by_amount.values():
        fit = found.after
        for value in (fit.diffuse, fit.f0, fit.f90, fit.roughness):
            assert value.min() >= 0 and value.max() <= 1
        assert [s.material for s in found.styles] == [0, 1, 2, 3]
        for style in found.styles:
            assert style.residual_after < 0.75 * style.residual_before
            assert "diffuse" in style.freed
        assert len(found.rounds) > 1 and all(b < a for a, b in zip(found.rounds, found.rounds[1:]))


def test_what_is_held_stays_and_the_same_again_is_the_same(room: Lit, near: Surroundings) -> None:
    field, as_it_was = room.field, room.field.radiance()
    results = []
    for _ in range(2):
        *_, found = stylize_light(field, near, 1.0, 0.1, (0, 2), 8)
        results.append(found)
        field.set_surface(Surface.of(room.elements))
        field.outgoing_d, field.waits[:] = field.device.upload(as_it_was), 0
    one, two = results
    held = np.isin(room.elements.material, (1, 3))
    for change in one.change_at(np.flatnonzero(held)):
        assert not change.any()
    assert all(change.any() for change in one.change_at(np.flatnonzero(~held))[:1])
    for name in ("diffuse", "f0", "f90", "roughness"):
        np.testing.assert_array_equal(getattr(one.after, name), getattr(two.after, name))


# ---- what cannot be --------------------------------------------------------------------------
@pytest.mark.parametrize(("amount", "radius"), [(-0.1, 0.1), (11, 0.1), (np.nan, 0.1), (1, 0), (1, 1.5), (1, np.nan)])
def test_bad_numbers_are_named(amount: float, radius: float) -> None:
    with pytest.raises(InputError, match="is not in"):
        check_numbers(amount, radius)


def test_a_radius_below_the_elements_is_named(room: Lit) -> None:
    with pytest.raises(InputError, match="larger radius or more elements"):
        check_surroundings(find_surroundings(room.elements, room.tracer, 0.01), room.scene)


def test_materials_that_cannot_be_edited_are_named(room: Lit) -> None:
    fixed = [replace(m, why_not_editable="it is made of cheese") for m in room.scene.materials]
    scene = replace(room.scene, materials=(fixed[0], *room.scene.materials[1:]))
    said: list[str] = []
    assert editable_materials(scene, (0, 1, 2, 3), said) == [1, 2, 3]
    assert said == ["the material of /stripe0, /stripe2 stays: it is made of cheese"]
    with pytest.raises(AuthorError, match="made of cheese"):
        editable_materials(replace(scene, materials=tuple(fixed)), (0, 1, 2, 3), said)


def test_the_mask_of_a_device_has_all_its_bins(room: Lit, near: Surroundings) -> None:
    wanted = room.field.device.download(mask_light(room.field, near, 0.0))
    assert wanted.shape == (len(room.elements), D, 3)
    np.testing.assert_array_equal(wanted, room.outgoing)


def test_a_material_without_an_element_stays_as_it_is(tmp_path: Path, device: Device) -> None:
    stage = StageBuilder(tmp_path)
    floor, shut = (stage.material(name, diffuseColor=(0.4, 0.3, 0.2), roughness=0.5) for name in ("floor", "shut"))
    stage.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), floor)
    stage.mesh("chest", box(0.4, 0.4, 0.4), floor)
    stage.mesh("shut_in", rectangle((-0.1, 0.2, 0.1), (0.2, 0, 0), (0, 0, -0.2)), shut)
    stage.rect_light("lamp", (0.5, 2.0, 1.0), (0, 0, 0), 0.6, 0.5, (4, 3.6, 3))
    shot = Shot.open(str(stage.save()), device=device, elements=40, bounces=1)
    assert {shot.scene.materials[m].path for m in shot.elements.material} == {floor}
    found = find_style(shot, radius=0.5).stylized
    assert found is not None
    assert [shot.scene.materials[s.material].path for s in found.styles] == [floor]
