"""Light between surfaces, by the whole chain, against closed forms and integral equations."""

from __future__ import annotations

import numpy as np
import pytest
from kit.light_field_scenes import Lit, lit, material
from kit.scene_records import box, lamp, quad, sphere
from reference import light_field as ref

from usdslf.gpu.device import Device
from usdslf.sampling.hemisphere import bin_directions

Z = bin_directions()[:, 2]


@pytest.mark.parametrize("reflectance", [0.5, 0.9])
def test_a_closed_box_glows_by_the_sum_of_all_bounces(device: Device, reflectance: float) -> None:
    """Everywhere and in all directions alike; at 0.9 a leak of one ray in a hundred would cost 9 %."""
    made = lit(device, [box((0, 0, 0), (2, 1.5, 1), inward=True)], [material(reflectance, emission=1.0)], bounces=150)
    inside = made.outgoing[made.elements.side > 0]
    expected = ref.closed_box(1, reflectance)
    assert len(inside) > 100
    assert inside.mean() == pytest.approx(expected, rel=0.005)
    np.testing.assert_allclose(inside, expected, rtol=0.02)
    outside = made.outgoing[made.elements.side < 0]
    np.testing.assert_allclose(outside, 1, rtol=1e-5)  # emission alone: a convex body sees nothing of itself

    rng = np.random.default_rng(1)
    towards = rng.normal(size=(500, 3))
    towards = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32)
    hits = made.tracer.intersect(np.tile(np.float32([1, 0.7, 0.5]), (500, 1)), towards)
    seen = made.field.radiance_from_hits(hits.triangle, hits.barycentric, towards)
    np.testing.assert_allclose(seen, expected, rtol=0.02)
    np.testing.assert_allclose(made.field.incident(np.flatnonzero(made.elements.side > 0)[:5]), expected, rtol=0.02)
    missed = made.field.radiance_from_hits(np.full(3, -1, np.int32), np.zeros((3, 2), np.float32), towards[:3])
    np.testing.assert_array_equal(missed, 0)


def plates(
    device: Device, side: float, emission: tuple[float, float], reflectance: tuple[float, float], count: int
) -> tuple[Lit, np.ndarray, np.ndarray]:
    """Two squares one apart: the lit field, rows of the elements inside on the lower and on the upper one."""
    h = side / 2
    meshes = [
        quad((-h, -h, 0), (side, 0, 0), (0, side, 0), material=0, path="/low"),
        quad((-h, -h, 1), (0, side, 0), (side, 0, 0), material=1, path="/high"),
    ]
    made = lit(device, meshes, [material(r, emission=e) for r, e in zip(reflectance, emission)], count=count)
    e = made.elements
    return made, *(np.flatnonzero((e.mesh == m) & (e.side > 0)) for m in (0, 1))


def test_two_parallel_plates_are_the_solution_of_the_integral_equation(device: Device) -> None:
    made, low, high = plates(device, 2.0, (1.0, 0.0), (0.5, 0.8), 500)
    out = made.outgoing[..., 0].mean(1)
    for rows, exact in zip((low, high), ref.square_plates(2, 1, (1, 0), (0.5, 0.8))):
        expected = exact(made.elements.position[rows, :2])
        assert out[rows].mean() == pytest.approx(expected.mean(), rel=0.005)
        np.testing.assert_allclose(out[rows], expected, rtol=0.04)

    # Seen by a ray, between the elements.
    at = np.random.default_rng(0).uniform(-0.85, 0.85, (300, 2))
    towards = np.tile(np.float32([0.1, 0.2, 1]) / np.float32(np.sqrt(1.05)), (300, 1))
    origin = np.concatenate([at, np.full((300, 1), 0.5)], 1).astype(np.float32)
    hits = made.tracer.intersect(origin, towards)
    seen = made.field.radiance_from_hits(hits.triangle, hits.barycentric, towards)[:, 0]
    place = (origin + towards * hits.distance[:, None])[:, :2]
    met = hits.triangle >= 0
    expected = ref.square_plates(2, 1, (1, 0), (0.5, 0.8))[1](place[met])
    np.testing.assert_allclose(seen[met], expected, rtol=0.12)  # four elements to a corner of the plate
    assert np.abs(seen[met] / expected - 1).mean() < 0.02


def test_two_endless_plates_are_the_closed_form(device: Device) -> None:
    """Plates of sixty times their distance, in the middle."""
    made, low, high = plates(device, 60.0, (1.0, 0.3), (0.6, 0.7), 400)
    out = made.outgoing[..., 0].mean(1)
    for rows, expected in zip((low, high), ref.infinite_plates((1.0, 0.3), (0.6, 0.7))):
        middle = rows[np.abs(made.elements.position[rows, :2]).max(1) < 15]
        assert len(middle) > 5
        np.testing.assert_allclose(out[middle], expected, rtol=0.01)


@pytest.mark.parametrize("roughness", [0.3, 0.7])
def test_inside_a_sphere_glossy_light_goes_round_as_the_integral_equation_says(
    device: Device, roughness: float
) -> None:
    """preview_surface with all its terms: diffuse balance, lobe and Fresnel, over all bounces."""
    surface = material(0.5, 0.2, roughness, emission=1.0)
    made = lit(device, [sphere(1.0, rows=32)], [surface], count=400, model="preview_surface", bounces=60)
    inside = made.outgoing[made.elements.side < 0][..., 0].astype(float)
    exact = ref.inside_of_sphere(1, 0.5, 0.2, 1, roughness)
    cosines, which = np.unique(Z.round(6), return_inverse=True)
    expected = exact(cosines)[which]
    assert inside.mean() == pytest.approx(expected.mean(), rel=0.02)
    steep = Z > 0.2
    np.testing.assert_allclose(inside.mean(0)[steep], expected[steep], rtol=0.03)


def test_a_mean_does_not_depend_on_the_number_of_elements(device: Device) -> None:
    """A lamp in a room with a block: four times the elements change its mean irradiance by less than 2 %.

    The block has 40 elements of the 400, on five faces: its mean changes by less than 6 %.
    """
    meshes = [
        box((0, 0, 0), (3, 2, 2), inward=True, path="/room"),
        box((0.8, 0.5, 0), (1.6, 1.1, 0.9), path="/block"),
    ]
    light = lamp(1.9, (1.5, 1.0), 0.6)
    means = []
    for count in (400, 1600):
        made = lit(device, meshes, [material(0.6)], (light,), count, bounces=10, tolerance=1e-3)
        means.append([mean_over_surface(made, mesh) for mesh in (0, 1)])
    (few_room, few_block), (many_room, many_block) = means
    assert many_room == pytest.approx(few_room, rel=0.02)
    assert many_block == pytest.approx(few_block, rel=0.06)


def mean_over_surface(made: Lit, mesh: int, count: int = 4000) -> float:
    """Mean radiance of the front of a diffuse mesh over random points."""
    table, rng = made.scene.triangles, np.random.default_rng(9)
    area = table.areas * (table.mesh == mesh)
    triangle = rng.choice(len(area), count, p=area / area.sum())
    at = rng.random((count, 2))
    at = np.where(at.sum(1, keepdims=True) > 1, 1 - at, at)
    elements, weights = made.lookup.nearest(triangle, at, np.ones(count))
    value = (made.outgoing[:, 0, 0][elements] * weights).sum(1)
    return float(value[weights.sum(1) > 0].mean())  # where the block stands there is no light
