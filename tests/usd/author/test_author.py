"""The look layer: sparse, clean, always winning, in the right place, on made-up and on real stages."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.look_stages import (
    add_material,
    add_quads,
    as_reflectance,
    author,
    bind,
    change_of,
    compose,
    new_instances,
    new_shot,
    read_inputs,
    shown,
    validate,
)
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from usdslf.color import USD_DEFAULT_SPACE, Color
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.errors import AuthorError
from usdslf.strokes.stroke import Stroke
from usdslf.usd.author.author import author_look, author_review_root, why_not_editable
from usdslf.usd.binding import bound_relationship, users_of
from usdslf.usd.notes import Notes
from usdslf.usd.read.materials import MaterialTable
from usdslf.usd.stroke_layer import write_strokes


@pytest.fixture
def shot(tmp_path: Path) -> Usd.Stage:
    return new_shot(tmp_path)


@pytest.fixture
def instances(tmp_path: Path) -> Usd.Stage:
    return new_instances(tmp_path)


# ---- the material in place -----------------------------------------------------------------------
@pytest.mark.parametrize(
    ("freed", "d", "f0", "roughness"),
    [
        ("diffuse", (0.1, 0.4, 0.2), None, None),
        ("specular", None, (0.2,) * 3, None),
        ("specular", None, (0.3, 0.1, 0.1), None),
        ("glossiness", None, None, 0.15),
        ("diffuse+specular+glossiness", (0.0,) * 3, (0.9, 0.7, 0.3), 0.3),
    ],
)
def test_what_shows_is_what_was_solved(
    shot: Usd.Stage, tmp_path: Path, freed: str, d: Any, f0: Any, roughness: float | None
) -> None:
    change = change_of(shot, "/World/ball", freed, d, f0, roughness)
    edits = author(shot, tmp_path, change)
    assert edits and all(e.wins and not e.hidden_by for e in edits)
    review = compose(tmp_path)
    for prim in ("/World/ball", "/World/other"):
        got = shown(review, prim)
        assert_allclose(got["d"], change.after.diffuse, rtol=0.01, atol=1e-5)
        assert_allclose(got["f0"], change.after.f0, rtol=0.01, atol=1e-5)
        assert_allclose(got["roughness"], change.after.roughness, rtol=0.01)
    assert shown(review, "/World/row") == shown(shot, "/World/row")
    for edit in edits:
        value = review.GetAttributeAtPath(f"{edit.prim}.{edit.attribute}").Get()
        assert_allclose(np.ravel(value), np.ravel(edit.after), rtol=1e-6)


def test_the_layer_is_sparse(shot: Usd.Stage, tmp_path: Path) -> None:
    change = change_of(shot, "/World/ball", "diffuse+glossiness", (0.1, 0.4, 0.2), roughness=0.2)
    author(shot, tmp_path, change)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    paths: list[Sdf.Path] = []
    layer.Traverse("/", paths.append)
    assert sorted(str(p) for p in paths if p.IsPropertyPath()) == [
        "/World/mtl/red/pbr.inputs:diffuseColor",
        "/World/mtl/red/pbr.inputs:roughness",
    ]
    specs = [layer.GetPrimAtPath(p) for p in paths if p.IsPrimPath()]
    assert all(s.specifier == Sdf.SpecifierOver and not s.typeName for s in specs)
    # Every opinion matters: without it the picture is another one.
    full = read_inputs(compose(tmp_path), "/World/ball")
    for path in [p for p in paths if p.IsPropertyPath()]:
        less = Sdf.Layer.CreateAnonymous(".usda")
        less.TransferContent(layer)
        prim = less.GetPrimAtPath(path.GetPrimPath())
        prim.RemoveProperty(prim.attributes[path.name])
        root = Sdf.Layer.CreateAnonymous(".usda")
        root.subLayerPaths = [less.identifier, shot.GetRootLayer().identifier]
        assert read_inputs(Usd.Stage.Open(root), "/World/ball") != full


def test_nothing_is_written_for_a_change_that_is_none(shot: Usd.Stage, tmp_path: Path) -> None:
    assert author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse+specular+glossiness")) == []
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    assert list(layer.rootPrims.keys()) == ["World"] and not layer.rootPrims["World"].nameChildren


def test_same_edit_twice_gives_the_same_bytes(shot: Usd.Stage, tmp_path: Path) -> None:
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    author(shot, tmp_path, change, provenance={"version": "0.1.0", "solve": {"norm": "mixed"}})
    first = (tmp_path / "look.usda").read_bytes()
    author(shot, tmp_path, change, provenance={"solve": {"norm": "mixed"}, "version": "0.1.0"})
    assert (tmp_path / "look.usda").read_bytes() == first


def test_an_interrupted_write_leaves_the_earlier_file(
    shot: Usd.Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2)))
    first = (tmp_path / "look.usda").read_bytes()

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        author(shot, tmp_path, change_of(shot, "/World/ball", "glossiness", roughness=0.1))
    assert (tmp_path / "look.usda").read_bytes() == first
    assert sorted(p.name for p in tmp_path.iterdir()) == ["look.usda", "shot.usda"]


def test_provenance_says_strokes_values_and_hashes(shot: Usd.Stage, tmp_path: Path) -> None:
    stroke = Stroke("stroke_0001", np.zeros((2, 3), np.float32), np.ones(2), np.ones((2, 3)), np.ones((2, 3)))
    write_strokes(tmp_path / "strokes.usda", [stroke], shot)
    change = change_of(
        shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2), residual_before=0.5, residual_after=0.01
    )
    given = {"version": "0.1.0", "device": "cpu", "workingSpace": "lin_rec709_scene"}
    author(shot, tmp_path, change, provenance=given, strokes_path=tmp_path / "strokes.usda")
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    data = layer.customLayerData["usdslf"]
    assert (data["shot"], data["strokes"], data["device"]) == ("./shot.usda", "./strokes.usda", "cpu")
    assert data["shotHash"] == hashlib.sha256((tmp_path / "shot.usda").read_bytes()).hexdigest()
    assert data["strokesHash"] == hashlib.sha256((tmp_path / "strokes.usda").read_bytes()).hexdigest()
    review = compose(tmp_path)
    on_material = review.GetPrimAtPath("/World/mtl/red").GetCustomDataByKey("usdslf")
    assert list(on_material["strokes"]) == ["/SlfStrokes/stroke_0001"]
    assert on_material["inferred"] == "diffuse"
    assert_allclose(on_material["before"]["diffuse"], (0.6, 0.2, 0.1), rtol=1e-6)
    assert_allclose(on_material["after"]["diffuse"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert_allclose(on_material["after"]["specular"], (0.04,) * 3, rtol=1e-6)
    assert (on_material["residualBefore"], on_material["residualAfter"]) == (0.5, 0.01)


def test_what_lies_outside_the_folder_is_found_by_relative_paths(shot: Usd.Stage, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    author_look(shot, [change], tmp_path / "out/look.usda")
    author_review_root(tmp_path / "out/review.usda", tmp_path / "out/look.usda", None, tmp_path / "shot.usda")
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "out/review.usda"))
    assert list(layer.subLayerPaths) == ["./look.usda", "../shot.usda"]
    assert_allclose(shown(Usd.Stage.Open(layer), "/World/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    tmp = tmp_path / "out"
    tmp.rename(tmp_path / "moved")
    moved = Usd.Stage.Open(str(tmp_path / "moved/review.usda"))
    assert_allclose(shown(moved, "/World/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)


# ---- does it win -----------------------------------------------------------------------------------
def test_an_edit_that_a_stronger_layer_hides_says_by_what(shot: Usd.Stage, tmp_path: Path) -> None:
    shot.SetEditTarget(shot.GetSessionLayer())
    shader = UsdShade.Shader(shot.GetPrimAtPath("/World/mtl/red/pbr"))
    shader.GetInput("diffuseColor").Set(Gf.Vec3f(1, 1, 1))
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    edits = author_look(shot, [change], tmp_path / "look.usda")
    assert not edits[0].wins and "session" in edits[0].hidden_by


def test_time_samples_below_are_overridden_and_said(shot: Usd.Stage, tmp_path: Path) -> None:
    shader = UsdShade.Shader(shot.GetPrimAtPath("/World/mtl/grey/pbr"))
    for t in (1, 24):
        shader.GetInput("roughness").GetAttr().Set(0.1 * t, t)
    shot.GetRootLayer().Save()
    warnings: list[str] = []
    change = change_of(shot, "/World/row", "glossiness", roughness=0.7)
    (edit,) = author(shot, tmp_path, change, warnings=warnings)
    assert edit.wins and len(warnings) == 1 and "animated" in warnings[0]
    review = compose(tmp_path)
    assert review.GetAttributeAtPath("/World/mtl/grey/pbr.inputs:roughness").Get(24) == pytest.approx(0.7)


def test_a_stronger_binding_above_is_found(shot: Usd.Stage, tmp_path: Path) -> None:
    red = UsdShade.Material(shot.GetPrimAtPath("/World/mtl/red"))
    api = UsdShade.MaterialBindingAPI.Apply(shot.GetPrimAtPath("/World"))
    api.Bind(red, UsdShade.Tokens.strongerThanDescendants)
    shot.GetRootLayer().Save()
    (edit,) = author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", (0.9,) * 3, scope="prim"))
    assert not edit.wins and "stronger binding" in edit.hidden_by


# ---- refusals ----------------------------------------------------------------------------------------
def test_why_not_editable_names_the_reason(shot: Usd.Stage) -> None:
    assert why_not_editable(shot.GetPrimAtPath("/World/ball")) == ""
    assert why_not_editable(shot.GetPrimAtPath("/World/mtl/red")) == ""
    bare = UsdGeom.Sphere.Define(shot, "/World/bare").GetPrim()
    assert "no material" in why_not_editable(bare)
    lost = UsdShade.MaterialBindingAPI.Apply(bare).GetDirectBindingRel()
    lost.SetTargets(["/World/mtl/lost"])
    assert "/World/mtl/lost, which is not there" in why_not_editable(bare)
    other = UsdShade.Material.Define(shot, "/World/mtl/ri")
    node = UsdShade.Shader.Define(shot, "/World/mtl/ri/node")
    node.CreateIdAttr("PxrSurface")
    other.CreateSurfaceOutput("ri").ConnectToSource(node.ConnectableAPI(), "surface")
    bind(bare, other)
    assert "(it has ri)" in why_not_editable(bare)


def test_neither_shot_nor_a_strangers_file_is_overwritten(shot: Usd.Stage, tmp_path: Path) -> None:
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    before = (tmp_path / "shot.usda").read_bytes()
    for write in (
        lambda: author_look(shot, [change], tmp_path / "shot.usda"),
        lambda: author_review_root(tmp_path / "shot.usda", "look.usda", None, tmp_path / "shot.usda"),
    ):
        with pytest.raises(AuthorError, match="shot"):
            write()
    assert (tmp_path / "shot.usda").read_bytes() == before
    stranger = tmp_path / "mine.usda"
    stranger.write_text("#usda 1.0\n")
    with pytest.raises(AuthorError, match="not a look layer"):
        author_look(shot, [change], stranger)
    with pytest.raises(AuthorError, match="cannot be written"):
        author_look(shot, [change], tmp_path / "missing/look.usda")


# ---- validators, and programs without the plugin -------------------------------------------------------
PLAIN = """
import sys
from pxr import Usd, UsdValidation
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
for path in sys.argv[1:]:
    stage = Usd.Stage.Open(path)
    assert "usdslf" not in sys.modules
    assert not Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("SlfStrokeAPI")
    assert not stage.GetCompositionErrors()
    for error in UsdValidation.ValidationContext(validators).Validate(stage):
        print(path, error.GetErrorAsString())
"""


def test_all_layers_validate_in_plain_usd_without_the_plugin(instances: Usd.Stage, tmp_path: Path) -> None:
    stage = instances
    row = add_quads(stage, "/World/row")
    bind(row.GetPrim(), add_material(stage, "/World/mtl/grey"))
    stage.GetRootLayer().Save()
    stroke = Stroke("stroke_0001", np.zeros((2, 3), np.float32), np.ones(2), np.ones((2, 3)), np.ones((2, 3)))
    write_strokes(tmp_path / "strokes.usda", [stroke], stage)
    changes = [
        change_of(stage, "/World/a/ball", "diffuse", (0.1, 0.4, 0.2), scope="prim"),
        change_of(stage, "/World/b/nested/ball", "specular", f0=(0.3, 0.1, 0.1)),
        change_of(
            stage, "/World/row", "glossiness", roughness=0.1, scope="stroke", faces={"/World/row": (1,)}
        ),
    ]
    assert all(e.wins for e in author(stage, tmp_path, *changes, strokes_path=tmp_path / "strokes.usda"))
    compose(tmp_path, strokes="strokes.usda")
    environment = {k: v for k, v in os.environ.items() if k not in ("PXR_PLUGINPATH_NAME", "PYTHONPATH")}
    files = [str(tmp_path / name) for name in ("look.usda", "strokes.usda", "review.usda")]
    done = subprocess.run(
        [sys.executable, "-P", "-c", PLAIN, *files], env=environment, capture_output=True, text=True
    )
    # What the shot itself is blamed for (new_stage leaves out extents) may show in the review root.
    said = [line for line in done.stdout.splitlines() if "review.usda" not in line]
    assert (done.returncode, said, done.stderr) == (0, [], "")
    assert len(done.stdout.splitlines()) == len(validate(stage))


# ---- real stages -----------------------------------------------------------------------------------------
REAL = [
    ("living_room_godot/living_room.usda", "/root/Cylinder/Cylinder"),
    ("cornell_box/cornell-box.usda", "/cornell_box/left_wall/left_wall"),
    ("avocado/avocado.usda", "/Avocado/Avocado"),
    ("dutch_ship_polyhaven/dutch_ship_medium.usdc", "/root/dutch_ship_medium_hull"),
    ("teapot_usdwg/Teapot.usd", "/Teapot/Geometry"),
    ("teapots_instanced_usdwg/scenes/teapotScene.usd", "/Scene/ring000/teapot002/geo/default/Body"),
    (
        "vehicles_usdwg/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda",
        "/vehicleVariant/tractorFullAsset/tractor/geo/tractor/_2_redMax",
    ),
    ("preview_surface_mayausd/UsdPreviewSurface/UseSpecularWorkflowTest.usda", "/pSphere1"),
]


def find_gprim(stage: Usd.Stage, path: str) -> str:
    """The prim, or the first one below it that has a material."""
    for prim in Usd.PrimRange(stage.GetPrimAtPath(path), Usd.TraverseInstanceProxies()):
        if not bound_relationship(prim)[0].isEmpty and (prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset)):
            return str(prim.GetPath())
    raise AssertionError(path)


@pytest.mark.parametrize(("name", "prim"), REAL)
def test_real_stages_take_three_kinds_of_change(assets: Path, tmp_path: Path, name: str, prim: str) -> None:
    # A part of the thousands of instances is enough.
    mask = Usd.StagePopulationMask(["/Scene/ring000"] if "instanced" in name else ["/"])
    stage = Usd.Stage.OpenMasked(str(assets / name), mask)
    blamed = set(validate(stage))
    painted = find_gprim(stage, prim)
    table = MaterialTable(Usd.TimeCode.Default(), Color(None, USD_DEFAULT_SPACE), Notes())
    material = table.materials[table(stage.GetPrimAtPath(painted))]
    others = {str(p.GetPath()) for p in users_of(stage, Sdf.Path(material.path))}
    others = sorted(o for o in others if not o.startswith(painted))[:3]
    for scope, freed in (("material", "diffuse"), ("material", "specular"), ("prim", "glossiness")):
        before = as_reflectance(diffuseColor=(0.4, 0.35, 0.3))
        after = Reflectance(before.diffuse * 0.5, before.f0 * 2, 0.21)
        change = MaterialChange(material, scope, (painted,), (freed,), before, after, means={"metallic": 0.0})
        edits = author_look(stage, [change], tmp_path / "look.usda")
        assert edits and all(e.wins for e in edits), edits
        author_review_root(tmp_path / "review.usda", tmp_path / "look.usda", None, assets / name)
        review = Usd.Stage.OpenMasked(str(tmp_path / "review.usda"), mask)
        assert validate(Usd.Stage.Open(str(tmp_path / "look.usda"))) == []
        assert set(validate(review)) <= blamed, freed
        for other in others if scope == "prim" else ():
            assert read_inputs(review, other) == read_inputs(stage, other)
