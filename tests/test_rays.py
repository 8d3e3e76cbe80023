"""Rays into arrays that are there already find what rays into new ones do."""

from __future__ import annotations

import numpy as np
import pytest
from kit.scene_pictures import matte
from kit.scene_records import make_mesh, make_scene, sphere

from usdslf.embree import BLOCK
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


def test_triangles_of_many_blocks_keep_their_numbers() -> None:
    side = 160
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    a = np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3)  # lower left corners of unit squares in z = 0
    right, up = np.array([1, 0, 0]), np.array([0, 1, 0])
    corners = np.stack([np.stack([a, a + right, a + up], 1), np.stack([a + right + up, a + up, a + right], 1)], 1)
    points = corners.reshape(-1, 3).astype(np.float32)
    grid = make_mesh(points, np.arange(len(points)).reshape(-1, 3))
    tracer = RayTracer(make_scene(grid))
    asked = np.random.default_rng(5).permutation(2 * side * side)[:20_000]
    assert 2 * side * side > BLOCK
    origin = points.reshape(-1, 3, 3)[asked].mean(1) + np.float32([0, 0, 1])
    down = np.broadcast_to(np.float32([0, 0, -1]), origin.shape)
    np.testing.assert_array_equal(tracer.intersect(origin, down).triangle, asked)
    np.testing.assert_array_equal(tracer.intersect_columns(origin.copy(), down.copy())[0], asked)
    triangle, (u, v, distance) = np.zeros(len(asked), np.int32), np.zeros((3, len(asked)), np.float32)
    tracer.intersect_into((origin, down.copy(), np.full(len(asked), 2, np.float32)), (triangle, u, v, distance))
    np.testing.assert_array_equal(triangle, asked)
    assert (tracer.intersect(origin, -down).triangle == -1).all()
