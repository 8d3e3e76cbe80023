"""A look over a shot in memory composes as the same look in a review root does, and never reaches the shot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from kit.stage_parts import StageBuilder, ball
from pxr import Sdf, Tf, Usd, UsdLux, UsdShade

from usdslf.errors import InputError
from usdslf.usd.live_stage import LIGHTS, LiveStage
from usdslf.usd.read.read import open_stage, read_scene


def write_ball(folder: Path, has_light: bool) -> Path:
    b = StageBuilder(folder)
    b.mesh("ball", ball(0.5), b.material("red", diffuseColor=(0.1, 0.2, 0.3)))
    if has_light:
        b.distant_light("sun", (0, -1, -1), 1.0, 2.0)
    b.camera((0, 0, 3), (0, 0, 0))
    return b.save()


@pytest.fixture
def shot(tmp_path: Path) -> Usd.Stage:
    return open_stage(write_ball(tmp_path, True))


def surface_path(stage: Usd.Stage) -> Sdf.Path:
    return next(p.GetPath() for p in stage.Traverse() if UsdShade.Shader(p) and p.GetName() != "mtl")


def look_of(shot: Usd.Stage, path: Path, red: float) -> Path:
    """A look by hand: `over`s down to the surface shader."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    prim = Sdf.CreatePrimInLayer(layer, surface_path(shot))
    color = Sdf.AttributeSpec(prim, "inputs:diffuseColor", Sdf.ValueTypeNames.Color3f)
    color.default = (red, 0, 0)
    for name, file in (("picture", "./look.textures/a.png"), ("elsewhere", "studio:/b.png")):
        Sdf.AttributeSpec(prim, f"inputs:{name}", Sdf.ValueTypeNames.Asset).default = Sdf.AssetPath(file)
    layer.Export(str(path))
    return path


def value(stage: Usd.Stage, name: str) -> object:
    return stage.GetPrimAtPath(surface_path(stage)).GetAttribute(f"inputs:{name}").Get()


def test_a_look_is_shown_changed_and_taken_away(shot: Usd.Stage, tmp_path: Path) -> None:
    before = shot.GetRootLayer().ExportToString()
    live = LiveStage.of(shot, read_scene(shot))
    plain = value(live.stage, "diffuseColor")
    look = look_of(shot, tmp_path / "look.usda", 0.75)
    live.show(look)
    assert tuple(value(live.stage, "diffuseColor")) == (0.75, 0, 0)
    look_of(shot, look, 0.5)
    live.show(look)
    assert tuple(value(live.stage, "diffuseColor")) == (0.5, 0, 0)
    live.show("")
    assert value(live.stage, "diffuseColor") == plain == value(shot, "diffuseColor")
    assert shot.GetRootLayer().ExportToString() == before and not shot.GetRootLayer().dirty


def test_files_beside_the_look_are_found_and_others_named_as_they_are(shot: Usd.Stage, tmp_path: Path) -> None:
    live = LiveStage.of(shot, read_scene(shot))
    (tmp_path / "looks").mkdir()
    live.show(look_of(shot, tmp_path / "looks/look.usda", 1.0))
    assert value(live.stage, "picture").path == str((tmp_path / "looks/look.textures/a.png").resolve())
    assert value(live.stage, "elsewhere").path == "studio:/b.png"


def test_only_what_differs_is_told_to_who_listens(shot: Usd.Stage, tmp_path: Path) -> None:
    live = LiveStage.of(shot, read_scene(shot))
    live.show(look_of(shot, tmp_path / "a.usda", 0.25))
    paths: list[tuple[list[str], list[str]]] = []

    def hear(notice: Usd.Notice.ObjectsChanged, _: Usd.Stage) -> None:
        paths.append((list(map(str, notice.GetResyncedPaths())), list(map(str, notice.GetChangedInfoOnlyPaths()))))

    listener = Tf.Notice.Register(Usd.Notice.ObjectsChanged, hear, live.stage)
    live.show(look_of(shot, tmp_path / "b.usda", 0.5))
    listener.Revoke()
    attribute = f"{surface_path(shot)}.inputs:diffuseColor"
    assert attribute in [p for _, changed in paths for p in changed]
    assert not [p for resynced, _ in paths for p in resynced if not p.startswith(str(surface_path(shot)))]


def test_a_shot_without_light_gets_the_stated_default_and_says_so(tmp_path: Path) -> None:
    dark = open_stage(write_ball(tmp_path, False))
    live = LiveStage.of(dark, read_scene(dark))
    kinds = {p.GetTypeName() for p in live.stage.GetPrimAtPath(LIGHTS).GetChildren()}
    assert kinds == {"DomeLight", "DistantLight"} and "no light" in live.note
    dome = UsdLux.DomeLight(live.stage.GetPrimAtPath(f"{LIGHTS}/dome"))
    picture = OpenImageIO.ImageBuf(dome.GetTextureFileAttr().Get().path).get_pixels()
    shines = dome.GetIntensityAttr().Get() * picture
    assert picture.shape == (2, 4, 3) and shines == pytest.approx(np.full((2, 4, 3), 0.35), rel=0.005)
    assert not dark.GetPrimAtPath(LIGHTS)
    live.close()
    assert not Path(dome.GetTextureFileAttr().Get().path).exists()


def test_a_lit_shot_keeps_its_light(shot: Usd.Stage) -> None:
    live = LiveStage.of(shot, read_scene(shot))
    assert not live.note and not live.stage.GetPrimAtPath(LIGHTS)


def test_a_look_that_cannot_be_read_leaves_what_was_there(shot: Usd.Stage, tmp_path: Path) -> None:
    live = LiveStage.of(shot, read_scene(shot))
    live.show(look_of(shot, tmp_path / "look.usda", 0.75))
    (tmp_path / "broken.usda").write_text("#usda 1.0\nover {")
    for name, words in (("none.usda", "there is no look layer"), ("broken.usda", "not a readable USD file")):
        with pytest.raises(InputError, match=words):
            live.show(tmp_path / name)
    assert tuple(value(live.stage, "diffuseColor")) == (0.75, 0, 0)


def test_bindings_without_their_schema_are_bindings_all_the_same(tmp_path: Path) -> None:
    path = write_ball(tmp_path, True)
    path.write_text(path.read_text().replace('prepend apiSchemas = ["MaterialBindingAPI"]', ""))
    plain = open_stage(path)
    assert not plain.GetPrimAtPath("/World/ball").HasAPI(UsdShade.MaterialBindingAPI)
    live = LiveStage.of(plain, read_scene(plain))
    ball_of_live = live.stage.GetPrimAtPath("/World/ball")
    assert ball_of_live.HasAPI(UsdShade.MaterialBindingAPI)
    found, _ = UsdShade.MaterialBindingAPI(ball_of_live).ComputeBoundMaterial()
    assert found.GetPath() == "/World/mtl/red"
    assert not plain.GetPrimAtPath("/World/ball").HasAPI(UsdShade.MaterialBindingAPI)
