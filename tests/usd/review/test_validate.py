"""What is wrong with looks and strokes is found, each kind by what causes it, and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.look_stages import F, add_material, add_two_instances, author, bind, change_of, compose, new_shot, new_stage
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdValidation

from usdslf.strokes.stroke import Stroke
from usdslf.usd.author.author import author_look
from usdslf.usd.review import validators
from usdslf.usd.review.validate import lines_of_findings, validate
from usdslf.usd.stroke_layer import write_strokes

GREEN = (0.1, 0.4, 0.2)
RED = "/World/mtl/red/pbr"
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def shot(tmp_path: Path) -> Usd.Stage:
    return new_shot(tmp_path)


def on_row(**more: Any) -> Stroke:
    """A dab in the middle of the second square of /World/row."""
    values = dict(
        surfaces=("/World/row",), surface_index=np.zeros(2, np.int32), face=np.full(2, 1, np.int32),
        barycentric=np.full((2, 2), (1.25, 0.25), np.float32),
    )  # fmt: skip
    points = np.tile(np.float32([1.5, 0.5, 0]), (2, 1))
    eye = points + np.float32([0, 0, 5])
    return Stroke("stroke_0001", points, np.full(2, 0.1, np.float32), points, eye, **(values | more))


def look_of(folder: Path) -> Sdf.Layer:
    return Sdf.Layer.FindOrOpen(str(folder / "look.usda"))


def put(layer: Sdf.Layer, path: str, name: str, kind: Sdf.ValueTypeName, value: Any) -> Sdf.AttributeSpec:
    spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, path), name, kind)
    spec.default = value
    return spec


def names(stage: Usd.Stage) -> list[str]:
    return [f.name for f in validate(stage, None)]


def all_kinds(stage: Usd.Stage) -> list:
    return [
        change_of(stage, "/World/ball", "diffuse", GREEN, scope="prim"),
        change_of(
            stage, "/World/row", "glossiness", roughness=0.2, scope="stroke", faces={"/World/row": (1,)}
        ),
        change_of(stage, "/World/other", "specular", f0=(0.2,) * 3),
    ]


# ---- nothing is found where nothing is wrong -----------------------------------------------------------
def test_a_shot_and_a_fresh_look_have_no_findings(shot: Usd.Stage, tmp_path: Path) -> None:
    assert validate(shot, None) == []
    write_strokes(tmp_path / "strokes.usda", [on_row()], shot)
    author(shot, tmp_path, *all_kinds(shot), strokes_path=tmp_path / "strokes.usda")
    review = compose(tmp_path, strokes="strokes.usda")
    assert validate(review, None) == []
    assert validate(Usd.Stage.Open(str(tmp_path / "look.usda")), None) == []  # over the shot that it names
    assert lines_of_findings([]) == ["findings: 0"]


def test_looks_inside_instances_have_no_findings(tmp_path: Path) -> None:
    stage = instanced(tmp_path)
    change = change_of(stage, "/World/a/ball", "diffuse", GREEN)
    author(stage, tmp_path, change)
    assert validate(compose(tmp_path), None) == []


def test_looks_of_real_stages_have_no_findings(assets: Path, tmp_path: Path) -> None:
    path = assets / "cornell_box/cornell-box.usda"
    stage = Usd.Stage.Open(str(path))
    author_look(stage, [change_of(stage, "/cornell_box/left_wall/left_wall", "glossiness", roughness=0.2)],
                tmp_path / "look.usda")  # fmt: skip
    found = validate(Usd.Stage.Open(str(tmp_path / "look.usda")), None)
    # The assets may be in another place on this machine, which only a path from the root can say.
    assert {f.name for f in found} <= {"AbsolutePath"}


# ---- looks ------------------------------------------------------------------------------------------------
def rename_prim(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    shot.GetPrimAtPath(RED).name = "shader"


def remove_target(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    prim = Sdf.CreatePrimInLayer(look, RED)
    spec = Sdf.AttributeSpec(prim, "inputs:clearcoat", F.Float)
    spec.connectionPathList.explicitItems = ["/World/mtl/red/gone.outputs:r"]


def rename_input(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, RED, "inputs:shininess", F.Float, 0.5)


def rename_interface(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, "/World/mtl/red", "inputs:tint", F.Color3f, Gf.Vec3f(0.5, 0.5, 0.5))


def stray_value(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, RED, "inputs:metallic", F.Float, 1.5)


def low_ior(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, RED, "inputs:ior", F.Float, 0.3)


def nan_value(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, "/World/ball", "primvars:slf:x", F.Float, float("nan"))


def strange_space(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, RED, "inputs:emissiveColor", F.Color3f, Gf.Vec3f(0)).colorSpace = "my_studio_space"


def absolute_file(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, "/World/ball", "userProperties:file", F.Asset, Sdf.AssetPath(str(shot.realPath)))


def lost_file(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    put(look, "/World/ball", "userProperties:file", F.Asset, Sdf.AssetPath("./look.textures/gone.exr"))


def changed_shot(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    shot.comment = "another take"


def weak_binding(shot: Sdf.Layer, look: Sdf.Layer) -> None:
    world = shot.GetPrimAtPath("/World")
    world.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialBindingAPI"]))
    above = Sdf.RelationshipSpec(world, "material:binding")
    above.targetPathList.explicitItems = ["/World/mtl/grey"]
    above.SetInfo("bindMaterialAs", "strongerThanDescendants")
    mine = Sdf.RelationshipSpec(Sdf.CreatePrimInLayer(look, "/World/ball"), "material:binding")
    mine.targetPathList.explicitItems = ["/World/mtl/red"]


CASES = {
    rename_prim: ("DanglingOver", RED),
    remove_target: ("MissingTarget", f"{RED}.inputs:clearcoat"),
    rename_input: ("DanglingInput", f"{RED}.inputs:shininess"),
    rename_interface: ("DanglingInput", "/World/mtl/red.inputs:tint"),
    stray_value: ("OutOfRange", f"{RED}.inputs:metallic"),
    low_ior: ("OutOfRange", f"{RED}.inputs:ior"),
    nan_value: ("OutOfRange", "/World/ball.primvars:slf:x"),
    strange_space: ("UnknownColorSpace", f"{RED}.inputs:emissiveColor"),
    absolute_file: ("AbsolutePath", "/World"),
    lost_file: ("MissingFile", "/World/ball.userProperties:file"),
    changed_shot: ("StaleLook", "/"),
    weak_binding: ("HiddenEdit", "/World/ball"),
}


@pytest.mark.parametrize("spoil", CASES, ids=lambda f: f.__name__)
def test_what_is_wrong_with_a_look_is_found(shot: Usd.Stage, tmp_path: Path, spoil: Any) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN))
    look = look_of(tmp_path)
    spoil(shot.GetRootLayer(), look)
    look.Save()
    shot.GetRootLayer().Save()
    found = [f for f in validate(compose(tmp_path), None) if spoil is changed_shot or f.name != "StaleLook"]
    name, prim = CASES[spoil]
    assert [(f.name, f.prim) for f in found] == [(name, prim)]
    assert "look.usda" in found[0].message


def test_a_stronger_value_is_found(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN))
    review = compose(tmp_path)
    review.SetEditTarget(review.GetSessionLayer())
    UsdShade.Shader(review.GetPrimAtPath(RED)).GetInput("diffuseColor").Set(Gf.Vec3f(1, 1, 1))
    (found,) = validate(review, None)
    assert found.name == "HiddenEdit" and "session" in found.message


def instanced(folder: Path) -> Usd.Stage:
    asset = new_stage(folder / "asset.usda")
    bind(UsdGeom.Sphere.Define(asset, "/World/ball").GetPrim(),
         add_material(asset, "/World/mtl/red", diffuseColor=Gf.Vec3f(0.6, 0.2, 0.1)))  # fmt: skip
    asset.GetRootLayer().Save()
    stage = new_stage(folder / "shot.usda")
    add_two_instances(stage)
    return stage


def test_an_over_below_an_instance_is_found(tmp_path: Path) -> None:
    stage = instanced(tmp_path)
    author(stage, tmp_path, change_of(stage, "/World/a/ball", "diffuse", GREEN))
    look = look_of(tmp_path)
    put(look, "/World/b/mtl/red/pbr", "inputs:roughness", F.Float, 0.1)
    look.Save()
    (found,) = validate(compose(tmp_path), None)
    assert (found.name, found.prim) == ("EditUnderInstance", "/World/b/mtl")


# ---- strokes ------------------------------------------------------------------------------------------------
def test_a_stroke_whose_surface_moved_or_went_is_found(shot: Usd.Stage, tmp_path: Path) -> None:
    write_strokes(tmp_path / "strokes.usda", [on_row()], shot)
    author(shot, tmp_path, strokes_path=tmp_path / "strokes.usda")
    row = UsdGeom.Mesh(shot.GetPrimAtPath("/World/row"))
    row.AddTranslateOp().Set((0, 0, 1))
    shot.GetRootLayer().Save()
    assert names(compose(tmp_path, strokes="strokes.usda")) == ["StaleLook", "MovedStroke"]
    shot.RemovePrim("/World/row")
    shot.GetRootLayer().Save()
    assert names(compose(tmp_path, strokes="strokes.usda")) == ["StaleLook", "MissingTarget"]


def test_changed_strokes_and_bad_ones_are_found(shot: Usd.Stage, tmp_path: Path) -> None:
    write_strokes(tmp_path / "strokes.usda", [on_row()], shot)
    author(shot, tmp_path, strokes_path=tmp_path / "strokes.usda")
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "strokes.usda"))
    layer.GetAttributeAtPath("/SlfStrokes/stroke_0001.slf:tool").default = "hammer"
    layer.Save()
    found = validate(compose(tmp_path, strokes="strokes.usda"), None)
    assert [f.name for f in found] == ["StaleLook", "BadStroke"]
    assert "hammer" in found[1].message and "strokes" in found[0].message


# ---- the framework, and the command line -----------------------------------------------------------------
def test_the_framework_reports_the_findings(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN))
    look = look_of(tmp_path)
    stray_value(shot.GetRootLayer(), look)
    look.Save()
    validators.register_validators()
    ours = UsdValidation.ValidationRegistry().GetOrLoadValidatorByName(validators.NAME)
    (error,) = UsdValidation.ValidationContext([ours]).Validate(compose(tmp_path))
    assert error.GetName() == "OutOfRange" and "1.5" in error.GetMessage()
    assert error.GetType() == UsdValidation.ValidationErrorType.Error


def test_a_validator_that_fails_says_so(shot: Usd.Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(stage: Usd.Stage, ocio: str | None) -> list:
        raise ValueError("out of order")

    monkeypatch.setattr(validators, "validate", broken)
    (error,) = validators.find(shot)
    assert error.GetName() == "ValidatorFailed" and "out of order" in error.GetMessage()


OTHER_PROGRAM = """
from pxr import Usd, UsdValidation
found = UsdValidation.ValidationRegistry().GetOrLoadValidatorByName("usdslf.usd.review.validators:LooksAndStrokes")
stage = Usd.Stage.Open("look.usda")
print(*(e.GetName() for e in UsdValidation.ValidationContext([found]).Validate(stage)))
"""


def test_another_program_finds_the_validator_on_the_plugin_path(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN))
    look = look_of(tmp_path)
    low_ior(shot.GetRootLayer(), look)
    look.Save()
    environment = dict(os.environ) | {
        "PXR_PLUGINPATH_NAME": os.pathsep.join([str(ROOT / "schemas"), str(ROOT / "schemas/validators")]),
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run([sys.executable, "-P", "-c", OTHER_PROGRAM], cwd=tmp_path, env=environment,
                          capture_output=True, text=True)  # fmt: skip
    assert (done.returncode, done.stdout.split(), done.stderr) == (0, ["OutOfRange"], "")


def test_info_prints_findings_and_ends_well(shot: Usd.Stage, tmp_path: Path, run: Any) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN))
    look = look_of(tmp_path)
    low_ior(shot.GetRootLayer(), look)
    look.Save()
    compose(tmp_path)
    code, out, err = run("info", tmp_path / "review.usda", "--quiet")
    assert code == 0, err
    assert "findings: 1" in out and "OutOfRange" in out and f"{RED}.inputs:ior" in out
    code, out, _ = run("info", tmp_path / "review.usda", "--quiet", "--json")
    (finding,) = json.loads(out)["findings"]
    assert (code, finding["name"], finding["layer"]) == (0, "OutOfRange", "look.usda")
