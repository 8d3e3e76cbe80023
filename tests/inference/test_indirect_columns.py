"""Columns of indirect strokes against the full light field, changed a little and sent round, and against a textbook.

The first scene: a floor of three kinds that sees a wall and a box under a lamp and a sky.  The second: a small pad
before a panel that parallel light meets head on; nothing else shines.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, box, rectangle
from pxr import UsdLux
from reference.indirect import panel_columns

import usdslf
from usdslf.inference.candidate import Candidate
from usdslf.inference.direct import gather_strokes
from usdslf.inference.joint_fit import Change, radiance_of
from usdslf.inference.receivers import Receiver, carried, make_receiver, receiver_tables, rows_in_sight

FLOORS = {
    "mirror": {"diffuseColor": (0.9, 0.9, 0.9), "metallic": 1.0, "roughness": 0.0},
    "glossy": {"diffuseColor": (0.3, 0.3, 0.3), "metallic": 0.6, "roughness": 0.3},
    "diffuse": {"diffuseColor": (0.6, 0.55, 0.5), "roughness": 0.9},
}
WALL = {"diffuseColor": (0.5, 0.3, 0.2), "roughness": 0.4}


@dataclass(frozen=True)
class Seen:
    session: Any
    receivers: list[Receiver]
    material: int


def _stage(folder: Path, floor: dict) -> Path:
    b = StageBuilder(folder)
    ground, wall = b.material("floor", **floor), b.material("wall", **WALL)
    green = b.material("green", diffuseColor=(0.2, 0.5, 0.25), roughness=0.5)
    b.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), ground)
    b.mesh("wall", rectangle((-1, 0, -1), (2, 0, 0), (0, 1.2, 0)), wall)
    b.mesh("box", box(0.4, 0.6, 0.4), green, (0.5, 0, -0.4), 20.0)
    b.rect_light("lamp", (-0.3, 1.8, 1.2), (0, 0.3, -0.6), 0.8, 0.8, (9.0, 8.5, 8.0))
    b.dome_light("sky", 0.3, (0.8, 0.9, 1.0))
    b.camera((0.0, 0.9, 2.4), (0.0, 0.1, -0.2), 36)
    return b.save()


def _dabs(session: Any, xy: list[tuple[float, float]]) -> Any:
    paths = [np.array([p]) for p in xy]
    return usdslf.paint_stroke(
        session.scene, session.tracer, session.camera(), paths, 0.012, aspect=4 / 3, mode="indirect"
    )


def _receiver(session: Any, xy: list[tuple[float, float]]) -> Receiver:
    stroke = _dabs(session, xy)
    field = session.light_field
    (painted,) = gather_strokes([stroke], session.scene, session.tracer, field, session.light_set, [])
    return make_receiver(painted, painted.evidence(field), field, False)


@pytest.fixture(scope="module", params=FLOORS)
def seen(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Seen:
    folder = tmp_path_factory.mktemp(request.param)
    session = usdslf.open(str(_stage(folder, FLOORS[request.param])), elements=700)
    for _ in session.light_field.converge(40, 1e-6):
        pass
    xy = [(0.3, 0.62), (0.36, 0.58), (0.42, 0.6), (0.36, 0.66), (0.48, 0.57), (0.45, 0.64)]
    material = next(i for i, m in enumerate(session.scene.materials) if m.path.endswith("wall"))
    return Seen(session, [_receiver(session, xy)], material)


@pytest.mark.parametrize("name", ["diffuse", "f0", "roughness"])
def test_columns_are_what_one_bounce_of_the_changed_light_field_brings(seen: Seen, name: str) -> None:
    field = seen.session.light_field
    start, as_it_was_d = field.surface, field.outgoing_d.copy()
    own = float(start.roughness[field.elements.material == seen.material].mean())
    tables, _ = receiver_tables(seen.receivers, seen.material, start, field, np.array([own + 0.1]))
    rows = field.elements.material == seen.material
    step = 0.1 if name == "roughness" else 0.02
    try:
        field.bounce()
        before = radiance_of(seen.receivers, field)
        field.set_surface(start.with_rows(rows, **{name: getattr(start, name)[rows] + np.float32(step)}))
        field.outgoing_d = as_it_was_d.copy()
        field.bounce()
        change = radiance_of(seen.receivers, field) - before
    finally:
        field.set_surface(start)
        field.outgoing_d = as_it_was_d
    foreseen = {
        "diffuse": step * tables.dabs.u[:, tables.own],
        "f0": step * tables.dabs.v[:, tables.own],
        "roughness": tables.dabs.p[:, 0] - tables.dabs.p[:, tables.own],
    }[name]
    assert np.abs(change).max() > 1e-5
    np.testing.assert_allclose(foreseen.sum(0), change.sum(0), rtol=0.02)
    assert np.abs(foreseen - change).max() < 0.02 * np.abs(change).max()


def test_the_present_is_among_the_tables(seen: Seen) -> None:
    field = seen.session.light_field
    tables, as_metal = receiver_tables(seen.receivers, seen.material, field.surface, field)
    now = radiance_of(seen.receivers, field)
    np.testing.assert_allclose(tables.dabs.p[:, tables.own], now, rtol=1e-3)
    # a metal whose F0 is the wall's diffuse colour is brighter than one whose F0 is the dielectric's
    assert as_metal is not None and (as_metal.dabs.v > 0).all()
    assert (as_metal.before < now).all()


def test_a_factor_on_a_varying_f0_is_foreseen_too(seen: Seen) -> None:
    """As of a textured metallic or specularColor: what is bright changes most, by a factor of all of it."""
    field = seen.session.light_field
    start, as_it_was_d = field.surface, field.outgoing_d.copy()
    rows = np.flatnonzero(field.elements.material == seen.material)
    varied = start.with_rows(rows, f0=np.random.default_rng(3).uniform(0.05, 0.6, (len(rows), 3)))
    try:
        field.set_surface(varied)
        field.bounce()
        before = radiance_of(seen.receivers, field)
        field.outgoing_d = as_it_was_d.copy()
        tables, _ = receiver_tables(seen.receivers, seen.material, varied, field)
        field.set_surface(varied.with_rows(rows, f0=1.1 * varied.f0[rows]))
        field.bounce()
        change = radiance_of(seen.receivers, field) - before
    finally:
        field.set_surface(start)
        field.outgoing_d = as_it_was_d
    factor = Candidate(("specular",), delta_f0=np.full(3, 0.1), is_factor=True, level=tables.own)
    assert tables.is_textured_f0 and np.abs(change).max() > 1e-5
    np.testing.assert_allclose((factor.radiance(tables) - tables.before).sum(0), change.sum(0), rtol=0.02)
    low, high = Change.of(seen.material, replace(factor, freedoms=3), tables).bounds
    np.testing.assert_allclose(tables.f0 * (1 + low), 0, atol=1e-9)
    np.testing.assert_allclose(tables.f0 * (1 + high), 1, rtol=1e-6)


RECEIVERS = {
    "diffuse": {"diffuse": 0.5, "f0": 0.0, "roughness": 0.9},
    "glossy": {"diffuse": 0.2, "f0": 0.4, "roughness": 0.35},
}
EYE, POINT = np.array([0.0, 0.5, 1.2]), np.array([0.0, 0.0, 0.0])


@pytest.mark.parametrize("kind", RECEIVERS)
def test_columns_are_the_textbook_s(kind: str, tmp_path: Path) -> None:
    """A panel at z = -0.7, 1.6 x 1.2, of roughness .5, under light along -z."""
    look, b = RECEIVERS[kind], StageBuilder(tmp_path)
    grey = lambda v: (v, v, v)  # noqa: E731
    pad = b.material(
        "pad", useSpecularWorkflow=1, diffuseColor=grey(look["diffuse"]), specularColor=grey(look["f0"]),
        roughness=look["roughness"],
    )  # fmt: skip
    wall = b.material(
        "panel", useSpecularWorkflow=1, diffuseColor=grey(0.4), specularColor=grey(0.1), roughness=0.5
    )
    b.mesh("pad", rectangle((-0.1, 0, 0.1), (0.2, 0, 0), (0, 0, -0.2)), pad)
    b.mesh("panel", rectangle((-0.8, 0.05, -0.7), (1.6, 0, 0), (0, 1.2, 0)), wall)
    b.distant_light("sun", (0, 0, -1), 0.0, 2.0)
    UsdLux.DistantLight.Get(b.stage, "/World/sun").GetAngleAttr().Set(0.5)
    b.camera(tuple(EYE), tuple(POINT), 20)
    session = usdslf.open(str(b.save()), elements=1200)
    receiver = _receiver(session, [(0.5, 0.5), (0.49, 0.51), (0.51, 0.49)])
    field = session.light_field
    material = next(i for i, m in enumerate(session.scene.materials) if m.path.endswith("panel"))
    rows = rows_in_sight([receiver], material, field)
    expected = panel_columns(
        (-0.8, 0.05, -0.7), (1.6, 0, 0), (0, 1.2, 0), 0.5, (0, 0, 1), 2.0, {**look, "f90": 1.0}, POINT, (0, 1, 0), EYE
    )
    for k in range(4):
        weights = np.zeros((len(rows), 4, 3), np.float32)
        weights[:, k] = 1
        found = carried([receiver], field, field.respond(rows, weights, field.surface.roughness[rows])).mean()
        assert found == pytest.approx(expected[k], rel=0.05, abs=0.004 * expected.max()), "XYAB"[k]
    # the table of a diffuse change is made of them: (1 - F0) X + (1 - F90) Y
    tables, _ = receiver_tables([receiver], material, field.surface, field)
    assert tables.dabs.u[:, tables.own].mean() == pytest.approx(0.9 * expected[0], rel=0.04)
