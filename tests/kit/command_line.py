"""A plain shot for the command line, and what an error may look like."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

Run = Callable[..., tuple[int, str, str]]
CAMERA = "/world/camera"
SMALL = ("--elements", 300, "--bounces", 2)


def write_shot(folder: Path) -> Path:
    """A floor, a wall, a red ball, a light and a camera."""
    path = folder / "shot.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/world").GetPrim())
    for name, color, corners in (
        ("floor", (0.6, 0.6, 0.6), [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)]),
        ("wall", (0.2, 0.5, 0.3), [(-2, 0, -2), (2, 0, -2), (2, 3, -2), (-2, 3, -2)]),
    ):
        mesh = UsdGeom.Mesh.Define(stage, f"/world/{name}")
        mesh.CreatePointsAttr(Vt.Vec3fArray([Gf.Vec3f(*c) for c in corners]))
        mesh.CreateFaceVertexCountsAttr([4])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        mesh.CreateSubdivisionSchemeAttr("none")
        bind(stage, mesh.GetPrim(), name, color)
    ball = UsdGeom.Sphere.Define(stage, "/world/ball")
    ball.CreateRadiusAttr(0.6)
    ball.AddTranslateOp().Set(Gf.Vec3d(0, 0.6, 0))
    bind(stage, ball.GetPrim(), "red", (0.6, 0.05, 0.05))
    light = UsdLux.RectLight.Define(stage, "/world/light")
    light.CreateIntensityAttr(12)
    light.AddTransformOp().Set(
        Gf.Matrix4d().SetLookAt(Gf.Vec3d(1, 3, 2), Gf.Vec3d(0, 0.5, 0), Gf.Vec3d(0, 1, 0)).GetInverse()
    )
    camera = UsdGeom.Camera.Define(stage, CAMERA)
    camera.CreateHorizontalApertureAttr(36)
    camera.CreateVerticalApertureAttr(24)
    camera.CreateFocalLengthAttr(50)
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0.8, 5))
    stage.Save()
    return path


def bind(stage: Usd.Stage, prim: Usd.Prim, name: str, color: tuple[float, float, float]) -> None:
    """Gives a prim a UsdPreviewSurface of one colour."""
    material = UsdShade.Material.Define(stage, f"/world/materials/{name}")
    shader = UsdShade.Shader.Define(stage, f"/world/materials/{name}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def paint_ball(shot: Path, folder: Path, run: Run) -> Path:
    """A blue dab row on the ball."""
    path = folder / "strokes.usda"
    code, _, err = run(
        "stroke", shot, path, "--camera", CAMERA, "--path", "0.44,0.55 0.5,0.6 0.56,0.55",
        "--color", "0.03,0.05,0.3",
    )  # fmt: skip
    assert code == 0, err
    return path


def assert_one_line(err: str) -> None:
    """An error is one line that names the program, and no traceback."""
    lines = [x for x in err.splitlines() if x.strip()]
    assert len(lines) == 1, err
    assert lines[0].startswith("usdslf: ")
    assert "internal error" not in err and "Traceback" not in err


def files_of(folder: Path) -> dict[str, bytes]:
    """Names and content of all files in a folder."""
    return {p.name: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def environment() -> dict[str, str]:
    """This process's environment, with the program on the path."""
    root = str(Path(__file__).resolve().parents[2])
    return {**os.environ, "PYTHONPATH": root}
