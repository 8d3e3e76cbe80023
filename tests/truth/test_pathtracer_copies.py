"""Instances, subdivision and primvars of the reference path tracer, against the same written out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from reference.mitsuba_setup import why_no_pathtracer

if why_no_pathtracer():
    pytest.skip(why_no_pathtracer(), allow_module_level=True)

from kit.stage_parts import MeshData, StageBuilder, ball, box, grid
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade
from reference import subdivide
from reference.catmull_clark import refine, refine_corners
from reference.pathtracer import Tracer

HILL = np.stack([*np.meshgrid(np.arange(4.0), np.arange(3.0)), np.add.outer([0, 1, 0.5], [0, 0.3, 1, 0.2])], -1)
PLACES = ((-1.0, 0.0, 0.5), (0.8, 0.2, -0.6), (0.2, 0.1, 1.2))


@pytest.fixture
def builder(tmp_path: Path) -> StageBuilder:
    return StageBuilder(tmp_path)


def seen_from_above(path: Path) -> tuple[NDArray, NDArray, NDArray]:
    """Returns names, positions and diffuse colours that a grid of parallel rays meets."""
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-2, 2, 40), np.linspace(-2, 2, 40)))
    origins = np.stack([x + 0.003, np.full_like(x, 5.0), z], -1)
    tracer = Tracer(path)
    assert not tracer.warnings
    return tracer.first_hits(origins, np.broadcast_to([0, -1.0, 0], origins.shape))


def pot(folder: Path) -> Path:
    """Writes an asset: a box with its material, moved within the asset."""
    folder.mkdir()
    builder = StageBuilder(folder)
    material = builder.material("red", diffuseColor=(0.7, 0.1, 0.2))
    builder.mesh("body", box(0.5, 0.7, 0.4), material, (0.1, 0, 0), 20.0)
    return builder.save()


def test_instances_are_what_they_would_be_written_out(tmp_path: Path) -> None:
    asset = pot(tmp_path / "asset")
    found = {}
    for kind in ("instances", "points", "copies"):
        (tmp_path / kind).mkdir()
        builder = StageBuilder(tmp_path / kind)
        builder.mesh("ball", ball(0.3), builder.material("blue", diffuseColor=(0.1, 0.1, 0.6)), (-1, 0, -1))
        stage = builder.stage
        if kind == "points":
            instancer = UsdGeom.PointInstancer.Define(stage, "/World/many")
            instancer.AddRotateYOp().Set(30.0)
            stage.DefinePrim("/World/many/pot", "Xform").GetReferences().AddReference(str(asset))
            UsdGeom.Xform(stage.GetPrimAtPath("/World/many/pot")).AddScaleOp().Set(Gf.Vec3f(0.8))
            instancer.CreatePrototypesRel().SetTargets(["/World/many/pot"])
            instancer.CreateProtoIndicesAttr([0] * 4)
            instancer.CreatePositionsAttr([*PLACES, (0, 0, 0)])
            instancer.CreateIdsAttr([0, 1, 2, 3])
            instancer.DeactivateId(3)
        else:
            holder = UsdGeom.Xform.Define(stage, "/World/many")
            holder.AddRotateYOp().Set(30.0)
            for i, place in enumerate(PLACES):
                copy = UsdGeom.Xform.Define(stage, f"/World/many/pot{i}")
                copy.AddTranslateOp().Set(Gf.Vec3d(*place))
                copy.AddScaleOp().Set(Gf.Vec3f(0.8))
                copy.GetPrim().GetReferences().AddReference(str(asset))
                copy.GetPrim().SetInstanceable(kind == "instances")
        found[kind] = seen_from_above(builder.save())
    names, positions, diffuse = found["copies"]
    assert (np.char.find(names.astype(str), "pot") >= 0).sum() > 30
    hit = names != ""
    for kind in ("instances", "points"):
        np.testing.assert_array_equal(found[kind][0] != "", hit)
        np.testing.assert_allclose(found[kind][1][hit], positions[hit], atol=1e-5)
        np.testing.assert_allclose(found[kind][2][hit], diffuse[hit], atol=1e-6)


@pytest.mark.parametrize("data", [box(1, 1.4, 0.8), grid(HILL)], ids=["closed", "with a boundary"])
def test_refined_cage_is_catmull_clark(data: MeshData) -> None:
    positions = np.asarray(data.positions, float)
    _, first, back = np.unique(positions.round(9), axis=0, return_index=True, return_inverse=True)
    positions, indices = positions[first], back.reshape(-1)[np.asarray(data.indices)]
    faces = [list(map(int, f)) for f in np.split(indices, np.cumsum(data.counts)[:-1])]
    points, quads, _, _ = subdivide.subdivide(positions, faces, {}, corners_of(faces), "catmullClark")
    fine = refine(positions, indices, np.asarray(data.counts))
    np.testing.assert_allclose(fine.values, points, atol=1e-12)
    np.testing.assert_array_equal(fine.indices, quads)


def corners_of(faces: list[list[int]]) -> dict[int, float]:
    """Vertices of one face only stay where they are, as edgeAndCorner says."""
    count = np.bincount(np.concatenate(faces))
    return {int(v): np.inf for v in np.nonzero(count == 1)[0]}


def test_corner_values_are_linear_in_a_face() -> None:
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    fine = refine_corners(corners, np.array([4]))
    np.testing.assert_allclose(fine[:4], [[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    np.testing.assert_allclose(fine.reshape(4, 4, 2).mean((0, 1)), [0.5, 0.5])


def test_constant_primvar_colours_a_prim(builder: StageBuilder) -> None:
    material = builder.material("painted", diffuseColor=(0, 0, 0))
    reader = UsdShade.Shader.Define(builder.stage, material + "/reader")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    surface = UsdShade.Shader(builder.stage.GetPrimAtPath(material + "/surface"))
    surface.GetInput("diffuseColor").ConnectToSource(reader.CreateOutput("result", Sdf.ValueTypeNames.Float3))
    colors = {"a": (0.3, 0.2, 0.1), "b": (0.1, 0.5, 0.9)}
    for i, (name, color) in enumerate(colors.items()):
        path = builder.mesh(name, box(0.6, 0.6, 0.6), material, (2.0 * i - 1, 0, 0))
        UsdGeom.Gprim(Usd.Stage.GetPrimAtPath(builder.stage, path)).CreateDisplayColorAttr([color])
    names, _, diffuse = seen_from_above(builder.save())
    for name, color in colors.items():
        np.testing.assert_allclose(diffuse[names == f"/World/{name}"].mean(0), color, atol=1e-6)
