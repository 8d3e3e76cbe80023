"""Look layers for a diffuse, a specular and a glossiness stroke on every real stage with an editable material.

Before and after are stated, so that no light field is needed: the means of a material over its surface, and a
change of them.  Each look is valid (stock validators and ours), wins, is minimal (no opinion equal to what lies
below it, none that could be left out: without any one of them the surface is another), changes what it says and
nothing else, and reads back, through textures and all, to the mean that was asked for within 1 %.  On three
stages whole solves do the same from painted colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from kit.look_stages import validate as stock
from kit.real_stages import LAYERS, LIT, UNLIT
from numpy.typing import NDArray
from pxr import Sdf, Usd

import usdslf
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.gpu.device import Device
from usdslf.scene.records import PrimvarInput, Scene, Texture
from usdslf.strokes.anchors import locate_stroke
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface
from usdslf.usd.author.author import author_look
from usdslf.usd.binding import bound_relationship
from usdslf.usd.layer.network import same_value
from usdslf.usd.layer.wins import AuthoredEdit, compose_over
from usdslf.usd.read.read import open_stage, read_scene
from usdslf.usd.review.validate import validate as find_wrong

NOT_EDITABLE = (  # displayColor only, or no material at all
    "cornell_box/cornell-box_displayColor.usda",
    "preview_surface_mayausd/normals/primvars_normals.usda",
    "teapot_usdwg/Teapot_Geometry.usd",
    "teapot_usdwg/geo/FancyTeapot.usd",
    "teapot_usdwg/geo/UtahTeapot.usd",
    "teapots_instanced_usdwg/assets/teapot/geo.usd",
    "teapots_instanced_usdwg/assets/teapot/geo/UtahTeapot.usd",
)
ENTRIES = [e for e in (*LIT, *UNLIT, *LAYERS) if e not in NOT_EDITABLE]
POINTS = 400
STROKES = ("diffuse", "specular", "glossiness")


@dataclass(frozen=True)
class Entry:
    """A real stage, with points on its surfaces and what they are."""

    stage: Usd.Stage
    scene: Scene
    triangle: NDArray
    barycentric: NDArray
    points: SurfacePoints


def opened(path: Path) -> Entry:
    stage = open_stage(path)
    if "teapotScene" in path.name:  # a part of the thousand instances is enough
        mask = Usd.StagePopulationMask(["/Scene/ring000/teapot000", "/Scene/ring000/teapot001"])
        stage = Usd.Stage.OpenMasked(stage.GetRootLayer(), mask)
    scene = read_scene(stage, refine=0)
    rng = np.random.default_rng(1)
    table = scene.triangles
    chosen = [
        rng.choice(np.flatnonzero(table.material == m), POINTS, p=share(table.areas[table.material == m]))
        for m in range(len(scene.materials))
    ]
    triangle = np.concatenate(chosen)
    b = rng.uniform(0, 1, (len(triangle), 2))
    barycentric = np.where(b.sum(1, keepdims=True) > 1, 1 - b, b)
    return Entry(stage, scene, triangle, barycentric, evaluate_surface(scene, triangle, barycentric))


def share(areas: NDArray) -> NDArray:
    return areas / areas.sum() if areas.sum() > 0 else np.full(len(areas), 1 / len(areas))


def again(entry: Entry, stage: Usd.Stage) -> SurfacePoints:
    """The same points in another composition of the same geometry."""
    scene = read_scene(stage, refine=0)
    assert np.array_equal(scene.triangles.positions, entry.scene.triangles.positions)
    return evaluate_surface(scene, entry.triangle, entry.barycentric)


def means(points: SurfacePoints, on: NDArray) -> Reflectance:
    return Reflectance(
        points.diffuse[on].mean(0, dtype=np.float64),
        points.f0[on].mean(0, dtype=np.float64),
        float(points.roughness[on].mean(dtype=np.float64)),
    )


INPUTS = {"diffuseColor": "base_color", "metallic": "metallic", "ior": "ior", "specularColor": "specular_color",
          "roughness": "roughness", "opacity": "opacity"}  # fmt: skip


def change(entry: Entry, number: int, stroke: str) -> tuple[MaterialChange, NDArray]:
    """A change that the material can take at all of its points: towards the middle of what is possible."""
    material, points = entry.scene.materials[number], entry.points
    on = points.material == number
    before = means(points, on)
    after = before
    if stroke == "diffuse":
        after = Reflectance(before.diffuse * (0.5, 0.75, 0.9) + 0.01, before.f0, before.roughness)
    elif stroke == "specular":
        after = Reflectance(before.diffuse, before.f0 + np.where(before.f0 > 0.5, -0.1, 0.1), before.roughness)
    else:
        after = Reflectance(before.diffuse, before.f0, before.roughness * 0.6 + 0.02)
    targets = tuple(dict.fromkeys(m.path for m in entry.scene.meshes if number in m.material_of_triangle))
    at = {name: np.atleast_2d(getattr(points, field)[on].T) for name, field in INPUTS.items()}
    made = MaterialChange(
        material, "material", targets, (stroke,), before, after, ("/SlfStrokes/stroke_0001",),
        means={name: v.mean(1, dtype=np.float64) for name, v in at.items()},
        highest={name: float(v.max()) for name, v in at.items()},
    )  # fmt: skip
    return made, on


def chosen_materials(entry: Entry) -> list[int]:
    """Up to two materials that differ in what drives them, textured ones first."""
    found: dict[tuple, int] = {}
    for i, m in enumerate(entry.scene.materials):
        if not m.why_not_editable:
            kinds = tuple(type(v).__name__ for v in vars(m).values() if isinstance(v, (Texture, PrimvarInput)))
            found.setdefault((kinds, m.use_specular_workflow), i)
    return sorted(found.values(), key=lambda i: str(found))[:2]


@pytest.mark.divided
@pytest.mark.parametrize("name", ENTRIES)
def test_looks_of_a_real_stage(name: str, assets: Path, tmp_path: Path) -> None:
    entry = opened(assets / name)
    materials = chosen_materials(entry)
    assert materials
    blamed = set(stock(entry.stage))
    for number in materials:
        for stroke in STROKES:
            made, on = change(entry, number, stroke)
            said: list[str] = []
            edits = author_look(entry.stage, [made], tmp_path / "look.usda", warnings=said)
            assert edits and all(e.wins for e in edits), (stroke, edits)
            look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
            review = compose_over(entry.stage, look)
            check_valid(review, blamed, tmp_path)
            check_minimal(entry, look, edits)
            shown = again(entry, review)
            check_read_back(entry, shown, made, on, edits)
            check_each_opinion_shows(entry, look, shown)


def check_valid(review: Usd.Stage, blamed: set[str], folder: Path) -> None:
    assert stock(Usd.Stage.Open(str(folder / "look.usda"))) == []
    assert set(stock(review)) <= blamed
    # The assets may lie elsewhere on this machine, which only a path from the root can say.
    assert {f.name for f in find_wrong(review, None)} <= {"AbsolutePath"}


def check_minimal(entry: Entry, look: Sdf.Layer, edits: list[AuthoredEdit]) -> None:
    """No opinion equal to what lies below; every property of the layer is an edit or belongs to a new node."""
    paths: list[Sdf.Path] = []
    look.Traverse("/", paths.append)
    shown_at = {Sdf.Path(e.prim).AppendProperty(e.attribute): Sdf.Path(e.shown_at) for e in edits}
    for path in (p for p in paths if p.IsPropertyPath() and not p.IsTargetPath()):
        spec = look.GetObjectAtPath(path)
        at = shown_at.get(path)
        if at is None:  # a node that was copied, and the connection to it
            assert "slf_" in str(path) or spec.connectionPathList.GetAddedOrExplicitItems(), path
            continue
        below = entry.stage.GetAttributeAtPath(at)
        assert not below or not same_value(below.Get(Usd.TimeCode.EarliestTime()), spec.default), path
    specs = [look.GetPrimAtPath(p) for p in paths if p.IsPrimPath()]
    defined = [s.path for s in specs if s.specifier == Sdf.SpecifierDef]
    assert all("slf_" in str(p) for p in defined)


def check_read_back(
    entry: Entry, after: SurfacePoints, made: MaterialChange, on: NDArray, edits: list[AuthoredEdit]
) -> None:
    got, wanted = means(after, on), made.after
    changed = {bound_relationship(entry.stage.GetPrimAtPath(p))[0] for e in edits for p in e.affects}
    shown = [i for i, m in enumerate(entry.scene.materials) if Sdf.Path(m.path) in changed]
    is_mixed = not made.material.use_specular_workflow and np.ptp(entry.points.metallic[on]) > 1e-4
    names = {"diffuse": "diffuse", "specular": "f0", "glossiness": "roughness"}
    for freed, name in names.items():
        g, w = getattr(got, name), getattr(wanted, name)
        if freed in made.freed or not is_mixed:
            np.testing.assert_allclose(g, w, rtol=0.01, atol=1e-4)
        else:  # painted metal beside bare metal: a colour of the one is a reflectance of the other
            np.testing.assert_allclose(g, w, atol=0.01)
    others = ~np.isin(entry.points.material, shown)
    for field in ("diffuse", "f0", "roughness", "opacity", "emission"):
        np.testing.assert_array_equal(getattr(after, field)[others], getattr(entry.points, field)[others])


def check_each_opinion_shows(entry: Entry, look: Sdf.Layer, full: SurfacePoints) -> None:
    """Without any one opinion the surface is another one."""
    paths: list[Sdf.Path] = []
    look.Traverse("/", paths.append)
    attributes = [a for a in map(look.GetAttributeAtPath, paths) if a]
    told = [a for a in attributes if a.HasDefaultValue() or a.connectionPathList.GetAddedOrExplicitItems()]
    assert told
    for path in (a.path for a in told):  # the others declare outputs
        less = Sdf.Layer.CreateAnonymous(".usda")
        less.TransferContent(look)
        prim = less.GetPrimAtPath(path.GetPrimPath())
        prim.RemoveProperty(prim.attributes[path.name])
        points = again(entry, compose_over(entry.stage, less))
        fields = ("diffuse", "f0", "f90", "roughness")
        assert any(np.abs(getattr(points, f) - getattr(full, f)).max() > 1e-5 for f in fields), path


# ---- whole solves ------------------------------------------------------------------------------------------
SOLVES = (  # stage, where the picture of its camera is painted, with what colour of the surface, how
    ("cornell_box/cornell-box.usda", [[0.2, 0.45], [0.25, 0.6]], (0.10, 0.35, 0.40), "override"),
    ("living_room_godot/living_room.usda", [[0.45, 0.55], [0.55, 0.55]], (0.30, 0.10, 0.10), "new"),
    ("dutch_ship_polyhaven/dutch_ship_medium.usdc", [[0.45, 0.62], [0.55, 0.62]], (0.25, 0.10, 0.05), ""),
)


@pytest.mark.parametrize(("name", "path", "color", "mode"), SOLVES)
def test_a_whole_solve_of_a_real_stage(
    name: str, path: list, color: tuple, mode: str, assets: Path, tmp_path: Path, device: Device
) -> None:
    session = usdslf.open(assets / name, device=device, elements=600, bounces=3)
    stroke = usdslf.paint_stroke(
        session.scene, session.tracer, session.camera(), [path], 0.03, np.float32(color), space="reflectance"
    )
    session.add_stroke(stroke)
    (answer,) = session.solve()
    edits = session.author(tmp_path / "look.usda", mode=mode)
    assert edits and all(e.wins and e.affects for e in edits)
    assert "diffuse" in answer.chosen.freed
    review = compose_over(session.source, Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda")))
    check_valid(review, set(stock(session.source)), tmp_path)
    at = locate_stroke(session.scene, stroke)
    before, after = (evaluate_surface(s, at.triangle, at.barycentric) for s in (session.scene, read_scene(review)))
    on = before.material == answer.pool.material
    b, a = (x.diffuse[on].mean(0, dtype=np.float64) for x in (before, after))
    solved = answer.after["diffuse"]
    if "ship" in name:  # textured: what was solved is a factor, whatever the mean under the stroke
        np.testing.assert_allclose(a / b, solved / answer.before["diffuse"], rtol=0.01, atol=1e-6)
    else:
        np.testing.assert_allclose(a, solved, rtol=0.01)
        np.testing.assert_allclose(a, color, atol=0.03)  # painted as an albedo, of which 4 % are specular
    for field, value in (("f0", answer.after["specular"]), ("roughness", answer.after["roughness"])):
        np.testing.assert_allclose(getattr(after, field)[on].mean(0), value, rtol=0.01)
    meshes = {p for e in edits for p in e.affects}
    painted = {session.scene.meshes[m].path for m in np.unique(before.mesh[on])}
    if mode == "new":
        assert all(any(p.startswith(q) for q in painted) for p in meshes)
    elif mode == "override":
        assert len(meshes) > len(painted)
