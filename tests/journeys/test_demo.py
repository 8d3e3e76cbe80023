"""The demo infers what its strokes were painted for, and writes layers that plain USD opens."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd
from reference.mitsuba_setup import why_no_pathtracer

from usdslf.gallery import demo
from usdslf.gallery.still_life import MATERIALS, RADIUS, STROKES, TRUTH, build
from usdslf.procedural.shapes import QuadMesh, ball, curve, lathe, rounded_box, torus, tube
from usdslf.usd.build_stage import write_stage

INPUTS = {"diffuse": "diffuseColor", "specular": "specularColor", "glossiness": "roughness"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's folder, with small pictures."""
    out = tmp_path_factory.mktemp("demo")
    lines = list(demo.run_demos((), False, out, None, None, None, lambda step, share: None, size=(64, 36), samples=1))
    assert sum(": shown" in line for line in lines) == 3, lines
    return out / "still_life"


def test_each_stroke_names_its_parameter_and_finds_its_value(folder: Path) -> None:
    found = json.loads((folder / "report.json").read_text())["strokes"]
    assert [s["inferred"] for s in found] == ["diffuse", "specular", "glossiness"]
    for stroke in found:
        name = INPUTS[stroke["inferred"]]
        truth = TRUTH[stroke["material"].rsplit("/", 1)[-1]][name]
        value = stroke["after"]["roughness" if name == "roughness" else stroke["inferred"]]
        tolerance = 0.07 if name == "roughness" else 0.05
        assert np.abs(np.subtract(value, truth)).max() < tolerance, (stroke["material"], value, truth)
        assert stroke["residual_after"] < 0.5 * stroke["residual_before"]


def test_all_that_is_promised_is_there(folder: Path) -> None:
    for name in ("shot.usda", "strokes.usda", "look.usda", "review.usda", "report.json"):
        assert (folder / name).stat().st_size > 0
    for name in ("before.png", "after.png", "strokes.png"):
        assert (folder / name).read_bytes()[:4] == b"\x89PNG"
    assert "after.png" in (folder.parent / "index.html").read_text()


def test_the_review_root_shows_the_look(folder: Path) -> None:
    stage = Usd.Stage.Open(str(folder / "review.usda"))
    assert not stage.GetCompositionErrors()
    assert stage.GetDefaultPrim().GetName() == "still_life"
    changed = {m: next(iter(inputs)) for m, inputs in TRUTH.items()}
    for material, name in changed.items():
        value = stage.GetAttributeAtPath(f"/still_life/materials/{material}/surface.inputs:{name}").Get()
        assert not np.allclose(value, MATERIALS[material][name], atol=0.05)


def test_the_shot_is_the_same_every_time(tmp_path: Path) -> None:
    first, second = (tmp_path / n for n in ("a", "b"))
    for place in (first, second):
        place.mkdir()
        write_stage(build(place), place)
    for name in ("shot.usda", "objects.usdc"):
        assert (first / name).read_bytes() == (second / name).read_bytes()


@pytest.mark.parametrize(
    "make",
    [
        lambda: ball(1.0),
        lambda: torus(1.0, 0.3),
        lambda: rounded_box((1, 2, 3), 0.2),
        lambda: lathe(curve([(0, 0), (0.3, 0), (0.4, 0.3), (0.2, 0.6), (0, 0.6)], 40)),
        lambda: tube(curve([(0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 2, 1)], 30), np.linspace(0.1, 0.05, 30)),
    ],
)
def test_normals_of_shapes_are_those_of_their_faces(make: Callable[[], QuadMesh]) -> None:
    shape = make()
    corners = shape.points[shape.quads]
    face = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    area = np.linalg.norm(face, axis=1)
    mean = shape.normals[shape.quads].mean(1)
    living = area > 1e-9
    cosine = (face * mean).sum(1)[living] / (area * np.linalg.norm(mean, axis=1))[living]
    assert cosine.min() > 0.98
    assert np.allclose(np.linalg.norm(shape.normals, axis=1), 1)


def test_the_volume_of_a_ball_and_a_torus() -> None:
    for shape, volume in ((ball(1.0), 4 / 3 * np.pi), (torus(1.0, 0.3), 2 * np.pi**2 * 0.3**2)):
        p = shape.points[shape.quads]
        signed = sum(np.einsum("fi,fi->f", p[:, 0], np.cross(p[:, i], p[:, i + 1])) for i in (1, 2)) / 6
        assert signed.sum() == pytest.approx(volume, rel=0.02)


@pytest.mark.skipif(bool(why_no_pathtracer()), reason=why_no_pathtracer())
def test_the_painted_colours_are_those_of_the_changed_scene(tmp_path: Path) -> None:
    from reference.pathtracer import Tracer, camera_rays

    shot = build(tmp_path)
    stage = Usd.Stage.Open(str(write_stage(shot.changed(TRUTH), tmp_path, "truth.usda")))
    tracer = Tracer(stage, "smith", max_depth=6)
    rng, paths = np.random.default_rng(1), 8192
    for script in STROKES:
        painted = np.array([rgb for rgb, places in script.dabs for _ in places])
        places = np.array([p for _, places in script.dabs for p in places])
        # Paths through the disk of each dab, in a picture of 800 x 450.
        r = RADIUS * 450 * np.sqrt(rng.random((len(places), paths)))
        turn = rng.random(r.shape) * 2 * np.pi
        at = (places[:, None] + np.stack([r * np.cos(turn), r * np.sin(turn)], -1)) / (800, 450)
        origins, directions = camera_rays(stage, shot.view_path(), at.reshape(-1, 2), 800 / 450)
        seen = tracer.radiance(origins, directions, seed=7).reshape(*r.shape, 3).mean(1)
        # Few colours stand for many: a dab is a quarter off at most, or a little in the dark.
        error = np.abs(painted - seen) / (seen + 0.05)
        assert error.max() < 0.35 and error.mean() < 0.1, (script.intent, error.round(2))
