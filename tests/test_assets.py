"""`info` and `render` on every real stage beside the repository: no traceback, warnings that name prims, pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import usdslf
from usdslf.cli import main
from usdslf.gpu.device import open_device

CAR = "vehicles_usdwg/USD_Mini_Car_Kit/assets"
MAYA = "preview_surface_mayausd"
# entry file -> whether it brings light of its own
ENTRIES = {
    "avocado/avocado.usda": False,
    "cornell_box/cornell-box.usda": True,
    "cornell_box/cornell-box_displayColor.usda": False,
    "dutch_ship_polyhaven/dutch_ship_medium.usdc": False,
    "living_room_godot/living_room.usda": True,
    f"{MAYA}/UsdPreviewSurface/DisplayColorCube.usda": False,
    f"{MAYA}/UsdPreviewSurface/F0_is_base.usda": False,
    f"{MAYA}/UsdPreviewSurface/LightAPI_Test.usda": False,
    f"{MAYA}/UsdPreviewSurface/TestFallbackColor.usda": False,
    f"{MAYA}/UsdPreviewSurface/TestOpacityThreshold.usda": False,
    f"{MAYA}/UsdPreviewSurface/UsdTransform2dTest.usda": False,
    f"{MAYA}/UsdPreviewSurface/UseSpecularWorkflowTest.usda": False,
    f"{MAYA}/multipleMaterialsAssignment/MultipleMaterialsAssignment.usda": False,
    f"{MAYA}/normals/primvars_normals.usda": False,
    "shaderball_usdwg/standard_shader_ball_scene.usda": True,
    "teapot_usdwg/DrawModes.usd": False,
    "teapot_usdwg/Teapot.usd": False,
    "teapot_usdwg/geo/FancyTeapot.usd": False,
    "teapots_instanced_usdwg/scenes/teapotScene.usd": False,
    f"{CAR}/vehicles/vehicleVariants.usda": False,
    **{
        f"{CAR}/vehicles/{car}/asset/{car}FullAsset.usda": False
        for car in ("4wd", "ambulance", "formula", "sedan", "tractor", "truckFlat", "van")
    },
    f"{CAR}/wheels/wheelVariants.usda": False,
}
NOTHING_TO_SHOW = (
    "shaderball_usdwg/layers/camera.usda",
    "shaderball_usdwg/layers/example_materials.usda",
    f"{CAR.removesuffix('/assets')}/materials/red.usda",
)
DEFAULT_LIGHT = "the stage has no light"


@pytest.fixture(scope="module")
def device() -> Any:
    return open_device()


@pytest.mark.parametrize("entry", ENTRIES)
def test_a_real_stage_is_read_and_shown(entry: str, assets: Path, device: Any) -> None:
    session = usdslf.open(assets / entry, device=device, elements=300, bounces=2)
    picture = session.render(size=(48, 27), samples=4)["color"]
    assert picture.shape == (27, 48, 3)
    assert np.isfinite(picture).all() and picture.min() >= 0
    assert picture.max() > 1e-3 and np.ptp(picture) > 1e-3
    said = [w for w in session.warnings if DEFAULT_LIGHT in w]
    assert bool(said) != ENTRIES[entry] and len(said) < 2
    others = [w for w in session.warnings if w not in said]
    assert all("/" in w for w in others), others  # a prim or a file is named
    assert len(session.warnings) == len(set(session.warnings)) < 30


@pytest.mark.parametrize("entry", ["avocado/avocado.usda", "living_room_godot/living_room.usda"])
def test_info_tells_what_a_real_stage_holds(
    entry: str, assets: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(assets / entry), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("entry", NOTHING_TO_SHOW)
def test_a_layer_with_nothing_to_show_is_one_sentence(
    entry: str, assets: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(assets / entry)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
