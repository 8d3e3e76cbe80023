"""Cameras that a mouse moves keep what they should: distance, level, what is under the pointer, what is framed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydra_viewer.model.navigation import View, are_turned, dollied, framed, in_sight, orbited, panned, view_of
from usdslf import Camera, project_points

SHARE = st.floats(-0.9, 0.9)
BOX = np.array([-1.0, -0.5, -2.0]), np.array([2.0, 1.5, 1.0])


def view(perspective: bool = True, up: str = "Y") -> View:
    matrix = np.eye(4)
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) if up == "Z" else np.eye(3)
    matrix[:3, :3], matrix[:3, 3] = turn, turn @ [0.3, 0.4, 6.0]
    return view_of(Camera("/cam", matrix, 36.0, 24.0, 50.0, perspective=perspective), BOX, up)


@settings(max_examples=40, deadline=None)
@given(SHARE, SHARE, st.sampled_from("YZ"))
def test_orbiting_keeps_the_distance_the_level_and_the_pivot(right: float, down: float, up: str) -> None:
    before = view(up=up)
    after = orbited(before, right, down)
    m = after.camera.world_from_camera
    np.testing.assert_allclose(m[:3, :3].T @ m[:3, :3], np.eye(3), atol=1e-9)
    assert after.distance == pytest.approx(before.distance)
    np.testing.assert_allclose(m[:3, 0] @ after.up, before.camera.world_from_camera[:3, 0] @ before.up, atol=1e-9)
    np.testing.assert_allclose(
        project_points(after.camera, before.pivot[None], 1.5)[0],
        project_points(before.camera, before.pivot[None], 1.5)[0], atol=1e-9,
    )  # fmt: skip
    assert abs(m[:3, 2] @ after.up) <= np.sin(np.radians(89.1))
    assert after.camera.path == ""


@settings(max_examples=20, deadline=None)
@given(SHARE, SHARE, st.booleans())
def test_what_lies_at_the_pivot_follows_a_pan(right: float, down: float, perspective: bool) -> None:
    before = view(perspective)
    at, _ = project_points(before.camera, before.pivot[None], 1.5)
    moved, _ = project_points(panned(before, right, down).camera, before.pivot[None], 1.5)
    np.testing.assert_allclose((moved - at)[0], (right / 1.5, down), atol=1e-9)


@pytest.mark.parametrize("perspective", [True, False])
def test_a_dolly_of_one_makes_what_lies_at_the_pivot_twice_as_large(perspective: bool) -> None:
    before = view(perspective)
    ends = np.stack([before.pivot, before.pivot + np.array([0, 0.1, 0])])
    height = lambda v: np.ptp(project_points(v.camera, ends, 1.5)[0][:, 1])  # noqa: E731
    assert height(dollied(before, 1.0)) == pytest.approx(2 * height(before))
    assert height(dollied(dollied(before, 0.7), -0.7)) == pytest.approx(height(before))


@pytest.mark.parametrize("perspective", [True, False])
def test_what_is_framed_is_seen_whole_and_not_small(perspective: bool) -> None:
    low, high = BOX
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    at, depth = project_points(framed(view(perspective), BOX).camera, corners, 1.5)
    assert (depth > 0).all() and at.min() > 0 and at.max() < 1
    assert np.ptp(at[:, 1]) > 0.4


def test_what_is_framed_is_looked_at_from_before_the_wall_that_would_hide_it() -> None:
    found = framed(view(), BOX)
    eye = lambda v: float(v.camera.world_from_camera[2, 3])  # noqa: E731
    wall = 0.6 * eye(found)
    half_seen = lambda camera: 0.5 * float(camera.world_from_camera[2, 3] < wall)  # noqa: E731
    near = in_sight(found, half_seen)
    assert 0.75 * wall < eye(near) < wall and np.allclose(near.pivot, found.pivot)
    assert eye(in_sight(found, lambda camera: 0.5)) == pytest.approx(eye(found))


@pytest.mark.parametrize("perspective", [True, False])
def test_a_box_is_looked_at_from_outside(perspective: bool) -> None:
    low, high = BOX
    middle, half = (low + high) / 2, (high - low) / 2
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    faces = middle + normals * half
    found = framed(view(perspective), BOX)
    eye = lambda v: v.camera.world_from_camera[:3, 3]  # noqa: E731
    near = in_sight(found, lambda camera: float(are_turned(camera, faces, normals).mean()))
    assert (np.abs(eye(near) - middle) > half).any()
    inside = next(v for v in (dollied(found, n) for n in (2.0, 3.0, 4.0)) if (np.abs(eye(v) - middle) < half).all())
    turned = are_turned(inside.camera, faces, normals).sum()
    assert turned == 0 if perspective else turned > 0  # what is seen in parallel does not depend on where from
