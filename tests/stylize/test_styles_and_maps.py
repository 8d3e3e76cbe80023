"""Styles keep the meaning of maps too: what only spoiling them could say stays."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from kit.eyelets import CARD, CLOTH, MATERIAL, composed, maps, reflects, write_eyelets

import usdslf
from usdslf.color import color_of
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.stylize.changes import with_styles
from usdslf.usd.author.author import author_look
from usdslf.usd.author.collateral import Reading, look_collateral

BEFORE = Reflectance(np.array(CLOTH), np.full(3, 0.04), 0.7)
AFTER = Reflectance(np.array(CLOTH), np.array((0.06, 0.06, 0.24)), 0.5)


def styled(stage: Path) -> tuple[MaterialChange, list[str], usdslf.Session]:
    """A style that wants a bluer and sharper highlight on all elements of the cloth."""
    session = usdslf.open(str(stage), elements=150)
    scene, elements = session.scene, session.elements
    n = len(elements.position)
    style = SimpleNamespace(material=0, elements=np.arange(n))
    moved = SimpleNamespace(
        change_at=lambda rows: (np.zeros((n, 3)), np.tile(AFTER.f0 - BEFORE.f0, (n, 1)), np.full(n, -0.2))
    )
    change = MaterialChange(scene.materials[0], "material", (CARD,), ("specular", "glossiness"), BEFORE, AFTER)
    said: list[str] = []
    color = color_of(scene.ocio, scene.working_space)
    return with_styles(change, style, moved, scene, elements, stage.parent / "t", color, said), said, session


def test_a_highlight_that_maps_can_say_gets_a_whole_set(tmp_path: Path) -> None:
    stage, look = write_eyelets(tmp_path), tmp_path / "look.usda"
    change, _, session = styled(stage)
    assert {"diffuseColor", "specularColor", "roughness"} == set(change.baked)
    author_look(session.source, [change], look)
    (_, f0), (_, new) = reflects(composed(stage)), reflects(composed(stage, look))
    metal = maps()[1] > 0
    inside = metal & np.roll(metal, 1, 0) & np.roll(metal, -1, 0) & np.roll(metal, 1, 1) & np.roll(metal, -1, 1)
    np.testing.assert_allclose(new[inside], f0[inside], atol=2e-3)
    found = look_collateral(session.source, session.scene, look, Reading(None))
    assert not any(c.is_finding for c in found)


def test_one_that_they_cannot_say_stays_and_the_rest_is_written(tmp_path: Path) -> None:
    stage, look = write_eyelets(tmp_path, packed_wrap="clamp"), tmp_path / "look.usda"
    change, said, session = styled(stage)
    assert change.freed == ("glossiness",) and set(change.baked) == {"roughness"}
    assert any(w.startswith(f"{MATERIAL} stays") and w.endswith("its specular colour stays") for w in said)
    author_look(session.source, [change], look)
    (d, f0), (new_d, new_f0) = reflects(composed(stage)), reflects(composed(stage, look))
    assert new_f0 == pytest.approx(f0) and new_d == pytest.approx(d)
