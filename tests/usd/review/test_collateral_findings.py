"""What a look changes beside what it is meant to: told by solve, its report and review; a finding where it is seen."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.eyelets import CARD, CLOTH, MATERIAL, composed, maps, reflects, write_eyelets
from pxr import Sdf

from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.usd.author.author import author_look
from usdslf.usd.read.read import open_stage, read_scene

Run = Callable[..., tuple[int, str, str]]
CLOTH_SEEN = Reflectance(np.array(CLOTH), np.full(3, 0.04), 0.7)


def write_plainly(stage: Path, look: Path, freed: str, **after: object) -> None:
    """Writes a change as a scale of maps and constants, whatever that does to the metal."""
    scene = read_scene(stage)
    new = replace(CLOTH_SEEN, **{k: np.array(v) for k, v in after.items()})
    author_look(
        open_stage(stage), [MaterialChange(scene.materials[0], "material", (CARD,), (freed,), CLOTH_SEEN, new)], look
    )


def findings(run: Run, stage: Path, look: Path) -> tuple[int, list[str], list[dict]]:
    code, out, err = run("review", stage, look, "--json")
    assert not err
    found = json.loads(out)
    return code, [f["name"] for f in found["findings"]], found["collateral"]


def test_a_look_that_spoils_the_metal_is_a_finding(run: Run, tmp_path: Path) -> None:
    stage, look = write_eyelets(tmp_path), tmp_path / "look.usda"
    write_plainly(stage, look, "diffuse", diffuse=0.4 * CLOTH_SEEN.diffuse)
    code, names, (one,) = findings(run, stage, look)
    assert code == 1 and "Collateral" in names
    assert one["material"] == MATERIAL and one["finding"]
    assert one["parameters"]["specular"]["worst"] == pytest.approx(0.6 * 0.9, abs=0.02)
    code, out, _ = run("review", stage, look)
    assert code == 1 and f"  Collateral: {MATERIAL} changes where nothing was asked of it: specular by 0.5" in out


def test_a_look_that_keeps_to_what_it_is_meant_to_is_none(run: Run, tmp_path: Path) -> None:
    stage, look = write_eyelets(tmp_path), tmp_path / "look.usda"
    write_plainly(stage, look, "glossiness", roughness=0.35)
    code, names, beside = findings(run, stage, look)
    assert (code, names, beside) == (0, [], [])


def test_what_a_person_adds_is_that_person_s_wish(run: Run, tmp_path: Path) -> None:
    stage, look = write_eyelets(tmp_path), tmp_path / "look.usda"
    write_plainly(stage, look, "glossiness", roughness=0.35)
    layer = Sdf.Layer.FindOrOpen(str(look))
    surface = Sdf.CreatePrimInLayer(layer, f"{MATERIAL}/surface")
    Sdf.AttributeSpec(surface, "inputs:clearcoat", Sdf.ValueTypeNames.Float).default = 1.0
    layer.Save()
    assert findings(run, stage, look)[:2] == (0, [])


def test_solve_says_what_it_changes_beside(run: Run, tmp_path: Path) -> None:
    """A dab of bright red on cloth, between the eyelets: they stay brass, by the files that usd-core connects."""
    stage, strokes = write_eyelets(tmp_path), tmp_path / "strokes.usda"
    look, report = tmp_path / "look.usda", tmp_path / "report.json"
    at = ("--camera", "/World/camera", "--path", "0.47,0.5 0.53,0.5", "--radius", "0.01")
    assert run("stroke", stage, strokes, *at, "--color", ".5,.1,.1")[0] == 0
    code, out, err = run("solve", stage, strokes, "-o", look, "--report", report, "--elements", 300)
    assert code == 0, err
    found = json.loads(report.read_text())
    assert found["strokes"][0]["inferred"] == "diffuse", out
    assert not any(c["finding"] for c in found["collateral"])
    assert all(c["material"] == MATERIAL and f"{MATERIAL} beside that: " in out for c in found["collateral"])
    (d, f0), (new_d, new_f0) = reflects(composed(stage)), reflects(composed(stage, look))
    metal = maps()[1] > 0
    inside = metal & np.roll(metal, 1, 0) & np.roll(metal, -1, 0) & np.roll(metal, 1, 1) & np.roll(metal, -1, 1)
    assert np.abs(new_f0 - f0)[inside].max() < 2e-3
    assert (new_d - d)[~metal].mean(0)[0] > 0.2
    assert run("review", stage, look)[0] == 0
