"""Matrices of cameras against those of USD's own frustum."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf

from usdslf.scene.cameras import film_aspect, project_points, view_and_projection
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
