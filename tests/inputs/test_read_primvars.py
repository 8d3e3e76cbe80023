"""Primvars of every role, coordinates of three floats, and colours that a PointInstancer gives its instances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from usdslf.scene.records import Scene
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface
from usdslf.usd.read.read import read_scene


def points(scene: Scene, mesh: int = 0, barycentric: tuple[float, float] = (0.3, 0.3)) -> SurfacePoints:
    triangles = np.flatnonzero(scene.triangles.mesh == mesh)
    return evaluate_surface(scene, triangles, np.full((len(triangles), 2), barycentric))


@pytest.mark.parametrize("role", ["vector3f", "point3f", "normal3f"])
def test_a_primvar_of_any_role_is_a_colour_where_it_is_read_as_one(inputs: Path, role: str) -> None:
    scene = read_scene(str(inputs / f"primvar_roles/{role}.usda"))
    assert points(scene).diffuse == pytest.approx(np.tile([0.8, 0.1, 0.8], (2, 1)))
    assert not scene.warnings


def test_a_count_that_does_not_fit_is_said(inputs: Path) -> None:
    scene = read_scene(str(inputs / "primvar_roles/count.usda"))
    assert any("/World/M.primvars:tint" in s and "do not fit" in s for s in scene.warnings)
    assert points(scene).diffuse == pytest.approx(np.full((4, 3), 0.2))


@pytest.mark.parametrize("name", ["s", "float3", "texCoord3h"])
def test_texture_coordinates_of_three_floats_are_their_first_two(inputs: Path, name: str) -> None:
    scene, two = read_scene(str(inputs / f"texcoord3/{name}.usda")), read_scene(two_floats(inputs, name))
    assert not scene.warnings
    colors = set()
    for u, v in ((0.25, 0.2), (0.7, 0.25), (0.75, 0.8), (0.3, 0.75)):  # the quadrants of the card
        triangle, at = (0, (u - v, v)) if u > v else (1, (u, v - u))
        found, right = (evaluate_surface(s, np.array([triangle]), np.array([at])).emission[0] for s in (scene, two))
        assert found == pytest.approx(right)
        colors.add(tuple(np.round(found, 3)))
    assert len(colors) == 4, colors


def two_floats(inputs: Path, name: str) -> Usd.Stage:
    """The same stage with texCoord2f coordinates."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(inputs / f"texcoord3/{name}.usda")))
    stage = Usd.Stage.Open(layer)
    stage.GetPrimAtPath("/World/m/t").GetAttribute("inputs:file").Set(Sdf.AssetPath(str(inputs / "texcoord3/t.png")))
    card = stage.GetPrimAtPath("/World/card")
    st = [tuple(v)[:2] for v in UsdGeom.PrimvarsAPI(card).GetPrimvar("st").Get()]
    card.RemoveProperty("primvars:st")
    UsdGeom.PrimvarsAPI(card).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex").Set(st)
    return stage


def test_an_instancer_gives_display_colours_to_what_has_no_material(inputs: Path) -> None:
    scene = read_scene(str(inputs / "instancer_display_color/s.usda"))
    found = [points(scene, i).diffuse[0] for i in range(3)]
    assert np.array(found) == pytest.approx(np.array([[0.8, 0.8, 0.1], [0.8, 0.1, 0.8], [0.1, 0.8, 0.8]]))


def test_the_prototypes_own_display_colour_is_stronger(inputs: Path) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(inputs / "instancer_display_color/s.usda")))
    stage = Usd.Stage.Open(layer)
    UsdGeom.Gprim(stage.GetPrimAtPath("/World/geo/pi/P/c")).CreateDisplayColorAttr([(0.3, 0.2, 0.1)])
    scene = read_scene(stage)
    for i in range(3):
        assert points(scene, i).diffuse[0] == pytest.approx([0.3, 0.2, 0.1])
