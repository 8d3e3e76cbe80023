"""Meshes written to a stage in memory and read back."""

from __future__ import annotations

from pxr import Usd, UsdGeom

from usdslf.scene.records import Mesh
from usdslf.usd.read.geometry import read_meshes

DEFAULT = Usd.TimeCode.Default()
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


def stage() -> Usd.Stage:
    return Usd.Stage.CreateInMemory()


def add_mesh(s, path, points, faces, scheme="none"):
    mesh = UsdGeom.Mesh.Define(s, path)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([len(f) for f in faces])
    mesh.CreateFaceVertexIndicesAttr([i for f in faces for i in f])
    if scheme:
        mesh.CreateSubdivisionSchemeAttr(scheme)
    return mesh


def read(s, time=DEFAULT, refine=1, material=lambda prim, given: 0):
    warnings: list[str] = []
    return read_meshes(s, time, material, refine, warnings), warnings


def only(s, **options) -> Mesh:
    meshes, warnings = read(s, **options)
    assert len(meshes) == 1 and not warnings, (meshes, warnings)
    return meshes[0]
