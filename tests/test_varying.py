"""Answers that vary: a gradient asks for one, an uneven hand does not; textures say it, and are read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade, Vt
from reference import evidence as ref
from reference.solve import radiance
from stage_parts import StageBuilder, rectangle

import usdslf
from usdslf.nearest import nearest_on_triangles
from usdslf.session import Session
from usdslf.strokes import Stroke
from usdslf.style_textures import lies_flat
from usdslf.surface import evaluate_surface

EYE = np.array([0.3, 2.2, 1.6])
LAMP, SIZE, POWER = np.array([-0.6, 1.6, 0.5]), (0.9, 0.7), np.array([6.0, 5.6, 5.0])
ROUGHNESS, F0 = 0.6, 0.04
LEFT, RIGHT = np.array([0.7, 0.12, 0.08]), np.array([0.08, 0.15, 0.6])


def write_floor(folder: Path, points_on_a_side: int = 0) -> Path:
    """A grey floor of 2 x 2 under a rect light that shines down: with texture coordinates, or points without."""
    b = StageBuilder(folder)
    look = b.material(
        "floor", useSpecularWorkflow=1.0, diffuseColor=(0.4, 0.4, 0.4), specularColor=(F0,) * 3, roughness=ROUGHNESS
    )
    if points_on_a_side:
        grid(b.stage, points_on_a_side, look)
    else:
        b.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), look)
    light = UsdLux.RectLight.Define(b.stage, "/World/lamp")
    light.CreateWidthAttr(SIZE[0])
    light.CreateHeightAttr(SIZE[1])
    light.CreateIntensityAttr(1.0)
    light.CreateColorAttr(Gf.Vec3f(*POWER))
    light.AddTranslateOp().Set(Gf.Vec3d(*LAMP))
    light.AddRotateXOp().Set(-90.0)
    b.camera(tuple(EYE), (0, 0, 0))
    return b.save()


def grid(stage: Usd.Stage, n: int, look: str) -> None:
    """The floor as n x n points, turned and moved by its transform."""
    mesh = UsdGeom.Mesh.Define(stage, "/World/floor")
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.float32(np.stack([u, v - 3, 0 * u], 1))))
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.int32(np.stack([i, i + 1, i + n + 1, i + n], 1)).ravel()))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(i), 4))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.AddRotateXOp().Set(-90.0)
    mesh.AddTranslateOp().Set(Gf.Vec3d(0, 3, 0))
    material = UsdShade.Material(stage.GetPrimAtPath(look))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def seen(points: np.ndarray, diffuse: np.ndarray) -> np.ndarray:
    """Radiance (n, 3) of the floor from the eye with a diffuse colour of each point, by quadrature over the lamp."""
    columns = []
    for p in points:
        u, v = (np.arange(48) + 0.5) / 48 - 0.5, (np.arange(48) + 0.5) / 48 - 0.5
        offset = np.broadcast_arrays(u[:, None] * SIZE[0], 0 * u[:, None], v[None] * SIZE[1])
        at = LAMP + np.stack(offset, -1).reshape(-1, 3)
        way = at - p
        far = np.linalg.norm(way, axis=1)
        l = way / far[:, None]
        solid = l[:, 1] / far**2 * SIZE[0] * SIZE[1] / 48**2
        columns.append(ref.columns_of_light("preview_surface", ROUGHNESS, [0, 1, 0], EYE - p, l, solid))
    return radiance("preview_surface", np.array(columns)[..., None] * POWER, diffuse, (F0,) * 3, (1, 1, 1))


def places() -> np.ndarray:
    x, z = np.meshgrid(np.linspace(-0.7, 0.7, 8), np.linspace(-0.4, 0.6, 4))
    return np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], 1)


def gradient(points: np.ndarray) -> np.ndarray:
    t = ((points[:, :1] + 0.7) / 1.4).clip(0, 1)
    return LEFT * (1 - t) + RIGHT * t


def stroke(colors: np.ndarray, **more: object) -> Stroke:
    p = places()
    twice = lambda x: np.repeat(np.float32(x), 2, 0)  # noqa: E731
    n = len(p)
    return Stroke(
        "stroke_0001", twice(p), np.full(2 * n, 0.06, np.float32), twice(colors), np.tile(np.float32(EYE), (2 * n, 1)),
        curve_counts=(2,) * n, **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return usdslf.open(str(write_floor(tmp_path_factory.mktemp("floor"))), elements=400)


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
    t = other.scene.triangles
    p = places()
    # each point of the plane lies in one of its triangles
    corner = t.positions.astype(float)
    for q, wanted in zip(p, gradient(p)):
        for i in range(len(corner)):
            a, b, c = corner[i]
            uv = np.linalg.lstsq(np.stack([b - a, c - a], 1), q - a, rcond=None)[0]
            if uv.min() >= -1e-9 and uv.sum() <= 1 + 1e-9:
                got = evaluate_surface(other.scene, np.array([i]), np.float32(uv[None])).diffuse[0]
                np.testing.assert_allclose(got, wanted, atol=0.05)
                break
        else:
            pytest.fail("a dab is off the plane")
    # the shot itself is as it was, and a second time gives the same bytes
    files = sorted((tmp_path / "look.textures").iterdir())
    before = [f.read_bytes() for f in [look, *files]]
    session.author(look)
    assert [f.read_bytes() for f in [look, *sorted((tmp_path / "look.textures").iterdir())]] == before


def test_without_texture_coordinates_the_points_carry_it(tmp_path: Path) -> None:
    session = usdslf.open(str(write_floor(tmp_path, points_on_a_side=33)), elements=400)
    found = solve(session, stroke(seen(places(), gradient(places()))))
    assert found["varies"]
    look = tmp_path / "look.usda"
    (edit,) = session.author(look)
    assert (edit.representation, edit.attribute, edit.wins) == ("primvar", "primvars:slf:diffuseColor", True)
    other = session.edited(look)
    t = other.scene.triangles
    near = nearest_on_triangles(t.positions, places())
    got = evaluate_surface(other.scene, near.triangle.astype(np.int32), near.barycentric.astype(np.float32)).diffuse
    np.testing.assert_allclose(got, gradient(places()), atol=0.05)
    session.author(tmp_path / "again.usda")
    assert Usd.Stage.Open(str(look)).GetAttributeAtPath("/World/floor.primvars:slf:diffuseColor").HasValue()


def test_coordinates_without_area_are_none(session: Session) -> None:
    scene = session.scene
    every = np.arange(len(scene.triangles.mesh))
    assert lies_flat(scene, every, "st")
    collapsed = tuple(replace(m, uvs={k: 0 * v for k, v in m.uvs.items()}) for m in scene.meshes)
    assert not lies_flat(replace(scene, meshes=collapsed), every, "st")


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
