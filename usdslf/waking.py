"""Waking: elements for the surfaces that were dark where elements were placed, and see light at another frame.

A few probes say which sides have light now where they have no elements; only those get candidates, as `elements.py`
spreads them, and elements where none is near.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from usdslf.blue_noise import choose_blue_noise, surface_coordinates
from usdslf.elements import (
    CANDIDATES,
    LARGEST_COUNT,
    LEAST,
    PROBES,
    Elements,
    elements_of_pool,
    living_candidates,
)
from usdslf.living_sides import ROUNDS
from usdslf.scene import Scene

if TYPE_CHECKING:
    from usdslf.visibility import RayTracer

MOST_PROBES = 1000  # on all that is dark: what is lit now is found where it is more than about a hundredth of that
HOLE = 1.0  # spacings to the nearest element; those of blue noise leave no larger holes
RIM = 0.6  # spacings about a hole that its new elements may lie in too, or stand for
PROBE_ROUNDS = (1, 3)  # paths per probe


def wake_elements(elements: Elements, scene: Scene, tracer: RayTracer, rng: np.random.Generator) -> Elements:
    """Returns the elements, followed by new ones on what was dark and sees light in this scene; the same if none."""
    table = scene.triangles
    area = np.where(np.isfinite(table.areas), table.areas, 0.0)
    part_of_triangle = elements.part_of_triangle
    area_of_part = np.bincount(part_of_triangle, area)
    parts = len(area_of_part)
    group = elements.part + parts * (elements.side < 0)
    number = np.bincount(group, minlength=2 * parts)
    lit = np.bincount(group, elements.area, 2 * parts)
    side_area = np.tile(area_of_part, 2)
    usual = np.minimum(float(np.median(elements.area)), side_area / LEAST)
    each = np.where(number > 0, lit / np.maximum(number, 1), usual)
    dark = np.maximum(side_area - lit, 0)
    dark[dark < np.maximum(0.5 * each, 1e-3 * side_area)] = 0
    if not dark.any():
        return elements
    spacing = np.sqrt(np.maximum(each, 1e-30))

    beside = np.flatnonzero(dark[group] > 0)  # elements on what is partly dark

    def is_free(position: NDArray, normal: NDArray, of: NDArray, rim: float = 0.0) -> NDArray[np.bool_]:
        free = dark[of] > 0
        at = np.flatnonzero(free & (number[of] > 0))
        if len(at):
            groups = np.concatenate([group[beside], of[at]])
            both = surface_coordinates(
                np.concatenate([elements.position[beside], position[at]]),
                np.concatenate([elements.normal[beside], normal[at]]),
                groups,
                spacing[groups],
            )
            there, asked = both[: len(beside)], both[len(beside) :]
            away = cKDTree(there).query(asked, distance_upper_bound=HOLE, workers=tracer.threads)[0]
            free[at] = hole = away > HOLE
            if rim and hole.any():
                near = cKDTree(asked[hole]).query(asked, distance_upper_bound=rim, workers=tracer.threads)[0]
                free[at] = np.isfinite(near) & (away > HOLE - rim)
        return free

    # Probes as dense on the dark part of each side as they are to be, and no denser than two an element.
    share = side_area / np.where(dark > 0, dark, 1)
    probes = np.maximum(PROBES, MOST_PROBES * dark / dark.sum()) * share * (dark > 0)
    probes = np.ceil(np.minimum(probes, np.maximum(2 * side_area / each, PROBES)) * (dark > 0)).astype(np.int64)
    found, _ = living_candidates(scene, tracer, area, part_of_triangle, probes, dark > 0, PROBE_ROUNDS, rng, is_free)
    woken = np.bincount(found.group, minlength=2 * parts) > 0
    if not woken.any():
        return elements

    # Candidates in the holes and about them, so that new elements stand for what is theirs and not for the holes alone.
    spread = np.ceil(CANDIDATES * np.maximum(side_area / each, LEAST) * woken).astype(np.int64)
    pool, points = living_candidates(
        scene, tracer, area, part_of_triangle, spread, woken, ROUNDS, rng, partial(is_free, rim=RIM)
    )
    new_area = np.bincount(pool.group, minlength=2 * parts) * side_area / np.maximum(spread, 1)
    new_area = np.minimum(new_area, dark)
    quota = np.rint(new_area / each).astype(np.int64)
    if not quota.any():
        return elements
    coordinates = surface_coordinates(pool.position, pool.normal, pool.group, spacing[pool.group])
    chosen = choose_blue_noise(coordinates, pool.group, quota, rng)
    assert len(elements) + len(chosen) < LARGEST_COUNT, len(chosen)
    count = np.bincount(pool.group[chosen], minlength=2 * parts)
    surroundings = cKDTree(coordinates[chosen]).query(coordinates, workers=tracer.threads)[1]
    each = new_area / np.maximum(count, 1)
    new = elements_of_pool(points, pool.group, chosen, surroundings, each, part_of_triangle, rng)
    names = [f.name for f in fields(Elements) if f.name != "part_of_triangle"]
    return replace(elements, **{n: np.concatenate([getattr(elements, n), getattr(new, n)]) for n in names})
