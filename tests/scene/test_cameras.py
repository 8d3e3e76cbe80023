"""Matrices and rays of cameras against those of USD's own frustum."""

from __future__ import annotations

import numpy as np
import pytest
from kit.scene_pictures import camera_at
from pxr import Gf

from usdslf.scene.cameras import camera_rays, film_aspect, project_points, view_and_projection
from usdslf.scene.records import Camera

TURNED = Gf.Matrix4d().SetRotate(Gf.Rotation((1, 2, 3), 40)) * Gf.Matrix4d().SetTranslate((1, -2, 5))
CAMERA = Camera("/cam", np.array(TURNED).T, 24.0, 18.0, 35.0, horizontal_offset=2.0, vertical_offset=-1.0)


def camera(perspective: bool) -> Camera:
    return Camera(**{**vars(CAMERA), "perspective": perspective})


@pytest.mark.parametrize("perspective", [True, False])
def test_they_are_those_of_usd(perspective: bool) -> None:
    usd = Gf.Camera(
        TURNED, Gf.Camera.Perspective if perspective else Gf.Camera.Orthographic, 24.0, 18.0, 2.0, -1.0, 35.0,
        Gf.Range1f(0.5, 90.0),
    )  # fmt: skip
    c = camera(perspective)
    view, projection = view_and_projection(c, film_aspect(c), 0.5, 90.0)
    assert view == pytest.approx(np.array(usd.frustum.ComputeViewMatrix()).T, abs=1e-6)
    assert projection == pytest.approx(np.array(usd.frustum.ComputeProjectionMatrix()).T, abs=1e-5)


@pytest.mark.parametrize("perspective", [True, False])
def test_points_land_where_strokes_are_painted_in_a_wider_picture(perspective: bool) -> None:
    c, aspect, shift = camera(perspective), 2.5, (0.01, -0.02)
    local = np.array([[0.3, 0.2, -4.0], [-1.0, 0.5, -30.0], [0.0, 0.0, -0.6]])
    points = local @ c.world_from_camera[:3, :3].T + c.world_from_camera[:3, 3]
    view, projection = view_and_projection(c, aspect, 0.5, 90.0, shift)
    clip = np.concatenate([points, np.ones((3, 1))], 1) @ (projection @ view).T
    at, _ = project_points(c, points, aspect)
    expected = np.stack([at[:, 0] + shift[0], at[:, 1] - shift[1]], 1)
    assert np.stack([clip[:, 0] / clip[:, 3], -clip[:, 1] / clip[:, 3]], 1) / 2 + 0.5 == pytest.approx(expected)


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("aspect", [0.6, 2.5])
def test_rays_pass_through_the_frustum_of_usd(perspective: bool, aspect: float) -> None:
    """Gf.Camera gives the frustum of the authored aperture; the wider picture shows it in its middle."""
    camera = camera_at((3, 2, 5), (0.3, 0, 0), horizontal_offset=4.0, vertical_offset=-3.0, perspective=perspective)
    gf = Gf.Camera()
    gf.transform = Gf.Matrix4d(camera.world_from_camera.T)
    gf.projection = Gf.Camera.Perspective if perspective else Gf.Camera.Orthographic
    gf.horizontalAperture, gf.verticalAperture = 36.0, 24.0
    gf.horizontalApertureOffset, gf.verticalApertureOffset = 4.0, -3.0
    gf.focalLength = 55.0
    frustum = gf.frustum
    window = frustum.window
    center, half = window.GetMidpoint(), window.GetSize() / 2
    if aspect > 36 / 24:
        half[0] = half[1] * aspect
    else:
        half[1] = half[0] / aspect
    at = np.array([[0.5, 0.5], [0.1, 0.8], [1, 0]])
    rays = camera_rays(camera, at, aspect)
    for (x, y), origin, direction in zip(at, rays.origin, rays.direction):
        frustum.window = Gf.Range2d(center - half, center + half)
        ray = frustum.ComputePickRay(Gf.Vec2d(2 * x - 1, 1 - 2 * y))
        expected = np.array(ray.direction) / np.linalg.norm(ray.direction)
        np.testing.assert_allclose(direction, expected, atol=2e-6)
        off = np.cross(origin - np.array(ray.startPoint), expected)
        np.testing.assert_allclose(off, 0, atol=2e-5)
    back, _ = project_points(camera, rays.origin + 2 * rays.direction, aspect)
    np.testing.assert_allclose(back, at, atol=1e-5)
