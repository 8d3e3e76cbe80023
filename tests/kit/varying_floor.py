"""A floor under one lamp, and what an eye sees of it by quadrature: for answers that vary over a surface."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from kit.stage_parts import InputValue, StageBuilder, rectangle
from numpy.typing import ArrayLike, NDArray
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade, Vt
from reference import evidence as ref
from reference.solve import radiance

from usdslf.geometry.closest_point import nearest_on_triangles
from usdslf.scene.records import Scene
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface

EYE = np.array([0.3, 2.2, 1.6])
LAMP, SIZE, POWER = np.array([-0.6, 1.6, 0.5]), (0.9, 0.7), np.array([6.0, 5.6, 5.0])
ROUGHNESS, F0 = 0.6, 0.04
LEFT, RIGHT = np.array([0.7, 0.12, 0.08]), np.array([0.08, 0.15, 0.6])
GREY: dict[str, InputValue] = {
    "useSpecularWorkflow": 1.0, "diffuseColor": (0.4, 0.4, 0.4), "specularColor": (F0,) * 3, "roughness": ROUGHNESS,
}  # fmt: skip


def write_floor(folder: Path, points_on_a_side: int = 0, **inputs: InputValue) -> Path:
    """A floor of 2 x 2 under a rect light that shines down: with texture coordinates, or points without."""
    b = StageBuilder(folder)
    look = b.material("floor", **(inputs or GREY))
    if points_on_a_side:
        grid(b.stage, points_on_a_side, look)
    else:
        b.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), look)
    add_lamp(b)
    return b.save()


def add_lamp(b: StageBuilder) -> None:
    """The light and the eye."""
    light = UsdLux.RectLight.Define(b.stage, "/World/lamp")
    light.CreateWidthAttr(SIZE[0])
    light.CreateHeightAttr(SIZE[1])
    light.CreateIntensityAttr(1.0)
    light.CreateColorAttr(Gf.Vec3f(*POWER))
    light.AddTranslateOp().Set(Gf.Vec3d(*LAMP))
    light.AddRotateXOp().Set(-90.0)
    b.camera(tuple(EYE), (0, 0, 0))


def grid(stage: Usd.Stage, n: int, look: str) -> None:
    """The floor as n x n points, turned and moved by its transform."""
    mesh = UsdGeom.Mesh.Define(stage, "/World/floor")
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.float32(np.stack([u, v - 3, 0 * u], 1))))
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.int32(np.stack([i, i + 1, i + n + 1, i + n], 1)).ravel()))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(i), 4))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.AddRotateXOp().Set(-90.0)
    mesh.AddTranslateOp().Set(Gf.Vec3d(0, 3, 0))
    material = UsdShade.Material(stage.GetPrimAtPath(look))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def seen(
    points: NDArray, diffuse: ArrayLike, f0: ArrayLike = (F0,) * 3, roughness: ArrayLike = ROUGHNESS,
    f90: ArrayLike = (1, 1, 1),
) -> NDArray:  # fmt: skip
    """Radiance (n, 3) of points from the eye with a reflectance of each point, by quadrature over the lamp."""
    columns = []
    for p, rough in zip(points, np.broadcast_to(roughness, len(points))):
        u, v = (np.arange(48) + 0.5) / 48 - 0.5, (np.arange(48) + 0.5) / 48 - 0.5
        offset = np.broadcast_arrays(u[:, None] * SIZE[0], 0 * u[:, None], v[None] * SIZE[1])
        at = LAMP + np.stack(offset, -1).reshape(-1, 3)
        way = at - p
        far = np.linalg.norm(way, axis=1)
        l = way / far[:, None]
        solid = l[:, 1] / far**2 * SIZE[0] * SIZE[1] / 48**2
        columns.append(ref.columns_of_light("preview_surface", float(rough), [0, 1, 0], EYE - p, l, solid))
    return radiance("preview_surface", np.array(columns)[..., None] * POWER, diffuse, f0, f90)


def places() -> np.ndarray:
    x, z = np.meshgrid(np.linspace(-0.7, 0.7, 8), np.linspace(-0.4, 0.6, 4))
    return np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], 1)


def gradient(points: np.ndarray) -> np.ndarray:
    t = ((points[:, :1] + 0.7) / 1.4).clip(0, 1)
    return LEFT * (1 - t) + RIGHT * t


def stroke(colors: np.ndarray, **more: object) -> Stroke:
    p = places()
    twice = lambda x: np.repeat(np.float32(x), 2, 0)  # noqa: E731
    n = len(p)
    return Stroke(
        "stroke_0001", twice(p), np.full(2 * n, 0.06, np.float32), twice(colors), np.tile(np.float32(EYE), (2 * n, 1)),
        curve_counts=(2,) * n, **more,
    )  # fmt: skip


def part(name: str, rows: np.ndarray, color: tuple[float, float, float]) -> Stroke:
    """A stroke on some of the places, every second of them, that asks for a diffuse colour."""
    rows = np.flatnonzero(rows)[::2]
    colors = np.zeros((len(places()), 3))
    colors[rows] = seen(places()[rows], color)
    whole, twice = stroke(colors), np.stack([2 * rows, 2 * rows + 1], 1).ravel()
    kept = {field: getattr(whole, field)[twice] for field in ("points", "widths", "colors", "eye")}
    return replace(whole, name=name, prim=f"/SlfStrokes/{name}", curve_counts=(2,) * len(rows), **kept)


def surface_at(scene: Scene, points: NDArray) -> SurfacePoints:
    """What a scene's surface is at the places nearest to points."""
    near = nearest_on_triangles(scene.triangles.positions, points)
    return evaluate_surface(scene, near.triangle.astype(np.int32), near.barycentric.astype(np.float32))
