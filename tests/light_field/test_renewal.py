"""A light field follows an edit where it changes: as near as is stated, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from kit.light_field_scenes import lit, material
from kit.scene_records import box, lamp, quad

from usdslf.gpu.device import Device
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import BLOCKED, ESCAPES
from usdslf.light_field.renewal import renew, seen_from
from usdslf.light_field.surface import Surface, albedo, changed_rows

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


def test_elements_matter_by_their_share_of_the_rays(room: LightField) -> None:
    links = np.array([[3 << 10 | 7, 5 << 10], [3 << 10, ESCAPES], [BLOCKED, 3 << 10]], np.uint32)
    weights = np.array([[0.75, 0.25], [1.0, 9.0], [9.0, 0.5]], np.float32)
    reflects = np.full(10, 0.5)
    got = seen_from(links, weights, reflects)
    direct = np.zeros(10)
    direct[[3, 5]] = 2.25, 0.25
    np.testing.assert_allclose(got, direct + 2.5 * 0.5 / 0.5 / 10)


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
