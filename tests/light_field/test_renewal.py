"""A light field follows an edit where it changes: as near as is stated, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from kit.light_field_scenes import lit, material
from kit.scene_records import box, lamp, quad

from usdslf.gpu.device import Device
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import BLOCKED, ESCAPES
from usdslf.light_field.renewal import BLOCK, renew
from usdslf.light_field.surface import Surface, albedo, changed_rows
from usdslf.sampling.hemisphere import SIDE, D

FLOOR, BOX, CELLAR = 0, 1, 2
EXACT = 1e-6


@pytest.fixture(scope="module")
def room(device: Device) -> LightField:
    """A floor with a box on it under a lamp; below both a ceiling that is lit from below, and sees nothing of them."""
    scene = [
        quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), material=FLOOR, path="/floor"),
        box((-0.5, -0.5, 0.01), (0.5, 0.5, 1.0), material=BOX, path="/box"),
        quad((-2, -2, -4), (0, 4, 0), (4, 0, 0), material=CELLAR, path="/cellar"),
    ]
    materials = [material(0.6), material((0.2, 0.5, 0.7), 0.05, 0.3), material(0.5)]
    lights = (lamp(2.5, (1, 0.5), 0.8), lamp(-6.0, up=True))
    return lit(device, scene, materials, lights, 240, "preview_surface", 60, EXACT).field


def edited(field: LightField, **values: np.ndarray) -> Surface:
    return field.surface.with_rows(field.elements.material == BOX, **values)


def outgoing(field: LightField) -> np.ndarray:
    return field.device.download(field.outgoing_d).astype(np.float64)


def converged(field: LightField, surface: Surface) -> np.ndarray:
    other = field.with_surface(surface)
    for _ in other.converge(60, EXACT):
        pass
    return outgoing(other)


RED = {"diffuse": np.float32([0.9, 0.1, 0.05]), "roughness": np.float32(0.6)}


def test_what_is_left_out_is_below_the_tolerance_and_falls_with_it(room: LightField) -> None:
    surface = edited(room, **RED)
    exact, before = converged(room, surface), outgoing(room)
    errors, reflected = [], []
    for tolerance in (1e-2, 3e-3, 1e-3, 1e-4, 0.0):
        field = room.with_surface(surface)
        found = renew(field, 60, tolerance)
        assert found.left <= tolerance
        errors.append(float(np.abs(outgoing(field) - exact).sum() / exact.sum()))
        reflected.append(sum(found.elements))
        assert errors[-1] < 2 * tolerance + 2e-5  # what waits would be reflected on
    assert np.abs(before - exact).sum() > 0.02 * exact.sum()
    assert (np.diff(errors) < 0).all() and (np.diff(reflected) > 0).all(), (errors, reflected)


def test_only_what_changed_reflects_first_and_what_sees_nothing_of_it_never(room: LightField) -> None:
    surface = edited(room, **RED)
    rows = changed_rows(room.surface, surface)
    np.testing.assert_array_equal(rows, room.elements.material == BOX)
    field = room.with_surface(surface)
    found = renew(field, 60, 0.0)
    assert found.elements[0] == rows.sum() and max(found.elements) <= (room.elements.material != CELLAR).sum()
    cellar = room.elements.material == CELLAR
    assert cellar.sum() > 40
    np.testing.assert_array_equal(outgoing(field)[cellar], outgoing(room)[cellar])
    assert renew(field, 60, 1e-6).elements == ()  # nothing is due
    assert renew(room.with_surface(room.surface), 60, 1e-6).elements == ()


def test_small_steps_add_up(room: LightField) -> None:
    """Twenty steps, each so small that its light would wait."""
    field, tolerance = room.with_surface(room.surface), 5e-3
    start = room.surface.diffuse[room.elements.material == BOX]
    for share in np.linspace(0, 1, 21)[1:]:
        surface = edited(room, diffuse=((1 - share) * start + share * RED["diffuse"]).astype(np.float32))
        field.set_surface(surface)
        assert renew(field, 60, tolerance).left <= tolerance
    exact = converged(room, surface)
    assert np.abs(outgoing(field) - exact).sum() < 2 * tolerance * exact.sum()


@pytest.mark.parametrize("change", [{"diffuse": 1.02}, {"f0": 1.1}, {"roughness": 1.02}])
def test_a_small_change_waits_until_it_matters(room: LightField, change: dict[str, float]) -> None:
    """Those that it changes too: what they will send otherwise is foreseen, and no less than it is."""
    box = room.elements.material == BOX
    surface = edited(room, **{k: getattr(room.surface, k)[box] * np.float32(by) for k, by in change.items()})
    exact = converged(room, surface)
    field, light = room.with_surface(surface), outgoing(room).sum()
    found = renew(field, 60, 5e-2)
    assert found.elements == () and found.left * light >= 0.9 * np.abs(outgoing(room) - exact)[box].sum() > 0
    assert sum(renew(field, 60, 1e-5).elements) >= box.sum()
    assert np.abs(outgoing(field) - exact).sum() < 5e-5 * exact.sum()


def test_the_light_of_some_elements_is_theirs(room: LightField) -> None:
    rows = np.array([17, 5, 40])
    sent = outgoing(room).sum((1, 2))
    np.testing.assert_allclose(room.sent_by(rows), sent[rows], rtol=1e-5)
    np.testing.assert_allclose(room.sent, sent, rtol=1e-5)
    assert len(room.sent_by(rows[:0])) == 0 < np.ptp(sent[rows])


def test_what_is_foreseen_of_small_changes_adds_up(room: LightField) -> None:
    """Of the light that elements send now, whatever they sent at first."""
    field, tolerance = room.with_surface(edited(room, diffuse=np.float32([0.05, 0.05, 0.05]))), 2e-3
    renew(field, 60, 0.0)
    for share in np.geomspace(0.05, 0.5, 60)[1:]:
        field.set_surface(edited(room, diffuse=np.full(3, share, np.float32)))
        assert renew(field, 60, tolerance).left <= tolerance
    exact = converged(room, field.surface)
    assert np.abs(outgoing(field) - exact).sum() < 2 * tolerance * exact.sum()


def test_what_does_not_matter_waits(room: LightField) -> None:
    surface = edited(room, **RED)
    matters = (room.elements.material == BOX).astype(float)
    field = room.with_surface(surface)
    found = renew(field, 60, 0.0, matters)
    assert set(found.elements) == {int(matters.sum())}
    floor = room.elements.material == FLOOR
    np.testing.assert_array_equal(outgoing(field)[floor], outgoing(room)[floor])
    assert sum(renew(field, 60, 1e-6).elements) > matters.sum()  # it was not forgotten
    exact = converged(room, surface)
    assert np.abs(outgoing(field) - exact).sum() < 1e-4 * exact.sum()


def test_what_arrives_of_a_change_is_summed_and_sized(device: Device) -> None:
    """Random rows, links and light, against numpy."""
    rng, n, rows = np.random.default_rng(5), 6, np.array([1, 3, 4])
    old, new = (rng.uniform(0, 2, (n, D, 3)).astype(np.float32) for _ in range(2))
    hit = rng.integers(0, n * D, (n, D)).astype(np.uint32)
    hit[:, ::7], hit[:, 3::11] = ESCAPES, BLOCKED
    cosine = rng.dirichlet(np.ones(D)).astype(np.float32)
    kernel = lambda name: device.kernel("renewal", name, BLOCK=BLOCK)  # noqa: E731
    side, count = SIDE // BLOCK, D // BLOCK**2
    outgoing_d, change_d = device.upload(old), device.zeros((1 + len(rows), count, 4), np.float32)
    arriving_d = device.zeros((n, 2), np.float32)
    total = len(rows) * count
    kernel("take_rows")(
        (-(-total // 64) * 64,), (64,), device.upload(rows.astype(np.int32)), np.uint32(total), device.upload(new),
        outgoing_d, change_d,
    )  # fmt: skip
    row_of = np.zeros(n, np.int32)
    row_of[rows] = 1 + np.arange(len(rows))
    kernel("arriving_change")(
        (64,), (64,), device.upload(hit), device.upload(row_of), change_d, device.upload(cosine), np.uint32(n),
        arriving_d,
    )  # fmt: skip
    taken = old.copy()
    taken[rows] = new[rows]
    np.testing.assert_array_equal(device.download(outgoing_d), taken)
    moved = (taken - old).astype(np.float64).reshape(n, side, BLOCK, side, BLOCK, 3)
    means = np.concatenate([moved, np.abs(moved).sum(-1, keepdims=True)], -1).mean((2, 4)).reshape(n, count, 4)
    np.testing.assert_allclose(device.download(change_d)[1:], means[rows], atol=1e-5)
    bins = np.arange(D)
    block = bins // SIDE // BLOCK * side + bins % SIDE // BLOCK
    met = np.where(hit >= BLOCKED, 0, hit)
    seen = means[met // D, block[met % D]] * (hit < BLOCKED)[..., None]
    sums = (cosine[:, None] * seen).sum(1)
    expected = np.stack([np.abs(sums[:, :3]).sum(1), sums[:, 3]], 1)
    np.testing.assert_allclose(device.download(arriving_d), expected, rtol=1e-4, atol=1e-6)


def test_albedo_is_that_of_schlicks_ramp(room: LightField) -> None:
    """Against the integral over the hemisphere, by cosine."""
    s, mu = room.surface, (np.arange(4000) + 0.5) / 4000
    ramp = s.f0[:, :, None] + (s.f90 - s.f0)[:, :, None] * (1 - mu) ** 5
    expected = (s.diffuse * (1 - s.f0)).max(1) + (2 * mu * ramp).mean(2).max(1)
    np.testing.assert_allclose(albedo(s), expected, rtol=1e-3)


def test_what_is_lent_is_as_the_shot_is_whatever_the_one_before_did(room: LightField) -> None:
    before = outgoing(room)
    for bounces in (3, 0):
        with room.lent() as field:
            np.testing.assert_array_equal(outgoing(field), before)
            assert renew(field, 60, 1e-6).elements == ()
            field.set_surface(edited(room, **RED))
            assert renew(field, 2, 0.0).elements
            for _ in range(bounces):  # of everything: nothing is kept of it
                field.bounce()
            assert np.abs(outgoing(field) - before).max() > 0.01
        np.testing.assert_array_equal(outgoing(room), before)
    with room.lent() as field, room.lent() as other:
        assert field is not other
        np.testing.assert_array_equal(outgoing(other), before)
