"""Gprims without UsdPreviewSurface get one that shows what they showed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kit.look_stages import F, add_quads, bind, new_stage, validate
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.usd.author.author import author_review_root
from usdslf.usd.binding import bound_relationship
from usdslf.usd.preview.preview_material import PreviewMaterials, make_preview, without_preview
from usdslf.usd.read.read import read_scene


def over(stage: Usd.Stage, made: PreviewMaterials) -> Usd.Stage:
    """The shot with the new materials over it."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [made.layer.identifier, stage.GetRootLayer().identifier]
    for name in ("metersPerUnit", "upAxis"):
        root.pseudoRoot.SetInfo(name, made.layer.pseudoRoot.GetInfo(name))
    root.defaultPrim = made.layer.defaultPrim
    return Usd.Stage.Open(root)


def assert_same_look(before: Usd.Stage, after: Usd.Stage) -> None:
    scenes = [read_scene(s, refine=0) for s in (before, after)]
    assert [m.path for m in scenes[0].meshes] == [m.path for m in scenes[1].meshes]
    n = len(scenes[0].triangles.mesh)
    triangle = np.unique(np.linspace(0, n - 1, 300).astype(int))
    barycentric = np.random.default_rng(0).uniform(0, 0.5, (len(triangle), 2))
    old, new = (evaluate_surface(s, triangle, barycentric) for s in scenes)
    for name in ("diffuse", "f0", "f90", "roughness", "opacity", "clearcoat", "emission"):
        assert_allclose(getattr(new, name), getattr(old, name), atol=1e-6, err_msg=name)
    used = {scenes[1].materials[m].why_not_editable for m in np.unique(scenes[1].triangles.material)}
    assert used == {""}


def test_display_colours_of_every_kind_are_reproduced(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    kinds = {"plain": None, "constant": 1, "uniform": 4, "vertex": 10, "faceVarying": 16}
    for name, count in kinds.items():
        mesh = add_quads(stage, f"/World/{name}")
        if count:
            colors = np.random.default_rng(count).uniform(0, 1, (count, 3)).astype(np.float32)
            mesh.CreateDisplayColorPrimvar(name).Set(Vt.Vec3fArray.FromNumpy(colors))
            mesh.CreateDisplayOpacityPrimvar("constant").Set(Vt.FloatArray([0.5]))
    twin = add_quads(stage, "/World/twin")
    twin.CreateDisplayColorPrimvar("constant").Set(
        UsdGeom.Gprim(stage.GetPrimAtPath("/World/constant")).GetDisplayColorAttr().Get()
    )
    twin.CreateDisplayOpacityPrimvar("constant").Set(Vt.FloatArray([0.5]))
    stage.GetRootLayer().Save()
    made = make_preview(stage, None)
    assert made.warnings == () and len(made.material_of) == 6
    # One for each constant look, and one that all readers of displayColor share.
    assert len(set(made.material_of.values())) == 3
    assert made.material_of["/World/twin"] == made.material_of["/World/constant"]
    after = over(stage, made)
    assert_same_look(stage, after)
    assert without_preview(after) == []
    made.layer.Export(str(tmp_path / "preview.usda"))
    author_review_root(tmp_path / "root.usda", tmp_path / "preview.usda", None, tmp_path / "shot.usda")
    assert validate(Usd.Stage.Open(str(tmp_path / "root.usda"))) == validate(stage)


def test_other_contexts_keep_their_material_for_final_renders(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    mesh = add_quads(stage, "/World/row")
    mesh.CreateDisplayColorPrimvar("constant").Set([Gf.Vec3f(0.2, 0.4, 0.6)])
    final = UsdShade.Material.Define(stage, "/World/mtl/final")
    node = UsdShade.Shader.Define(stage, "/World/mtl/final/node")
    node.CreateIdAttr("studio_surface")
    final.CreateSurfaceOutput("ri").ConnectToSource(node.CreateOutput("surface", F.Token))
    bind(mesh.GetPrim(), final)
    stage.GetRootLayer().Save()
    made = make_preview(stage, None)
    assert any("/World/row" in w and "ri" in w for w in made.warnings), made.warnings
    after = over(stage, made)
    assert_same_look(stage, after)
    api = UsdShade.MaterialBindingAPI(after.GetPrimAtPath("/World/row"))
    assert api.ComputeBoundMaterial(UsdShade.Tokens.full)[0].GetPath() == final.GetPath()


def test_instances_get_materials_each_their_own(tmp_path: Path) -> None:
    asset = new_stage(tmp_path / "asset.usda")
    add_quads(asset, "/World/row")
    asset.GetRootLayer().Save()
    stage = new_stage(tmp_path / "shot.usda")
    for i, name in enumerate("ab"):
        prim = stage.DefinePrim(f"/World/{name}", "Xform")
        prim.GetReferences().AddReference("./asset.usda")
        prim.SetInstanceable(True)
        UsdGeom.PrimvarsAPI(prim).CreatePrimvar("displayColor", F.Color3fArray).Set(
            [Gf.Vec3f(0.2 * i, 0.4, 0.6)]
        )
    stage.GetRootLayer().Save()
    made = make_preview(stage, None)
    after = over(stage, made)
    assert_same_look(stage, after)
    assert len(set(made.material_of.values())) == 2
    assert after.GetPrimAtPath("/World/a").IsInstance()


def test_subsets_and_materials_of_other_contexts_each_get_their_own(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    final = []
    for name in "ab":
        material = UsdShade.Material.Define(stage, f"/World/mtl/{name}")
        node = UsdShade.Shader.Define(stage, f"/World/mtl/{name}/node")
        node.CreateIdAttr("studio_surface")
        material.CreateSurfaceOutput("ri").ConnectToSource(node.CreateOutput("surface", F.Token))
        final.append(material)
    row = add_quads(stage, "/World/row")
    bind(row.GetPrim(), final[0])
    api = UsdShade.MaterialBindingAPI(row)
    bind(api.CreateMaterialBindSubset("part", Vt.IntArray([1])).GetPrim(), final[1])
    api.SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.nonOverlapping)
    stage.GetRootLayer().Save()
    made = make_preview(stage, None)
    assert set(made.material_of) == {"/World/row", "/World/row/part"}
    assert len(set(made.material_of.values())) == 2  # the same look, but another surface in final renders
    assert_same_look(stage, over(stage, made))
    assert without_preview(over(stage, made)) == []


@pytest.mark.parametrize("name", ["cornell_box/cornell-box_displayColor.usda"])
def test_real_stages_show_what_they_showed(assets: Path, name: str) -> None:
    stage = Usd.Stage.Open(str(assets / name))
    made = make_preview(stage, None)
    assert len(made.material_of) == len(without_preview(stage)) > 5
    after = over(stage, made)
    assert_same_look(stage, after)
    for gprim, material in made.material_of.items():
        assert bound_relationship(after.GetPrimAtPath(gprim))[0] == Sdf.Path(material)
