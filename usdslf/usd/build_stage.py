"""Shots built in code -> stages on disk: meshes in a binary sublayer, materials, lights and cameras readable.

    write_stage(shot, folder, name="shot.usda") -> Path
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.usd.files import write_layer

Names = Sdf.ValueTypeNames
COLORS = ("diffuseColor", "emissiveColor", "specularColor")


def write_stage(shot: BuiltShot, folder: Path, name: str = "shot.usda") -> Path:
    """Writes a shot into `folder`, where its textures lie already, and returns the stage's path.

    Raises: AuthorError where a file cannot be written.
    """
    objects, root = Sdf.Layer.CreateAnonymous(".usda"), Sdf.Layer.CreateAnonymous(".usda")
    _fill(shot, root, objects)
    root.subLayerPaths[:] = ["./objects.usdc"]
    for layer, file in ((objects, "objects.usdc"), (root, name)):
        write_layer(layer, folder / file)
    return folder / name


def _fill(shot: BuiltShot, root: Sdf.Layer, objects: Sdf.Layer) -> None:
    root.subLayerPaths.append(objects.identifier)
    stage = Usd.Stage.Open(root)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    top = UsdGeom.Xform.Define(stage, f"/{shot.name}")
    stage.SetDefaultPrim(top.GetPrim())
    stage.DefinePrim(f"/{shot.name}/materials", "Scope")
    for material, inputs in shot.materials.items():
        _add_material(stage, f"/{shot.name}/materials/{material}", inputs)
    for lamp in shot.lamps:
        _add_lamp(stage, f"/{shot.name}/{lamp.name}", lamp)
    for view in shot.views:
        _add_view(stage, f"/{shot.name}/{view.name}", view)
    with Usd.EditContext(stage, objects):
        for part in shot.parts:
            _add_part(stage, shot.name, part)
    objects.defaultPrim = root.defaultPrim
    for key in ("metersPerUnit", "upAxis"):
        objects.pseudoRoot.SetInfo(key, root.pseudoRoot.GetInfo(key))


def _add_lamp(stage: Usd.Stage, path: str, lamp: Lamp) -> None:
    schema = {
        "rect": UsdLux.RectLight, "disk": UsdLux.DiskLight, "sphere": UsdLux.SphereLight,
        "distant": UsdLux.DistantLight, "dome": UsdLux.DomeLight,
    }[lamp.kind]  # fmt: skip
    light = schema.Define(stage, path)
    intensity = max(lamp.radiance) or 1.0
    light.CreateIntensityAttr(intensity)
    light.CreateColorAttr(Gf.Vec3f(*(c / intensity for c in lamp.radiance)))
    if lamp.kind == "dome":
        if lamp.file:
            light.CreateTextureFileAttr(f"./{lamp.file}")
            light.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        return
    if lamp.kind == "rect":
        light.CreateWidthAttr(lamp.size[0])
        light.CreateHeightAttr(lamp.size[1])
    elif lamp.kind == "distant":
        light.CreateAngleAttr(lamp.angle_deg)
    else:
        light.CreateRadiusAttr(lamp.size[0])
    light.AddTransformOp().Set(_looking(lamp.at, lamp.toward))


def _add_view(stage: Usd.Stage, path: str, view: View) -> None:
    camera = UsdGeom.Camera.Define(stage, path)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(20.25)
    camera.CreateFocalLengthAttr(view.focal_length)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.05, 50))
    camera.AddTransformOp().Set(_looking(view.eye, view.at))


def _looking(eye: tuple[float, ...], at: tuple[float, ...]) -> Gf.Matrix4d:
    """Object to world of what looks along its -Z from `eye` to `at`."""
    up = Gf.Vec3d(0, 1, 0)
    ahead = (Gf.Vec3d(*at) - Gf.Vec3d(*eye)).GetNormalized()
    if abs(ahead * up) > 0.999:
        up = Gf.Vec3d(0, 0, -1)
    return Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*at), up).GetInverse()


def _add_part(stage: Usd.Stage, shot: str, part: Part) -> None:
    mesh, shape = UsdGeom.Mesh.Define(stage, f"/{shot}/{part.name}"), part.shape
    mesh.CreatePointsAttr(_vec3f(shape.points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.quads), 4))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.quads.ravel()))
    mesh.CreateNormalsAttr(_vec3f(shape.normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(_vec3f(np.stack([shape.points.min(0), shape.points.max(0)])))
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Names.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy(_rounded(shape.st)))
    bound = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
    bound.Bind(UsdShade.Material(stage.GetPrimAtPath(f"/{shot}/materials/{part.material}")))


def _vec3f(rows: NDArray[np.float64]) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(_rounded(rows))


def _rounded(rows: NDArray[np.float64]) -> NDArray[np.float32]:
    """A hundredth of a millimetre is enough, and keeps the text of the layer short."""
    return np.ascontiguousarray(np.round(rows, 5) + 0.0, np.float32)


def _add_material(stage: Usd.Stage, path: str, inputs: Inputs) -> None:
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    for key, value in inputs.items():
        if isinstance(value, str):
            _add_texture(stage, path, surface, key, value)
        elif isinstance(value, tuple):
            surface.CreateInput(key, Names.Color3f).Set(Gf.Vec3f(*value))
        elif isinstance(value, int):
            surface.CreateInput(key, Names.Int).Set(value)
        else:
            surface.CreateInput(key, Names.Float).Set(value)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")


def _add_texture(stage: Usd.Stage, path: str, surface: UsdShade.Shader, key: str, file: str) -> None:
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Names.String).Set("st")
    reader.CreateOutput("result", Names.Float2)
    texture = UsdShade.Shader.Define(stage, f"{path}/{key}_texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Names.Asset).Set(f"./{file}")
    is_color = key in COLORS
    texture.CreateInput("sourceColorSpace", Names.Token).Set("auto" if is_color else "raw")
    texture.CreateInput("wrapS", Names.Token).Set("repeat")
    texture.CreateInput("wrapT", Names.Token).Set("repeat")
    if key == "normal":
        texture.CreateInput("scale", Names.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
        texture.CreateInput("bias", Names.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))
    texture.CreateInput("fallback", Names.Float4).Set(Gf.Vec4f(0.3, 0.2, 0.12, 1))
    texture.CreateInput("st", Names.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    output, kind = ("rgb", Names.Float3) if is_color or key == "normal" else ("r", Names.Float)
    texture.CreateOutput(output, kind)
    kind = Names.Normal3f if key == "normal" else Names.Color3f if is_color else Names.Float
    surface.CreateInput(key, kind).ConnectToSource(texture.ConnectableAPI(), output)
