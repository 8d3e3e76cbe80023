"""Similarity to a stroke as a picture: what was painted has all of it, and position alone falls with distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from kit.stage_parts import StageBuilder, TextureInput, rectangle, write_image
from kit.stage_parts import ball as stage_ball
from kit.varying_floor import GREY, add_lamp, places, seen, surface_at
from kit.varying_floor import stroke as dabs

import usdslf
from usdslf.errors import StrokeError
from usdslf.inference.gathered import Gathered
from usdslf.light_field.light_field import LightField
from usdslf.procedural.built_shot import BuiltShot, Lamp, Part, View
from usdslf.procedural.shapes import ball, panel
from usdslf.scene.cameras import project_points
from usdslf.session import Session
from usdslf.similarity.similarity import Weights
from usdslf.strokes.paint import paint_stroke
from usdslf.strokes.stroke import Stroke
from usdslf.usd.build_stage import write_stage
from usdslf.usd.stroke_layer import write_strokes

Run = Callable[..., tuple[int, str, str]]
SIZE = (96, 54)
COLORS = {"red": (0.5, 0.08, 0.06), "like": (0.48, 0.09, 0.06), "blue": (0.06, 0.12, 0.5), "floor": (0.4, 0.4, 0.4)}
BALLS = {"red": -0.6, "like": 0.0, "blue": 0.6}
ONLY_POSITION, ONLY_REFLECTANCE = Weights(1, 0, 0), Weights(0, 0, 1)


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> usdslf.Shot:
    """Three balls, two of them nearly alike, on a floor."""
    parts = (
        Part("floor", panel((-2, 0, 1), (4, 0, 0), (0, 0, -2)), "floor"),
        *(Part(f"ball_{m}", ball(0.22, 24, 48).moved((x, 0.23, 0)), m) for m, x in BALLS.items()),
    )
    lamps = (Lamp("lamp", "rect", (9.0, 9.0, 9.0), (0.3, 2.0, 1.5), (0, 0.2, 0), (1.0, 1.0)),)
    materials = {m: {"diffuseColor": c, "roughness": 0.6} for m, c in COLORS.items()}
    shot = BuiltShot("balls", materials, parts, lamps, (View("camera", (0, 0.5, 2.6), (0, 0.25, 0)),))
    return Session(str(write_stage(shot, tmp_path_factory.mktemp("balls"))), elements=700).shot


@pytest.fixture
def session(opened: usdslf.Shot) -> Session:
    return Session(opened)


def dab(session: Session, name: str = "stroke_0001", **other: object) -> Stroke:
    """A dab in the middle of the red ball."""
    return paint_stroke(
        session.scene, session.tracer, session.camera(), [[at_of(session, "red")]], 0.02, (0.1, 0.3, 0.1), name=name,
        **other,
    )  # fmt: skip


def at_of(session: Session, material: str) -> tuple[float, float]:
    """The middle of a ball on the picture."""
    at, _ = project_points(session.camera(), [(BALLS[material], 0.23, 0.22)], SIZE[0] / SIZE[1])
    return float(at[0, 0]), float(at[0, 1])


def shown_at(picture: np.ndarray, at: tuple[float, float]) -> float:
    return float(picture[int(at[1] * SIZE[1]), int(at[0] * SIZE[0]), 0])


def test_the_painted_ball_is_most_similar_and_the_like_one_next(session: Session) -> None:
    picture = session.similarity(dab(session), size=SIZE)
    assert picture.shape == (SIZE[1], SIZE[0], 1)
    red, like, blue = (shown_at(picture, at_of(session, m)) for m in BALLS)  # pixels, half of one beside the dab
    assert red > 0.9 and red > like > blue + 0.3
    assert picture[0].max() == 0, "there is nothing in the sky"


def test_position_alone_falls_with_distance_and_reflectance_alone_does_not(session: Session) -> None:
    stroke = dab(session)
    position = session.similarity(stroke, size=SIZE, weights=ONLY_POSITION)
    row = [shown_at(position, at_of(session, m)) for m in BALLS]
    assert row[0] > row[1] > row[2] > 0
    reflectance = session.similarity(stroke, size=SIZE, weights=ONLY_REFLECTANCE)
    shown = session.render(size=SIZE, samples=1, aovs=("material",))["material"][..., 0]
    names = {m.path.rsplit("/", 1)[-1]: i for i, m in enumerate(session.scene.materials)}
    inner = lambda m: np.percentile(reflectance[shown == names[m]], [20, 80])  # noqa: E731
    assert np.allclose(inner("red"), 1) and inner("like")[0] > 0.9 and inner("blue")[1] < 0.1


def test_similarity_needs_a_stroke(session: Session) -> None:
    with pytest.raises(StrokeError, match="there is no stroke"):
        session.similarity([])


def test_the_command_writes_a_layer_or_a_grey_picture(session: Session, tmp_path: Path, run: Run) -> None:
    layer, png, exr = tmp_path / "strokes.usda", tmp_path / "s.png", tmp_path / "s.exr"
    stage = session.source.GetRootLayer().realPath
    write_strokes(layer, [dab(session)], session.stage)
    about = ("--aov", "similarity", "--strokes", layer, "--size", "96x54")
    code, out, err = run("render", stage, "-o", png, *about, "--stroke", "stroke_0001")
    assert (code, out.strip()) == (0, str(png)), err
    grey = oiio.ImageBuf(str(png))
    expected = session.similarity(dab(session), size=SIZE)
    assert grey.nchannels == 1 and np.allclose(grey.get_pixels(oiio.FLOAT), expected, atol=0.01)
    code, _, err = run("render", stage, "-o", exr, *about, "--elements", 300, "--bounces", 1, "--samples", 1)
    assert code == 0, err
    both = oiio.ImageBuf(str(exr))
    names = list(both.spec().channelnames)
    assert {"R", "G", "B", "similarity.Y"} == set(names)
    layer_of = both.get_pixels(oiio.FLOAT)[..., [names.index("similarity.Y")]]
    assert np.allclose(layer_of, expected, atol=1e-4)
    code, _, err = run("render", stage, "-o", png, *about, "--similarity", "0,0,1")
    assert code == 0, err
    by_reflectance = session.similarity(dab(session), size=SIZE, weights=Weights(0, 0, 1))
    assert np.abs(by_reflectance - expected).max() > 0.1
    assert np.allclose(oiio.ImageBuf(str(png)).get_pixels(oiio.FLOAT), by_reflectance, atol=0.01)


@pytest.mark.parametrize(
    ("more", "says"),
    [((), "--strokes"), (("--strokes", "LAYER", "--stroke", "nobody"), "has no stroke nobody; it has stroke_0001")],
)
def test_errors_say_what_is_missing(
    session: Session, tmp_path: Path, run: Run, more: tuple[str, ...], says: str
) -> None:
    layer = tmp_path / "strokes.usda"
    write_strokes(layer, [dab(session)], session.stage)
    given = [str(layer) if x == "LAYER" else x for x in more]
    stage = session.source.GetRootLayer().realPath
    code, _, err = run("render", stage, "-o", tmp_path / "s.png", "--aov", "similarity", *given)
    assert code != 0 and says in err, err
    assert not (tmp_path / "s.png").exists()


# ── scope similar ────────────────────────────────────────────────────────────────────────────────


def solved(session: Session, *more: Stroke, scope: str, **options: object) -> dict[str, np.ndarray]:
    """Change (3,) of the diffuse colour of each material that changes, after a dab row on the red ball."""
    x, y = at_of(session, "red")
    row = [(x + dx, y + dy) for dx in (-0.03, 0.0, 0.03) for dy in (-0.04, 0.04)]
    pixels = session.render(size=SIZE, samples=64)["color"]
    colors = [pixels[int(b * SIZE[1]), int(a * SIZE[0])] for a, b in row]
    wanted = np.repeat([np.float32([1.0, 2.5, 1.0]) * c for c in colors], 2, 0)  # greener by the same light
    stroke = paint_stroke(
        session.scene, session.tracer, session.camera(), [[p] for p in row], 0.012, name="stroke_0001", scope=scope
    )
    session.strokes = []
    for s in (replace(stroke, colors=wanted), *more):
        session.add_stroke(s)
    session.solve(**options)
    return {
        c.material.path.rsplit("/", 1)[-1]: c.after.diffuse - c.before.diffuse
        for c in session.changes()
    }  # fmt: skip


def test_scope_material_changes_one_and_similar_the_like_one_by_the_same(session: Session, tmp_path: Path) -> None:
    one = solved(session, scope="material")
    assert set(one) == {"red"} and one["red"][1] > 0.05, one
    two = solved(session, scope="similar")
    assert set(two) == {"red", "like"}, two
    np.testing.assert_allclose(two["like"], two["red"], atol=1e-6)
    (also,) = session.report()["strokes"][0]["also"]
    assert also["material"].endswith("/like")
    edits = session.author(tmp_path / "look.usda")
    assert {e.prim.split("/")[-2] for e in edits} == {"red", "like"} and all(e.wins for e in edits)
    after = session.edited(tmp_path / "look.usda").scene.materials
    (like,) = [m for m in after if m.path.endswith("/like")]
    np.testing.assert_allclose(like.diffuse_color, COLORS["like"] + two["like"], atol=1e-5)


def test_weights_say_what_is_alike(session: Session) -> None:
    assert set(solved(session, scope="similar", similarity=Weights(1, 0, 0))) == {"red"}


def test_a_fixated_material_is_left_out(session: Session) -> None:
    fixed = paint_stroke(
        session.scene, session.tracer, session.camera(), [[at_of(session, "like")]], 0.02, name="kept", tool="fixate"
    )
    assert set(solved(session, fixed, scope="similar")) == {"red"}


def test_what_is_like_two_painted_materials_changes_once(tmp_path: Path) -> None:
    """Three floors of nearly the same grey; the first and the second are painted in other colours."""
    b = StageBuilder(tmp_path)
    for i, (name, grey) in enumerate((("a", 0.4), ("b", 0.42), ("c", 0.41))):
        look = b.material(name, **{**GREY, "diffuseColor": (grey,) * 3})
        b.mesh(name, rectangle((-1, 0, 1 + 2.2 * i), (2, 0, 0), (0, 0, -2)), look)
    add_lamp(b)
    session = Session(str(b.save()), elements=300)
    second = places() + np.array([0, 0, 2.2])
    other = replace(dabs(seen(second, (0.1, 0.2, 0.6))), name="stroke_0002", points=np.repeat(np.float32(second), 2, 0))
    for s in (dabs(seen(places(), (0.6, 0.2, 0.1))), other):
        session.add_stroke(replace(s, scope="similar"))
    session.solve()
    changes = {c.material.path[-1]: c.after.diffuse for c in session.changes()}
    assert [c.material.path[-1] for c in session.changes()] == ["a", "b", "c"]
    np.testing.assert_allclose(changes["c"], changes["a"] + 0.01, atol=1e-5)
    edits = session.author(tmp_path / "look.usda")
    assert len({(e.prim, e.attribute) for e in edits}) == len(edits) == 3


def test_the_light_field_sees_the_change_of_what_is_alike(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    set_surface = LightField.set_surface
    monkeypatch.setattr(LightField, "set_surface", lambda f, s: (seen.append(s.diffuse), set_surface(f, s))[1])
    monkeypatch.setitem(vars(session.shot), "gathered", Gathered())  # nothing is known yet
    delta = solved(session, scope="similar")["like"]
    names = [m.path.rsplit("/", 1)[-1] for m in session.scene.materials]
    rows = session.elements.material == names.index("like")
    off = [np.abs(d[rows] - session.elements.diffuse[rows] - delta).max() for d in seen]
    assert min(off) < 1e-5, off


def test_solve_takes_the_weights(session: Session, tmp_path: Path, run: Run) -> None:
    solved(session, scope="similar")
    layer, look = tmp_path / "strokes.usda", tmp_path / "look.usda"
    write_strokes(layer, session.strokes, session.stage)
    given = ("solve", session.source.GetRootLayer().realPath, layer, "-o", look, "--elements", 700)
    code, out, err = run(*given)
    assert code == 0 and "and diffuse of" in out and "mtl/like" in out.replace("materials", "mtl"), (out, err)
    look.unlink()  # what it would say of an earlier look is not asked
    code, out, _ = run(*given, "--similarity", "1,0,0")
    assert code == 0 and "/like" not in out, out
    code, _, err = run(*given, "--similarity", "1,0")
    assert code == 2 and "three weights" in err
    code, _, err = run(*given, "--similarity", "0,0,0")
    assert code != 0 and "one above 0" in err


def test_a_material_that_is_similar_in_part_changes_there(tmp_path: Path) -> None:
    """A panel, left half like the painted ball, right half blue: a texture holds the change of the left."""
    b = StageBuilder(tmp_path)
    red, blue = (0.5, 0.08, 0.06), (0.06, 0.12, 0.5)
    image = np.zeros((64, 128, 3), np.float32)
    image[:, :64], image[:, 64:] = red, blue
    write_image(tmp_path / "halves.exr", 1.055 * image ** (1 / 2.4) - 0.055)  # sRGB
    b.mesh("ball", stage_ball(0.25), b.material("red", diffuseColor=red, roughness=0.6), (-0.8, 0.3, 0.3))
    panel = b.material("panel", diffuseColor=TextureInput("halves.exr"), roughness=0.6)
    b.mesh("panel", rectangle((-0.4, 0, 0), (1.2, 0, 0), (0, 0.8, 0)), panel)
    b.dome_light("sky", 0.5, (1.0, 1.0, 1.0))
    b.camera((0, 0.6, 3.0), (0, 0.35, 0))
    session = Session(str(b.save()), elements=700)
    camera = session.camera()
    places = [(-0.8 + dx, 0.3 + dy, 0.54) for dx in (-0.06, 0, 0.06) for dy in (-0.05, 0.05)]
    at, _ = project_points(camera, places, 16 / 9)
    painted = paint_stroke(
        session.scene, session.tracer, camera, [[p] for p in at], 0.012, (0.2, 0.45, 0.1), name="stroke_0001",
        scope="similar", aspect=16 / 9,
    )  # fmt: skip
    session.add_stroke(painted)
    session.solve()
    (said,) = [w for w in session.warnings if "is similar; that part of it changes" in w]
    assert "/World/mtl/panel" in said
    edits = session.author(tmp_path / "look.usda")
    assert {e.representation for e in edits} == {"constant", "texture"} and all(e.wins for e in edits)
    other = session.edited(tmp_path / "look.usda")
    x = np.array([(u, 0.4, 0.0) for u in (-0.3, -0.1, 0.1, 0.3, 0.5, 0.7)])
    before, after = surface_at(session.scene, x).diffuse, surface_at(other.scene, x).diffuse
    on_ball = np.array([(-0.8, 0.3, 0.55)])
    delta = surface_at(other.scene, on_ball).diffuse - surface_at(session.scene, on_ball).diffuse
    assert np.abs(delta).max() > 0.1
    np.testing.assert_allclose(after[:3] - before[:3], np.repeat(delta, 3, 0), atol=0.02)
    np.testing.assert_array_equal(after[3:], before[3:])
    also = {a["material"]: a for a in session.report()["strokes"][0]["also"]}
    moved = np.subtract(also["/World/mtl/panel"]["after"]["diffuse"], also["/World/mtl/panel"]["before"]["diffuse"])
    np.testing.assert_allclose(moved, delta[0] / 2, atol=0.03)  # half of its area
