"""What tests of look layers share: small shots, solved changes, and how a look shows over its shot."""

from __future__ import annotations

import atexit
import hashlib
import shutil
import tempfile
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, UsdValidation, Vt
from reference.preview_surface_inputs import FALLBACKS, reflectance

from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.scene.records import Material, PrimvarInput, Texture, constant
from usdslf.textures.images import write_image
from usdslf.usd.author.author import author_look, author_review_root
from usdslf.usd.binding import bound_relationship, preview_surface
from usdslf.usd.layer.wins import AuthoredEdit

F = Sdf.ValueTypeNames
TYPES = {
    "diffuseColor": F.Color3f,
    "specularColor": F.Color3f,
    "metallic": F.Float,
    "roughness": F.Float,
    "ior": F.Float,
    "useSpecularWorkflow": F.Int,
}


# ---- stages ------------------------------------------------------------------------------------
def add_material(stage: Usd.Stage, path: str, **inputs: Any) -> UsdShade.Material:
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/pbr")
    shader.CreateIdAttr("UsdPreviewSurface")
    for name, value in inputs.items():
        shader.CreateInput(name, TYPES[name]).Set(value)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def bind(prim: Usd.Prim, material: UsdShade.Material) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def add_quads(stage: Usd.Stage, path: str, count: int = 4) -> UsdGeom.Mesh:
    """A row of squares, one face each."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    x = np.arange(count + 1, dtype=np.float32)
    points = np.concatenate([np.stack([x, x * 0 + y, x * 0], -1) for y in (0, 1)])
    i = np.arange(count)
    faces = np.stack([i, i + 1, i + count + 2, i + count + 1], -1)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([4] * count))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel().astype(np.int32)))
    mesh.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(0, 0, 0), Gf.Vec3f(count, 1, 0)]))
    return mesh


def new_stage(path: Path) -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    root = UsdGeom.Xform.Define(stage, "/World").GetPrim()
    stage.SetDefaultPrim(root)
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(24)
    UsdGeom.Scope.Define(stage, "/World/mtl")
    return stage


def new_shot(folder: Path) -> Usd.Stage:
    """Two balls of one red material and a row of squares of another."""
    stage = new_stage(folder / "shot.usda")
    red = add_material(stage, "/World/mtl/red", diffuseColor=Gf.Vec3f(0.6, 0.2, 0.1))
    grey = add_material(stage, "/World/mtl/grey", diffuseColor=Gf.Vec3f(0.5, 0.5, 0.5), roughness=0.4)
    for name in ("ball", "other"):
        ball = UsdGeom.Sphere.Define(stage, f"/World/{name}")
        ball.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(-1, -1, -1), Gf.Vec3f(1, 1, 1)]))
        bind(ball.GetPrim(), red)
    bind(add_quads(stage, "/World/row").GetPrim(), grey)
    stage.GetRootLayer().Save()
    return stage


@lru_cache
def new_instances(folder: Path) -> Usd.Stage:
    """/World/a and /World/b are instances of an asset of two gprims, in which /inner is an instance too."""
    asset = Usd.Stage.CreateNew(str(folder / "asset.usda"))
    red = None
    for root in ("/inner", "/asset"):
        prim = UsdGeom.Xform.Define(asset, root).GetPrim()
        UsdGeom.Scope.Define(asset, f"{root}/mtl")
        red = add_material(asset, f"{root}/mtl/red", diffuseColor=Gf.Vec3f(0.6, 0.2, 0.1))
        bind(UsdGeom.Sphere.Define(asset, f"{root}/ball").GetPrim(), red)
        bind(UsdGeom.Sphere.Define(asset, f"{root}/ball2").GetPrim(), red)
        Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    nested = asset.DefinePrim("/asset/nested", "Xform")
    nested.GetReferences().AddInternalReference("/inner")
    nested.SetInstanceable(True)
    asset.GetRootLayer().Save()
    stage = new_stage(folder / "shot.usda")
    add_two_instances(stage, "/asset")
    return stage


def add_two_instances(stage: Usd.Stage, root: str = "") -> None:
    """Adds /World/a and /World/b, instances of `root` ("": the default prim) of asset.usda beside it, and saves."""
    for name in ("a", "b"):
        prim = stage.DefinePrim(f"/World/{name}", "Xform")
        prim.GetReferences().AddReference("./asset.usda", root or Sdf.Path.emptyPath)
        prim.SetInstanceable(True)
    stage.GetRootLayer().Save()


@cache
def image_file() -> str:
    """An image that can be read; it goes when the process ends."""
    folder = tempfile.mkdtemp(prefix="usdslf_")
    atexit.register(shutil.rmtree, folder, True)
    return str(write_image(Path(folder) / "map.png", np.full((2, 2, 3), 0.5)))


# ---- changes and their effect --------------------------------------------------------------------
def record(path: str, **inputs: Any) -> Material:
    fields = {"diffuseColor": "diffuse_color", "specularColor": "specular_color"}
    values: dict[str, Any] = {}
    for name, value in inputs.items():
        if name == "useSpecularWorkflow":
            values["use_specular_workflow"] = bool(value)
        else:
            driven = isinstance(value, Texture | PrimvarInput)
            values[fields.get(name, name)] = value if driven else constant(*np.ravel(value))
    return Material(path, **values)


def as_reflectance(**inputs: Any) -> Reflectance:
    r = reflectance(**inputs)
    return Reflectance(np.array(r["d"]), np.array(r["f0"]), r["roughness"])


def read_inputs(stage: Usd.Stage, prim: str) -> dict[str, Any]:
    """The constants that show on a prim, as a renderer reads them."""
    material = UsdShade.Material(stage.GetPrimAtPath(bound_relationship(stage.GetPrimAtPath(prim))[0]))
    shader = preview_surface(material)
    assert shader is not None
    out = {}
    for name in FALLBACKS:
        port = shader.GetInput(name)
        attributes = port.GetValueProducingAttributes() if port else []
        if attributes and not UsdShade.Output.IsOutput(attributes[0]):
            out[name] = attributes[0].Get()
    return out


def shown(stage: Usd.Stage, prim: str) -> dict[str, Any]:
    return reflectance(**read_inputs(stage, prim))


def change_of(
    stage: Usd.Stage, prim: str, freed: str, d: Any = None, f0: Any = None, roughness: Any = None, **more: Any
) -> MaterialChange:
    """The change of what shows on a prim to some reflectance."""
    inputs = read_inputs(stage, prim)
    path = bound_relationship(stage.GetPrimAtPath(prim))[0]
    before = as_reflectance(**inputs)
    after = Reflectance(
        before.diffuse if d is None else np.array(d, float),
        before.f0 if f0 is None else np.array(f0, float),
        before.roughness if roughness is None else roughness,
    )
    values = {"scope": "material", "targets": (prim,), "strokes": ("/SlfStrokes/stroke_0001",)} | more
    material = values.pop("material", record(str(path), **inputs))
    names = tuple(freed.split("+"))
    return MaterialChange(material=material, freed=names, before=before, after=after, **values)


def compose(folder: Path, strokes: str | None = None) -> Usd.Stage:
    """The review root, opened anew."""
    root = folder / "review.usda"
    painted = folder / strokes if strokes else None
    author_review_root(root, folder / "look.usda", painted, folder / "shot.usda")
    return Usd.Stage.Open(str(root))


def author(stage: Usd.Stage, folder: Path, *changes: MaterialChange, **options: Any) -> list[AuthoredEdit]:
    """Writes the look, and checks what holds for every look: the shot is untouched."""
    files = [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath]
    before = [hashlib.sha256(f.read_bytes()).digest() for f in files]
    edits = author_look(stage, changes, folder / "look.usda", **options)
    assert before == [hashlib.sha256(f.read_bytes()).digest() for f in files]
    assert not any(layer.dirty for layer in stage.GetUsedLayers() if layer.realPath)
    return edits


def validate(stage: Usd.Stage) -> list[str]:
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    return [f"{e.GetName()}: {e.GetMessage()}" for e in errors]
