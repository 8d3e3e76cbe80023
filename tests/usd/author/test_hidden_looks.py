"""What hides an edit and what mends it: stronger layers, variants, bindings, other surfaces of final renders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from kit.look_stages import (
    F,
    author,
    compose,
    new_stage,
)
from kit.red_balls import ball, green, put, red
from pxr import Gf, Sdf, Usd, UsdShade

from usdslf.usd.layer.wins import why_hidden
from usdslf.usd.review.validate import validate as find_wrong

# ---- what hides an edit, and what mends it --------------------------------------------------------------------
ATTRIBUTE = "/World/mtl/red/pbr.inputs:diffuseColor"


def stronger_layer(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    put(top, "/World/mtl/red/pbr")
    top.GetAttributeAtPath(ATTRIBUTE).default = Gf.Vec3f(1, 1, 1)


def stronger_samples(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    stronger_layer(stage, top, look)
    top.SetTimeSample(ATTRIBUTE, 1.0, Gf.Vec3f(1, 1, 1))


def stronger_samples_that_start_alike(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    stronger_layer(stage, top, look)
    top.GetAttributeAtPath(ATTRIBUTE).default = look.GetAttributeAtPath(ATTRIBUTE).default
    for time, value in ((1.0, look.GetAttributeAtPath(ATTRIBUTE).default), (9.0, Gf.Vec3f(1, 1, 1))):
        top.SetTimeSample(ATTRIBUTE, time, value)


def own_samples(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    look.SetTimeSample(ATTRIBUTE, 1.0, Gf.Vec3f(1, 1, 1))


def stronger_connection(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(top, "/World/mtl/red/pbr"), "inputs:diffuseColor", F.Color3f)
    spec.connectionPathList.explicitItems = ["/World/mtl/red/tex.outputs:rgb"]


def inactive(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    Sdf.CreatePrimInLayer(top, "/World/mtl/red").active = False


def in_the_session(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    stronger_layer(stage, stage.GetSessionLayer(), look)


HIDING = {
    stronger_layer: (f"top.usda at {ATTRIBUTE}", "put look.usda above top.usda"),
    stronger_samples: ("time samples in top.usda", "above top.usda"),
    stronger_samples_that_start_alike: ("time samples in top.usda", "above top.usda"),
    own_samples: ("time samples in look.usda itself", f"remove the time samples of {ATTRIBUTE}"),
    stronger_connection: ("a connection to /World/mtl/red/tex.outputs:rgb", "edit /World/mtl/red/tex"),
    inactive: ("/World/mtl/red, which is inactive", "activate /World/mtl/red"),
    in_the_session: ("session", "from the session layer"),
}


@pytest.mark.parametrize("how", HIDING, ids=lambda f: f.__name__)
def test_what_hides_an_edit_is_named_with_what_mends_it(tmp_path: Path, how: Any) -> None:
    shot = new_stage(tmp_path / "shot.usda")
    ball(shot, "/World/ball", red(shot, "/World/mtl/red"))
    shot.GetRootLayer().Save()
    author(shot, tmp_path, green(shot, "/World/ball"))
    look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    root = Sdf.Layer.CreateNew(str(tmp_path / "root.usda"))
    top = Sdf.Layer.CreateNew(str(tmp_path / "top.usda"))
    root.subLayerPaths = ["./top.usda", "./look.usda", "./shot.usda"]
    stage = Usd.Stage.Open(root)
    assert why_hidden(stage, look, Sdf.Path(ATTRIBUTE), Sdf.Path(ATTRIBUTE)) == ("", "")
    how(stage, top, look)
    what, mend = why_hidden(stage, look, Sdf.Path(ATTRIBUTE), Sdf.Path(ATTRIBUTE))
    assert HIDING[how][0] in what and HIDING[how][1] in mend
    assert next(f.name for f in find_wrong(stage, None) if f.name != "StaleLook") in ("HiddenEdit", "DanglingOver")


def test_another_variant_hides_what_only_one_has(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    group = stage.GetPrimAtPath("/World").GetVariantSets().AddVariantSet("kind")
    for name in ("full", "empty"):
        group.AddVariant(name)
    group.SetVariantSelection("full")
    with group.GetVariantEditContext():
        ball(stage, "/World/ball", red(stage, "/World/own/red"))
    stage.GetRootLayer().Save()
    author(stage, tmp_path, green(stage, "/World/ball"))
    review = compose(tmp_path)
    path = Sdf.Path("/World/own/red/pbr.inputs:diffuseColor")
    look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    review.SetEditTarget(review.GetSessionLayer())
    review.GetPrimAtPath("/World").GetVariantSet("kind").SetVariantSelection("empty")
    what, mend = why_hidden(review, look, path, path)
    assert "with the variant kind=empty of /World" in what and "choose the variant that has /World/own" in mend


def test_a_stronger_binding_is_mended_where_it_is(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    shared = red(stage, "/World/mtl/red")
    for name in "ab":
        ball(stage, f"/World/{name}", shared)
    api = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/World"))
    api.Bind(shared, UsdShade.Tokens.strongerThanDescendants)
    stage.GetRootLayer().Save()
    (edit,) = author(stage, tmp_path, green(stage, "/World/a", scope="prim"))
    assert not edit.wins and edit.mend.startswith("make /World.material:binding weakerThanDescendants")


# ---- final renders ---------------------------------------------------------------------------------------------
def test_final_renders_that_do_not_see_it_are_named(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    both = red(stage, "/World/mtl/both")
    node = UsdShade.Shader.Define(stage, "/World/mtl/both/ri")
    node.CreateIdAttr("PxrSurface")
    both.CreateSurfaceOutput("ri").ConnectToSource(node.CreateOutput("surface", F.Token))
    ball(stage, "/World/a", both)
    shown_only = ball(stage, "/World/b", red(stage, "/World/mtl/preview"))
    final = UsdShade.Material.Define(stage, "/World/mtl/final")
    final.CreateSurfaceOutput("mtlx").ConnectToSource(node.CreateOutput("surface", F.Token))
    UsdShade.MaterialBindingAPI(shown_only).Bind(final, materialPurpose=UsdShade.Tokens.full)
    ball(stage, "/World/c", red(stage, "/World/mtl/plain"))
    stage.GetRootLayer().Save()
    said: list[str] = []
    author(stage, tmp_path, *(green(stage, f"/World/{n}") for n in "abc"), warnings=said)
    assert said == [
        "final renders of /World/a by ri use another surface of /World/mtl/both and do not see the edit",
        "final renders of /World/b by mtlx show /World/mtl/final, bound for purpose full, and do not see the edit",
    ]
