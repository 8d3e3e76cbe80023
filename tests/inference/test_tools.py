"""Tools ask of the light field what they say, and what is inferred from them is what a painter means."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, ball, rectangle
from pxr import Usd, UsdGeom

import usdslf
from usdslf.errors import StrokeError
from usdslf.gpu.device import Device
from usdslf.inference.answers import Answer
from usdslf.inference.direct import gather_strokes
from usdslf.inference.tools import OPERATORS, SeenDabs, apply_tool, offset_on_picture
from usdslf.session import Session
from usdslf.strokes.paint import paint_stroke
from usdslf.strokes.stroke import TOOLS, Stroke

Made = Callable[..., Session]
RED, BLUE = (0.6, 0.12, 0.06), (0.08, 0.12, 0.5)
ACROSS = [[[0.4, 0.5], [0.6, 0.5]]]
LEFT, RIGHT = [[[0.25, 0.5], [0.35, 0.55]]], [[[0.65, 0.5], [0.75, 0.55]]]
# over the highlight of the glossy ball and well beside it
HIGHLIGHT = [[[0.44, 0.38], [0.66, 0.38]], [[0.44, 0.28], [0.66, 0.28]], [[0.54, 0.2], [0.54, 0.5]]]


def matte(color: tuple[float, float, float]) -> dict[str, Any]:
    """A material that reflects nothing but diffusely."""
    return {"useSpecularWorkflow": 1.0, "diffuseColor": color, "specularColor": (0.0, 0.0, 0.0), "roughness": 1.0}


def opened(builder: StageBuilder, device: Device) -> Session:
    """A session on what was built."""
    return usdslf.open(str(builder.save()), device=device, elements=1500)


@pytest.fixture(scope="module")
def matte_ball(tmp_path_factory: pytest.TempPathFactory, device: Device) -> Session:
    """A matte red ball in even light."""
    b = StageBuilder(tmp_path_factory.mktemp("matte"))
    b.mesh("ball", ball(1.0), b.material("red", **matte(RED)))
    b.dome_light("sky", 1.0)
    b.camera((0, 1, 6), (0, 1, 0), 30)
    return opened(b, device)


@pytest.fixture(scope="module")
def glossy_ball(tmp_path_factory: pytest.TempPathFactory, device: Device) -> Session:
    """A lacquered ball with the highlight of a lamp."""
    b = StageBuilder(tmp_path_factory.mktemp("glossy"))
    lacquer = {"diffuseColor": (0.1, 0.1, 0.2), "specularColor": (0.2, 0.2, 0.2), "roughness": 0.3}
    b.mesh("ball", ball(1.0), b.material("lacquer", useSpecularWorkflow=1.0, **lacquer))
    b.dome_light("sky", 0.1)
    b.rect_light("lamp", (1.5, 3, 4), (0, 1, 0), 1.0, 1.0, (30, 30, 30))
    b.camera((0, 1, 6), (0, 1, 0), 30)
    return opened(b, device)


@pytest.fixture(scope="module")
def two_cards(tmp_path_factory: pytest.TempPathFactory, device: Device) -> Session:
    """A red card on the left and a blue one on the right, in even light."""
    b = StageBuilder(tmp_path_factory.mktemp("cards"))
    b.mesh("left", rectangle((-2, 0, 0), (1.8, 0, 0), (0, 2, 0)), b.material("red", **matte(RED)))
    b.mesh("right", rectangle((0.2, 0, 0), (1.8, 0, 0), (0, 2, 0)), b.material("blue", **matte(BLUE)))
    b.dome_light("sky", 1.0)
    b.camera((0, 1, 6), (0, 1, 0), 30)
    return opened(b, device)


def painted(session: Session, tool: str, paths: list = ACROSS, name: str = "stroke_0001", **brush: Any) -> Stroke:
    """A stroke on the picture of the session's camera."""
    given = {"radius": 0.02, "spacing": 1.5, **brush}
    return paint_stroke(session.scene, session.tracer, session.camera(), paths, tool=tool, name=name, **given)


def solved(session: Session, *strokes: Stroke, **options: Any) -> list[Answer]:
    """What strokes say, on an untouched session."""
    session.strokes, session.warnings = list(strokes), []
    return session.solve(**options)


def wanted(session: Session, stroke: Stroke) -> np.ndarray:
    """The radiance (n, 3) that a stroke asks for."""
    field = session.light_field
    one = gather_strokes([stroke], session.scene, session.tracer, field, session.light_set, [])[0]
    return one.evidence(field).target


def test_every_tool_has_an_operator() -> None:
    assert set(OPERATORS) == set(TOOLS)


@pytest.mark.parametrize("strength", [0.0, 0.3, 1.0])
def test_operators(strength: float) -> None:
    rng = np.random.default_rng(1)
    x, paint, source, mean = rng.uniform(0.5, 2, (4, 7, 3))
    seen = SeenDabs(x, paint, source, mean)
    ask = {tool: apply_tool(tool, seen, strength) for tool in TOOLS}
    s = strength
    assert np.allclose(ask["brighten"], (1 + s) * x)
    assert np.allclose(ask["darken"], (1 - s) * x)
    assert np.allclose(ask["fixate"], x)
    assert np.allclose(ask["replace"], (1 - s) * x + s * paint)
    assert np.allclose(ask["clone"], (1 - s) * x + s * source)
    assert np.allclose(ask["blur"], (1 - s) * x + s * mean)
    assert np.allclose(ask["sharpen"], (1 - s) * x + s * x * (x / mean))
    assert all((a >= 0).all() for a in ask.values())


@pytest.mark.parametrize(("tool", "factor"), [("brighten", 1.5), ("darken", 0.5)])
def test_a_diffuse_ball_takes_the_factor(matte_ball: Session, tool: str, factor: float) -> None:
    stroke = painted(matte_ball, tool, strength=0.5)
    before = wanted(matte_ball, painted(matte_ball, "fixate"))
    assert np.allclose(wanted(matte_ball, stroke), factor * before, rtol=1e-6)
    (answer,) = solved(matte_ball, stroke)
    assert answer.chosen.id == "diffuse"
    assert np.allclose(answer.after["diffuse"], factor * np.array(RED), rtol=0.02)
    assert answer.residual_after < 0.02  # the light that is seen then is what was asked for
    assert not answer.tables.has_one_color.any()  # as even as one brush colour, and yet meant dab by dab


def test_a_blur_of_even_light_asks_for_nothing(matte_ball: Session) -> None:
    (answer,) = solved(matte_ball, painted(matte_ball, "blur"))
    assert answer.chosen.id == "none"
    assert answer.residual_before < 0.02


@pytest.mark.parametrize(("tool", "sign"), [("blur", 1), ("sharpen", -1)])
def test_blur_dulls_and_sharpen_polishes(glossy_ball: Session, tool: str, sign: int) -> None:
    (answer,) = solved(glossy_ball, painted(glossy_ball, tool, HIGHLIGHT))
    assert answer.chosen.id == "glossiness"
    change = float(answer.after["roughness"][0] - answer.before["roughness"][0])
    assert 0.03 < sign * change < 0.2
    assert answer.residual_after < 0.6 * answer.residual_before
    assert not answer.is_ambiguous


def test_blur_flattens_a_highlight_and_keeps_its_light(glossy_ball: Session) -> None:
    grid = [[[0.4, y], [0.68, y]] for y in np.linspace(0.15, 0.47, 5)]
    before = wanted(glossy_ball, painted(glossy_ball, "fixate", grid))
    after = wanted(glossy_ball, painted(glossy_ball, "blur", grid))
    assert after.max() < 0.85 * before.max()
    assert abs(after.mean() / before.mean() - 1) < 0.15


def test_clone_takes_the_colour_of_its_source(two_cards: Session) -> None:
    stroke = painted(two_cards, "clone", RIGHT, clone_offset=(-2.2, 0.0, 0.0))
    (answer,) = solved(two_cards, stroke)
    assert answer.chosen.id == "diffuse"
    assert np.allclose(answer.after["diffuse"], RED, rtol=0.03)
    assert two_cards.scene.materials[answer.pool.material].path.endswith("blue")


def test_a_source_off_the_surface_is_what_the_eye_sees_there(two_cards: Session) -> None:
    # half as far off and half way to the eye at z = 6: the same line of sight
    on = painted(two_cards, "clone", RIGHT, clone_offset=(-2.2, 0.0, 0.0))
    point, eye = on.points.astype(float), on.eye.astype(float)
    source = point + np.array([-2.2, 0, 0])
    before = (0.5 * (source + eye) - point)[0]
    off = painted(two_cards, "clone", RIGHT, clone_offset=tuple(before))
    assert np.allclose(wanted(two_cards, off), wanted(two_cards, on), rtol=0.02)


def test_a_source_on_nothing_is_said(two_cards: Session) -> None:
    with pytest.raises(StrokeError, match="choose a clone offset"):
        solved(two_cards, painted(two_cards, "clone", RIGHT, clone_offset=(0.0, 40.0, 0.0)))


def test_offset_on_the_picture_is_that_of_the_surfaces(two_cards: Session) -> None:
    s = two_cards
    found = offset_on_picture(s.scene, s.tracer, s.camera(), RIGHT, (-0.4, 0.0))
    height = 2 * 6 * np.tan(np.radians(15))
    assert np.allclose(found, (-0.4 * height * 4 / 3, 0, 0), atol=1e-4)
    with pytest.raises(StrokeError, match="off every surface"):
        offset_on_picture(s.scene, s.tracer, s.camera(), RIGHT, (0.0, 5.0))


def test_what_is_fixated_never_changes(two_cards: Session) -> None:
    fix = painted(two_cards, "fixate", LEFT)
    (alone,) = solved(two_cards, fix)
    assert alone.chosen.id == "none"
    assert alone.residual_after < 1e-3
    held, other = solved(two_cards, fix, painted(two_cards, "darken", RIGHT, "stroke_0002", strength=0.5))
    assert (held.chosen.id, other.chosen.id) == ("none", "diffuse")
    assert [c.material.path for c in two_cards.changes()] == [two_cards.scene.materials[other.pool.material].path]
    assert [s["inferred"] for s in two_cards.report()["strokes"]] == ["none", "diffuse"]
    with pytest.raises(StrokeError, match="stroke_0001 fixates"):
        solved(two_cards, fix, painted(two_cards, "darken", LEFT, "stroke_0002"))


def test_darkened_to_black_a_surface_gives_off_what_its_highlight_leaves(two_cards: Session) -> None:
    (answer,) = solved(two_cards, painted(two_cards, "darken", RIGHT))  # strength 1 asks for nothing at all
    before, after = answer.before["diffuse"], answer.after["diffuse"]
    assert "diffuse" in answer.chosen.freed
    assert (after <= 0.01).all() and (before > 0.01).any()
    assert answer.residual_after < answer.residual_before < 100  # of what is seen there: the paint has no light


@pytest.mark.parametrize("tool", TOOLS)
def test_no_strength_asks_for_nothing(two_cards: Session, tool: str) -> None:
    stroke = painted(two_cards, tool, RIGHT, strength=0.0, norm="l2", clone_offset=(-2.2, 0.0, 0.0), color=(1, 0, 0))
    (answer,) = solved(two_cards, stroke)
    assert answer.chosen.id == "none"
    assert not two_cards.changes() and not two_cards.warnings


def test_no_strength_holds_nobody_back(two_cards: Session) -> None:
    idle = painted(two_cards, "fixate", RIGHT, strength=0.0)
    none, other = solved(two_cards, idle, painted(two_cards, "brighten", RIGHT, "stroke_0002", strength=0.5))
    assert none.chosen.id == "none"
    assert np.allclose(other.after["diffuse"], 1.5 * np.array(BLUE), rtol=0.02)


def test_replace_by_halves(two_cards: Session) -> None:
    before = wanted(two_cards, painted(two_cards, "fixate", RIGHT))
    half = wanted(two_cards, painted(two_cards, "replace", RIGHT, strength=0.5, color=(0.4, 0.2, 0.1)))
    assert np.allclose(half, 0.5 * before + [0.2, 0.1, 0.05], rtol=1e-5)


def test_tools_do_not_chase_what_they_did(tmp_path: Path, device: Device) -> None:
    """In a corner whose walls light one another, half as much light again is asked for once, not in each round."""
    b = StageBuilder(tmp_path)
    card = b.material("card", **matte((0.4, 0.4, 0.4)))
    b.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), card)
    b.mesh("wall", rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0)), card)
    b.dome_light("sky", 1.0)
    b.camera((0, 1, 6), (0, 1, 0), 30)
    session = opened(b, device)
    (answer,) = solved(session, painted(session, "brighten", [[[0.4, 0.6], [0.6, 0.6]]], strength=0.5))
    assert len(answer.rounds) > 1
    assert answer.residual_after < 0.02
    assert 0.5 < answer.after["diffuse"][0] < 0.6  # less than 0.6: the walls send more light too


Run = Callable[..., tuple[int, str, str]]


def test_the_command_line_asks_for_what_a_tool_needs(two_cards: Session, tmp_path: Path, run: Run) -> None:
    stage, layer = two_cards.stage.GetRootLayer().realPath, tmp_path / "s.usda"
    begin = ("stroke", stage, layer, "--camera", "/World/camera", "--path", "0.7,0.5")
    for tool in ("brighten", "darken", "blur", "sharpen", "fixate"):
        code, _, err = run(*begin, "--tool", tool, "--strength", 0.5)
        assert code == 0, err
    assert run(*begin, "--tool", "clone", "--clone-offset=-0.4,0")[0] == 0
    assert run(*begin, "--tool", "clone", "--clone-offset=-1,0.5,0")[0] == 0
    clone = ("--tool", "clone", "--clone-offset")
    misled = ("--tool", "blur", *clone[2:], "1,0")
    for wrong in (("--tool", "replace"), clone[:2], misled, (*clone, "1"), (*clone, "0,9")):
        code, out, err = run(*begin, *wrong)
        assert (code, out) == (2, "") and len(err.splitlines()) == 1, wrong
    written = Usd.Stage.Open(str(layer))
    prims = written.GetPrimAtPath("/SlfStrokes").GetChildren()
    assert len(prims) == 7 and all(UsdGeom.BasisCurves(p) for p in prims)
    on_picture, in_world = (p.GetAttribute("slf:cloneOffset").Get() for p in prims[-2:])
    assert on_picture[0] < -1 and abs(on_picture[2]) < 1e-4
    assert tuple(in_world) == (-1, 0.5, 0)
