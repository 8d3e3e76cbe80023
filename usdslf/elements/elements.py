"""Elements: blue-noise points on every side of every gprim that light can reach.

Candidates, some per element, are spread over the triangles by area, more on curved parts; those that
light cannot reach are dropped; elements are a well-spaced choice of the rest.  The others give each
element the mean reflectance of the surface around it, so that a texture finer than the spacing enters
by its average.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.reachability import CANDIDATE_ROUNDS, PROBE_ROUNDS, find_reached_points, share_of_reached
from usdslf.errors import StageError
from usdslf.progress import tell
from usdslf.runs import numbered
from usdslf.sampling.blue_noise import choose_blue_noise, surface_coordinates
from usdslf.sampling.frames import tangents
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F32, I32, Scene
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

CANDIDATES = 8  # per element
PROBES = 10  # points per part that are asked first whether light reaches a side
MOST_PROBES = 40_000  # of all parts
LEAST = 6  # elements on a side of a part, fewer where there are very many parts
CURVED = 4.0  # times as many elements, at most, for the area of a curved surface
TURN = 0.05  # radians between neighbours for which there are twice as many
LARGEST_COUNT = 1 << 22  # 32 bits less 10 for the bin
MEANS = (
    *("diffuse", "f0", "f90", "roughness", "clearcoat", "clearcoat_roughness", "coat_f0", "emission"),
    *("opacity", "presence", "base_color", "metallic", "ior", "specular_color"),
)


@dataclass(frozen=True)
class Elements:
    """N points with their reflectance, the mean over their surroundings.  Normals are flipped to `side`.

    A part is what one material covers of one gprim; where there are too many gprims, small ones of the
    same material are one part.
    """

    position: F32  # (N, 3)
    geometric_normal: F32  # (N, 3) unit
    normal: F32  # (N, 3) unit, shading
    frame: F32  # (N, 3, 3) rows tangent, bitangent, normal, right-handed; turned about the normal at random
    area: F32  # (N,) sums to what light reaches of the area of each side of a part
    mesh: I32  # (N,) into Scene.meshes
    triangle: I32  # (N,)
    barycentric: F32  # (N, 2)
    material: I32  # (N,)
    side: I32  # (N,) +1 where the normal is that of the winding, -1 on the back
    part: I32  # (N,)
    part_of_triangle: I32  # (T,) of the scene
    diffuse: F32  # (N, 3)
    f0: F32  # (N, 3)
    f90: F32  # (N, 3)
    roughness: F32  # (N,)
    clearcoat: F32  # (N,)
    clearcoat_roughness: F32  # (N,)
    coat_f0: F32  # (N,)
    emission: F32  # (N, 3)
    opacity: F32  # (N,)
    presence: F32  # (N,)
    base_color: F32  # (N, 3)
    metallic: F32  # (N,)
    ior: F32  # (N,)
    specular_color: F32  # (N, 3)

    def __len__(self) -> int:
        return len(self.position)


def sample_elements(
    scene: Scene, tracer: RayTracer, count: int = 10000, rng: np.random.Generator | None = None
) -> Elements:
    """Spreads about `count` elements over the sides of the scene's surfaces that light reaches.

    Each side of a part has its share by area, more of it (up to CURVED times) where the surface turns between
    elements: what a curved mirror sends is known as well as its elements' normals follow it.  None has fewer
    than LEAST.

    Raises: StageError where there is no surface.
    """
    assert 0 < count < LARGEST_COUNT, count
    rng = rng if rng is not None else np.random.default_rng(0)
    table = scene.triangles
    area = np.where(np.isfinite(table.areas), table.areas, 0.0)
    if not area.sum() > 0:
        raise StageError(f"{scene.stage or 'the stage'} has no surface to shade; check visibility and purpose")
    part_of_triangle = find_parts(scene, area, count)
    area_of_part = np.bincount(part_of_triangle, area)
    parts = len(area_of_part)

    # Which sides light reaches: a few probes on each part, more on large ones.
    probes = max(2, min(PROBES, MOST_PROBES // (2 * parts)))
    number = np.maximum(probes, np.ceil(4000 * area_of_part / area.sum())).astype(np.int64)
    both = np.tile(number * (area_of_part > 0), 2)
    everywhere = np.ones(2 * parts, bool)
    probed, _ = _reached_candidates(scene, tracer, area, part_of_triangle, both, everywhere, PROBE_ROUNDS, rng)
    tell(0.25)
    reached = np.bincount(probed.group, minlength=2 * parts) / np.maximum(both, 1)
    share = np.tile(_share_of_curved(scene, area, part_of_triangle, count), 2)
    if not reached.any():
        reached = (both > 0).astype(float)  # no light anywhere: all sides are as good

    # Candidates on the sides that are reached; those that are everywhere need no second look.
    side_area = np.tile(area_of_part, 2)
    quota = share_out(reached * side_area * share, count)
    number = np.ceil(CANDIDATES * quota / np.maximum(reached, 0.05)).astype(np.int64)
    doubtful = reached < 1
    pool, points = _reached_candidates(scene, tracer, area, part_of_triangle, number, doubtful, CANDIDATE_ROUNDS, rng)
    tell(0.5)
    reached = np.bincount(pool.group, minlength=2 * parts) / np.maximum(number, 1)
    quota = share_out(reached * side_area * share, count)
    spacing = np.sqrt(reached * side_area / np.maximum(quota, 1))

    coordinates = surface_coordinates(pool.position, pool.normal, pool.group, spacing[pool.group])
    chosen = choose_blue_noise(coordinates, pool.group, quota, rng)
    tell(0.9)
    number = np.bincount(pool.group[chosen], minlength=2 * parts)
    each = (reached * side_area) / np.maximum(number, 1)
    surroundings = tree_of(coordinates[chosen]).query(coordinates, workers=tracer.threads)[1]
    return elements_of_pool(points, pool.group, chosen, surroundings, each, part_of_triangle, rng)


def elements_of_pool(
    points: SurfacePoints, group: NDArray, chosen: NDArray, surroundings: NDArray, area: NDArray, part_of_triangle: I32,
    rng: np.random.Generator,
) -> Elements:  # fmt: skip
    """Makes elements of some candidates.

    Args:
        points, group: (n,) candidates, and part of each, plus the number of parts on the back.
        chosen: (N,) of them.
        surroundings: (n,) into `chosen`: the element whose means each candidate enters.
        area: (2 parts,) that an element stands for.
    """
    parts = len(area) // 2
    group = group[chosen]
    side = np.where(group < parts, 1, -1).astype(np.int32)
    flip = side[:, None].astype(np.float32)
    geometric = flip * points.geometric_normal[chosen]
    normal = _upright(flip * points.normal[chosen], geometric)
    return Elements(
        position=points.position[chosen],
        geometric_normal=geometric,
        normal=normal,
        frame=turned_frames(normal, 2 * np.pi * rng.random(len(chosen))),
        area=area[group].astype(np.float32),
        mesh=points.mesh[chosen],
        triangle=points.triangle[chosen],
        barycentric=points.barycentric[chosen],
        material=points.material[chosen],
        side=side,
        part=(group % parts).astype(np.int32),
        part_of_triangle=part_of_triangle,
        **{name: _mean(getattr(points, name), surroundings, len(chosen)) for name in MEANS},
    )


def find_parts(scene: Scene, area: NDArray, count: int) -> I32:
    """Numbers what shares elements (T,): each material of each gprim, or, of the smallest, each material."""
    table = scene.triangles
    materials = len(scene.materials) + 1
    key = table.mesh.astype(np.int64) * materials + table.material
    names, part = numbered(key)
    own = max(count // 4, 1)
    if len(names) > own:
        area_of_part = np.bincount(part, area)
        small = np.argsort(-area_of_part, kind="stable")[own:]
        names = names.copy()
        names[small] = -1 - names[small] % materials
        part = numbered(names[part])[1]
    return part.astype(np.int32)


def share_out(area: NDArray, count: int) -> NDArray[np.int64]:
    """Shares `count` out by area, each positive area having at least LEAST, or less where they are many.

    Where there are more areas than `count`, the largest have one each.
    """
    some = np.flatnonzero(area > 0)
    out = np.zeros(len(area), np.int64)
    if not len(some):
        return out
    if len(some) >= count:
        out[some[np.argsort(-area[some], kind="stable")[:count]]] = 1
        return out
    least = float(np.clip(count // (4 * len(some)), 1, LEAST))
    a = area[some].astype(np.float64)
    share = np.full(len(a), least)
    large = np.ones(len(a), bool)
    while large.any():
        share[large] = (count - least * (~large).sum()) * a[large] / a[large].sum()
        small = large & (share < least)
        if not small.any():
            break
        share[small] = least
        large &= ~small
    # Largest remainders make the sum exact.
    whole = np.floor(share + 1e-9).astype(np.int64)
    missing = max(count - int(whole.sum()), 0)
    whole[np.argsort(whole - share, kind="stable")[:missing]] += 1
    out[some] = whole
    return out


def turned_frames(normal: NDArray, angle: NDArray) -> F32:
    """Right-handed frames (n, 3, 3) about unit normals (n, 3), turned by angles (n,) [rad].

    Source: Duff et al. 2017, Building an orthonormal basis, revisited.
    """
    n = np.asarray(normal, np.float64).T
    t, b = (v.T for v in tangents(n, np.copysign(1.0, n[2])))
    c, d = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([c * t + d * b, c * b - d * t, np.asarray(normal, np.float64)], 1).astype(np.float32)


@dataclass(frozen=True)
class _Pool:
    """Candidates that light reaches, of all sides."""

    position: F32  # (n, 3)
    normal: F32  # (n, 3) geometric, of the side
    group: NDArray[np.int64]  # (n,) part, plus the number of parts on the back


def _share_of_curved(scene: Scene, area: NDArray, part_of_triangle: NDArray, count: int) -> NDArray[np.float64]:
    """How many times as many elements an area of each part gets (parts,), 1 where it is flat."""
    table = scene.triangles
    along = np.linalg.norm(np.roll(table.positions, -1, 1) - table.positions, axis=2)
    turned = np.linalg.norm(np.roll(table.normals, -1, 1) - table.normals, axis=2)
    is_edge = along > 0.01 * along.max(1, keepdims=True)
    curvature = np.where(is_edge, turned / np.maximum(along, 1e-30), 0).max(1)
    weight = area * np.isfinite(curvature)
    turns = np.bincount(part_of_triangle, weight * np.nan_to_num(curvature))
    mean = turns / np.maximum(np.bincount(part_of_triangle, weight), 1e-30)
    return np.minimum(1 + mean * np.sqrt(area.sum() / count) / TURN, CURVED)


def _reached_candidates(
    scene: Scene,
    tracer: RayTracer,
    area: NDArray,
    part_of_triangle: I32,
    number: NDArray,
    doubtful: NDArray,
    rounds: tuple[int, ...],
    rng: np.random.Generator,
) -> tuple[_Pool, SurfacePoints]:
    """Spreads `number` (2 parts,) candidates over fronts and backs and keeps those that light reaches.

    Only the groups in `doubtful` (2 parts,) are looked at by rays.
    """
    triangle, bary, group = spread_candidates(area, part_of_triangle, number, rng)
    points = evaluate_surface(scene, triangle, bary, normal_maps=False)
    parts = len(number) // 2
    normal = np.where((group < parts)[:, None], points.geometric_normal, -points.geometric_normal)
    there = points.presence > 0  # no holes of cut-outs
    if not there.any():
        there[:] = True  # all is cut out: elements that no ray meets
    reached = there.copy()
    ask = np.flatnonzero(there & doubtful[group])
    reached[ask] = find_reached_points(scene, tracer, triangle[ask], points.position[ask], normal[ask], rng, rounds)
    # What lies among those that are reached, and sees them, is only in the dark by chance; what is shut off from them
    # stays dark.
    dark = ask[~reached[ask]]
    lit = ask[reached[ask]]
    if len(dark) and len(lit):
        size = np.sqrt(np.bincount(part_of_triangle, area)[group % parts] / np.maximum(number[group], 1))
        where = surface_coordinates(points.position, normal, group, np.maximum(size, 1e-30))
        known = np.concatenate([lit, dark])
        near = tree_of(where[known]).query(where[dark], k=min(6, len(known)), workers=tracer.threads)[1]
        reached[dark[share_of_reached(tracer, points.position, normal, reached, dark, known[near]) > 0.6]] = True
    keep = np.flatnonzero(reached)
    kept = take_points(points, keep)
    return _Pool(kept.position, normal[keep].astype(np.float32), group[keep]), kept


def spread_candidates(
    area: NDArray, part_of_triangle: I32, number: NDArray, rng: np.random.Generator
) -> tuple[I32, F32, NDArray[np.int64]]:
    """Spreads points over parts by area, stratified along their triangles.

    Returns: triangle (n,), barycentric (n, 2), group (n,), which is into `number`.
    """
    parts = len(number) // 2
    order = np.argsort(part_of_triangle, kind="stable")
    running = np.cumsum(area[order])
    end = running[np.searchsorted(part_of_triangle[order], np.arange(parts), side="right") - 1]
    start = np.concatenate([[0.0], end[:-1]])
    group = np.repeat(np.arange(2 * parts), number)
    index = np.arange(len(group)) - np.repeat(np.cumsum(number) - number, number)
    part = group % parts
    along = start[part] + (end - start)[part] * (index + rng.random(len(group))) / number[group]
    row = np.searchsorted(running, along, side="right")
    first = np.searchsorted(part_of_triangle[order], np.arange(parts))
    last = np.searchsorted(part_of_triangle[order], np.arange(parts), side="right") - 1
    triangle = order[np.clip(row, first[part], last[part])].astype(np.int32)
    r, s = rng.random((2, len(group)))
    root = np.sqrt(r)
    return triangle, np.stack([root * (1 - s), root * s], 1).astype(np.float32), group


def take_points(points: SurfacePoints, rows: NDArray) -> SurfacePoints:
    """Some of the points."""
    return SurfacePoints(**{name: value[rows] for name, value in vars(points).items()})


def _mean(values: NDArray, owner: NDArray, n: int) -> F32:
    """Mean (n, ...) of the values (k, ...) of each owner (k,); each owner has one at least."""
    flat = values.reshape(len(values), -1).astype(np.float64)
    number = np.bincount(owner, minlength=n)
    sums = np.stack([np.bincount(owner, column, minlength=n) for column in flat.T], 1)
    return (sums / np.maximum(number, 1)[:, None]).reshape(n, *values.shape[1:]).astype(np.float32)


def _upright(normal: NDArray, geometric: NDArray) -> F32:
    """Shading normals (n, 3) that lean no further than 84 degrees from the geometric ones."""
    cosine = (normal * geometric).sum(1, keepdims=True)
    n = np.where(cosine < 0.1, normal + (0.1 - cosine) * geometric, normal)
    return (n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-20)).astype(np.float32)


def refresh_reflectance(elements: Elements, before: Scene, after: Scene) -> Elements:
    """Returns elements with the reflectance of a scene of the same geometry and other materials.

    Each mean moves by what the surface at the element itself moved; exact for constant inputs.
    """
    old = evaluate_surface(before, elements.triangle, elements.barycentric, normal_maps=False)
    new = evaluate_surface(after, elements.triangle, elements.barycentric, normal_maps=False)
    moved = {}
    for name in MEANS:
        value = getattr(elements, name) + getattr(new, name) - getattr(old, name)
        moved[name] = np.maximum(value, 0) if name in ("emission", "ior") else np.clip(value, 0, 1)
    return replace(elements, material=new.material, **moved)
