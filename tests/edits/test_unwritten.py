"""Unwritten changes: materials under them are those that USD reads with the look over the shot."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.stage_meshes import ball
from kit.stage_parts import StageBuilder, TextureInput
from kit.stage_textures import checker
from pxr import Usd

from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.edits.unwritten import materials_under
from usdslf.scene.difference import look_alike
from usdslf.scene.records import Scene
from usdslf.usd.author.author import author_look
from usdslf.usd.author.read_back import scene_under
from usdslf.usd.read.read import open_stage, read_scene

Shot = tuple[Usd.Stage, Scene]
GREY, WARM, F0 = (0.4, 0.4, 0.4), (0.4, 0.3, 0.2), (0.04, 0.04, 0.04)
CHANGES = {  # material, what is freed, before and after: diffuse, F0, roughness
    "colour": ("plain", "diffuse", (WARM, F0, 0.4), ((0.1, 0.2, 0.6), F0, 0.4)),
    "gloss": ("plain", "glossiness", (WARM, F0, 0.4), (WARM, F0, 0.15)),
    "coloured mirror": ("plain", "specular", (WARM, F0, 0.4), (WARM, (0.6, 0.3, 0.1), 0.4)),
    "darker texture": ("pattern", "diffuse", (GREY, F0, 0.5), ((0.2, 0.1, 0.3), F0, 0.5)),
    "brighter texture": ("pattern", "diffuse", (GREY, F0, 0.5), ((0.7, 0.4, 0.5), F0, 0.5)),
}


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    b = StageBuilder(tmp_path_factory.mktemp("unwritten"))
    plain = b.material("plain", diffuseColor=WARM, roughness=0.4)
    image = b.image("pattern.png", checker((0.2, 0.2, 0.2), (0.8, 0.8, 0.8)))
    pattern = b.material("pattern", diffuseColor=TextureInput(image, (0.9, 0.8, 0.7)), roughness=0.5)
    for n, material in enumerate((plain, plain, pattern)):
        b.mesh(f"ball_{n}", ball(0.4, 8), material, (n, 0, 0))
    stage = open_stage(b.save())
    return stage, read_scene(stage)


def change_of(scene: Scene, name: str) -> MaterialChange:
    material, freed, before, after = CHANGES[name]
    number = next(i for i, m in enumerate(scene.materials) if m.path.endswith(material))
    before, after = (Reflectance(np.array(d), np.array(f0), rough) for d, f0, rough in (before, after))
    targets = scene.shown_on(number)
    return MaterialChange(scene.materials[number], "material", targets, (freed,), before, after)


@pytest.mark.parametrize("name", CHANGES)
def test_they_are_what_usd_reads_with_the_look(shot: Shot, name: str, tmp_path: Path) -> None:
    stage, scene = shot
    change = change_of(scene, name)
    author_look(stage, [change], tmp_path / "look.usda")
    read = scene_under(stage, tmp_path / "look.usda", None, 1, None)
    found = materials_under([change], scene)
    assert look_alike(tuple(found), read.materials) and not look_alike(tuple(found), scene.materials)
    assert [a is b for a, b in zip(found, scene.materials)].count(False) == 1  # the others are the same objects


def test_what_no_material_says_as_a_whole_is_left_to_the_look(shot: Shot) -> None:
    _, scene = shot
    change = change_of(scene, "colour")
    assert materials_under([], scene) == list(scene.materials)
    assert materials_under([replace(change, targets=change.targets[:1], scope="prim")], scene) is None
    assert materials_under([replace(change, faces={change.targets[0]: (1, 2)})], scene) is None
    lost = replace(change, after=replace(change.after, roughness=math.nan))
    assert materials_under([lost], scene) is None  # which writing the look says
