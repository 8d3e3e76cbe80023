"""A look that is solved anew over a shot that changed: what drifted, changed, became unnecessary, and stale strokes."""

from __future__ import annotations

from pathlib import Path

import pytest
from kit.look_stages import author, change_of, new_shot
from pxr import Sdf, Usd

from usdslf.usd.author.rebase import Became, Rebase, earlier_look, rebased, silence_again
from usdslf.usd.layer.silent import SILENT
from usdslf.usd.layer.wins import AuthoredEdit
from usdslf.usd.review.review import review_look
from usdslf.usd.review.toggle import toggle

GREY = "/World/mtl/grey/pbr"
STROKE = "/SlfStrokes/stroke_0001"
Row = tuple[Became, str]


def solve(folder: Path, roughness: float, **more: tuple[float, ...]) -> list[AuthoredEdit]:
    """Writes the look over the shot as it is now."""
    freed = "diffuse+glossiness" if more else "glossiness"
    stage = Usd.Stage.Open(str(folder / "shot.usda"))
    return author(stage, folder, change_of(stage, "/World/row", freed, roughness=roughness, **more))


def again(folder: Path, roughness: float, there: tuple[str, ...] = (STROKE,), **more: tuple[float, ...]) -> Rebase:
    earlier = earlier_look(folder / "look.usda")
    assert earlier
    edits = solve(folder, roughness, **more)
    return rebased(earlier, Usd.Stage.Open(str(folder / "shot.usda")), edits, (), there)


def rows(found: Rebase) -> set[Row]:
    return {(e.became, e.attribute.removeprefix("inputs:")) for e in found.edits}


def change_shot(folder: Path, roughness: float) -> None:
    shot = Sdf.Layer.FindOrOpen(str(folder / "shot.usda"))
    shot.GetAttributeAtPath(f"{GREY}.inputs:roughness").default = roughness
    shot.Save()


def test_nothing_became_of_what_is_the_same(tmp_path: Path) -> None:
    new_shot(tmp_path)
    assert earlier_look(tmp_path / "look.usda") is None
    solve(tmp_path, 0.2)
    assert again(tmp_path, 0.2) == Rebase()


def test_what_the_shot_says_otherwise_drifted(tmp_path: Path) -> None:
    new_shot(tmp_path)
    solve(tmp_path, 0.2)
    change_shot(tmp_path, 0.6)
    found = again(tmp_path, 0.2)
    assert rows(found) == {(Became.DRIFTED, "roughness")}
    (edit,) = found.edits
    values = [edit.base, edit.now, edit.was, edit.asks]
    assert [round(v, 6) for v in values] == [0.4, 0.6, 0.2, 0.2]
    assert edit.as_values()["became"] == "drifted"


def test_other_values_no_values_and_new_ones_are_named(tmp_path: Path) -> None:
    new_shot(tmp_path)
    solve(tmp_path, 0.2)
    assert rows(again(tmp_path, 0.3)) == {(Became.CHANGED, "roughness")}
    assert rows(again(tmp_path, 0.3, d=(0.1, 0.2, 0.3))) == {(Became.NEW, "diffuseColor")}
    change_shot(tmp_path, 0.3)  # the shot is as the strokes want it
    found = again(tmp_path, 0.3, d=(0.1, 0.2, 0.3))
    assert rows(found) == {(Became.DRIFTED, "roughness")} and found.edits[0].asks is None
    change_shot(tmp_path, 0.4)
    solve(tmp_path, 0.2, d=(0.1, 0.2, 0.3))
    earlier = earlier_look(tmp_path / "look.usda")
    assert earlier
    edits = [e for e in solve(tmp_path, 0.2) if e.attribute == "inputs:roughness"]
    found = rebased(earlier, Usd.Stage.Open(str(tmp_path / "shot.usda")), edits, (), (STROKE,))
    assert rows(found) == {(Became.UNNECESSARY, "diffuseColor")}


@pytest.mark.parametrize("how", ["new", "alternatives"])
def test_a_material_of_the_look_drifts_with_that_which_it_comes_from(tmp_path: Path, how: str) -> None:
    """Also where it holds alternatives: those that are not selected are not asked for, and nothing became of them."""
    new_shot(tmp_path)

    def solve_it() -> list[AuthoredEdit]:
        stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
        rough = change_of(stage, "/World/row", "glossiness", roughness=0.2)
        rival = change_of(stage, "/World/row", "diffuse", (0.1, 0.4, 0.2))
        more = {"mode": "new"} if how == "new" else {"rivals": {0: [rival]}}
        return author(stage, tmp_path, rough, **more)

    def compared() -> Rebase:
        earlier = earlier_look(tmp_path / "look.usda")
        assert earlier
        return rebased(earlier, Usd.Stage.Open(str(tmp_path / "shot.usda")), solve_it(), (), (STROKE,))

    solve_it()
    assert compared() == Rebase()
    change_shot(tmp_path, 0.6)
    found = review_look(tmp_path / "shot.usda", tmp_path / "look.usda", None)
    assert {r.rule for r in found.risks} == {"DriftedBase"}
    after = compared()
    assert rows(after) == {(Became.DRIFTED, "roughness")} and round(after.edits[0].now, 6) == 0.6
    assert not review_look(tmp_path / "shot.usda", tmp_path / "look.usda", None).risks


def test_strokes_that_are_gone_or_moved_are_stale(tmp_path: Path) -> None:
    new_shot(tmp_path)
    edits = solve(tmp_path, 0.2)
    earlier = earlier_look(tmp_path / "look.usda")
    assert earlier
    found = rebased(earlier, Usd.Stage.Open(str(tmp_path / "shot.usda")), edits, ("/SlfStrokes/stroke_0002",), ())
    assert set(found.stale_strokes) == {STROKE, "/SlfStrokes/stroke_0002"}
    assert "gone" in found.stale_strokes[STROKE] and found.as_values()["stale_strokes"]


def test_a_base_is_kept_for_what_the_shot_never_said(tmp_path: Path) -> None:
    """An input without an opinion in the shot: the base is the fallback, and an opinion that comes later is drift."""
    new_shot(tmp_path)
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    author(stage, tmp_path, change_of(stage, "/World/ball", "glossiness", roughness=0.1))
    shot = Sdf.Layer.FindOrOpen(str(tmp_path / "shot.usda"))
    pbr = shot.GetPrimAtPath("/World/mtl/red/pbr")
    Sdf.AttributeSpec(pbr, "inputs:roughness", Sdf.ValueTypeNames.Float).default = 0.9
    shot.Save()
    earlier = earlier_look(tmp_path / "look.usda")
    assert earlier
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    edits = author(stage, tmp_path, change_of(stage, "/World/ball", "glossiness", roughness=0.1))
    found = rebased(earlier, stage, edits, (), (STROKE,))
    assert [(e.became, round(e.base, 6), round(e.now, 6)) for e in found.edits] == [(Became.DRIFTED, 0.5, 0.9)]


def test_what_was_switched_off_stays_off_when_the_look_is_written_anew(tmp_path: Path) -> None:
    new_shot(tmp_path)
    look, red = tmp_path / "look.usda", (0.6, 0.1, 0.1)
    solve(tmp_path, 0.2, d=red)
    colour = f"{GREY}.inputs:diffuseColor"
    toggle(look, [colour], on=False)
    earlier = earlier_look(look)
    assert earlier
    edits = solve(tmp_path, 0.2, d=(0.1, 0.5, 0.1))
    (said,) = silence_again(look, earlier)
    assert said == f"{colour} stays switched off; bring it back with: usdslf toggle --on"
    file = Sdf.Layer.FindOrOpen(str(tmp_path / "shot.usda"))
    shot, composed = (Usd.Stage.Open(file, Sdf.Layer.CreateAnonymous()) for _ in range(2))
    composed.GetSessionLayer().subLayerPaths = [str(look)]
    rough, shown, plain = (
        stage.GetPrimAtPath(GREY).GetAttribute(f"inputs:{name}").Get()
        for stage, name in ((composed, "roughness"), (composed, "diffuseColor"), (shot, "diffuseColor"))
    )
    assert rough == pytest.approx(0.2) and shown == plain
    became = rebased(earlier, shot, edits, (), (STROKE,))
    assert rows(became) == {(Became.CHANGED, "diffuseColor")}  # neither new nor gone for being off
    toggle(look, [colour], on=True)
    written = Sdf.Layer.OpenAsAnonymous(str(look))
    assert written.GetAttributeAtPath(colour).default[1] == pytest.approx(0.5) and SILENT not in written.rootPrims
