"""Looks on real packed maps keep what they do not change: by usd-core's connections and the files' texels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.eyelets import composed, reflects, texels_of
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from usdslf.color import color_of
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.edits.representations import least_collateral
from usdslf.scene.records import Scene
from usdslf.usd.author.author import author_look
from usdslf.usd.author.collateral import Reading, look_collateral
from usdslf.usd.read.read import open_stage, read_scene

SHIP = "dutch_ship_polyhaven/dutch_ship_medium.usdc"
TIMBER = Reflectance(np.array((0.12, 0.08, 0.05)), np.full(3, 0.04), 0.7)
PANELS = "preview_surface_mayausd/multipleMaterialsAssignment/MultipleMaterialsAssignment.usda"


@pytest.fixture(scope="module")
def ship(assets: Path) -> Scene:
    return read_scene(assets / SHIP)


def look_of(scene: Scene, stage: Path, name: str, folder: Path, freed: str, kind: str = "add", **after: Any) -> Path:
    """Writes a change of what is no metal on a material of a stage, by terms or factors (kind: add | multiply)."""
    (at,) = [i for i, m in enumerate(scene.materials) if m.path.endswith(name)]
    new = replace(TIMBER, **{k: np.array(v) for k, v in after.items()})
    change = MaterialChange(scene.materials[at], "material", scene.shown_on(at), (freed,), TIMBER, new, map=kind)
    color = color_of(scene.ocio, scene.working_space)
    change = least_collateral(scene, at, change, folder / "look.textures" / name, color, [])
    author_look(open_stage(stage), [change], folder / "look.usda", color=color)
    return folder / "look.usda"


def both(stage: Path, look: Path, name: str) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray], NDArray]:
    """d and F0 of a map's texels without and with a look, and its metallic."""
    material, plain = f"/root/_materials/{name}", composed(stage)
    metallic = np.clip(texels_of(plain, "metallic", material=material)[..., 0], 0, 1)
    n = len(metallic)
    return reflects(plain, 0, material, n), reflects(composed(stage, look), 0, material, n), metallic


@pytest.mark.assets
@pytest.mark.parametrize("name", ["dutch_ship_medium_hull", "dutch_ship_medium_rigging"])
def test_a_coloured_highlight_on_timber_leaves_its_iron_and_its_grain(
    assets: Path, ship: Scene, tmp_path: Path, name: str
) -> None:
    look = look_of(ship, assets / SHIP, name, tmp_path, "specular", f0=(0.06, 0.06, 0.24))
    (d, f0), (new_d, new_f0), m = both(assets / SHIP, look, name)
    timber, iron = m < 0.004, m > 0.96
    assert timber.mean() > 0.5 and iron.sum() > 1000
    assert_allclose(new_d, d, atol=2e-3)  # of every texel
    assert_allclose(new_f0[timber] - f0[timber], np.broadcast_to((0.02, 0.02, 0.2), f0.shape)[timber], atol=2e-3)
    assert np.abs(new_f0[iron] - f0[iron]).max() < 0.2 * 0.04 + 1e-3  # as much of it as they are no metal


@pytest.mark.assets
@pytest.mark.parametrize("name", ["dutch_ship_medium_hull", "dutch_ship_medium_rigging"])
def test_painted_timber_leaves_its_iron(assets: Path, ship: Scene, tmp_path: Path, name: str) -> None:
    look = look_of(ship, assets / SHIP, name, tmp_path, "diffuse", diffuse=(0.4, 0.08, 0.05))
    (d, f0), (new_d, new_f0), m = both(assets / SHIP, look, name)
    timber, iron = m < 0.004, m > 0.96
    assert_allclose(new_d[timber], np.clip(d[timber] + (0.28, 0, 0), 0, 1), atol=5e-3)
    assert_allclose(new_f0[iron], f0[iron], atol=2e-3)
    assert look_collateral(open_stage(assets / SHIP), ship, look, Reading(None))[0].is_finding is False


@pytest.mark.assets
@pytest.mark.parametrize("freed", ["diffuse", "specular"])
def test_maps_of_the_specular_workflow_change_apart(assets: Path, tmp_path: Path, freed: str) -> None:
    """Three panels whose shaders read maps of both colours, some of them the same file."""
    scene = read_scene(assets / PANELS)
    after = {"diffuse": {"diffuse": TIMBER.diffuse * 0.5}, "specular": {"f0": TIMBER.f0 * 0.25}}[freed]
    look = look_of(scene, assets / PANELS, "render_red_material", tmp_path, freed, "multiply", **after)
    shot, with_look = composed(assets / PANELS), composed(assets / PANELS, look)
    for color in ("red", "green"):
        material = f"/root/MATERIAL/render_{color}_material"
        for name, changes in (("diffuseColor", freed == "diffuse"), ("specularColor", freed == "specular")):
            old, new = (texels_of(s, name, material=material) for s in (shot, with_look))
            factor = (0.5 if freed == "diffuse" else 0.25) if changes and color == "red" else 1.0
            assert_allclose(new, old * factor, atol=1e-6)
