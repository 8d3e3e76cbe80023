"""Baked textures in a look: what shows is what was there plus the change, where it was painted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.look_stages import F, author, compose
from kit.textured_rows import textured_shot
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdShade

from usdslf.color import color_of
from usdslf.edits.baked_texture import bake_texture, plain_texture
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.scene.records import Scene, Texture
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.usd.layer.baked_files import textures_folder
from usdslf.usd.read.read import read_scene
from usdslf.usd.review.validate import validate

FIELDS = {"diffuseColor": "diffuse_color", "roughness": "roughness", "metallic": "metallic"}
SHOWN = {"diffuseColor": "base_color", "roughness": "roughness", "metallic": "metallic"}


def bend(channels: int) -> Any:
    """A change over the first row of squares: none at its left end."""
    return lambda scene: (
        lambda triangle, barycentric: np.repeat(0.05 * _x(scene, triangle, barycentric)[:, None], channels, 1)
    )


def _x(scene: Scene, triangle: NDArray, barycentric: NDArray) -> NDArray:
    corners = scene.triangles.positions[triangle, :, 0]
    u, v = barycentric.T
    return corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v


def baked_change(stage: Usd.Stage, folder: Path, name: str, scope: str = "material") -> MaterialChange:
    scene = read_scene(stage, refine=0)
    (row,) = [i for i, m in enumerate(scene.meshes) if m.path == "/World/row"]
    material = scene.materials[scene.meshes[row].material_of_triangle[0]]
    texture = getattr(material, FIELDS[name])
    if not isinstance(texture, Texture):
        texture = plain_texture(texture)
    channels = 3 if texture.channels == "rgb" else 1
    triangles = np.flatnonzero(scene.triangles.mesh == row)
    baked = bake_texture(
        scene, texture, triangles, bend(channels)(scene), textures_folder(folder / "look.usda") / name,
        color_of(scene.ocio, scene.working_space),
        size=None if texture.path else (64, 40),
    )  # fmt: skip
    same = Reflectance(np.zeros(3), np.zeros(3), 0.5)
    return MaterialChange(material, scope, ("/World/row",), (), same, same, baked={name: baked})


def at_points(stage: Usd.Stage) -> dict[str, tuple[NDArray, Any]]:
    """For each row of squares, x and the inputs at points away from the edges."""
    scene = read_scene(stage, refine=0)
    rng = np.random.default_rng(0)
    found = {}
    for i, mesh in enumerate(scene.meshes):
        triangle = rng.choice(np.flatnonzero(scene.triangles.mesh == i), 300)
        barycentric = rng.uniform(0.05, 0.45, (300, 2))
        points = evaluate_surface(scene, triangle, barycentric)
        found[mesh.path] = (points.position[:, 0], points)
    return found


CASES = [
    ({"diffuseColor": "rgb"}, "diffuseColor", {}),
    ({"roughness": "g", "metallic": "b"}, "roughness", {}),
    ({"roughness": "r", "metallic": "r"}, "roughness", {}),
    ({}, "diffuseColor", {"diffuseColor": Gf.Vec3f(0.5, 0.25, 0.125)}),
    ({}, "roughness", {}),
]


@pytest.mark.parametrize(("inputs", "name", "constants"), CASES)
@pytest.mark.parametrize("scope", ["material", "prim"])
def test_the_change_shows_where_it_was_painted(
    tmp_path: Path, inputs: dict[str, str], name: str, constants: dict[str, Any], scope: str
) -> None:
    stage = textured_shot(tmp_path, inputs, **constants)
    edits = author(stage, tmp_path, baked_change(stage, tmp_path, name, scope))
    assert edits and all(e.wins and e.representation == "texture" for e in edits), edits
    review = compose(tmp_path)
    before, after = at_points(stage), at_points(review)
    for other in set(SHOWN) - {name}:
        for mesh in before:
            assert_allclose(
                getattr(after[mesh][1], SHOWN[other]), getattr(before[mesh][1], SHOWN[other]), atol=1e-6
            )
    x, old = before["/World/row"]
    inside = (x > 0.2) & (x < 3.8)  # bilinear reads reach over the ends
    change = getattr(after["/World/row"][1], SHOWN[name]) - getattr(old, SHOWN[name])
    assert_allclose(change.T[..., inside], np.broadcast_to(0.05 * x, change.T.shape)[..., inside], atol=2e-3)
    x, old = before["/World/other"]
    inside = (x > 0.2) & (x < 3.8)
    same = [getattr(s, SHOWN[name])[inside] for s in (old, after["/World/other"][1])]
    assert_allclose(same[1], same[0], atol=1e-6)
    assert validate(review, None) == []


def test_what_is_authored_is_all_that_is_needed(tmp_path: Path) -> None:
    stage = textured_shot(tmp_path, {"diffuseColor": "rgb"})
    change = baked_change(stage, tmp_path, "diffuseColor")
    edits = author(stage, tmp_path, change)
    # The source is raw and repeats along s already; along t it was left to the file.
    assert [e.attribute for e in edits] == ["inputs:file", "inputs:wrapT", "inputs:fallback"]
    first = (tmp_path / "look.usda").read_bytes()
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    file = layer.GetAttributeAtPath("/World/mtl/tex/map.inputs:file")
    assert file.default.path.startswith("./look.textures/diffuseColor_")
    assert file.default.path.endswith(".exr") and file.colorSpace == "raw"
    author(stage, tmp_path, baked_change(stage, tmp_path, "diffuseColor"))
    assert (tmp_path / "look.usda").read_bytes() == first
    assert len(list((tmp_path / "look.textures").iterdir())) == 1
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for each in ("look.usda", "look.textures", "shot.usda", "map.exr"):
        (tmp_path / each).rename(moved / each)
    again = Usd.Stage.Open(str(moved / "look.usda"))
    file = again.GetAttributeAtPath("/World/mtl/tex/map.inputs:file").Get()
    assert Path(file.resolvedPath).is_file()


def test_a_file_that_several_textures_share_stays_for_the_others(tmp_path: Path) -> None:
    stage = textured_shot(tmp_path, {"diffuseColor": "rgb"})
    material = UsdShade.Material(stage.GetPrimAtPath("/World/mtl/tex"))
    port = material.CreateInput("image", F.Asset)
    port.Set("./map.exr")
    second = UsdShade.Shader.Define(stage, "/World/mtl/tex/map2")
    second.CreateIdAttr("UsdUVTexture")
    for node in (UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/tex/map")), second):
        node.CreateInput("file", F.Asset).ConnectToSource(port)
    stage.GetRootLayer().Save()
    assert all(e.wins for e in author(stage, tmp_path, baked_change(stage, tmp_path, "diffuseColor")))
    review = compose(tmp_path)
    nodes = [UsdShade.Shader(review.GetPrimAtPath(f"/World/mtl/tex/{name}")) for name in ("map", "map2")]
    mine, other = (n.GetInput("file").GetValueProducingAttributes()[0].Get().path for n in nodes)
    assert mine.startswith("./look.textures/") and other == "./map.exr"
