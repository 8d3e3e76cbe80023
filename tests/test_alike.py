"""Similarity to a stroke as a picture: what was painted has all of it, and position alone falls with distance."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from usdslf.demo_shapes import ball, panel
from usdslf.errors import StrokeError
from usdslf.propagate import Weights
from usdslf.session import Session
from usdslf.shot import Lamp, Part, Shot, View
from usdslf.strokes import Stroke, paint_stroke
from usdslf.usd.build_stage import write_stage
from usdslf.usd.stroke_layer import write_strokes

Run = Callable[..., tuple[int, str, str]]
SIZE = (96, 54)
COLORS = {"red": (0.5, 0.08, 0.06), "like": (0.48, 0.09, 0.06), "blue": (0.06, 0.12, 0.5), "floor": (0.4, 0.4, 0.4)}
BALLS = {"red": -0.6, "like": 0.0, "blue": 0.6}
ONLY_POSITION, ONLY_REFLECTANCE = Weights(1, 0, 0), Weights(0, 0, 1)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Three balls, two of them nearly alike, on a floor."""
    parts = (
        Part("floor", panel((-2, 0, 1), (4, 0, 0), (0, 0, -2)), "floor"),
        *(Part(f"ball_{m}", ball(0.22, 24, 48).moved((x, 0.23, 0)), m) for m, x in BALLS.items()),
    )
    lamps = (Lamp("lamp", "rect", (9.0, 9.0, 9.0), (0.3, 2.0, 1.5), (0, 0.2, 0), (1.0, 1.0)),)
    materials = {m: {"diffuseColor": c, "roughness": 0.6} for m, c in COLORS.items()}
    shot = Shot("balls", materials, parts, lamps, (View("camera", (0, 0.5, 2.6), (0, 0.25, 0)),))
    return Session(str(write_stage(shot, tmp_path_factory.mktemp("balls"))), elements=700)


def dab(session: Session, name: str = "stroke_0001", **other: object) -> Stroke:
    """A dab in the middle of the red ball."""
    return paint_stroke(
        session.scene, session.tracer, session.camera(), [[at_of(session, "red")]], 0.02, (0.1, 0.3, 0.1), name=name,
        **other,
    )  # fmt: skip


def at_of(session: Session, material: str) -> tuple[float, float]:
    """The middle of a ball on the picture."""
    from usdslf.camera_rays import project_points

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
    stage = session.shot.GetRootLayer().realPath
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
    stage = session.shot.GetRootLayer().realPath
    code, _, err = run("render", stage, "-o", tmp_path / "s.png", "--aov", "similarity", *given)
    assert code != 0 and says in err, err
    assert not (tmp_path / "s.png").exists()
