"""Value clips: what they hold is read at its frame, and an edit over them wins or says what hides it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.lit_plane import FLOOR, places
from kit.oddity_stages import AFTER, GRID, as_asset, evaluate_at, floor_of, floor_shot, solved, textured
from kit.stage_parts import StageBuilder
from kit.stage_textures import write_image
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from usdslf.usd.layer.wins import why_hidden
from usdslf.usd.read.read import read_scene
from usdslf.usd.review.validate import validate

FIRST, LAST = 1.0, 10.0
DIFFUSE = "/World/mtl/floor/surface.inputs:diffuseColor"
GREY = (0.1, 0.2, 0.3)


def write_clip(path: Path, attribute: str, samples: dict[float, Any], kind: Sdf.ValueTypeName) -> None:
    """A layer of time samples of one attribute."""
    layer = Sdf.Layer.CreateNew(str(path))
    at = Sdf.Path(attribute)
    Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, at.GetPrimPath()), at.name, kind)
    for time, value in samples.items():
        layer.SetTimeSample(at, time, value)
    layer.Save()


def use_clips(prim: Usd.Prim, *files: str, active: Any = ((0, 0),), inside: str = "/World") -> None:
    """Clips on a prim, each at the stage's own time."""
    api = Usd.ClipsAPI(prim)
    api.SetClipAssetPaths([Sdf.AssetPath(f) for f in files])
    api.SetClipPrimPath(inside)
    api.SetClipActive(Vt.Vec2dArray([Gf.Vec2d(*a) for a in active]))
    api.SetClipTimes(Vt.Vec2dArray([(FIRST, FIRST), (LAST, LAST)]))


def clipped_color(b: StageBuilder, samples: dict[float, tuple[float, float, float]]) -> None:
    """The floor's diffuse colour comes from a clip only."""
    b.stage.SetStartTimeCode(FIRST)
    b.stage.SetEndTimeCode(LAST)
    colors = {time: Gf.Vec3f(*color) for time, color in samples.items()}
    write_clip(b.folder / "clip.usda", DIFFUSE, colors, Sdf.ValueTypeNames.Color3f)
    b.stage.GetAttributeAtPath(DIFFUSE).Clear()


def moving_floor(b: StageBuilder, frames: dict[float, float]) -> dict[float, Any]:
    """Points of the floor at a height for each frame."""
    b.stage.SetStartTimeCode(FIRST)
    b.stage.SetEndTimeCode(LAST)
    floor_of(b).GetPointsAttr().Clear()
    return {t: Vt.Vec3fArray.FromNumpy(np.add(GRID, (0, 0, z)).astype(np.float32)) for t, z in frames.items()}


# ---- geometry -----------------------------------------------------------------------------------------------
def test_points_from_a_clip(tmp_path: Path) -> None:
    """Between the samples on a line; at frame 10 the floor lies where it belongs, and solves."""
    b = floor_shot(tmp_path)
    samples = moving_floor(b, {FIRST: -9.0, LAST: 0.0})
    write_clip(tmp_path / "clip.usda", "/World/floor.points", samples, Sdf.ValueTypeNames.Point3fArray)
    use_clips(b.stage.GetPrimAtPath("/World"), "./clip.usda")
    path = b.save()
    for frame, z in ((FIRST, -9.0), (4.0, -6.0), (LAST, 0.0)):
        (mesh,) = read_scene(path, frame=frame).meshes
        np.testing.assert_allclose(mesh.positions, np.add(GRID, (0, 0, z)), atol=1e-5)
        assert mesh.is_animated
    assert all(e.wins for e in solved(path, frame=LAST).author(tmp_path / "look.usda"))


def test_a_clip_for_each_frame_by_a_template(tmp_path: Path) -> None:
    """As caches of simulations are: one file a frame, held between frames."""
    b = floor_shot(tmp_path)
    samples = moving_floor(b, {1.0: -3.0, 2.0: -2.0, 3.0: 0.0})
    for frame, points in samples.items():
        file = tmp_path / f"sim.{int(frame):04d}.usda"
        write_clip(file, "/World/floor.points", {frame: points}, Sdf.ValueTypeNames.Point3fArray)
    api = Usd.ClipsAPI(b.stage.GetPrimAtPath("/World"))
    api.SetClipPrimPath("/World")
    api.SetClipTemplateAssetPath("./sim.####.usda")
    api.SetClipTemplateStartTime(1)
    api.SetClipTemplateEndTime(3)
    api.SetClipTemplateStride(1)
    path = b.save()
    for frame, z in ((1.0, -3.0), (2.0, -2.0), (3.0, 0.0)):
        (mesh,) = read_scene(path, frame=frame).meshes
        np.testing.assert_allclose(mesh.positions, np.add(GRID, (0, 0, z)), atol=1e-5)
    solved(path, frame=3)


def test_a_transform_from_a_clip(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    b.stage.SetStartTimeCode(FIRST)
    b.stage.SetEndTimeCode(LAST)
    UsdGeom.Xformable(floor_of(b)).AddTranslateOp()
    samples = {FIRST: Gf.Vec3d(0, 0, -9), LAST: Gf.Vec3d(0, 0, 0)}
    write_clip(tmp_path / "clip.usda", "/World/floor.xformOp:translate", samples, Sdf.ValueTypeNames.Double3)
    use_clips(b.stage.GetPrimAtPath("/World/floor"), "./clip.usda", inside="/World/floor")
    path = b.save()
    (mesh,) = read_scene(path, frame=4.0).meshes
    np.testing.assert_allclose(mesh.positions, np.add(GRID, (0, 0, -6)), atol=1e-5)
    assert mesh.is_animated
    solved(path, frame=LAST)


# ---- materials ----------------------------------------------------------------------------------------------
def colors_at(review: Usd.Stage, *frames: float) -> np.ndarray:
    """What the floor shows at each frame (frames, 3)."""
    return np.array([evaluate_at(read_scene(review, frame=f), places()).base_color[0] for f in frames])


def test_an_edit_over_clips_of_the_shot_wins_at_every_frame(tmp_path: Path) -> None:
    """Clips are weaker than opinions of the layers above the one that asks for them; that they end is said."""
    b = floor_shot(tmp_path)
    clipped_color(b, {FIRST: GREY, LAST: FLOOR["diffuse"]})
    use_clips(b.stage.GetPrimAtPath("/World"), "./clip.usda")
    path = b.save()
    middle = (8 / 9) * np.array(GREY) + (1 / 9) * np.array(FLOOR["diffuse"])
    shown = colors_at(Usd.Stage.Open(str(path)), FIRST, 2.0, LAST)
    np.testing.assert_allclose(shown, [GREY, middle, FLOOR["diffuse"]], atol=1e-6)
    session = solved(path, frame=LAST)
    (edit,) = session.author(tmp_path / "look.usda", review_root=tmp_path / "review.usda")
    assert edit.wins
    assert [w for w in session.warnings if "animated" in w and DIFFUSE in w]
    review = Usd.Stage.Open(str(tmp_path / "review.usda"))
    np.testing.assert_allclose(colors_at(review, FIRST, 5.0, LAST), np.tile(AFTER["diffuse"], (3, 1)), atol=0.02)


def referenced(b: StageBuilder, is_instance: bool, where: str) -> None:
    """The floor and its material as an asset that /World/a refers to, with the clips in the asset or in the shot.

    USD drops clips of an instance's own prim, as it drops overs below one: in an asset they are below its root.
    """
    asset = as_asset(b, "/World")
    of_asset = Usd.Stage.Open(asset)
    of_asset.CreateClassPrim("/_class_floor")
    of_asset.GetPrimAtPath("/World").GetInherits().AddInherit("/_class_floor")
    if where == "asset":
        use_clips(of_asset.GetPrimAtPath("/World/mtl"), "./clip.usda", inside="/World/mtl")
    asset.Save()
    for name in ("floor", "mtl"):
        b.stage.RemovePrim(f"/World/{name}")
    prim = UsdGeom.Xform.Define(b.stage, "/World/a").GetPrim()
    prim.GetReferences().AddReference("./asset.usda")
    prim.SetInstanceable(is_instance)
    if where == "shot":
        use_clips(prim, "./clip.usda")


ASSETS = (  # is an instance, where the clips are, mode of the edit, whether it wins
    (False, "shot", "", True),
    (False, "asset", "", True),
    (True, "asset", "", True),
    (True, "asset", "class", True),
    (False, "asset", "class", True),
    (False, "shot", "class", False),  # clips of the prim are stronger than the class that it inherits
)


@pytest.mark.parametrize(("is_instance", "where", "mode", "wins"), ASSETS)
def test_an_edit_over_clips_of_a_referenced_asset(
    tmp_path: Path, is_instance: bool, where: str, mode: str, wins: bool
) -> None:
    """It shows at every frame; where a clip hides it, the report says so and the clip is what shows."""
    b = floor_shot(tmp_path)
    clipped_color(b, {FIRST: GREY, LAST: FLOOR["diffuse"]})
    referenced(b, is_instance, where)
    path = b.save()
    as_it_was = [GREY, FLOOR["diffuse"]]
    np.testing.assert_allclose(colors_at(Usd.Stage.Open(str(path)), FIRST, LAST), as_it_was, atol=1e-6)
    session = solved(path, frame=LAST)
    (edit,) = session.author(tmp_path / "look.usda", review_root=tmp_path / "review.usda", mode=mode)
    review = Usd.Stage.Open(str(tmp_path / "review.usda"))
    assert edit.wins is wins
    if wins:
        np.testing.assert_allclose(colors_at(review, FIRST, LAST), np.tile(AFTER["diffuse"], (2, 1)), atol=0.02)
        return
    np.testing.assert_allclose(colors_at(review, FIRST, LAST), as_it_was, atol=1e-6)
    assert edit.hidden_by == "a value clip" and "out of the clip" in edit.mend and not edit.affects
    assert any("a value clip" in w and edit.mend in w for w in session.warnings)
    assert [e["wins"] for e in session.report()["edits"] if e["hidden_by"] == "a value clip"] == [False]
    assert any("a value clip" in str(f) for f in validate(review, None))


@pytest.mark.parametrize("is_last", [False, True])
def test_clips_of_a_stronger_layer_hide_an_edit(tmp_path: Path, is_last: bool) -> None:
    """Also where their first value is by chance that of the edit, and they leave it later."""
    b = floor_shot(tmp_path)
    b.save()
    (edit,) = solved(b.path).author(tmp_path / "look.usda")
    first = edit.after if is_last else GREY
    colors = {FIRST: Gf.Vec3f(*first), LAST: Gf.Vec3f(0.7, 0.7, 0.7)}
    write_clip(tmp_path / "clip.usda", DIFFUSE, colors, Sdf.ValueTypeNames.Color3f)
    top = Sdf.Layer.CreateNew(str(tmp_path / "top.usda"))
    top.subLayerPaths = ["./look.usda", "./stage.usda"]
    stage = Usd.Stage.Open(top)
    use_clips(stage.OverridePrim("/World"), "./clip.usda")
    look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    np.testing.assert_allclose(stage.GetAttributeAtPath(DIFFUSE).Get(LAST), 0.7, atol=1e-6)
    what, mend = why_hidden(stage, look, Sdf.Path(DIFFUSE), Sdf.Path(DIFFUSE))
    assert what == "a value clip" and "out of the clip" in mend


def test_a_texture_that_a_clip_changes_keeps_its_frames_under_an_edit(tmp_path: Path) -> None:
    """A sequence of pictures: the edit is a scale and a bias, and each frame shows its own picture by them."""
    b = floor_shot(tmp_path)
    b.stage.SetStartTimeCode(FIRST)
    b.stage.SetEndTimeCode(LAST)
    for name, color in (("one", (0.2, 0.3, 0.4)), ("ten", FLOOR["diffuse"])):
        write_image(tmp_path / f"{name}.exr", np.tile(np.float32(color), (8, 8, 1)))
    file = textured(b).GetInput("file").GetAttr()
    file.Clear()
    samples = {FIRST: Sdf.AssetPath("./one.exr"), LAST: Sdf.AssetPath("./ten.exr")}
    write_clip(tmp_path / "clip.usda", str(file.GetPath()), samples, Sdf.ValueTypeNames.Asset)
    use_clips(b.stage.GetPrimAtPath("/World"), "./clip.usda")
    session = solved(b.save(), frame=LAST)
    edits = session.author(tmp_path / "look.usda", review_root=tmp_path / "review.usda")
    assert edits and all(e.wins and e.representation == "scale" for e in edits)
    review = Usd.Stage.Open(str(tmp_path / "review.usda"))
    # Red gets lighter, by less of what is missing to white; green and blue by a factor.
    red = 1 - (1 - 0.2) * (1 - AFTER["diffuse"][0]) / (1 - FLOOR["diffuse"][0])
    expected = [(red, 0.3 * 0.15 / 0.3, 0.4 * 0.1 / 0.2), AFTER["diffuse"]]
    np.testing.assert_allclose(colors_at(review, FIRST, LAST), expected, atol=0.02)
