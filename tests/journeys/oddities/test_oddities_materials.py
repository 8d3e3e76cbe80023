"""Odd materials and textures of real stages: shown as the plain way, solved as the closed form, or named in a warning.

The table of all oddities is in README.md.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.lit_plane import FLOOR, places
from kit.oddity_stages import (
    AFTER,
    FACES,
    GRID,
    add_floor,
    add_mesh,
    authored,
    evaluate_at,
    floor_of,
    floor_shot,
    shader_of,
    shown_alike,
    solved,
    solves_and_shows,
    warnings_of,
)
from kit.stage_parts import StageBuilder
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

import usdslf
from usdslf.errors import AuthorError
from usdslf.usd.read.read import read_scene

Run = Callable[..., tuple[int, str, str]]
F = Sdf.ValueTypeNames
BOUND = "material:binding"
PATCH = [(-0.4, -0.4, 0.2), (0.4, -0.4, 0.2), (0.4, 0.4, 0.2), (-0.4, 0.4, 0.2)]


def add_patch(b: StageBuilder, material: str = "") -> Usd.Prim:
    """A square that hovers over the floor, bound to a path that need not exist."""
    prim = add_mesh(b.stage, "/World/patch", PATCH, [range(4)]).GetPrim()
    if material:
        UsdShade.MaterialBindingAPI.Apply(prim)
        prim.CreateRelationship(BOUND).SetTargets([material])
    return prim


def grey_patch(tmp_path: Path) -> Path:
    """The patch in the plain way, of the fallbacks of UsdPreviewSurface."""
    b = floor_shot(tmp_path / "plain")
    add_patch(b, b.material("grey", diffuseColor=(0.18, 0.18, 0.18)))
    return b.save()


# ---- what gives no UsdPreviewSurface ------------------------------------------------------------------------
def test_a_materialx_reference_is_a_warning(tmp_path: Path, run: Run, assets: Path) -> None:
    """A real .mtlx file behind a material: named, shown in grey, and the floor beside it solves."""
    b = floor_shot(tmp_path)
    shutil.copy(assets / "shaderball_usdwg/example_materials/gold.mtlx", tmp_path)
    gold = b.stage.DefinePrim("/World/mtl/gold")
    gold.GetReferences().AddReference("./gold.mtlx", "/MaterialX/Materials/Gold")
    add_patch(b, "/World/mtl/gold")
    path = b.save()
    warnings_of(path, run, "gold.mtlx", "/World/mtl/gold", "MaterialX")
    shown_alike(path, grey_patch(tmp_path))


def test_a_dangling_binding_shows_grey_and_is_named(tmp_path: Path, run: Run) -> None:
    b = floor_shot(tmp_path)
    add_patch(b, "/World/mtl/gone")
    path = b.save()
    warnings_of(path, run, "/World/patch", "names no material")
    shown_alike(path, grey_patch(tmp_path))


def test_a_material_without_preview_surface_says_what_it_has(tmp_path: Path, run: Run) -> None:
    """Its displayColor shows; a stroke on it ends in one sentence with the remedy, and the remedy works."""
    b = floor_shot(tmp_path)
    other = UsdShade.Material.Define(b.stage, "/World/mtl/other")
    node = UsdShade.Shader.Define(b.stage, "/World/mtl/other/node")
    node.CreateIdAttr("studio_surface")  # of nobody's library, so that nothing but displayColor can be shown
    other.CreateSurfaceOutput("studio").ConnectToSource(node.CreateOutput("out", F.Token))
    UsdShade.MaterialBindingAPI(floor_of(b)).Bind(other)
    floor_of(b).CreateDisplayColorAttr([Gf.Vec3f(*FLOOR["diffuse"])])
    path = b.save()
    warnings_of(path, run, "no UsdPreviewSurface", "studio", "/World/mtl/other")
    asked = AFTER | {"specular": (0.04,) * 3, "roughness": 0.5}  # on the fallbacks
    session = solved(path, asked)
    with pytest.raises(AuthorError, match="make-preview"):
        session.author(tmp_path / "look.usda")
    session = solved(path, asked, make_preview=True)
    assert all(e.wins for e in session.author(tmp_path / "look.usda"))


def test_a_gprim_without_material_is_grey(tmp_path: Path, run: Run) -> None:
    b = floor_shot(tmp_path)
    add_patch(b)
    path = b.save()
    warnings_of(path, run, "no material is bound to /World/patch")
    shown_alike(path, grey_patch(tmp_path))


def ramp(points: NDArray) -> NDArray:
    """A colour that is linear in the place, so that it does not matter how a quad is cut."""
    return np.stack([points[:, 0] / 5 + 0.5, points[:, 1] / 5 + 0.5, 0 * points[:, 0] + 0.25], 1)


def face_of(points: NDArray) -> NDArray:
    return (points[:, 0] > 0) + 2 * (points[:, 1] > 0)


FACE_COLORS = np.array([(0.1, 0.2, 0.3), (0.4, 0.3, 0.2), (0.6, 0.1, 0.5), (0.2, 0.7, 0.1)])
DISPLAY: dict[str, tuple[NDArray, Callable[[NDArray], NDArray]]] = {
    "constant": (np.array([[0.3, 0.5, 0.1]]), lambda p: np.tile((0.3, 0.5, 0.1), (len(p), 1))),
    "uniform": (FACE_COLORS, lambda p: FACE_COLORS[face_of(p)]),
    "vertex": (ramp(GRID), ramp),
    "faceVarying": (  # each face has a ramp of its own
        ramp(GRID)[FACES.ravel()] * np.repeat([0.2, 0.4, 0.6, 0.8], 4)[:, None],
        lambda p: ramp(p) * np.array([0.2, 0.4, 0.6, 0.8])[face_of(p)][:, None],
    ),
}


@pytest.mark.parametrize("interpolation", DISPLAY)
def test_display_color_is_read_back(tmp_path: Path, interpolation: str) -> None:
    """As it is, and from the material that --make-preview makes of it."""
    values, expected = DISPLAY[interpolation]
    b = floor_shot(tmp_path)
    floor_of(b).GetPrim().RemoveProperty(BOUND)
    primvar = UsdGeom.PrimvarsAPI(floor_of(b)).CreatePrimvar("displayColor", F.Color3fArray, interpolation)
    primvar.Set(Vt.Vec3fArray.FromNumpy(values.astype(np.float32)))
    path = b.save()
    for make_preview in (False, True):
        scene = usdslf.open(str(path), make_preview=make_preview).scene
        np.testing.assert_allclose(evaluate_at(scene, places()).base_color, expected(places()), atol=1e-5)
        assert all(bool(m.why_not_editable) is not make_preview for m in scene.materials)


# ---- bindings -----------------------------------------------------------------------------------------------
def test_a_binding_for_purpose_full_only(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    floor_of(b).GetPrim().RemoveProperty(BOUND)
    floor = UsdShade.Material(b.stage.GetPrimAtPath("/World/mtl/floor"))
    UsdShade.MaterialBindingAPI(floor_of(b)).Bind(floor, materialPurpose=UsdShade.Tokens.full)
    solves_and_shows(b.save())


def test_a_variant_that_replaces_the_painted_prim(tmp_path: Path, run: Run) -> None:
    """The edit holds for the variant that was painted; the other is as it was, and what is asked there is said."""
    b = floor_shot(tmp_path)
    stage, root = b.stage, b.stage.GetRootLayer()
    Sdf.CopySpec(root, "/World/mtl/floor", root, "/Other")
    stage.RemovePrim("/World/mtl/floor")
    looks = stage.GetPrimAtPath("/World/mtl").GetVariantSets().AddVariantSet("look")
    for name, color in (("first", FLOOR["diffuse"]), ("second", (0.2, 0.2, 0.6))):
        looks.AddVariant(name)
        at = Sdf.Path(f"/World/mtl{{look={name}}}floor")
        Sdf.CopySpec(root, "/Other", root, at)
        output = root.GetPropertyAtPath(at.AppendProperty("outputs:surface"))
        output.connectionPathList.explicitItems = [Sdf.Path("/World/mtl/floor/surface.outputs:surface")]
        diffuse = root.GetPropertyAtPath(at.AppendPath("surface.inputs:diffuseColor"))
        diffuse.default = Gf.Vec3f(*color)
    stage.RemovePrim("/Other")
    looks.SetVariantSelection("first")
    session = solved(b.save())
    authored(session, tmp_path)
    review = Usd.Stage.Open(str(tmp_path / "review.usda"))
    review.SetEditTarget(review.GetSessionLayer())
    for name, color in (("second", (0.2, 0.2, 0.6)), ("first", AFTER["diffuse"])):
        review.GetPrimAtPath("/World/mtl").GetVariantSet("look").SetVariantSelection(name)
        np.testing.assert_allclose(evaluate_at(read_scene(review), places()).base_color[0], color, atol=0.02)


def test_one_material_on_many_meshes(tmp_path: Path) -> None:
    """All of them are named before it is written; a new material changes the painted one alone."""
    b = floor_shot(tmp_path)
    for i in range(3):
        far = add_floor(b.stage, f"/World/far{i}", "/World/mtl/floor")
        far.AddTranslateOp().Set(Gf.Vec3d(30 + 5 * i, 0, 0))
    session = solved(b.save())
    users = {"/World/floor", *(f"/World/far{i}" for i in range(3))}
    assert {p for e in authored(session, tmp_path) for p in e.affects} == users
    session.strokes = [session.strokes[0]]
    session.solve()
    session.author(tmp_path / "new.usda", mode="new")
    assert {p for e in session.edits for p in e.affects} == {"/World/floor"}


def test_subsets_without_a_family_bind(tmp_path: Path) -> None:
    """The faces of a subset show its material, whatever the mesh is bound to; the others the mesh's."""
    b = floor_shot(tmp_path)
    white = b.material("white", diffuseColor=(0.9, 0.9, 0.9))
    b.stage.GetPrimAtPath("/World/floor").GetRelationship(BOUND).SetTargets([white])
    subset = UsdGeom.Subset.Define(b.stage, "/World/floor/painted")
    subset.CreateElementTypeAttr("face")
    subset.CreateIndicesAttr([0, 1, 2])
    assert not subset.GetFamilyNameAttr().Get()
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(
        UsdShade.Material(b.stage.GetPrimAtPath("/World/mtl/floor"))
    )
    scene = read_scene(b.save())
    of_face = [scene.materials[m].path for m in scene.meshes[0].material_of_triangle[::2]]
    assert of_face == ["/World/mtl/floor"] * 3 + [white]
    subset.GetIndicesAttr().Set([0, 1, 2, 3])
    solves_and_shows(b.save())


def test_inputs_that_are_not_of_the_schema_are_left(tmp_path: Path, run: Run) -> None:
    """Blender's: they change nothing that shows, nothing is said of them, and the look leaves them alone."""
    b = floor_shot(tmp_path)
    odd: dict[str, Any] = {"specular": 0.9, "specularTint": 1.0, "anisotropic": 0.7, "transmission": 1.0, "alpha": 0.1}
    for name, value in odd.items():
        shader_of(b).CreateInput(name, F.Float).Set(value)
    floor_of(b).GetPrim().CreateAttribute("userProperties:blender:object_name", F.String).Set("Plane")
    session = solves_and_shows(b.save())
    assert not session.scene.warnings
    assert {e.attribute for e in session.edits} == {"inputs:diffuseColor"}
    shown_alike(b.path, floor_shot(tmp_path / "plain").save())
