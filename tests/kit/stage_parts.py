"""Writes small test stages: the builder, with the meshes and textures that it is used with.

Lengths are metres before the builder's `units_per_meter`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from kit.stage_meshes import (
    MeshData,
    Triple,
    ball,
    blob,
    bottle,
    box,
    capsule,
    grid,
    joined,
    lathe,
    rectangle,
    teapot,
    torus,
    tube,
    vase,
)
from kit.stage_textures import checker, noise, sky, write_image
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

__all__ = [
    "InputValue",
    "MeshData",
    "StageBuilder",
    "TextureInput",
    "Triple",
    "ball",
    "blob",
    "bottle",
    "box",
    "capsule",
    "checker",
    "grid",
    "joined",
    "lathe",
    "noise",
    "rectangle",
    "sky",
    "teapot",
    "torus",
    "tube",
    "vase",
    "write_image",
]


@dataclass(frozen=True)
class TextureInput:
    """A texture that drives an input, `texel * scale`."""

    file: str
    scale: Triple = (1.0, 1.0, 1.0)


InputValue = float | Triple | TextureInput

INPUT_TYPES = {
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "specularColor": Sdf.ValueTypeNames.Color3f,
    "emissiveColor": Sdf.ValueTypeNames.Color3f,
    "useSpecularWorkflow": Sdf.ValueTypeNames.Int,
}


class StageBuilder:
    """Writes one stage, `folder/stage.usda`, with everything below /World.

    Args:
      up: "Y" or "Z"; the world is turned, so that builders always think Y-up.
      units_per_meter: 1 or, say, 100 for a stage in centimetres.
    """

    def __init__(self, folder: Path, up: str = "Y", units_per_meter: float = 1.0) -> None:
        self.folder = folder
        self.path = folder / "stage.usda"
        self.stage = Usd.Stage.CreateNew(str(self.path))
        UsdGeom.SetStageUpAxis(self.stage, up)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1.0 / units_per_meter)
        world = UsdGeom.Xform.Define(self.stage, "/World")
        self.stage.SetDefaultPrim(world.GetPrim())
        if up == "Z":
            world.AddRotateXOp().Set(90.0)
        if units_per_meter != 1:
            world.AddScaleOp().Set(Gf.Vec3f(units_per_meter))
        self._units = units_per_meter

    def save(self) -> Path:
        """Writes the stage and returns its path."""
        self.stage.GetRootLayer().Save()
        return self.path

    def image(self, name: str, pixels: NDArray) -> str:
        """Writes an image beside the stage and returns its name."""
        if not (self.folder / name).exists():
            write_image(self.folder / name, pixels)
        return name

    def material(self, name: str, **inputs: InputValue) -> str:
        """Makes a UsdPreviewSurface and returns the path of its Material."""
        path = f"/World/mtl/{name}"
        material = UsdShade.Material.Define(self.stage, path)
        shader = UsdShade.Shader.Define(self.stage, path + "/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        for key, value in inputs.items():
            shade_input = shader.CreateInput(key, INPUT_TYPES.get(key, Sdf.ValueTypeNames.Float))
            if isinstance(value, TextureInput):
                shade_input.ConnectToSource(self._texture(path, key, value))
            elif isinstance(value, tuple):
                shade_input.Set(Gf.Vec3f(*value))
            else:
                shade_input.Set(int(value) if key == "useSpecularWorkflow" else value)
        shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        return path

    def _texture(self, material: str, key: str, value: TextureInput) -> UsdShade.Output:
        reader = UsdShade.Shader.Define(self.stage, material + "/st")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        texture = UsdShade.Shader.Define(self.stage, f"{material}/{key}_texture")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./" + value.file)
        texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        for wrap in ("wrapS", "wrapT"):
            texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("repeat")
        if value.scale != (1.0, 1.0, 1.0):
            texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*value.scale, 1.0))
        coordinates = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(coordinates)
        return texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)

    def mesh(self, name: str, data: MeshData, material: str, at: Triple = (0, 0, 0), turn: float = 0.0) -> str:
        """Adds a Mesh without subdivision, turned about y by degrees."""
        mesh = UsdGeom.Mesh.Define(self.stage, f"/World/{name}")
        mesh.CreatePointsAttr(data.positions.astype(np.float32))
        mesh.CreateFaceVertexCountsAttr(data.counts.astype(np.int32))
        mesh.CreateFaceVertexIndicesAttr(data.indices.astype(np.int32))
        mesh.CreateSubdivisionSchemeAttr("none")
        if data.normals is not None:
            mesh.CreateNormalsAttr(data.normals.astype(np.float32))
            mesh.SetNormalsInterpolation("vertex")
        if data.uvs is not None:
            api = UsdGeom.PrimvarsAPI(mesh)
            st = api.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
            st.Set(data.uvs.astype(np.float32))
        return self._place(mesh, material, at, turn)

    def sphere(self, name: str, radius: float, material: str, at: Triple) -> str:
        """Adds a Sphere about `at`."""
        gprim = UsdGeom.Sphere.Define(self.stage, f"/World/{name}")
        gprim.CreateRadiusAttr(radius)
        gprim.CreateExtentAttr([Gf.Vec3f(-radius), Gf.Vec3f(radius)])
        return self._place(gprim, material, at, 0.0)

    def cube(self, name: str, sides: Triple, material: str, at: Triple, turn: float = 0.0) -> str:
        """Adds a scaled Cube standing at `at`."""
        gprim = UsdGeom.Cube.Define(self.stage, f"/World/{name}")
        gprim.CreateSizeAttr(1.0)
        gprim.CreateExtentAttr([Gf.Vec3f(-0.5), Gf.Vec3f(0.5)])
        path = self._place(gprim, material, (at[0], at[1] + sides[1] / 2, at[2]), turn)
        gprim.AddScaleOp().Set(Gf.Vec3f(*sides))
        return path

    def plane(self, name: str, width: float, length: float, material: str, y: float = 0.0, axis: str = "Y") -> str:
        """Adds a Plane about the origin, horizontal where its normal is along Y."""
        gprim = UsdGeom.Plane.Define(self.stage, f"/World/{name}")
        gprim.CreateAxisAttr(axis)
        gprim.CreateWidthAttr(width)
        gprim.CreateLengthAttr(length)
        return self._place(gprim, material, (0, y, 0), 0.0)

    def _place(self, gprim: UsdGeom.Gprim, material: str, at: Triple, turn: float) -> str:
        gprim.AddTranslateOp().Set(Gf.Vec3d(*at))
        if turn:
            gprim.AddRotateYOp().Set(turn)
        UsdShade.MaterialBindingAPI.Apply(gprim.GetPrim()).Bind(UsdShade.Material(self.stage.GetPrimAtPath(material)))
        return str(gprim.GetPath())

    def rect_light(self, name: str, eye: Triple, target: Triple, width: float, height: float, radiance: Triple) -> None:
        """Adds a RectLight at `eye` shining at `target`."""
        light = UsdLux.RectLight.Define(self.stage, f"/World/{name}")
        light.CreateWidthAttr(width)
        light.CreateHeightAttr(height)
        light.CreateIntensityAttr(max(radiance))
        light.CreateColorAttr(Gf.Vec3f(*radiance) / max(radiance))
        light.AddTransformOp().Set(_look_at(eye, target))

    def sphere_light(self, name: str, at: Triple, radius: float, power: Triple) -> None:
        """Adds a normalized SphereLight."""
        light = UsdLux.SphereLight.Define(self.stage, f"/World/{name}")
        light.CreateRadiusAttr(radius)
        light.CreateNormalizeAttr(True)
        # Normalization divides by the world-space area, which grows with the stage's units.
        light.CreateIntensityAttr(max(power) * self._units**2)
        light.CreateColorAttr(Gf.Vec3f(*power) / max(power))
        light.AddTranslateOp().Set(Gf.Vec3d(*at))

    def distant_light(self, name: str, direction: Triple, angle: float, irradiance: float) -> None:
        """Adds a DistantLight shining along `direction` with an irradiance at normal incidence."""
        light = UsdLux.DistantLight.Define(self.stage, f"/World/{name}")
        light.CreateAngleAttr(angle)
        light.CreateNormalizeAttr(True)
        light.CreateIntensityAttr(irradiance)
        light.AddTransformOp().Set(_look_at((0, 0, 0), direction))

    def dome_light(
        self, name: str, radiance: float, color: Triple = (1, 1, 1), texture: str = "", turn: float = 0.0
    ) -> None:
        """Adds a DomeLight, constant or with a latlong texture."""
        light = UsdLux.DomeLight.Define(self.stage, f"/World/{name}")
        light.CreateIntensityAttr(radiance)
        light.CreateColorAttr(Gf.Vec3f(*color))
        if texture:
            light.CreateTextureFileAttr("./" + texture)
            light.CreateTextureFormatAttr("latlong")
        if turn:
            light.AddRotateYOp().Set(turn)

    def camera(self, eye: Triple, target: Triple, fov_deg: float = 40.0, aspect: float = 4 / 3) -> str:
        """Adds /World/camera with a vertical field of view; returns its path."""
        camera = UsdGeom.Camera.Define(self.stage, "/World/camera")
        camera.CreateFocalLengthAttr(35.0)
        vertical = 2 * 35.0 * math.tan(math.radians(fov_deg) / 2)
        camera.CreateVerticalApertureAttr(vertical)
        camera.CreateHorizontalApertureAttr(vertical * aspect)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1e5))
        camera.AddTransformOp().Set(_look_at(eye, target))
        return "/World/camera"


def _look_at(eye: Triple, target: Triple) -> Gf.Matrix4d:
    """A transform at `eye` whose -Z axis points at `target`."""
    e, t = Gf.Vec3d(*eye), Gf.Vec3d(*target)
    up = Gf.Vec3d(0, 1, 0) if abs((t - e).GetNormalized()[1]) < 0.99 else Gf.Vec3d(0, 0, -1)
    return Gf.Matrix4d().SetLookAt(e, t, up).GetInverse()
