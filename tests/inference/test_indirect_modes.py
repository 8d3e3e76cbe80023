"""Indirect strokes with every tool, choice and neighbour: a mirror and a dull floor in a room of four materials."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import usdslf
from usdslf.errors import SolveError, StrokeError
from usdslf.gallery.indirect_room import MIDDLE, NEAR_RIGHT, ON_BOX, shot_of
from usdslf.strokes.stroke import Stroke
from usdslf.usd.build_stage import write_stage

ELEMENTS = 900
ASPECT = 448 / 252


def _room(folder: Path, floor: str) -> Any:
    return usdslf.open(str(write_stage(shot_of("room", floor), folder)), elements=ELEMENTS)


@pytest.fixture(scope="module")
def mirror(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return _room(tmp_path_factory.mktemp("mirror"), "mirror")


@pytest.fixture(scope="module")
def dull(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return _room(tmp_path_factory.mktemp("dull"), "dull")


def paint(session: Any, xy: Any, color: Any = (1, 1, 1), name: str = "stroke_0001", view: str = "camera", **brush: Any):
    paths = [np.array([p]) for p in xy]
    camera = session.camera(f"/room/{view}")
    brush = {"mode": "indirect", **brush}
    return usdslf.paint_stroke(
        session.scene, session.tracer, camera, paths, 0.012, color, aspect=ASPECT, name=name, **brush
    )


def solve(session: Any, *strokes: Stroke, **options: Any) -> list[dict[str, Any]]:
    session.strokes, session.warnings = list(strokes), []
    session.solve(**options)
    return session.report()["strokes"]


def names(found: list[dict[str, Any]]) -> set[str]:
    """Last names of all materials that changed."""
    changed = [s["material"] for s in found if s["inferred"] != "none"]
    return {m.rsplit("/", 1)[-1] for m in changed + [a["material"] for s in found for a in s.get("also", [])]}


def met_or_said(session: Any, found: dict[str, Any]) -> bool:
    return found["note"].startswith("met within") or any("is met within" in w for w in session.warnings)


TOOLS: dict[str, dict[str, Any]] = {
    "replace": {"color": (0.27, 0.15, 0.06)},
    "brighten": {"strength": 0.5},
    "darken": {"strength": 0.5},
    "clone": {"clone_offset": (0.55, 0.0, 0.0)},
    "blur": {},
    "sharpen": {},
}


@pytest.mark.parametrize("tool", TOOLS)
def test_every_tool_changes_what_the_mirror_shows_or_says_why_not(mirror: Any, tool: str) -> None:
    (found,) = solve(mirror, paint(mirror, ON_BOX, tool=tool, **TOOLS[tool]))
    assert "floor" not in names([found])
    assert found["surface"] == "/room/floor"
    assert met_or_said(mirror, found), found["note"]
    if tool in ("replace", "brighten", "darken", "clone"):
        assert names([found]) == {"box"} and found["note"].startswith("met within"), found
    before, after = (np.mean(found[k]["diffuse"]) for k in ("before", "after"))
    if tool == "brighten":
        assert 1.3 * before < after < 1.7 * before  # half as bright again
    if tool == "darken":
        assert 0.3 * before < after < 0.7 * before


def test_a_fixate_stroke_changes_nothing_and_its_material_never_changes(mirror: Any) -> None:
    (found,) = solve(mirror, paint(mirror, ON_BOX, tool="fixate"))
    assert found["inferred"] == "none" and names([found]) == set()
    on_box = paint(mirror, [(0.385, 0.5), (0.39, 0.55)], name="stroke_0002", tool="fixate")
    assert on_box.surfaces == ("/room/box",)
    with pytest.raises(SolveError, match="fixated"):  # the mirror shows nothing but the box there
        solve(mirror, paint(mirror, ON_BOX, (0.27, 0.15, 0.06)), on_box)
    found = solve(mirror, paint(mirror, (*ON_BOX[:3], *NEAR_RIGHT[:3]), (0.27, 0.15, 0.06)), on_box)
    assert "box" not in names(found)
    assert met_or_said(mirror, found[0])


def test_taking_the_stroke_away_takes_the_change_away(mirror: Any) -> None:
    before, surface = mirror.device.download(mirror.light_field.outgoing_d), mirror.light_field.surface
    solve(mirror, paint(mirror, ON_BOX, (0.27, 0.15, 0.06)))
    assert mirror.changes()
    np.testing.assert_array_equal(mirror.device.download(mirror.light_field.outgoing_d), before)
    assert mirror.light_field.surface is surface
    mirror.remove_stroke("stroke_0001")
    assert not mirror.answers and not mirror.changes()


def test_solving_again_over_the_look_changes_nothing(mirror: Any, tmp_path: Path) -> None:
    stroke = paint(mirror, ON_BOX, (0.27, 0.15, 0.06))
    solve(mirror, stroke)
    mirror.author(tmp_path / "look.usda", review_root=tmp_path / "review.usda")
    again = mirror.reopened(str(tmp_path / "review.usda"))
    (found,) = solve(again, stroke)
    moved = np.abs(np.array(found["after"]["diffuse"]) - found["before"]["diffuse"]).max()
    assert found["inferred"] == "none" or moved < 0.03, found


def test_alternatives_are_chosen_by_parameters_and_material(dull: Any) -> None:
    stroke = paint(dull, MIDDLE, (0.33, 0.38, 0.33))
    (found,) = solve(dull, stroke)
    ids = [a["id"] for a in found["alternatives"]]
    assert "diffuse of /room/materials/left" in ids and "none" in ids and "diffuse of all in sight" in ids
    assert len(set(ids)) == len(ids)
    for asked in ("diffuse of /room/materials/left", "diffuse@/room/materials/left"):
        (found,) = solve(dull, stroke, choose={"stroke_0001": asked})
        assert names([found]) == {"left"} and found["inferred"] == "diffuse"
        assert found["alternatives"][0]["id"] == "diffuse of /room/materials/left"
    (found,) = solve(dull, replace(stroke, choice="none"))
    assert names([found]) == set()
    with pytest.raises(StrokeError, match="lacquer"):
        solve(dull, stroke, choose={"stroke_0001": "lacquer of /room/materials/left"})


def test_norms_say_how_many_materials_share_the_change(dull: Any) -> None:
    stroke = paint(dull, MIDDLE, (0.315, 0.375, 0.32))
    assert len(names(solve(dull, stroke, norm="l2"))) > 1
    (found,) = solve(dull, replace(stroke, norm="l0"))
    assert "+" not in found["inferred"]
    assert "floor" not in names([found])


def test_strokes_from_two_eyes_about_two_objects_are_solved_together(mirror: Any) -> None:
    orange = paint(mirror, ON_BOX, (0.27, 0.15, 0.06))
    green = paint(mirror, NEAR_RIGHT, (0.1, 0.24, 0.12), "stroke_0002", view="left_eye")
    found = solve(mirror, orange, green)
    assert {s["path"] for s in found} == {orange.path, green.path}
    assert {"box"} < names(found) and "floor" not in names(found)
    assert met_or_said(mirror, found[0])


def test_direct_and_indirect_strokes_of_one_session_work_together(mirror: Any) -> None:
    direct = paint(mirror, [(0.86, 0.3), (0.88, 0.35), (0.9, 0.3)], (0.06, 0.14, 0.05), "stroke_0002", mode="direct")
    assert direct.surfaces == ("/room/wall_right",)
    indirect = paint(mirror, ON_BOX, (0.27, 0.15, 0.06))
    (alone,) = solve(mirror, direct)
    found = {s["path"]: s for s in solve(mirror, indirect, direct)}
    assert found[direct.path]["material"] == "/room/materials/right"
    np.testing.assert_allclose(found[direct.path]["after"]["diffuse"], alone["after"]["diffuse"], atol=1e-3)
    assert names([found[indirect.path]]) == {"box"}
    # an indirect stroke about what a direct one changed does not undo it
    about_right = paint(mirror, NEAR_RIGHT, (0.25, 0.1, 0.1))
    found = {s["path"]: s for s in solve(mirror, about_right, direct)}
    assert "right" not in names([found[about_right.path]])
    assert "nothing that may change" in found[about_right.path]["note"]
    np.testing.assert_allclose(found[direct.path]["after"]["diffuse"], alone["after"]["diffuse"], atol=1e-3)


def test_a_floor_whose_own_look_a_direct_stroke_changes_is_seen_with_it(dull: Any) -> None:
    """Half as bright a floor shows half of what it gets: the indirect stroke counts from there."""
    direct = paint(dull, [(0.7, 0.8), (0.72, 0.84), (0.68, 0.82)], (0.17, 0.17, 0.17), "stroke_0002", mode="direct")
    indirect = paint(dull, MIDDLE, (0.18, 0.18, 0.18))
    found = {s["path"]: s for s in solve(dull, indirect, direct)}
    after = found[direct.path]["after"]["diffuse"]
    assert found[direct.path]["material"] == "/room/materials/floor" and max(after) < 0.4
    # what was painted is there already: nothing else is darkened for it
    changed = [s for s in (found[indirect.path], *found[indirect.path].get("also", [])) if s["inferred"] != "none"]
    for s in changed:
        assert np.abs(np.subtract(s["after"]["diffuse"], s["before"]["diffuse"])).max() < 0.25, s


def test_a_ring_of_metal_is_authored_with_metallic_and_reads_back(tmp_path: Path) -> None:
    from kit.caustic import TRUTH, held
    from kit.caustic import paint as paint_caustic
    from truth.recovery.indirect_stages import DULL, RING, build_caustic

    session = usdslf.open(str(build_caustic(tmp_path, DULL)), elements=1500)
    found = solve(session, paint_caustic(session, TRUTH["xy"], TRUTH["golden"]), *held(session))
    session.author(tmp_path / "look.usda", review_root=tmp_path / "review.usda")
    again = session.reopened(str(tmp_path / "review.usda"))
    ring = next(m for m in again.scene.materials if m.path == RING)
    assert not ring.use_specular_workflow
    np.testing.assert_allclose(ring.metallic, 1, atol=1e-6)
    np.testing.assert_allclose(ring.diffuse_color, found[0]["after"]["specular"], atol=2e-3)
    rows = again.elements.material == again.scene.materials.index(ring)
    np.testing.assert_allclose(again.elements.f0[rows].mean(0), found[0]["after"]["specular"], atol=5e-3)
    np.testing.assert_allclose(again.elements.diffuse[rows], 0, atol=1e-6)
