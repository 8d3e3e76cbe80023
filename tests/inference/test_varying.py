"""Answers that vary: a gradient asks for one, an uneven hand does not; textures say it, and are read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.varying_floor import gradient, places, seen, stroke, surface_at, write_floor
from pxr import Usd

import usdslf
from usdslf.geometry import closest_point, uv_layout
from usdslf.geometry.uv_layout import lies_flat
from usdslf.session import Session
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    return usdslf.open(str(write_floor(tmp_path_factory.mktemp("floor"))), elements=400).shot


@pytest.fixture
def session(opened: Shot) -> Session:
    return Session(opened)


def solve(session: Session, painted: Stroke) -> dict:
    session.strokes, session.warnings = [painted], []
    session.solve()
    return session.report()["strokes"][0]


def test_a_gradient_varies_and_its_texture_reads_back_as_painted(session: Session, tmp_path: Path) -> None:
    found = solve(session, stroke(seen(places(), gradient(places()))))
    assert found["inferred"] == "diffuse" and found["varies"], found
    assert found["residual_after"] < 0.05 < found["residual_before"]
    look = tmp_path / "look.usda"
    (file, *_) = [e for e in session.author(look) if e.attribute == "inputs:file"]
    assert file.representation == "texture" and all(e.wins for e in session.edits)
    other = session.edited(look)
    got = surface_at(other.scene, places()).diffuse
    np.testing.assert_allclose(got, gradient(places()), atol=0.05)
    # the shot itself is as it was, and a second time gives the same bytes
    files = sorted((tmp_path / "look.textures").iterdir())
    before = [f.read_bytes() for f in [look, *files]]
    session.author(look)
    assert [f.read_bytes() for f in [look, *sorted((tmp_path / "look.textures").iterdir())]] == before


def test_without_texture_coordinates_the_points_carry_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = usdslf.open(str(write_floor(tmp_path, points_on_a_side=33)), elements=400)
    sorted_, sort = [], closest_point._Spheres.__init__
    monkeypatch.setattr(closest_point._Spheres, "__init__", lambda s, *a: (sorted_.append(len(a[0])), sort(s, *a))[1])
    found = solve(session, stroke(seen(places(), gradient(places()))))
    assert found["varies"]
    assert len(sorted_) <= 2, sorted_  # those of the scene for the stroke, those of the material for all its changes
    look = tmp_path / "look.usda"
    (edit,) = session.author(look)
    assert (edit.representation, edit.attribute, edit.wins) == ("primvar", "primvars:slf:diffuseColor", True)
    other = session.edited(look)
    np.testing.assert_allclose(surface_at(other.scene, places()).diffuse, gradient(places()), atol=0.05)
    session.author(tmp_path / "again.usda")
    assert Usd.Stage.Open(str(look)).GetAttributeAtPath("/World/floor.primvars:slf:diffuseColor").HasValue()


def test_coordinates_without_area_are_none(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(session.scene)
    every = np.arange(len(scene.triangles.mesh))
    drawn, draw = [], uv_layout.texel_points
    monkeypatch.setattr(uv_layout, "texel_points", lambda uv, *a: (drawn.append(len(uv)), draw(uv, *a))[1])
    assert lies_flat(scene, every, "st")
    collapsed = tuple(replace(m, uvs={k: 0 * v for k, v in m.uvs.items()}) for m in scene.meshes)
    assert not lies_flat(replace(scene, meshes=collapsed), every, "st")
    assert lies_flat(scene, every, "st") and lies_flat(scene, every[1:], "st")
    assert drawn == [len(every), len(every), len(every) - 1]  # the same is drawn once


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_uneven_hand_asks_for_a_constant(session: Session, seed: int, tmp_path: Path) -> None:
    """10 % of smooth drift, 5 % of tint, as in the recovery suite."""
    rng = np.random.default_rng(seed)
    p = places()
    drift = 1 + 0.1 * np.sin(p[:, :1] * rng.uniform(2, 4) + p[:, 2:] * rng.uniform(-3, 3) + rng.uniform(0, 6))
    colors = seen(p, np.tile([0.55, 0.2, 0.1], (len(p), 1))) * drift * (1 + 0.05 * rng.normal(size=3))
    found = solve(session, stroke(colors))
    assert found["inferred"] == "diffuse" and not found["varies"]
    assert {e.representation for e in session.author(tmp_path / "look.usda")} == {"constant"}
    assert not (tmp_path / "look.textures").exists()


def test_one_colour_asks_for_a_constant(session: Session) -> None:
    assert not solve(session, stroke(np.full((32, 3), 0.3)))["varies"]


def test_l0_and_l2_do_not_vary(session: Session) -> None:
    painted = stroke(seen(places(), gradient(places())))
    for norm in ("l0", "l2"):
        assert not solve(session, replace(painted, norm=norm))["varies"]


def test_without_strokes_nothing_of_it_stays(session: Session, tmp_path: Path) -> None:
    solve(session, stroke(seen(places(), gradient(places()))))
    look = tmp_path / "look.usda"
    session.author(look)
    session.remove_stroke("stroke_0001")
    assert session.author(look) == []
    stage = Usd.Stage.Open(str(look))
    assert not [p for p in stage.TraverseAll() if p.GetAuthoredAttributes()]
