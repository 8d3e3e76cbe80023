"""The shipped demo scene, built in code: a still life in the corner of a room.

Left wall brick, right wall teal, back wall white; a vase, a teapot, a ball, a ring and a toy wagon on a
planked board; an area light from above and a dome with a picture of a studio.  Five materials use the metal
workflow, two the specular one; one is textured.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from usdslf.demo_shapes import (
    Shape,
    ball,
    curve,
    join,
    lathe,
    panel,
    rounded_box,
    torus,
    tube,
    turned_about,
)
from usdslf.errors import AuthorError

CAMERA = "/still_life/camera"

MATERIALS: dict[str, dict[str, object]] = {
    "plaster": {"diffuseColor": (0.72, 0.70, 0.66), "roughness": 0.9},
    "brick": {"diffuseColor": (0.62, 0.16, 0.09), "roughness": 0.85},
    "teal": {"diffuseColor": (0.07, 0.30, 0.32), "roughness": 0.85},
    "planks": {"diffuseColor": "planks.png", "roughness": 0.55},
    "glaze": {"diffuseColor": (0.30, 0.42, 0.55), "roughness": 0.3},
    "lacquer": {"useSpecularWorkflow": 1, "diffuseColor": (0.035, 0.05, 0.16),
                "specularColor": (0.04, 0.04, 0.04), "roughness": 0.25},
    "pewter": {"metallic": 1.0, "diffuseColor": (0.56, 0.54, 0.50), "roughness": 0.5},
    "gold": {"metallic": 1.0, "diffuseColor": (0.98, 0.68, 0.27), "roughness": 0.22},
    "paint": {"diffuseColor": (0.75, 0.44, 0.06), "roughness": 0.4},
    "rubber": {"useSpecularWorkflow": 1, "diffuseColor": (0.03, 0.03, 0.03),
               "specularColor": (0.03, 0.03, 0.03), "roughness": 0.6},
}  # fmt: skip
"""Inputs of each material; a text is the file of a texture."""

TRUTH: dict[str, dict[str, object]] = {
    "glaze": {"diffuseColor": (0.60, 0.055, 0.04)},
    "lacquer": {"specularColor": (0.25, 0.25, 0.25)},
    "pewter": {"roughness": 0.2},
}
"""What the scripted strokes are meant to bring about: one parameter of each of three materials."""


def build_demo_stage(
    folder: Path, changes: dict[str, dict[str, object]] | None = None, name: str = "shot.usda"
) -> Path:
    """Writes the demo stage into `folder` and returns its path.

    The meshes go to a binary sublayer, objects.usdc; materials, lights and camera stay readable.

    Args:
        folder: where planks.png and studio.exr lie already (see usdslf/demo.py).
        changes: inputs by material that replace those of MATERIALS.
    Raises: AuthorError where a file cannot be written.
    """
    objects, shot = Sdf.Layer.CreateAnonymous(".usda"), Sdf.Layer.CreateAnonymous(".usda")
    _fill(shot, objects, changes or {})
    shot.subLayerPaths[:] = ["./objects.usdc"]
    for layer, file in ((objects, "objects.usdc"), (shot, name)):
        _write(layer, folder / file)
    return folder / name


def _fill(shot: Sdf.Layer, objects: Sdf.Layer, changes: dict[str, dict[str, object]]) -> None:
    shot.subLayerPaths.append(objects.identifier)
    stage = Usd.Stage.Open(shot)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/still_life")
    stage.SetDefaultPrim(root.GetPrim())
    for material, inputs in MATERIALS.items():
        _add_material(stage, material, {**inputs, **changes.get(material, {})})
    _add_lights(stage)
    _add_camera(stage)
    with Usd.EditContext(stage, objects):
        _add_room(stage)
        _add_objects(stage)
    objects.defaultPrim = shot.defaultPrim
    for key in ("metersPerUnit", "upAxis"):
        objects.pseudoRoot.SetInfo(key, shot.pseudoRoot.GetInfo(key))


def _write(layer: Sdf.Layer, path: Path) -> None:
    try:
        if not layer.Export(str(path)):
            raise OSError("USD could not write it")
    except (OSError, RuntimeError) as error:
        raise AuthorError(f"{path} cannot be written ({error}); choose another folder with -o") from error


def _add_room(stage: Usd.Stage) -> None:
    # A board of 2 x 1.8, walls 1.4 high behind, at the left and, lower, at the right.
    _add_mesh(stage, "board", panel((-1, 0, 1), (2, 0, 0), (0, 0, -1.8)), "planks")
    _add_mesh(stage, "wall_back", panel((-1, 0, -0.8), (2, 0, 0), (0, 1.4, 0)), "plaster")
    _add_mesh(stage, "wall_left", panel((-1, 0, 1), (0, 0, -1.8), (0, 1.4, 0)), "brick")
    _add_mesh(stage, "wall_right", panel((1, 0, -0.8), (0, 0, 1.8), (0, 0.9, 0)), "teal")


def _add_objects(stage: Usd.Stage) -> None:
    _add_mesh(stage, "teapot", _teapot().moved((-0.36, 0, -0.12)), "glaze")
    _add_mesh(stage, "ball", ball(0.15).moved((0.10, 0.15, 0.26)), "lacquer")
    _add_mesh(stage, "vase", _vase().moved((0.20, 0, -0.36)), "pewter")
    _add_mesh(stage, "ring", torus(0.12, 0.032).moved((-0.30, 0.032, 0.42)), "gold")
    body, wheels = _wagon()
    turn, place = 0.55, (0.57, 0, 0.02)
    _add_mesh(stage, "wagon", turned_about(body, 1, turn).moved(place), "paint")
    _add_mesh(stage, "wagon_wheels", turned_about(wheels, 1, turn).moved(place), "rubber")


def _teapot() -> Shape:
    body = lathe(
        curve(
            [(0, 0.0), (0.10, 0.0), (0.125, 0.012), (0.185, 0.075), (0.20, 0.14), (0.17, 0.215), (0.12, 0.262),
             (0.108, 0.268), (0.095, 0.282), (0.05, 0.302), (0.022, 0.31), (0.02, 0.322), (0.036, 0.34),
             (0.03, 0.357), (0, 0.362)],
            110,
        ),
        96,
    )  # fmt: skip
    spout = curve([(0.15, 0.09, 0), (0.235, 0.12, 0), (0.275, 0.20, 0), (0.335, 0.262, 0)], 40)
    handle = curve(
        [(-0.15, 0.222, 0), (-0.235, 0.25, 0), (-0.29, 0.20, 0), (-0.27, 0.125, 0), (-0.18, 0.075, 0)], 48
    )
    return join(body, tube(spout, np.linspace(0.052, 0.022, 40)), tube(handle, 0.017))


def _vase() -> Shape:
    outside = [(0, 0.0), (0.085, 0.0), (0.10, 0.012), (0.15, 0.12), (0.185, 0.25), (0.165, 0.39), (0.09, 0.50),
               (0.072, 0.55), (0.09, 0.60), (0.112, 0.622)]  # fmt: skip
    inside = [(0.115, 0.63), (0.105, 0.628), (0.08, 0.60), (0.062, 0.55), (0.08, 0.49), (0.15, 0.38), (0, 0.36)]
    return lathe(curve(outside + inside, 130), 112)


def _wagon() -> tuple[Shape, Shape]:
    """Body with handle, and wheels, of a toy wagon along X."""
    floor = rounded_box((0.42, 0.03, 0.24), 0.012).moved((0, 0.10, 0))
    side = rounded_box((0.42, 0.10, 0.022), 0.009)
    end = rounded_box((0.022, 0.10, 0.24), 0.009)
    walls = [side.moved((0, 0.145, z)) for z in (-0.112, 0.112)] + [end.moved((x, 0.145, 0)) for x in (-0.2, 0.2)]
    pole = tube(curve([(0.2, 0.09, 0), (0.29, 0.10, 0), (0.34, 0.2, 0), (0.36, 0.27, 0)], 30), 0.009)
    grip = tube(curve([(0.36, 0.27, -0.055), (0.362, 0.275, 0), (0.36, 0.27, 0.055)], 16), 0.011)
    tyre = turned_about(torus(0.044, 0.02, 64), 0, np.pi / 2)
    disk = turned_about(lathe(curve([(0, -0.012), (0.04, -0.012), (0.04, 0.012), (0, 0.012)], 40), 48), 0, np.pi / 2)
    wheel = join(tyre, disk)
    places = [(x, 0.064, z) for x in (-0.13, 0.13) for z in (-0.145, 0.145)]
    return join(floor, *walls, pole, grip), join(*(wheel.moved(p) for p in places))


def _add_lights(stage: Usd.Stage) -> None:
    window = UsdLux.RectLight.Define(stage, "/still_life/window")
    window.CreateWidthAttr(0.7)
    window.CreateHeightAttr(0.5)
    window.CreateIntensityAttr(24.0)
    window.CreateColorAttr(Gf.Vec3f(1.0, 0.93, 0.82))
    at, toward = Gf.Vec3d(0.55, 1.45, 0.75), Gf.Vec3d(-0.05, 0.1, -0.1)
    window.AddTransformOp().Set(Gf.Matrix4d().SetLookAt(at, toward, Gf.Vec3d(0, 1, 0)).GetInverse())
    studio = UsdLux.DomeLight.Define(stage, "/still_life/studio")
    studio.CreateIntensityAttr(0.4)
    studio.CreateTextureFileAttr("./studio.exr")
    studio.CreateTextureFormatAttr(UsdLux.Tokens.latlong)


def _add_camera(stage: Usd.Stage) -> None:
    camera = UsdGeom.Camera.Define(stage, CAMERA)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(20.25)
    camera.CreateFocalLengthAttr(44.0)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.05, 50))
    eye, at = Gf.Vec3d(0.18, 0.86, 2.25), Gf.Vec3d(0.03, 0.235, -0.05)
    camera.AddTransformOp().Set(Gf.Matrix4d().SetLookAt(eye, at, Gf.Vec3d(0, 1, 0)).GetInverse())


def _add_mesh(stage: Usd.Stage, name: str, shape: Shape, material: str) -> None:
    mesh = UsdGeom.Mesh.Define(stage, f"/still_life/{name}")
    mesh.CreatePointsAttr(_vec3f(shape.points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.quads), 4))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.quads.ravel()))
    mesh.CreateNormalsAttr(_vec3f(shape.normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(_vec3f(np.stack([shape.points.min(0), shape.points.max(0)])))
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy(_rounded(shape.st)))
    bound = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
    bound.Bind(UsdShade.Material(stage.GetPrimAtPath(f"/still_life/materials/{material}")))


def _vec3f(rows: NDArray[np.float64]) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(_rounded(rows))


def _rounded(rows: NDArray[np.float64]) -> NDArray[np.float32]:
    """A hundredth of a millimetre is enough, and keeps the text of the layer short."""
    return np.ascontiguousarray(np.round(rows, 5) + 0.0, np.float32)


def _add_material(stage: Usd.Stage, name: str, inputs: dict[str, object]) -> None:
    stage.DefinePrim("/still_life/materials", "Scope")
    material = UsdShade.Material.Define(stage, f"/still_life/materials/{name}")
    surface = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("surface"))
    surface.CreateIdAttr("UsdPreviewSurface")
    for key, value in inputs.items():
        if isinstance(value, str):
            _add_texture(stage, material, surface.CreateInput(key, Sdf.ValueTypeNames.Color3f), value)
        elif isinstance(value, tuple):
            surface.CreateInput(key, Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*value))
        elif isinstance(value, int):
            surface.CreateInput(key, Sdf.ValueTypeNames.Int).Set(value)
        else:
            surface.CreateInput(key, Sdf.ValueTypeNames.Float).Set(value)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")


def _add_texture(stage: Usd.Stage, material: UsdShade.Material, target: UsdShade.Input, file: str) -> None:
    reader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("st"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("texture"))
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{file}")
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    texture.CreateInput("wrapS", Sdf.ValueTypeNames.Token).Set("repeat")
    texture.CreateInput("wrapT", Sdf.ValueTypeNames.Token).Set("repeat")
    texture.CreateInput("fallback", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(0.3, 0.2, 0.12, 1))
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    target.ConnectToSource(texture.ConnectableAPI(), "rgb")
