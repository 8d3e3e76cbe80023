"""Motion: elements of one frame at another, and visibility again for what moved alone.

    move_elements(elements, before, after, moved) -> Elements at the same places of their gprims
    why_not_spaced(before, after) -> why these are no longer spaced well
    retrace(...) -> Visibility, the same links as a trace of everything gives

A ray is traced again where it starts on something that moved, ended on it before (or on a dark side, or where hits are
named by other elements now), or lies in the cone of its bounding sphere now, and of that before where what moved can be
seen through.

Source: Nguyen et al. 2013, 6.1.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import LEAST, Elements
from usdslf.elements.lookup import ElementLookup
from usdslf.elements.neighbours import NONE, PER_ENTRY
from usdslf.gpu.device import Device
from usdslf.light_field.links import BLOCKED
from usdslf.light_field.visibility import Visibility, trace_bins
from usdslf.rays import RayTracer
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.scene.difference import Afresh, Moved, Space, Why
from usdslf.scene.records import F32, Scene
from usdslf.surfaces.surface_points import evaluate_surface

MOST_STRETCH = 2.0  # of the area that the elements of a side stand for, up or down, before they are placed afresh


def move_elements(elements: Elements, before: Scene, after: Scene, moved: NDArray) -> Elements:
    """Returns the elements with those on moved meshes (M,) at the same places of their triangles.

    Each stands for an area that follows its triangle's; where a whole side is alive, all of them for its area.
    """
    rows = np.flatnonzero(moved[elements.mesh])
    if not len(rows):
        return elements
    points = evaluate_surface(after, elements.triangle[rows], elements.barycentric[rows], normal_maps=False)
    flip = elements.side[rows, None].astype(np.float32)
    geometric, normal = flip * points.geometric_normal, flip * points.normal
    lean = (normal * geometric).sum(1, keepdims=True)
    normal = np.where(lean < 0.1, normal + (0.1 - lean) * geometric, normal)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20)
    tangent = elements.frame[rows, 0]
    tangent = tangent - (tangent * normal).sum(1, keepdims=True) * normal
    upright = np.linalg.norm(tangent, axis=1) < 1e-3  # turned by a quarter: its other axis
    other = elements.frame[rows, 1]
    other = other - (other * normal).sum(1, keepdims=True) * normal
    tangent = np.where(upright[:, None], other, tangent)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], 1)
    changes = {"position": points.position, "geometric_normal": geometric, "normal": normal, "frame": frame}
    changes["area"] = _stretched_areas(elements, before, after)[rows]
    new = {}
    for name, value in changes.items():
        array = getattr(elements, name).copy()
        array[rows] = value
        new[name] = array
    return replace(elements, **new)


def _stretched_areas(elements: Elements, before: Scene, after: Scene) -> F32:
    """Areas (N,) that follow those of the triangles."""
    old, new = before.triangles.areas, after.triangles.areas
    t = elements.triangle
    area = elements.area * np.where(old[t] > 0, new[t] / np.where(old[t] > 0, old[t], 1), 1)
    group, sides = _sides(elements)
    side_area = [np.tile(np.bincount(elements.part_of_triangle, np.nan_to_num(a)), 2) for a in (old, new)]
    is_full = np.bincount(group, elements.area, sides) > 0.999 * side_area[0]
    sum_ = np.bincount(group, area, sides)
    scale = np.where(is_full & (sum_ > 0), side_area[1] / np.where(sum_ > 0, sum_, 1), 1)
    return (area * scale[group]).astype(np.float32)


def _sides(elements: Elements) -> tuple[NDArray, int]:
    """Which side (N,) of which part each element is on, and how many there are."""
    parts = int(elements.part_of_triangle.max(initial=-1)) + 1
    return elements.part + parts * (elements.side < 0), 2 * parts


def why_not_spaced(before: Elements, after: Elements) -> Afresh | None:
    """Returns why elements that moved are no longer spaced well; None where they are."""
    group, sides = _sides(before)
    number = np.bincount(group, minlength=sides)
    old, new = (np.bincount(group, e.area, sides) for e in (before, after))
    ratio = np.where(number > LEAST, new / np.where(old > 0, old, 1), 1)
    if ratio.max(initial=1) > MOST_STRETCH or ratio.min(initial=1) < 1 / MOST_STRETCH:
        far = ratio[np.argmax(np.abs(np.log(np.maximum(ratio, 1e-30))))]
        return Afresh(Why.STRETCHED, f"{far:.3g}")
    return None


def retrace(
    seen: Visibility, before: ElementLookup, elements: Elements, lookup: ElementLookup, tracer: RayTracer,
    device: Device, moved: Moved,
) -> Visibility:  # fmt: skip
    """Traces again what the motion can have changed.

    Args:
        seen, before: visibility and lookup of the elements where they were.
        elements: the same, and more of them after those.
        lookup, tracer: of the scene now.
    """
    began = perf_counter()
    scene, known, count = tracer.scene, len(seen.hit), len(elements)
    is_affected = np.zeros(known + 1, bool)  # the last stands for no element
    is_affected[_named_otherwise(before, lookup, scene, moved.meshes)] = True
    own = moved.meshes[elements.mesh]
    materials = np.unique(scene.triangles.material[moved.meshes[scene.triangles.mesh]])
    opaque = all(scene.materials[m].is_opaque for m in materials)
    # What let a ray through changed its length by rounding: it is traced again where that is gone, too.
    cones = _cones((moved.after,) if opaque else (moved.after, moved.before), elements, tracer)
    bins = np.ascontiguousarray(bin_directions().T, np.float32)

    def wanted(rows: slice) -> NDArray[np.bool_]:
        hit = seen.hit[rows]  # fewer than rows, where elements are new
        found = np.empty((len(own[rows]), D), bool)
        found[len(hit) :] = True
        found[: len(hit)] = is_affected.take(hit >> np.uint32(10), mode="clip")
        found[: len(hit)] |= hit == BLOCKED
        found[own[rows]] = True
        for axis, cosine in cones:
            found |= axis[rows] @ bins >= cosine[rows, None]
        return found

    links = np.empty((count, D), np.uint32)
    links[:known] = seen.hit
    rays = trace_bins(elements, lookup, tracer, device, links.reshape(-1), wanted)
    return Visibility(links, rays, perf_counter() - began)


def _cones(spaces: tuple[Space, ...], elements: Elements, tracer: RayTracer) -> list[tuple[F32, F32]]:
    """For each sphere: axis (N, 3) in the elements' frames and least cosine (N,) of the rays that meet it."""
    start = tracer.offset_points(elements.position, elements.geometric_normal, elements.triangle).astype(np.float64)
    # Rays that a leaning normal sends below the surface are lifted out of it, by less than it leans.
    lean = np.arccos(np.clip((elements.normal * elements.geometric_normal).sum(1, dtype=np.float64), -1, 1))
    wider = np.where(lean < np.radians(3.1), 0, 1.05 * lean + 0.01)
    found = []
    for space in spaces:
        for centre, radius in zip(space.centre, space.radius, strict=True):
            towards = centre - start
            distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-30)
            sine = 1.001 * radius / distance
            angle = np.arcsin(np.minimum(sine, 1)) + wider
            cosine = np.where((sine >= 1) | (angle >= np.pi), -2, np.cos(angle) - 2e-6)
            axis = np.einsum("nij,nj->ni", elements.frame, towards / distance[:, None])
            found.append((axis.astype(np.float32), cosine.astype(np.float32)))
    return found


def _named_otherwise(before: ElementLookup, now: ElementLookup, scene: Scene, moved: NDArray) -> NDArray[np.int64]:
    """The elements that named hits on what moved, and on cells that name others now."""
    asked = np.ones(len(now.divisions), bool)
    found = [np.zeros((0, PER_ENTRY), np.uint32)]
    if now.kept_from is before:
        # Cells that were kept share their entries with those before, which are told apart one by one.
        old, new = before.elements_of_entry[now.kept_entries], now.elements_of_entry[: len(now.kept_entries)]
        found.append(old[(old != new).any(1)])
        asked = now.done_again
    stay = ~moved[scene.triangles.mesh] & (before.divisions == now.divisions)
    gone, same = (_cells_of(before, asked & ~stay), _cells_of(before, asked & stay))
    found.append(_lists(before, gone).reshape(-1, PER_ENTRY))
    old, new = _lists(before, same), _lists(now, _cells_of(now, asked & stay))
    found.append(old[(old != new).any(-1)])
    names = np.unique(np.concatenate(found))
    return names[names != NONE].astype(np.int64)


def _cells_of(lookup: ElementLookup, triangles: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The cells (n,) of some triangles (T,)."""
    return np.flatnonzero(np.repeat(triangles, lookup.divisions.astype(np.int64) ** 2))


def _lists(lookup: ElementLookup, cells: NDArray) -> NDArray[np.uint32]:
    """The elements (2, cells, n) that hits of each side on each cell are named by, all ones for none."""
    entry = lookup.entry_of_cell[:, cells]
    none = entry == NONE
    lists = lookup.elements_of_entry[np.where(none, 0, entry).astype(np.int64)]
    return np.where(none[..., None], NONE, lists)
