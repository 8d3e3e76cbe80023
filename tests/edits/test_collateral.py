"""Collateral: what goes beyond what was meant, parameter by parameter, in known amounts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.eyelets import CARD, CLOTH, MATERIAL, maps, write_eyelets
from numpy.testing import assert_allclose

from usdslf.edits.collateral import RAMP, WORST, Collateral, Spoilt, collateral_of, excess_of, summed_up
from usdslf.edits.edits import MaterialChange, Reflectance, moves_of
from usdslf.edits.moves import Move
from usdslf.scene.records import Material, Scene, constant
from usdslf.usd.read.read import read_scene


def test_a_move_is_an_offset_a_factor_or_what_is_between() -> None:
    move = Move.of(np.array([0.4]), np.array([0.2]))
    low, high = move.between(np.array([[0.4], [0.8], [0.1]]))
    assert_allclose(low[:, 0], [0.2, 0.4, 0.0])  # of .8 by the factor, of .1 by the offset, held to 0
    assert_allclose(high[:, 0], [0.4, 0.8, 0.1])  # or nothing
    low, high = Move.of(np.array([0.2]), np.array([0.4])).between(np.array([[0.2], [0.6]]))
    assert_allclose(high[:, 0], [0.4, 0.8])  # brighter: by the offset
    assert_allclose(Move.of(np.array([0.2]), np.array([0.4]), True).between(np.array([[0.45]]))[1], [[0.9]])


def test_moves_that_are_joined_go_as_far_as_either() -> None:
    one, other = Move((-0.1,), (0.0,), (0.5,), (1.0,)), Move((0.0, -0.2, 0.0), (0.3, 0.0, 0.1))
    both = one.joined(other)
    assert both == Move((-0.1, -0.2, -0.1), (0.3, 0.0, 0.1), (0.5,), (1.0,))
    assert other.joined(one) == both


def test_what_was_not_freed_has_to_stay() -> None:
    p = {"diffuse": np.array([[0.2] * 3, [0.5] * 3]), "specular": np.full((2, 3), 0.04)}
    new = {"diffuse": p["diffuse"] + [0.1, 0, 0], "specular": p["specular"] + [[0, 0, 0], [0, 0.3, -0.04]]}
    meant = {"diffuse": Move((0.0,) * 3, (0.1, 0.0, 0.0))}
    excess = excess_of(p, new, meant)
    assert_allclose(excess["diffuse"], 0, atol=1e-12)
    assert_allclose(excess["specular"], [0, 0.3])
    assert_allclose(excess_of(p, new, {})["diffuse"], 0.1)


def test_small_parts_are_not_lost_in_the_mean() -> None:
    """Two thousandths of a surface that change by .5 are a fifth of its worst hundredth."""
    excess = np.zeros(4000)
    excess[:8] = 0.5
    one = summed_up("/m", {"specular": excess, "roughness": np.zeros(4000)})
    assert set(one.spoilt) == {"specular"}
    assert_allclose((one.worst, one.spoilt["specular"].mean), (0.5 * 0.002 / WORST, 0.001))
    assert one.is_finding and "/m changes" in one.in_words()
    assert not Collateral("/m", {"grazing": Spoilt(0.01, 0.045), "diffuse": Spoilt(0.0, 0.029)}).is_finding


def with_material(scene: Scene, m: Material) -> Scene:
    return replace(scene, materials=(m,))


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return read_scene(write_eyelets(tmp_path_factory.mktemp("shot")))


def moved(shot: Scene, freed: str, **after: tuple[float, ...]) -> dict[str, dict[str, Move]]:
    before = Reflectance(np.array(CLOTH), np.full(3, 0.04), 0.7)
    new = replace(before, **{k: np.array(v) for k, v in after.items()})
    return {MATERIAL: moves_of(MaterialChange(shot.materials[0], "material", (CARD,), (freed,), before, new))}


def test_a_scale_of_the_colour_shows_on_the_metal(shot: Scene) -> None:
    """A diffuse change by a factor of .4 takes .6 of the brass too."""
    m = shot.materials[0]
    scaled = replace(m, diffuse_color=replace(m.diffuse_color, scale=(0.4, 0.4, 0.4, 1.0)))
    moves = moved(shot, "diffuse", diffuse=tuple(0.4 * c for c in CLOTH))
    (one,) = collateral_of(shot, with_material(shot, scaled), moves)
    assert one.spoilt["specular"].worst == pytest.approx(0.6 * 0.9, abs=0.02)
    share = maps()[1].mean()  # of the card that is metal
    assert one.spoilt["specular"].mean == pytest.approx(0.6 * 0.9 * share, rel=0.15)
    assert "diffuse" not in one.spoilt and one.is_finding


def test_one_specular_colour_for_cloth_and_metal_is_a_finding(shot: Scene) -> None:
    """What was written for a blue highlight on cloth: its eyelets turn grey, its diffuse colour stays that of metal."""
    blue = (0.1, 0.08, 0.25)
    flat = replace(shot.materials[0], use_specular_workflow=True, specular_color=constant(*blue))
    (one,) = collateral_of(shot, with_material(shot, flat), moved(shot, "specular", f0=blue))
    assert one.spoilt["specular"].worst > 0.7 and one.spoilt["diffuse"].worst > 0.8
    # F90 of the brass, (.9, .7, .35), gets white; its blue may go as far as that of F0
    assert one.spoilt["grazing"].worst == pytest.approx(RAMP * (1 - 0.35 - 0.21), abs=0.002)


def test_what_stays_as_it_is_is_not_looked_at(shot: Scene) -> None:
    assert collateral_of(shot, shot, {}) == []
    fewer = replace(shot, meshes=())
    assert collateral_of(shot, fewer, {}) == []


def test_what_another_edit_touches_is_found_in_each_parameter(shot: Scene, tmp_path: Path) -> None:
    m = shot.materials[0]
    odd = replace(m, clearcoat=constant(0.5), emissive_color=constant(0.2, 0, 0), opacity=constant(0.9))
    (one,) = collateral_of(shot, with_material(shot, odd), {MATERIAL: {}})
    found = {k: round(v.worst, 3) for k, v in one.spoilt.items()}
    assert found["emission"] == 0.2 and found["opacity"] == 0.1 and found["coat"] == pytest.approx(0.5 * 0.04)
