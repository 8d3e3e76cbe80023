"""What a path tracer sees change beside what was asked, under looks on maps that say what is metal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.mitsuba_setup import why_no_pathtracer

if why_no_pathtracer():
    pytest.skip(why_no_pathtracer(), allow_module_level=True)

from kit.eyelets import CARD, CLOTH, MATERIAL, composed, write_eyelets
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd
from reference.pathtracer import Tracer, camera_rays

from usdslf.color import color_of
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.edits.representations import least_collateral
from usdslf.usd.author.author import author_look
from usdslf.usd.read.read import open_stage, read_scene

CAMERA, SIZE, SPP = "/World/camera", (96, 72), 64
SEEN = Reflectance(np.array(CLOTH) * 0.875, np.full(3, 0.04), 0.7)


def look_of(stage: Path, freed: str, after: Reflectance) -> Path:
    """The look of a change that was painted on cloth."""
    scene, look = read_scene(stage), stage.parent / "look.usda"
    change = MaterialChange(scene.materials[0], "material", (CARD,), (freed,), SEEN, after, map="add")
    color = color_of(scene.ocio, scene.working_space)
    change = least_collateral(scene, 0, change, stage.parent / "t" / "cloth", color, [])
    author_look(open_stage(stage), [change], look, color=color)
    return look


def share_on_metal(stage: Path, look: Path) -> float:
    """How much of all that changes in the picture changes on the eyelets."""
    shot, under = (composed(stage, one) for one in (None, look))
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] + 0.5
    xy = np.stack([x.ravel() / SIZE[0], y.ravel() / SIZE[1]], 1)
    origins, directions = camera_rays(shot, CAMERA, xy, SIZE[0] / SIZE[1])
    f0 = Tracer(shot).first_surfaces(origins, directions).f0.reshape(*SIZE[::-1], 3)
    before, after = (Tracer(s, max_depth=4).render(CAMERA, *SIZE, SPP) for s in (shot, under))
    changed: NDArray = np.abs(after - before).sum(-1)
    metal = (f0[..., 0] > 0.6) & np.isfinite(f0[..., 0])
    assert metal.sum() > 300 and changed.max() > 0.05
    return float(changed[metal].sum() / changed.sum())


def test_a_blue_highlight_on_cloth_is_seen_on_cloth(tmp_path: Path) -> None:
    stage = write_eyelets(tmp_path)
    blue = replace(SEEN, f0=np.array((0.06, 0.06, 0.3)))
    assert share_on_metal(stage, look_of(stage, "specular", blue)) < 0.05
    old = tmp_path / "old.usda"  # one specular colour for all of it, as it was written before
    over = Usd.Stage.CreateNew(str(old))
    surface = over.OverridePrim(f"{MATERIAL}/surface")
    surface.CreateAttribute("inputs:useSpecularWorkflow", Sdf.ValueTypeNames.Int).Set(1)
    surface.CreateAttribute("inputs:specularColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*blue.f0))
    over.Save()
    assert share_on_metal(stage, old) > 0.15


def test_red_cloth_is_seen_red_beside_its_brass(tmp_path: Path) -> None:
    stage = write_eyelets(tmp_path)
    red = replace(SEEN, diffuse=np.array((0.5, 0.1, 0.1)))
    assert share_on_metal(stage, look_of(stage, "diffuse", red)) < 0.05
