"""A change of a textured input keeps the texture's detail, and what is out of its scope keeps every bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kit.look_stages import author, compose
from kit.textured_rows import textured_shot
from numpy.typing import NDArray
from pxr import Usd
from scipy.ndimage import uniform_filter

from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.scene.records import Scene
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface
from usdslf.usd.read.read import read_scene

SIZE = 64  # points along a side of the square in front


def on_first_square(scene: Scene, mesh: str) -> SurfacePoints:
    """Points in a grid over the first square of a row, in the order of rows."""
    (number,) = (i for i, m in enumerate(scene.meshes) if m.path == mesh)
    first = scene.triangles.first_of_mesh[number]
    y, x = ((np.indices((SIZE, SIZE)) + 0.5) / SIZE).reshape(2, -1)
    corners = scene.triangles.positions[first : first + 2]
    triangle, barycentric = np.full(SIZE**2, -1), np.zeros((SIZE**2, 2))
    for i, p in enumerate(corners.astype(np.float64)):
        edges = np.stack([p[1] - p[0], p[2] - p[0]], 1)[:2]
        uv = np.linalg.solve(edges, (np.stack([x, y]) - p[0, :2, None])).T
        inside = (uv >= -1e-9).all(1) & (uv.sum(1) <= 1 + 1e-9)
        triangle[inside], barycentric[inside] = first + i, uv[inside]
    assert (triangle >= 0).all()
    return evaluate_surface(scene, triangle, barycentric)


def detail(points: SurfacePoints) -> NDArray:
    """What is left of the colour (n, 3) without its mean over 9 x 9 points."""
    picture = points.base_color.reshape(SIZE, SIZE, 3).astype(np.float64)
    return (picture - uniform_filter(picture, (9, 9, 0), mode="nearest"))[4:-4, 4:-4].reshape(-1, 3)


@pytest.mark.parametrize("kind", ["multiply", "add", "auto"])
@pytest.mark.parametrize("mode", ["override", "new"])
def test_detail_stays_and_other_surfaces_keep_every_bit(tmp_path: Path, kind: str, mode: str) -> None:
    stage: Usd.Stage = textured_shot(tmp_path, {"diffuseColor": "rgb"})
    scene = read_scene(stage, refine=0)
    painted, other = (on_first_square(scene, f"/World/{n}") for n in ("row", "other"))
    (material,) = scene.materials
    mean = painted.diffuse.mean(0, dtype=np.float64)
    f0, roughness = painted.f0.mean(0, dtype=np.float64), float(painted.roughness.mean())
    before, after = (Reflectance(d, f0, roughness) for d in (mean, mean * (1.2, 0.8, 0.9)))
    change = MaterialChange(
        material, "material", ("/World/row",), ("diffuse",), before, after, means={"diffuseColor": mean}, map=kind
    )
    edits = author(stage, tmp_path, change, mode=mode)
    assert edits and all(e.wins and e.representation == "scale" for e in edits)
    composed = read_scene(compose(tmp_path), refine=0)
    now, beside = (on_first_square(composed, f"/World/{n}") for n in ("row", "other"))
    np.testing.assert_allclose(now.diffuse.mean(0), after.diffuse, rtol=1e-4)
    for was, is_now in zip(detail(painted).T, detail(now).T, strict=True):
        assert was.std() > 0.005
        assert np.corrcoef(was, is_now)[0, 1] > 0.99
    if mode == "new":
        assert np.array_equal(beside.base_color, other.base_color)
    else:  # one map for all that show the material
        for c in range(3):
            scale, bias = np.polyfit(painted.base_color[:, c], now.base_color[:, c], 1)
            np.testing.assert_allclose(beside.base_color[:, c], other.base_color[:, c] * scale + bias, atol=1e-4)
