"""Revealed: elements for the surfaces that were dark where elements were placed, and see light at another frame.

Probes say which sides see light now and did not before; only those get candidates, as `elements.py` spreads them, and
elements where none is near and most of the neighbourhood sees light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import (
    CANDIDATES,
    LARGEST_COUNT,
    LEAST,
    PROBES,
    Elements,
    elements_of_pool,
    spread_candidates,
    take_points,
)
from usdslf.elements.reachability import CANDIDATE_ROUNDS, find_reached_points, share_of_reached
from usdslf.sampling.blue_noise import choose_blue_noise, surface_coordinates
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F32, I32, Scene
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

MOST_PROBES = 1000  # on all that is dark: what is lit now is found where it is more than about a hundredth of that
DARK_PROBE_ROUNDS = (1, 3)  # paths per probe
HOLE = 1.0  # spacings to the nearest element; those of blue noise leave no larger holes
RIM = 0.6  # spacings about a hole that its new elements may lie in too, or stand for
SEED = 1
NEIGHBOURS = 8  # candidates, of which most see light where one is kept

_Free = Callable[[SurfacePoints, NDArray, NDArray, float], NDArray]
"""points, normals of their sides (n, 3), groups (n,), rim -> which have no element near (n,)."""


@dataclass(frozen=True)
class DarkProbes:
    """n places without elements near, where elements were laid, and which of them saw light there."""

    triangle: I32  # (n,)
    barycentric: F32  # (n, 2)
    group: NDArray[np.int64]  # (n,) part, plus the number of parts on the back
    reached: NDArray[np.bool_]  # (n,)


@dataclass(frozen=True)
class _Sides:
    """Fronts of all parts, then backs."""

    area: NDArray  # (2 parts,)
    each: NDArray  # (2 parts,) area of an element
    dark: NDArray  # (2 parts,) area without elements, 0 where it is too small for one


def probe_dark(elements: Elements, scene: Scene, tracer: RayTracer) -> DarkProbes:
    """Spreads probes over what has no elements, at the frame that the elements were laid at."""
    rng = np.random.default_rng(SEED)
    area = _finite_areas(scene)
    sides = _sides(elements, area)
    dark, total = sides.dark, len(sides.dark)
    # As dense on the dark part of each side as they are to be, and no denser than two an element.
    share = sides.area / np.where(dark > 0, dark, 1)
    number = np.maximum(PROBES, MOST_PROBES * dark / max(dark.sum(), 1e-30)) * share
    number = np.minimum(number, np.maximum(2 * sides.area / sides.each, PROBES)) * (dark > 0)
    triangle, bary, group = spread_candidates(area, elements.part_of_triangle, np.ceil(number).astype(np.int64), rng)
    points = evaluate_surface(scene, triangle, bary, normal_maps=False)
    ask = np.flatnonzero(_free_of(elements, sides, tracer)(points, _normals(points, group, total), group, 0.0))
    nobody = np.zeros(len(ask), bool)
    probes = DarkProbes(triangle[ask], bary[ask], group[ask], nobody)
    return replace(probes, reached=_is_reached(probes, scene, tracer, total))


def reveal_elements(
    elements: Elements, probes: DarkProbes, scene: Scene, tracer: RayTracer, rng: np.random.Generator
) -> Elements:
    """Returns the elements, followed by new ones on what was dark and sees light now; the same if nothing is.

    Args:
        elements: where they are now; probes: of the frame that they were laid at.
        scene, tracer: of now.
    """
    total = 2 * (int(elements.part_of_triangle.max(initial=-1)) + 1)
    revealed = _revealed_sides(probes, scene, tracer, total)
    if not revealed.any():
        return elements
    area = _finite_areas(scene)
    sides = _sides(elements, area)
    is_free = _free_of(elements, sides, tracer)

    # Candidates in the holes and about them, so that new elements stand for what is theirs and not for the holes alone.
    part_of_triangle = elements.part_of_triangle
    number = np.ceil(CANDIDATES * np.maximum(sides.area / sides.each, LEAST) * revealed).astype(np.int64)
    triangle, bary, group = spread_candidates(area, part_of_triangle, number, rng)
    points = evaluate_surface(scene, triangle, bary, normal_maps=False)
    normal = _normals(points, group, total)
    ask = np.flatnonzero(is_free(points, normal, group, RIM))
    reached = find_reached_points(
        scene, tracer, triangle[ask], points.position[ask], normal[ask], rng, CANDIDATE_ROUNDS
    )  # fmt: skip
    spacing = np.sqrt(sides.each)
    coordinates = surface_coordinates(points.position[ask], normal[ask], group[ask], spacing[group[ask]])
    k = min(NEIGHBOURS, len(ask))
    near = tree_of(coordinates).query(coordinates, k=k, workers=tracer.threads)[1].reshape(len(ask), k)
    # Few see light by chance deep inside of something, and none of those around see it behind a wall.
    share = share_of_reached(tracer, points.position[ask], normal[ask], reached, np.arange(len(ask)), near)
    kept = np.flatnonzero(share > 0.5)
    coordinates, ask = coordinates[kept], ask[kept]
    group, points = group[ask], take_points(points, ask)

    new_area = np.minimum(np.bincount(group, minlength=total) * sides.area / np.maximum(number, 1), sides.dark)
    quota = np.rint(new_area / sides.each).astype(np.int64)
    if not quota.any():
        return elements
    chosen = choose_blue_noise(coordinates, group, quota, rng)
    assert len(elements) + len(chosen) < LARGEST_COUNT, len(chosen)
    each = new_area / np.maximum(np.bincount(group[chosen], minlength=total), 1)
    surroundings = tree_of(coordinates[chosen]).query(coordinates, workers=tracer.threads)[1]
    new = elements_of_pool(points, group, chosen, surroundings, each, part_of_triangle, rng)
    names = [f.name for f in fields(Elements) if f.name != "part_of_triangle"]
    return replace(elements, **{n: np.concatenate([getattr(elements, n), getattr(new, n)]) for n in names})


def _sides(elements: Elements, area: NDArray) -> _Sides:
    side_area = np.tile(np.bincount(elements.part_of_triangle, area), 2)
    group = _groups(elements, len(side_area))
    number = np.bincount(group, minlength=len(side_area))
    lit = np.bincount(group, elements.area, len(side_area))
    usual = np.minimum(float(np.median(elements.area)), side_area / LEAST)
    each = np.maximum(np.where(number > 0, lit / np.maximum(number, 1), usual), 1e-30)
    dark = np.maximum(side_area - lit, 0)
    dark[dark < np.maximum(0.5 * each, 1e-3 * side_area)] = 0
    return _Sides(side_area, each, dark)


def _groups(elements: Elements, total: int) -> NDArray[np.int64]:
    found: NDArray[np.int64] = elements.part + (total // 2) * (elements.side < 0).astype(np.int64)
    return found


def _normals(points: SurfacePoints, group: NDArray, total: int) -> NDArray:
    return np.where((group < total // 2)[:, None], points.geometric_normal, -points.geometric_normal)


def _free_of(elements: Elements, sides: _Sides, tracer: RayTracer) -> _Free:
    """Makes the function that tells which places have no element near."""
    of_element = _groups(elements, len(sides.dark))
    number = np.bincount(of_element, minlength=len(sides.dark))
    beside = np.flatnonzero(sides.dark[of_element] > 0)  # elements on what is partly dark
    spacing = np.sqrt(sides.each)

    def is_free(points: SurfacePoints, normal: NDArray, group: NDArray, rim: float) -> NDArray[np.bool_]:
        free = (sides.dark[group] > 0) & (points.presence > 0)  # no holes of cut-outs
        at = np.flatnonzero(free & (number[group] > 0))
        if not len(at):
            return free
        groups = np.concatenate([of_element[beside], group[at]])
        both = surface_coordinates(
            np.concatenate([elements.position[beside], points.position[at]]),
            np.concatenate([elements.normal[beside], normal[at]]),
            groups,
            spacing[groups],
        )
        there, asked = both[: len(beside)], both[len(beside) :]
        away = tree_of(there).query(asked, distance_upper_bound=HOLE, workers=tracer.threads)[0]
        free[at] = hole = away > HOLE
        if rim and hole.any():
            near = tree_of(asked[hole]).query(asked, distance_upper_bound=rim, workers=tracer.threads)[0]
            free[at] = np.isfinite(near) & (away > HOLE - rim)
        return free

    return is_free


def _finite_areas(scene: Scene) -> NDArray:
    return np.where(np.isfinite(scene.triangles.areas), scene.triangles.areas, 0.0)


def _is_reached(probes: DarkProbes, scene: Scene, tracer: RayTracer, total: int) -> NDArray[np.bool_]:
    """Tells which probes (n,) see light in a scene, by the same random numbers in all."""
    points = evaluate_surface(scene, probes.triangle, probes.barycentric, normal_maps=False)
    normal, rng = _normals(points, probes.group, total), np.random.default_rng(SEED)
    return find_reached_points(scene, tracer, probes.triangle, points.position, normal, rng, DARK_PROBE_ROUNDS)


def _revealed_sides(probes: DarkProbes, scene: Scene, tracer: RayTracer, total: int) -> NDArray[np.bool_]:
    """Tells which sides (2 parts,) see light where they did not.

    Probes deep inside of something find light by chance, as often before as now (McNemar's test, two sigma).
    """
    if not len(probes.group):
        return np.zeros(total, bool)
    reached = _is_reached(probes, scene, tracer, total)
    gained = np.bincount(probes.group[reached & ~probes.reached], minlength=total)
    lost = np.bincount(probes.group[probes.reached & ~reached], minlength=total)
    found: NDArray[np.bool_] = gained - lost > 2 * np.sqrt(gained + lost)
    return found
