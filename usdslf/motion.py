"""Motion: what moved between two frames, and visibility again for that alone.

    moved_meshes(before, after) -> (M,) bool, None where the frames cannot be compared
    move_elements(elements, before, after, moved) -> Elements at the same places of their gprims
    retrace(...) -> Visibility, the same links as a trace of everything gives

A ray is traced again where it starts on something that moved, ended on it before (or on a dark side, or where hits are
named by other elements now), or lies in the cone of its bounding sphere now.  Where what moved can be seen through,
everything is traced.

Source: Nguyen et al. 2013, 6.1.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from usdslf.directions import bin_directions
from usdslf.element_lookup import NONE, ElementLookup
from usdslf.elements import Elements
from usdslf.gpu.device import Device
from usdslf.scene import Material, Scene
from usdslf.surface import evaluate_surface, is_opaque
from usdslf.visibility import BLOCKED, RayTracer, Visibility, trace_bins, trace_visibility


def moved_meshes(before: Scene, after: Scene) -> NDArray[np.bool_] | None:
    """Returns which meshes (M,) are elsewhere or of another shape; None where meshes, triangles or opacity differ."""
    if len(before.meshes) != len(after.meshes) or len(before.materials) != len(after.materials):
        return None
    if any(_opacity(a) != _opacity(b) for a, b in zip(before.materials, after.materials)):
        return None
    moved = np.zeros(len(after.meshes), bool)
    for i, (a, b) in enumerate(zip(before.meshes, after.meshes)):
        same = a.path == b.path and np.array_equal(a.triangles, b.triangles)
        if not same or not np.array_equal(a.material_of_triangle, b.material_of_triangle):
            return None
        moved[i] = not (
            np.array_equal(a.positions, b.positions) and np.array_equal(a.corner_normals, b.corner_normals)
        )
    return moved


def _opacity(m: Material) -> tuple[str, float, str]:
    """What says how far a material is seen through, for comparison."""
    return repr(m.opacity), m.opacity_threshold, m.opacity_mode


def move_elements(elements: Elements, after: Scene, moved: NDArray) -> Elements:
    """Returns the elements with those on moved meshes (M,) at the same places of their triangles."""
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
    new = {}
    for name, value in changes.items():
        array = getattr(elements, name).copy()
        array[rows] = value
        new[name] = array
    return replace(elements, **new)


def retrace(
    seen: Visibility, before: ElementLookup, elements: Elements, lookup: ElementLookup, tracer: RayTracer,
    device: Device, moved: NDArray,
) -> Visibility:  # fmt: skip
    """Traces again what the motion of some meshes (M,) can have changed.

    Args:
        seen, before: visibility and lookup of the same elements where they were.
        lookup, tracer: of the scene now.
    """
    began = perf_counter()
    scene = tracer.scene
    materials = np.unique(scene.triangles.material[moved[scene.triangles.mesh]])
    affected = _named_otherwise(before, lookup, scene, moved)
    if affected is None or not all(is_opaque(scene.materials[m]) for m in materials):
        return trace_visibility(elements, lookup, tracer, device)
    is_affected = np.zeros(len(elements) + 1, bool)
    is_affected[affected] = True
    named = np.minimum(seen.hit >> 10, len(elements))  # the last stands for no element
    wanted = is_affected[named] | (seen.hit == BLOCKED) | moved[elements.mesh][:, None]
    _add_met(wanted, elements, scene, moved)
    hit = seen.hit.reshape(-1).copy()
    trace_bins(elements, lookup, tracer, device, hit, wanted)
    return Visibility(hit.reshape(seen.hit.shape), int(wanted.sum()), perf_counter() - began)


def _add_met(wanted: NDArray, elements: Elements, scene: Scene, moved: NDArray) -> None:
    """Marks the rays that may meet a moved mesh at its new place: those in the cone of its bounding sphere."""
    bins = bin_directions().astype(np.float32)
    lean = (elements.normal * elements.geometric_normal).sum(1)
    wanted |= (lean < np.cos(np.radians(3.2)))[:, None]  # whose low rays are lifted
    for mesh in np.flatnonzero(moved):
        points = scene.meshes[mesh].positions.astype(np.float64)
        centre = 0.5 * (points.min(0) + points.max(0))
        radius = np.linalg.norm(points - centre, axis=1).max()
        towards = centre - elements.position
        distance = np.linalg.norm(towards, axis=1)
        sine = np.minimum(radius / np.maximum(distance, 1e-30), 1) * 1.001
        cosine = np.where(sine >= 1, -1.0, np.sqrt(np.maximum(1 - sine * sine, 0))) - 1e-4
        axis = np.einsum("nij,nj->ni", elements.frame, towards / np.maximum(distance, 1e-30)[:, None])
        wanted |= axis.astype(np.float32) @ bins.T >= cosine[:, None].astype(np.float32)


def _named_otherwise(before: ElementLookup, now: ElementLookup, scene: Scene, moved: NDArray) -> NDArray | None:
    """The elements that named hits on what moved, and on cells that name others now; None where cells differ."""
    if not np.array_equal(before.divisions, now.divisions):
        return None
    cell_moved = np.repeat(moved[scene.triangles.mesh], now.divisions.astype(np.int64) ** 2)
    old, new = _lists(before), _lists(now)
    other = cell_moved[None] | (old != new).any(-1)
    found = np.unique(old[other])
    return found[found != NONE].astype(np.int64)


def _lists(lookup: ElementLookup) -> NDArray[np.uint32]:
    """The elements (2, cells, n) that hits of each side on each cell are named by, all ones for none."""
    entry = lookup.entry_of_cell
    none = entry == NONE
    lists = lookup.elements_of_entry[np.where(none, 0, entry).astype(np.int64)]
    return np.where(none[..., None], NONE, lists)
