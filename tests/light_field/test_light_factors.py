"""inputs:diffuse and inputs:specular of lights scale what each kind of reflection receives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux

import usdslf
from usdslf.inference.direct import gather_strokes


def _columns(folder: Path, diffuse: float, specular: float) -> np.ndarray:
    """X, Y, A, B of a stroke on a plane below a disk light with the given factors."""
    stage = Usd.Stage.CreateNew(str(folder / f"d{diffuse}s{specular}.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.Plane.Define(stage, "/plane").CreateAxisAttr("Z")
    light = UsdLux.DiskLight.Define(stage, "/light")
    light.CreateIntensityAttr(5.0)
    light.AddTranslateOp().Set(Gf.Vec3d(0, 0, 2))
    api = UsdLux.LightAPI(light)
    api.CreateDiffuseAttr(diffuse)
    api.CreateSpecularAttr(specular)
    camera = UsdGeom.Camera.Define(stage, "/camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0, 3))
    stage.Save()
    s = usdslf.open(str(folder / f"d{diffuse}s{specular}.usda"), elements=100, bounces=1)
    stroke = usdslf.paint_stroke(s.scene, s.tracer, s.camera("/camera"), [np.array([[0.5, 0.5]])], 0.02)
    painted = gather_strokes([stroke], s.scene, s.tracer, s.light_field, s.light_set, [])[0]
    return painted.evidence(s.light_field).columns


def test_factors_scale_their_own_columns(tmp_path: Path) -> None:
    plain, scaled = _columns(tmp_path, 1.0, 1.0), _columns(tmp_path, 0.5, 3.0)
    np.testing.assert_allclose(scaled[:, :, :2], 0.5 * plain[:, :, :2], rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(scaled[:, :, 2:], 3.0 * plain[:, :, 2:], rtol=1e-4, atol=1e-7)
