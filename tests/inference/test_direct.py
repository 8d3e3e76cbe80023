"""Whom a change reaches: scopes, pools and kinds of surface, on planes under a white dome, where the light is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.stage_parts import StageBuilder
from pxr import UsdGeom
from reference.reflectance import albedo
from reference.solve import radiance

import usdslf
from usdslf.inference.direct import gather_strokes, infer_changes
from usdslf.inference.first_answers import Asking
from usdslf.session import Session
from usdslf.strokes.stroke import Stroke

LOOK = {"diffuse": (0.5, 0.4, 0.3), "f0": (0.04,) * 3, "f90": (1.0,) * 3, "roughness": 0.4}
RED = LOOK | {"diffuse": (0.7, 0.1, 0.1)}
EYE = np.array([0.0, 0.0, 3.0])
AT = {"left": -3.0, "middle": 0.0, "right": 3.0, "metal": 6.0}  # x of each plane's centre
GOLD, COPPER = (0.9, 0.7, 0.3), (0.8, 0.4, 0.3)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Three planes of 2 x 2 beside each other, two of one material, and one of metal."""
    b = StageBuilder(tmp_path_factory.mktemp("planes"))
    inputs = {
        "useSpecularWorkflow": 1.0, "diffuseColor": LOOK["diffuse"], "specularColor": LOOK["f0"], "roughness": 0.4,
    }  # fmt: skip
    shared, other = b.material("shared", **inputs), b.material("other", **inputs)
    metal = b.material("metal", diffuseColor=GOLD, metallic=1.0, roughness=0.4)
    for (name, x), look in zip(AT.items(), (shared, shared, other, metal)):
        plane = UsdGeom.Plane.Define(b.stage, f"/World/{name}")
        plane.CreateAxisAttr("Z")
        b._place(plane, look, (x, 0, 0), 0.0)
    b.dome_light("sky", 1.0)
    return usdslf.open(str(b.save()), elements=200)


def stroke_on(name: str, look: dict, stroke: str = "s", spread: float = 0.6, **other: object) -> Stroke:
    """Nine small dabs on a plane, with the radiance that another look would have."""
    u, v = (x.ravel() for x in np.meshgrid(*[np.linspace(-spread, spread, 3)] * 2))
    points = np.stack([AT[name] + u, v, 0 * u], 1)
    towards = EYE - points
    cosine = towards[:, 2] / np.linalg.norm(towards, axis=1)
    columns = albedo("preview_surface", look["roughness"], cosine)[..., None] * np.ones(3)
    colors = radiance("preview_surface", columns, look["diffuse"], look["f0"], look["f90"])
    twice = lambda x: np.repeat(np.float32(x), 2, 0)  # noqa: E731
    return Stroke(
        stroke, twice(points), np.full(18, 0.05, np.float32), twice(colors), np.tile(np.float32(EYE), (18, 1)),
        curve_counts=(2,) * 9, **other,
    )  # fmt: skip


def changed(session: Session, *strokes: Stroke) -> tuple[list, np.ndarray, object]:
    """Answers, the elements (N,) that they changed, and the reflectance that these have now."""
    field, original = session.light_field, session.light_field.surface
    try:
        painted = gather_strokes(list(strokes), session.scene, session.tracer, field, session.light_set, [])
        *_, answers = infer_changes(painted, Asking(session.scene, field))
        surface = field.surface
    finally:
        field.set_surface(original)
        for _ in field.converge(8):
            pass
    moved = [
        np.abs(getattr(surface, k) - getattr(original, k)).reshape(len(original.roughness), -1).max(1) > 1e-4
        for k in ("diffuse", "f0", "f90", "roughness")
    ]
    return answers, np.any(moved, 0), surface


def elements_of(session: Session, *names: str) -> np.ndarray:
    paths = np.array([m.path for m in session.scene.meshes])
    return np.isin(paths[session.elements.mesh], [f"/World/{n}" for n in names])


def test_a_change_reaches_its_scope_and_no_further(session: Session) -> None:
    for scope, reached in (("material", ("left", "middle")), ("prim", ("left",))):
        (answer,), moved, surface = changed(session, stroke_on("left", RED, scope=scope))
        assert answer.chosen.id == "diffuse"
        np.testing.assert_array_equal(moved, elements_of(session, *reached))
        np.testing.assert_allclose(
            surface.diffuse[moved], answer.after["diffuse"][None].repeat(moved.sum(), 0), atol=1e-6
        )
        np.testing.assert_allclose(answer.after["diffuse"], RED["diffuse"], atol=0.01)


def test_a_change_of_the_stroke_alone_reaches_what_the_brush_covered(session: Session) -> None:
    wide = stroke_on("left", RED, spread=0.25, scope="stroke")
    wide = replace(wide, widths=np.full(18, 0.4, np.float32))
    _, moved, _ = changed(session, wide)
    gap = np.linalg.norm(session.elements.position[:, None] - wide.points[None], axis=2).min(1)
    assert moved.any()
    np.testing.assert_array_equal(moved, (gap < 0.2) & elements_of(session, "left"))


def test_strokes_on_one_material_are_asked_together_and_others_apart(session: Session) -> None:
    strokes = [
        stroke_on("left", RED, "a"),
        stroke_on("middle", RED, "b"),
        stroke_on("right", LOOK | {"diffuse": (0.1, 0.2, 0.6)}, "c"),
    ]
    answers, moved, surface = changed(session, *strokes)
    by_strokes = {a.pool.strokes: a for a in answers}
    assert by_strokes.keys() == {(0, 1), (2,)}
    np.testing.assert_allclose(by_strokes[0, 1].after["diffuse"], RED["diffuse"], atol=0.01)
    np.testing.assert_allclose(by_strokes[(2,)].after["diffuse"], (0.1, 0.2, 0.6), atol=0.01)
    np.testing.assert_array_equal(moved, elements_of(session, "left", "middle", "right"))
    blue = elements_of(session, "right")
    np.testing.assert_allclose(surface.diffuse[blue], np.tile([[0.1, 0.2, 0.6]], (blue.sum(), 1)), atol=0.01)


def test_the_edge_of_a_metal_s_lobe_follows_its_color(session: Session) -> None:
    look = {"diffuse": (0.0,) * 3, "f0": COPPER, "f90": COPPER, "roughness": 0.4}
    (answer,), moved, surface = changed(session, stroke_on("metal", look))
    assert answer.chosen.id == "specular"
    np.testing.assert_allclose(answer.before["specular"], GOLD, atol=1e-5)
    np.testing.assert_allclose(answer.after["specular"], COPPER, atol=0.01)
    np.testing.assert_array_equal(moved, elements_of(session, "metal"))
    np.testing.assert_array_equal(surface.f90[moved], surface.f0[moved])


def test_nothing_wanted_changes_nothing(session: Session) -> None:
    (answer,), moved, _ = changed(session, stroke_on("left", LOOK))
    assert answer.chosen.id == "none" and not moved.any()
    assert answer.residual_after < 0.02


def test_a_stroke_across_two_materials_says_which_it_changes(session: Session) -> None:
    mostly, rest = stroke_on("middle", RED), stroke_on("right", RED)
    few = slice(0, 6)  # three of nine dabs
    names = ("points", "widths", "colors", "eye")
    joined = {k: np.concatenate([getattr(mostly, k), getattr(rest, k)[few]]) for k in names}
    both = replace(mostly, **joined, curve_counts=(2,) * 12, surfaces=("/World/right", "/World/middle"))
    session.warnings.clear()
    session.add_stroke(both)
    try:
        (answer,) = session.solve()
        (report,) = session.report()["strokes"]
        (said,) = (w for w in session.warnings if "stroke of its own" in w)
    finally:
        session.remove_stroke(both.name)
    paths = [m.path for m in session.scene.materials]
    assert "25% of it lies on /World/mtl/other, which it does not change, as most lies on /World/mtl/shared" in said
    assert paths[answer.pool.material] == report["material"] == "/World/mtl/shared"
    assert report["surface"] == "/World/middle"  # not the first that it lists, which shows another material
