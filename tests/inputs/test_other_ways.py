"""A change that does not show is written another way; where something hides it, that is said and the run fails."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdShade

from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.usd.author.read_back import scene_under
from usdslf.usd.read.read import open_stage

PAINTED = (0.066, 0.379, 0.014)  # of .1, .4, .05 in a dome of radiance 1
COLOR = "/World/m/s.inputs:diffuseColor"


@pytest.fixture
def shot(inputs: Path, tmp_path: Path) -> Sdf.Layer:
    """A card that shows /World/m, to be changed and saved by the test."""
    layer = Sdf.Layer.CreateNew(str(tmp_path / "shot.usda"))
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(inputs / "weak/camera_exposure.usda")))
    layer.Save()
    return layer


def paint(run: Callable, shot: Sdf.Layer, *solve: str, scope: str = "material") -> tuple[int, str, Path]:
    """Paints the card green and solves: exit code, what was said, the look."""
    strokes, look = Path(shot.realPath).with_name("strokes.usda"), Path(shot.realPath).with_name("look.usda")
    brush = ("--camera", "/World/cam", "--path", "0.47,0.5 0.53,0.5", "--color", ".1,.4,.05", "--scope", scope)
    if not strokes.exists():
        assert run("stroke", shot.realPath, strokes, *brush)[0] == 0
    code, _, err = run("solve", shot.realPath, strokes, "-o", look, "--elements", 300, *solve)
    return code, err, look


def diffuse(shot: Sdf.Layer, look: Path) -> np.ndarray:
    scene = scene_under(open_stage(shot.realPath), look, None)
    return evaluate_surface(scene, np.array([0]), np.full((1, 2), 1 / 3)).diffuse[0]


def test_what_no_edit_reaches_is_cut_off(run: Callable, shot: Sdf.Layer) -> None:
    """A node that usdslf cannot change drives the colour: a constant takes its place, and that is said."""
    stage = Usd.Stage.Open(shot)
    noise = UsdShade.Shader.Define(stage, "/World/m/noise")
    noise.CreateIdAttr("ND_noise3d_color3")
    port = UsdShade.Shader(stage.GetPrimAtPath("/World/m/s")).GetInput("diffuseColor")
    port.ConnectToSource(noise.CreateOutput("out", Sdf.ValueTypeNames.Color3f))
    shot.Save()
    code, said, look = paint(run, shot)
    assert code == 0, said
    assert diffuse(shot, look) == pytest.approx(PAINTED, abs=0.003)
    assert "cut off" in said and "/World/m/noise" in said
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [str(look), shot.realPath]
    review = Usd.Stage.Open(root)  # as any program composes it
    assert not review.GetAttributeAtPath(COLOR).GetConnections()
    assert tuple(review.GetAttributeAtPath(COLOR).Get()) == pytest.approx(PAINTED, abs=0.003)


def test_a_stronger_binding_is_said_and_fails(run: Callable, shot: Sdf.Layer) -> None:
    stage = Usd.Stage.Open(shot)
    other = stage.OverridePrim("/World/other")
    other.GetReferences().AddInternalReference("/World/card")
    stage.GetPrimAtPath("/World/other").SetTypeName("Mesh")
    api = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/World"))
    m = UsdShade.Material(stage.GetPrimAtPath("/World/m"))
    api.Bind(m, UsdShade.Tokens.strongerThanDescendants)
    shot.Save()
    code, said, look = paint(run, shot, scope="prim")
    (error,) = [line for line in said.splitlines() if line.startswith("usdslf: ")]
    assert code == 6 and "stronger binding of /World/m" in error and "weakerThanDescendants" in error
    assert look.exists() and "Traceback" not in said  # it shows as soon as the shot lets it


def test_a_value_that_a_person_wrote_into_the_look_is_not_worked_around(run: Callable, shot: Sdf.Layer) -> None:
    code, said, look = paint(run, shot)
    assert code == 0, said
    layer = Sdf.Layer.FindOrOpen(str(look))
    layer.Reload(force=True)
    layer.GetAttributeAtPath(COLOR).default = Gf.Vec3f(1, 1, 0)
    layer.Save()
    code, said, look = paint(run, shot)
    (error,) = [line for line in said.splitlines() if line.startswith("usdslf: ")]
    assert code == 6 and "by hand" in error and "look.usda is written" in error
    assert diffuse(shot, look) == pytest.approx((1, 1, 0), abs=0.001)


@pytest.mark.parametrize(
    ("misses", "says"), [({(False, False)}, "a new material"), ({(False, False), (True, False)}, "constants")]
)
def test_the_first_other_way_that_shows_is_taken(
    run: Callable, shot: Sdf.Layer, monkeypatch: pytest.MonkeyPatch, misses: set, says: str
) -> None:
    """A writer that misses its place in some ways of writing."""
    from usdslf.usd.author.change_writer import ChangeWriter

    write = ChangeWriter.write

    def faulty(self: ChangeWriter, edit: object) -> list:
        return [] if (self.mode == "new", self.is_constant) in misses else write(self, edit)

    monkeypatch.setattr(ChangeWriter, "write", faulty)
    code, said, look = paint(run, shot)
    assert code == 0, said
    assert f"is written as {says}" in said
    assert diffuse(shot, look) == pytest.approx(PAINTED, abs=0.003)


def test_what_is_similar_is_read_back_too(
    run: Callable, shot: Sdf.Layer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another material that a stroke of scope similar changes, by a writer that leaves it out."""
    from usdslf.usd.author.change_writer import ChangeWriter

    for old, new in (("/World/m", "/World/g"), ("/World/card", "/World/card_2")):
        Sdf.CopySpec(shot, old, shot, new)
    shot.GetRelationshipAtPath("/World/card_2.material:binding").targetPathList.explicitItems = ["/World/g"]
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    shot.GetAttributeAtPath("/World/card_2.points").default = [(x - 2.2, y, 0) for x, y in corners]
    output = "/World/g.outputs:surface"
    shot.GetAttributeAtPath(output).connectionPathList.explicitItems = ["/World/g/s.outputs:surface"]
    shot.Save()
    code, said, look = paint(run, shot, scope="similar")
    assert code == 0 and Sdf.Layer.FindOrOpen(str(look)).GetPrimAtPath("/World/g"), said
    write = ChangeWriter.write
    monkeypatch.setattr(ChangeWriter, "write", lambda self, e: [] if self.original == "/World/g" else write(self, e))
    code, said, _ = paint(run, shot)
    assert code == 6 and "/World/g" in said
