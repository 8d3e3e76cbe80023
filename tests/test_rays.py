"""Rays into arrays that are there already find what rays into new ones do."""

from __future__ import annotations

import numpy as np
import pytest
from kit.scene_pictures import matte
from kit.scene_records import make_scene, sphere

from usdslf.rays import RayTracer
from usdslf.scene.records import constant


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_rays_of_no_length_are_none_and_the_others_are_traced(share: float, opacity: float) -> None:
    veil = matte(opacity=constant(opacity))
    tracer = RayTracer(make_scene(sphere(1.0), sphere(3.0, material=1), materials=[matte(), veil]))
    rng = np.random.default_rng(3)
    n = 40_000  # several runs
    origin = rng.normal(size=(n, 3)).astype(np.float32) * 4
    direction = -origin / np.linalg.norm(origin, axis=1, keepdims=True) + rng.normal(size=(n, 3)) * 0.3
    direction = (direction / np.linalg.norm(direction, axis=1, keepdims=True)).astype(np.float32)
    length = np.where(rng.random(n) < share, np.float32(1e37), np.float32(0))
    there = length > 0
    triangle, (u, v, distance) = np.zeros(n, np.int32), np.zeros((3, n), np.float32)
    tracer.intersect_into((origin, direction, length), (triangle, u, v, distance))
    expected = tracer.intersect(origin, direction)
    np.testing.assert_array_equal(triangle, np.where(there, expected.triangle, -1))
    hit = there & (expected.triangle >= 0)
    np.testing.assert_array_equal(np.stack([u, v], 1)[hit], expected.barycentric[hit])
    np.testing.assert_allclose(distance[hit], expected.distance[hit], rtol=1e-6)
    blocked = np.zeros(n, np.uint8)
    tracer.occluded_into((origin, direction, np.minimum(length, 4)), blocked)
    np.testing.assert_array_equal(blocked[there] > 0, tracer.occluded(origin, direction, 4.0)[there])
    assert hit.mean() >= 0.5 * share
