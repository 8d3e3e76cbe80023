"""Will it survive: each rule on a stage that triggers it, and on one that does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from kit.look_stages import add_material, add_quads, author, bind, change_of, image_file, new_shot, new_stage, record
from kit.reviewed_looks import write_shot
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from usdslf.scene.records import Texture
from usdslf.textures.images import write_image
from usdslf.usd.layer.shown_paths import is_there
from usdslf.usd.review.review import review_look
from usdslf.usd.review.survival import SOURCES

NAMES = Sdf.ValueTypeNames
GREEN = (0.1, 0.4, 0.2)


def rules(folder: Path) -> dict[str, str]:
    """By rule the prim that it names, on the shot with its look."""
    return {r.rule: r.prim for r in review_look(folder / "shot.usda", folder / "look.usda", None).risks}


def edit(stage: Usd.Stage, folder: Path, prim: str = "/World/row", **more: object) -> None:
    author(stage, folder, change_of(stage, prim, "diffuse", GREEN, **more))


def row_of(folder: Path, change: Callable[[Usd.Stage], None]) -> Usd.Stage:
    """A shot whose grey row is changed before it is saved."""
    stage = new_shot(folder)
    change(stage)
    stage.GetRootLayer().Save()
    return stage


# ---- stages that trigger each rule ------------------------------------------------------------------
def instance_root(folder: Path) -> str:
    stage = write_shot(folder)
    author(stage, folder, change_of(stage, "/World/one/body", "diffuse", GREEN), mode="new")
    return "/World/one"


def nested_instance(folder: Path, binds: bool = True) -> str:
    write_shot(folder)
    outer = Usd.Stage.CreateNew(str(folder / "outer.usda"))
    outer.SetDefaultPrim(UsdGeom.Xform.Define(outer, "/Outer").GetPrim())
    inner = UsdGeom.Xform.Define(outer, "/Outer/inner").GetPrim()
    inner.GetReferences().AddReference("./asset.usda")
    inner.SetInstanceable(True)
    outer.GetRootLayer().Save()
    stage = Usd.Stage.Open(str(folder / "shot.usda"))
    prim = UsdGeom.Xform.Define(stage, "/World/outer").GetPrim()
    prim.GetReferences().AddReference("./outer.usda")
    prim.SetInstanceable(True)
    stage.GetRootLayer().Save()
    edit(stage, folder, "/World/outer/inner/body")
    if not binds:
        return "/World/outer/inner"
    look = Sdf.Layer.FindOrOpen(str(folder / "look.usda"))  # a person binds the instance within the instance
    home = next(r.path for r in look.rootPrims if r.name.startswith("_slf_World_outer"))
    at = Sdf.CreatePrimInLayer(look, home if home.name.endswith("inner") else home.AppendChild("inner"))
    if is_there(stage, at.path) or home.name.endswith("inner"):
        at = Sdf.CreatePrimInLayer(look, "/_slf_World_outer/inner")
    at.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialBindingAPI"]))
    Sdf.RelationshipSpec(at, "material:binding", custom=False).targetPathList.explicitItems = ["/World/mtl/red"]
    look.Save()
    return "/World/outer/inner"


def collection(folder: Path, instanceable: bool = True) -> str:
    asset = Usd.Stage.CreateNew(str(folder / "asset.usda"))
    asset.SetDefaultPrim(UsdGeom.Xform.Define(asset, "/Asset").GetPrim())
    UsdGeom.Scope.Define(asset, "/Asset/mtl")
    paint = add_material(asset, "/Asset/mtl/paint", diffuseColor=Gf.Vec3f(0.2, 0.3, 0.6))
    UsdGeom.Sphere.Define(asset, "/Asset/body")
    root = asset.GetPrimAtPath("/Asset")
    several = Usd.CollectionAPI.Apply(root, "painted")
    several.IncludePath("/Asset/body")
    UsdShade.MaterialBindingAPI.Apply(root).Bind(several, paint, "painted")
    asset.GetRootLayer().Save()
    stage = new_stage(folder / "shot.usda")
    prim = UsdGeom.Xform.Define(stage, "/World/one").GetPrim()
    prim.GetReferences().AddReference("./asset.usda")
    prim.SetInstanceable(instanceable)
    stage.GetRootLayer().Save()
    edit(stage, folder, "/World/one/body")
    return "/World/one/body"


def wrap_mode(folder: Path, mode: str = "mirror") -> str:
    def textured(stage: Usd.Stage) -> None:
        texture = UsdShade.Shader.Define(stage, "/World/mtl/grey/map")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", NAMES.Asset).Set(image_file())
        for name in ("wrapS", "wrapT"):
            texture.CreateInput(name, NAMES.Token).Set(mode)
        port = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/grey/pbr")).CreateInput("diffuseColor", NAMES.Color3f)
        port.ConnectToSource(texture.CreateOutput("rgb", NAMES.Float3))

    stage = row_of(folder, textured)
    material = record("/World/mtl/grey", diffuseColor=Texture("/World/mtl/grey/map", image_file()))
    author(
        stage, folder,
        change_of(stage, "/World/row", "diffuse", GREEN, material=material, means={"diffuseColor": (0.5, 0.5, 0.5)}),
    )  # fmt: skip
    return "/World/mtl/grey/map"


def no_api(folder: Path) -> str:
    def without(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath("/World/row").RemoveAPI(UsdShade.MaterialBindingAPI)

    edit(row_of(folder, without), folder)
    return "/World/row"


def other_context(folder: Path, connected: bool = True) -> str:
    def with_mtlx(stage: Usd.Stage) -> None:
        shader = UsdShade.Shader.Define(stage, "/World/mtl/grey/standard")
        output = shader.CreateOutput("out", NAMES.Token)
        surface = UsdShade.Material(stage.GetPrimAtPath("/World/mtl/grey")).CreateSurfaceOutput("mtlx")
        if connected:
            surface.ConnectToSource(output)

    edit(row_of(folder, with_mtlx), folder)
    return "/World/mtl/grey"


def full_purpose(folder: Path, alone: bool = True) -> str:
    def for_full(stage: Usd.Stage) -> None:
        api = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/World/row"))
        if alone:
            api.UnbindAllBindings()
        api.Bind(UsdShade.Material(stage.GetPrimAtPath("/World/mtl/grey")), materialPurpose=UsdShade.Tokens.full)

    edit(row_of(folder, for_full), folder)
    return "/World/row"


def drifted(folder: Path, name: str = "diffuseColor") -> str:
    stage = new_shot(folder)
    edit(stage, folder)
    value = Gf.Vec3f(0.3, 0.3, 0.3) if name == "diffuseColor" else 0.3
    stage.GetAttributeAtPath(f"/World/mtl/grey/pbr.inputs:{name}").Set(value)
    stage.GetRootLayer().Save()
    return "/World/mtl/grey/pbr"


TRIGGERS: dict[str, Callable[[Path], str]] = {
    "InstanceRootBinding": instance_root,
    "NestedInstanceBinding": nested_instance,
    "CollectionInInstance": collection,
    "WrapMode": wrap_mode,
    "NoBindingAPI": no_api,
    "OtherContext": other_context,
    "FullPurpose": full_purpose,
    "DriftedBase": drifted,
}


@pytest.mark.parametrize("rule", list(TRIGGERS))
def test_each_rule_on_a_stage_that_triggers_it(tmp_path: Path, rule: str) -> None:
    at = TRIGGERS[rule](tmp_path)
    assert rules(tmp_path).get(rule) == at


def test_no_rule_on_a_stage_without_any_of_that(tmp_path: Path) -> None:
    edit(new_shot(tmp_path), tmp_path)
    assert rules(tmp_path) == {}
    assert set(SOURCES) == set(TRIGGERS) and all("." in s and "/" in s for s in SOURCES.values())


NEARLY: dict[str, Callable[[Path], object]] = {
    "InstanceRootBinding": lambda folder: edit(write_shot(folder), folder, "/World/one/body"),  # by its class
    "NestedInstanceBinding": lambda folder: nested_instance(folder, binds=False),
    "CollectionInInstance": lambda folder: collection(folder, instanceable=False),
    "WrapMode": lambda folder: wrap_mode(folder, "repeat"),
    "WrapMode, clamp": lambda folder: wrap_mode(folder, "clamp"),
    "NoBindingAPI": lambda folder: edit(new_shot(folder), folder),
    "OtherContext": lambda folder: other_context(folder, connected=False),
    "FullPurpose": lambda folder: full_purpose(folder, alone=False),
    "DriftedBase": lambda folder: drifted(folder, "roughness"),  # which the look does not say
}


@pytest.mark.parametrize("rule", list(NEARLY))
def test_near_misses(tmp_path: Path, rule: str) -> None:
    """Each as like the stage that triggers the rule as can be, and all of it survives."""
    NEARLY[rule](tmp_path)
    assert rules(tmp_path) == {}
    assert {r.split(",")[0] for r in NEARLY} == set(TRIGGERS)


def test_a_scale_over_a_texture_that_was_painted_anew(tmp_path: Path) -> None:
    file = write_image(tmp_path / "map.png", [[[0.5, 0.5, 0.5]] * 2] * 2)
    stage = new_stage(tmp_path / "shot.usda")
    grey = add_material(stage, "/World/mtl/grey")
    texture = UsdShade.Shader.Define(stage, "/World/mtl/grey/map")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", NAMES.Asset).Set("./map.png")
    port = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/grey/pbr")).CreateInput("diffuseColor", NAMES.Color3f)
    port.ConnectToSource(texture.CreateOutput("rgb", NAMES.Float3))
    bind(add_quads(stage, "/World/row").GetPrim(), grey)
    stage.GetRootLayer().Save()
    material = record("/World/mtl/grey", diffuseColor=Texture("/World/mtl/grey/map", str(file)))
    means = {"diffuseColor": (0.5, 0.5, 0.5)}
    change = change_of(stage, "/World/row", "diffuse", GREEN, material=material, means=means)
    author(stage, tmp_path, change)
    assert "DriftedBase" not in rules(tmp_path)
    write_image(file, [[[0.9, 0.1, 0.5]] * 2] * 2)
    assert rules(tmp_path).get("DriftedBase") == "/World/mtl/grey/map"
