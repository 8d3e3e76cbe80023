"""ElementLookup: the elements near any point of the scene, in constant time.

Every triangle is cut into n x n cells, two thirds of the spacing of elements wide or less.  A cell names the
elements that its points may be nearest to: of the same part and side, with an agreeing normal, and seen
from the cell rather than hidden behind a wall.  Small triangles, and cells across a sliver, share entries.
A point then compares its distance to those few.  kernels/lookup.cl holds the device twin.

    cell (i, j, upper) of (u, v):  i = floor(u n), j = floor(v n), upper: frac(u n) + frac(v n) > 1
    its number:                    i (2 n - i) + 2 j + upper,  0 .. n^2 - 1
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from usdslf.blue_noise import surface_coordinates
from usdslf.scene import F32, Scene

if TYPE_CHECKING:
    from usdslf.elements import Elements
    from usdslf.gpu.device import Device
    from usdslf.visibility import RayTracer

NONE = np.uint32(0xFFFFFFFF)
NEAR = 8  # elements an entry names
ASKED = 10  # elements that are considered for them
BATCH = 16384
BLEND = 4  # of them are blended at a point
CELLS_PER_SPACING = 1.5
ENTRIES_PER_SPACING = 3.0  # cells that are closer may share their entry
NORMAL_WEIGHT = 1.0  # spacings for a normal turned by one radian
AGREES = 0.35  # least cosine between the normals of a point and its elements, where there is a choice
LIFT = 0.2  # of their distance: how far cell and element are lifted to look at each other
SLIVER = 4096  # cells that a triangle may have whatever its area
SMALL = 3  # divisions of triangles that share entries with others
LINK_GROUP = 64  # work-items of a group
MOST_CELLS = 500_000  # beside one for each triangle


@dataclass(frozen=True)
class DeviceLookup:
    """The tables on a device, in the order in which kernels/lookup.cl takes them."""

    cells_of_triangle_d: Any  # (T, 2) uint32: first cell, divisions n
    face_normal_d: Any  # (T, 3) float32
    entry_of_cell_d: Any  # (2, C) uint32, front and back; NONE where no light comes
    elements_of_entry_d: Any  # (entries, NEAR) uint32, nearest first; the first again where there are fewer
    position_d: Any  # (N, 3) float32
    frames_d: Any  # (N, 3, 3) float32
    corners_d: Any  # (T, 3, 3) float32
    cell_count: np.uint32


class ElementLookup:
    """Tables from triangle and barycentrics to the near elements."""

    def __init__(self, scene: Scene, tracer: RayTracer, elements: Elements) -> None:
        """Builds the tables; about 30 tree queries an element, once."""
        self._scene = scene
        self._elements = elements
        table = scene.triangles
        parts = int(elements.part_of_triangle.max(initial=-1)) + 1
        group = elements.part * 2 + (elements.side < 0)
        number = np.bincount(group, minlength=2 * parts)
        mean = np.bincount(group, elements.area, minlength=2 * parts) / np.maximum(number, 1)
        spacing = np.where(number > 0, np.sqrt(mean), np.inf).reshape(parts, 2)

        cell = spacing.min(1)[elements.part_of_triangle] / CELLS_PER_SPACING
        self.divisions = _divide_triangles(table.positions, table.areas, cell)
        squares = self.divisions.astype(np.int64) ** 2
        self.first_cell = (np.cumsum(squares) - squares).astype(np.uint32)
        total = int(squares.sum())
        self.entry_of_cell = np.full((2, total), NONE, np.uint32)
        self.elements_of_entry = np.full((0, NEAR), NONE, np.uint32)
        if len(elements) == 0:
            return

        triangle = np.repeat(np.arange(len(squares), dtype=np.int32), squares)
        bary = _cell_centres(np.arange(total) - self.first_cell[triangle].astype(np.int64), self.divisions[triangle])
        position = _interpolate(table.positions, triangle, bary)
        shading = _interpolate(table.normals, triangle, bary)
        face = table.face_normals[triangle]
        shading *= np.where((shading * face).sum(1, keepdims=True) < 0, -1, 1)
        shading /= np.maximum(np.linalg.norm(shading, axis=1, keepdims=True), 1e-20)
        part = elements.part_of_triangle[triangle]
        for side in (0, 1):
            sign = 1 - 2 * side
            live = np.flatnonzero(np.isfinite(spacing[part, side]))
            # Cells of small triangles may share with others of their group, those of large ones among
            # themselves only: between two large triangles there may be a wall.
            small = self.divisions[triangle[live]] <= SMALL
            owner = np.where(small, -1 - part[live], triangle[live])
            rows, entry = _share_cells(position[live], sign * shading[live], owner, spacing[part[live], side])
            rows = live[rows]
            near = _near_elements(
                tracer,
                elements,
                group,
                position[rows],
                sign * shading[rows],
                sign * face[rows],
                part[rows] * 2 + side,
                spacing.ravel(),
            )
            self.entry_of_cell[side, live] = entry + len(self.elements_of_entry)
            self.elements_of_entry = np.concatenate([self.elements_of_entry, near])

    @property
    def face_normals(self) -> F32:
        """Unit normals (T, 3) of the triangles: a ray against them arrives on the front."""
        return self._scene.triangles.face_normals

    @property
    def nbytes(self) -> int:
        """Bytes of the tables."""
        return sum(a.nbytes for a in (self.divisions, self.first_cell, self.entry_of_cell, self.elements_of_entry))

    def entry(self, triangle: NDArray, barycentric: NDArray, side: NDArray) -> NDArray[np.uint32]:
        """Returns the entry (n,) of points on triangles, NONE on sides that have no elements."""
        tri = np.asarray(triangle)
        cell = self.first_cell[tri] + _cell_of(np.asarray(barycentric, np.float32), self.divisions[tri])
        return self.entry_of_cell[(np.asarray(side) < 0).astype(np.intp), cell]

    def nearest(
        self, triangle: NDArray, barycentric: NDArray, side: NDArray
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Finds the elements near points and the weights that blend them.

        The weight of an element falls smoothly to zero where it stops being among the four nearest, so
        what is blended has no seams within a surface.

        Args:
            triangle: (n,).
            barycentric: (n, 2).
            side: (n,) +1 front, -1 back.

        Returns: elements (n, 4), nearest first, and weights (n, 4) that sum to 1; all weights are 0 on a
            side that has no elements.  Elements of zero weight may be repeated.
        """
        tri = np.asarray(triangle)
        entry = self.entry(tri, barycentric, side)
        dead = entry == NONE
        if not len(self.elements_of_entry):
            return np.zeros((len(tri), BLEND), np.int64), np.zeros((len(tri), BLEND), np.float32)
        near = self.elements_of_entry[np.where(dead, 0, entry)]  # (n, NEAR)
        point = _interpolate(self._scene.triangles.positions, tri, np.asarray(barycentric)).astype(np.float32)
        missing = near == NONE
        near = self._filled(near)
        gap = self._elements.position[near] - point[:, None]
        distance = np.where(missing, np.float32(np.inf), np.sqrt((gap * gap).sum(2)))
        order = np.argsort(distance, 1, kind="stable")[:, : BLEND + 1]
        near = np.take_along_axis(near, order, 1)
        distance = np.take_along_axis(distance, order, 1)
        weight = blend_weights(distance)
        weight[dead] = 0
        return near[:, :BLEND].astype(np.int64), weight

    @staticmethod
    def _filled(near: NDArray[np.uint32]) -> NDArray[np.uint32]:
        return np.where(near == NONE, near[:, :1], near)

    def upload(self, device: Device) -> DeviceLookup:
        """Copies the tables to a device."""
        return DeviceLookup(
            cells_of_triangle_d=device.upload(
                np.stack([self.first_cell, self.divisions.astype(np.uint32)], 1).astype(np.uint32)
            ),
            face_normal_d=device.upload(self._scene.triangles.face_normals),
            entry_of_cell_d=device.upload(self.entry_of_cell),
            elements_of_entry_d=device.upload(self._filled(self.elements_of_entry)),
            position_d=device.upload(self._elements.position),
            frames_d=device.upload(self._elements.frame),
            corners_d=device.upload(self._scene.triangles.positions),
            cell_count=np.uint32(self.entry_of_cell.shape[1]),
        )


def link_rays(
    device: Device, tables: DeviceLookup, triangle: NDArray, barycentric: NDArray, direction: NDArray
) -> tuple[Any, Any]:
    """Names on the device what rays arrive at: several times as quick as `ElementLookup.nearest`.

    Args:
        tables: of `ElementLookup.upload`.
        triangle: (n,) that was hit, -1 for none.
        barycentric: (n, 2).
        direction: (n, 3) of travel, unit.

    Returns: device arrays: links (n, 4) uint32, element << 10 | the bin that points back along the ray,
        or ESCAPES, or BLOCKED; and weights (n, 4) that sum to 1, or to 0 where there is no light.
    """
    n = len(triangle)
    link_d = device.empty((max(n, 1), BLEND), np.uint32)
    weight_d = device.empty((max(n, 1), BLEND), np.float32)
    device.kernel("lookup", "link_rays")(
        (-(-n // LINK_GROUP) * LINK_GROUP,),
        (LINK_GROUP,),
        np.uint32(n),
        device.upload(np.asarray(triangle, np.int32)),
        device.upload(np.asarray(barycentric, np.float32)),
        device.upload(np.asarray(direction, np.float32)),
        tables.face_normal_d,
        tables.corners_d,
        tables.cells_of_triangle_d,
        tables.entry_of_cell_d,
        tables.cell_count,
        tables.elements_of_entry_d,
        tables.position_d,
        tables.frames_d,
        link_d,
        weight_d,
    )
    return link_d, weight_d


def blend_weights(distance: NDArray) -> NDArray[np.float32]:
    """Turns distances (n, 5), ascending and inf where missing, into weights (n, 4) that sum to 1.

    w = (1 - (d / R)^2)^2, R the distance of the fifth; where there are fewer, twice that of the last.
    """
    d = np.asarray(distance, np.float32)
    last = np.where(np.isfinite(d[:, :BLEND]), d[:, :BLEND], 0).max(1)
    reach = np.where(np.isfinite(d[:, BLEND]), d[:, BLEND], 2 * last)
    reach = np.maximum(reach, np.float32(1e-30))[:, None]
    ratio = np.minimum(d[:, :BLEND], reach) / reach
    w = (1 - ratio * ratio) ** 2
    w[:, 0] = np.maximum(w[:, 0], np.float32(1e-6))  # five at the same distance
    return (w / w.sum(1, keepdims=True)).astype(np.float32)


def _divide_triangles(corners: NDArray, area: NDArray, cell: NDArray) -> NDArray[np.int32]:
    """Returns divisions (T,) that make cells at most `cell` (T,) wide, wider where they are too many."""
    c = corners.astype(np.float64)
    edges = np.linalg.norm(c - np.roll(c, 1, 1), axis=2)
    with np.errstate(invalid="ignore"):
        wanted = np.nan_to_num(edges.max(1, initial=0) / cell, posinf=1) if len(c) else np.zeros(0)
        fair = np.nan_to_num(np.sqrt(SLIVER + 30 * area / cell**2), posinf=1) if len(c) else np.zeros(0)
    slack = 1.0
    while True:
        n = np.clip(np.ceil(np.minimum(wanted, slack * fair)), 1, 2048).astype(np.int32)
        if (n.astype(np.int64) ** 2).sum() <= MOST_CELLS + len(n):
            return n
        slack *= 0.8


def _cell_centres(number: NDArray, n: NDArray) -> NDArray[np.float64]:
    """Barycentrics (k, 2) of the centres of cells, by their number (k,) in triangles of n (k,) divisions."""
    n = n.astype(np.int64)
    i = np.floor(n - np.sqrt((n * n - number).astype(np.float64))).astype(np.int64)
    i -= i * (2 * n - i) > number
    i += (i + 1) * (2 * n - i - 1) <= number
    rest = number - i * (2 * n - i)
    third = (1 + rest % 2) / 3
    return np.stack([(i + third) / n, (rest // 2 + third) / n], 1)


def _cell_of(bary: NDArray, n: NDArray) -> NDArray[np.uint32]:
    """Number (k,) of the cell that barycentrics (k, 2) lie in, in float32 as on the device."""
    size = n.astype(np.float32)
    u, v = np.maximum(bary[:, 0], 0) * size, np.maximum(bary[:, 1], 0) * size
    n = n.astype(np.int32)
    i = np.minimum(u.astype(np.int32), n - 1)
    j = np.minimum(v.astype(np.int32), n - 1 - i)
    upper = ((u - i) + (v - j) > 1) & (j < n - 1 - i)
    return (i * (2 * n - i) + 2 * j + upper).astype(np.uint32)


def _share_cells(
    position: NDArray, normal: NDArray, owner: NDArray, spacing: NDArray
) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Finds cells that are as good as the same: a third of the spacing apart, alike in normal and owner.

    Returns: one cell (entries,) for each entry, and the entry (n,) of each cell.
    """
    if not len(position):
        return np.zeros(0, np.int64), np.zeros(0, np.uint32)
    box = np.floor((position - position.min(0)) / (spacing[:, None] / ENTRIES_PER_SPACING)).astype(np.int64)
    turn = np.rint(normal * 1.5).astype(np.int64)
    key = owner.astype(np.int64).astype(np.uint64)
    for column in (*box.T, *turn.T):
        key = key * np.uint64(0x9E3779B97F4A7C15) + column.astype(np.uint64)
    _, first, entry = np.unique(key, return_index=True, return_inverse=True)
    return first, entry.astype(np.uint32)


def _near_elements(
    tracer: RayTracer,
    elements: Elements,
    element_group: NDArray,
    position: NDArray,
    normal: NDArray,
    face: NDArray,
    group: NDArray,
    spacing: NDArray,
) -> NDArray[np.uint32]:
    """Names the elements (n, NEAR) near cells: nearest first, those in agreement and in sight only."""
    count = len(elements)
    both = surface_coordinates(
        np.concatenate([elements.position, position]),
        np.concatenate([elements.normal, normal]),
        np.concatenate([element_group, group]),
        spacing[np.concatenate([element_group, group])],
        NORMAL_WEIGHT,
    )
    k = min(ASKED, count)
    reach = np.linalg.norm(np.ptp(both[:, :-1], axis=0)) + 1.0  # of a group: others are not looked at
    tree = cKDTree(both[:count])
    near = tree.query(both[count:], k=k, distance_upper_bound=reach, workers=tracer.threads)[1].reshape(-1, k)
    found = near < count
    near = np.where(found, near, 0)
    out = np.full((len(position), NEAR), NONE, np.uint32)
    position, normal, face = (a.astype(np.float32) for a in (position, normal, face))
    for a in range(0, len(position), BATCH):
        rows = slice(a, a + BATCH)
        same = found[rows] & (element_group[near[rows]] == group[rows, None])
        out[rows] = _in_sight(tracer, elements, near[rows], same, position[rows], normal[rows], face[rows])
    return out


def _in_sight(
    tracer: RayTracer,
    elements: Elements,
    near: NDArray,
    same: NDArray,
    position: F32,
    normal: F32,
    face: F32,
) -> NDArray[np.uint32]:
    """Sorts near elements (n, k) by distance and keeps those (n, NEAR) that agree and are in sight."""
    cosine = np.where(same, (elements.normal[near] * normal[:, None]).sum(2), np.float32(-np.inf))
    best = cosine.max(1, keepdims=True)
    good = same & (cosine >= np.minimum(AGREES, best - 0.25))
    gap = elements.position[near] - position[:, None]
    gap2 = (gap * gap).sum(2)

    # Elements behind a wall are left out where others are in sight.
    row, column = np.nonzero(good)
    e = near[row, column]
    up = (LIFT * np.sqrt(gap2[row, column]))[:, None]
    start = tracer.offset_points(position[row] + up * face[row], face[row])
    way = elements.position[e] + up * elements.geometric_normal[e] - start
    seen = good.copy()
    seen[row, column] = ~tracer.occluded(start, way, 0.999, see_through=False)
    good = np.where(seen.any(1, keepdims=True), seen, good)

    gap2 = np.where(good, gap2, np.float32(np.inf))
    order = np.argsort(gap2, 1, kind="stable")[:, :NEAR]
    out = np.full((len(near), NEAR), NONE, np.uint32)
    out[:, : order.shape[1]] = np.where(
        np.isfinite(np.take_along_axis(gap2, order, 1)), np.take_along_axis(near, order, 1), int(NONE)
    )
    return out


def _interpolate(corners: NDArray, triangle: NDArray, bary: NDArray) -> NDArray[np.float64]:
    c = corners[triangle].astype(np.float64)
    return c[:, 0] + bary[:, :1] * (c[:, 1] - c[:, 0]) + bary[:, 1:] * (c[:, 2] - c[:, 0])
