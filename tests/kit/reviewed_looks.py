"""Looks that tests of reviews take apart: made by the writer of looks from changes, without any light."""

from __future__ import annotations

from pathlib import Path

from kit.look_stages import add_material, author, bind, change_of, image_file, new_stage, record
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.scene.records import Texture

NAMES = Sdf.ValueTypeNames
RED, PACKED, ASSET = "/World/mtl/red", "/World/mtl/packed", "/World/one/mtl/paint"
ORM = f"{PACKED}/orm"


def write_shot(folder: Path) -> Usd.Stage:
    """Balls of a red material, one of a packed texture; an asset as two instances and as a plain reference."""
    asset = Usd.Stage.CreateNew(str(folder / "asset.usda"))
    asset.SetDefaultPrim(UsdGeom.Xform.Define(asset, "/Asset").GetPrim())
    UsdGeom.SetStageMetersPerUnit(asset, 1)
    UsdGeom.SetStageUpAxis(asset, "Z")
    UsdGeom.Scope.Define(asset, "/Asset/mtl")
    paint = add_material(asset, "/Asset/mtl/paint", diffuseColor=Gf.Vec3f(0.2, 0.3, 0.6), roughness=0.5)
    bind(_ball(asset, "/Asset/body").GetPrim(), paint)
    asset.GetRootLayer().Save()

    stage = new_stage(folder / "shot.usda")
    red = add_material(stage, RED, diffuseColor=Gf.Vec3f(0.6, 0.2, 0.1), roughness=0.4)
    for name in ("ball", "other"):
        bind(_ball(stage, f"/World/{name}").GetPrim(), red)
    bind(_ball(stage, "/World/crate").GetPrim(), _packed(stage))
    for name in ("one", "two", "three"):
        prim = UsdGeom.Xform.Define(stage, f"/World/{name}").GetPrim()
        prim.GetReferences().AddReference("./asset.usda")
        prim.SetInstanceable(name != "three")
    stage.GetRootLayer().Save()
    return stage


def write_look(folder: Path) -> Usd.Stage:
    """Writes shot and look: colour and roughness of red, the textured roughness, the colour of one instance."""
    stage = write_shot(folder)
    packed = record(
        PACKED, roughness=Texture(ORM, image_file(), channels="g"), metallic=Texture(ORM, image_file(), channels="b")
    )
    red = change_of(stage, "/World/ball", "diffuse+glossiness", (0.1, 0.4, 0.3), roughness=0.2, strokes=_strokes(1, 2))
    rough = change_of(
        stage, "/World/crate", "glossiness", roughness=0.25, material=packed, strokes=_strokes(3),
        means={"roughness": 0.5, "metallic": 0.5},
    )  # fmt: skip
    one = change_of(stage, "/World/one/body", "diffuse", (0.7, 0.6, 0.1), strokes=_strokes(4))
    author(stage, folder, red, rough, one)
    return stage


def _strokes(*numbers: int) -> tuple[str, ...]:
    return tuple(f"/SlfStrokes/stroke_{n:04d}" for n in numbers)


def _ball(stage: Usd.Stage, path: str) -> UsdGeom.Sphere:
    ball = UsdGeom.Sphere.Define(stage, path)
    ball.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(-1, -1, -1), Gf.Vec3f(1, 1, 1)]))
    return ball


def _packed(stage: Usd.Stage) -> UsdShade.Material:
    """Roughness and metallic from two channels of one texture."""
    material = add_material(stage, PACKED, diffuseColor=Gf.Vec3f(0.5, 0.5, 0.5))
    texture = UsdShade.Shader.Define(stage, ORM)
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", NAMES.Asset).Set(image_file())
    shader = UsdShade.Shader(stage.GetPrimAtPath(f"{PACKED}/pbr"))
    for name, channel in (("roughness", "g"), ("metallic", "b")):
        output = texture.CreateOutput(channel, NAMES.Float)
        shader.CreateInput(name, NAMES.Float).ConnectToSource(output)
    return material


def composed(folder: Path, look: str = "look.usda") -> dict[str, str]:
    """What USD composes of the shot with a look, by property: values and targets, of instances' prototypes too."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [str(folder / look), str(folder / "shot.usda")] if look else [str(folder / "shot.usda")]
    stage = Usd.Stage.Open(root)
    found = {}
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)):
        if not prim.IsActive():
            continue
        for each in prim.GetAuthoredProperties():
            is_value = isinstance(each, Usd.Attribute)
            found[str(each.GetPath())] = f"{each.Get() if is_value else ''} " + " ".join(
                map(str, each.GetConnections() if is_value else each.GetTargets())
            )
    return found
