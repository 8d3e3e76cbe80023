"""ElementLookup: the elements near any point of the scene, in constant time.

Every triangle is cut into n x n cells, two thirds of the spacing of elements wide or less.  A cell names the
elements that its points may be nearest to: of the same part and side, with an agreeing normal, and seen
from the cell rather than hidden behind a wall.  Small triangles, and cells across a sliver, share entries.
A point then compares its distance to those few.  kernels/lookup.cl holds the device twin, lookup_cells.py the cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.cells import (
    MOST_CELLS,
    cell_centres,
    cell_of,
    divide_triangles,
    interpolate,
    share_cells,
    steady_divisions,
    wanted_divisions,
)
from usdslf.elements.neighbours import NONE, PER_ENTRY, near_elements
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import Scene

if TYPE_CHECKING:
    from usdslf.elements.elements import Elements
    from usdslf.gpu.device import Device
    from usdslf.rays import RayTracer
    from usdslf.scene.difference import Moved

BLEND = 4  # of them are blended at a point
CELLS_PER_SPACING = 1.5
SMALL = 3  # divisions of triangles that share entries with others
_TABLES = (
    *("divisions", "_slack", "entry_of_cell", "elements_of_entry"),
    *("_cell_of_entry", "_reach_of_entry", "_middle_of_entry"),
)
SAME_SPACING = 0.05  # share by which that of a part may change before its cells are done again


@dataclass(frozen=True)
class DeviceLookup:
    """The tables on a device, in the order in which kernels/lookup.cl takes them."""

    cells_of_triangle_d: Any  # (T, 2) uint32: first cell, divisions n
    face_normal_d: Any  # (T, 3) float32
    entry_of_cell_d: Any  # (2, C) uint32, front and back; NONE where no light comes
    elements_of_entry_d: Any  # (entries, PER_ENTRY) uint32, nearest first; the first again where there are fewer
    position_d: Any  # (N, 3) float32
    frames_d: Any  # (N, 3, 3) float32
    corners_d: Any  # (T, 3, 3) float32
    cell_count: np.uint32


class ElementLookup:
    """Tables from triangle and barycentrics to the near elements."""

    def __init__(self, scene: Scene, tracer: RayTracer, elements: Elements) -> None:
        """Builds the tables; about 30 tree queries an element, once."""
        self._measure(scene, elements)
        table = scene.triangles
        self.divisions, self._slack = divide_triangles(table.positions, table.areas, self._cell_size)
        self._make_room(np.ones(len(table.areas), bool))
        self._fill(tracer, [])

    @property
    def tables(self) -> dict[str, NDArray]:
        """All that `of_tables` makes the same lookup of."""
        return {name: np.asarray(getattr(self, name)) for name in _TABLES}

    @staticmethod
    def of_tables(scene: Scene, elements: Elements, tables: Mapping[str, NDArray]) -> ElementLookup:
        """Returns the lookup of which `tables` were taken, for equal elements of an equal scene."""
        found = ElementLookup.__new__(ElementLookup)
        found._measure(scene, elements)
        found.divisions, found._slack = tables["divisions"], float(tables["_slack"])
        found._make_room(np.ones(len(found.divisions), bool))
        for name in _TABLES[2:]:
            setattr(found, name, tables[name])
        return found

    def after(self, scene: Scene, tracer: RayTracer, elements: Elements, moved: Moved) -> ElementLookup:
        """Returns the tables of the same elements, and new ones behind them, after something moved.

        Cells that this did not concern stay as they are; where all are concerned, the tables are built anew.
        """
        now = ElementLookup.__new__(ElementLookup)
        now._measure(scene, elements)
        again = self._parts_to_do(now, moved)[elements.part_of_triangle]
        if again.all() or not now._divide_again(self, again):
            return ElementLookup(scene, tracer, elements)
        now._make_room(again)
        if len(elements):
            now._fill(tracer, [now._keep(self, again, moved)])
        return now

    def _measure(self, scene: Scene, elements: Elements) -> None:
        """Finds how far apart elements are on each side of each part, and how wide cells are to be."""
        self._scene, self._elements = scene, elements
        parts = int(elements.part_of_triangle.max(initial=-1)) + 1
        self._group = elements.part * 2 + (elements.side < 0)
        number = np.bincount(self._group, minlength=2 * parts)
        mean = np.bincount(self._group, elements.area, minlength=2 * parts) / np.maximum(number, 1)
        self._spacing = np.where(number > 0, np.sqrt(mean), np.inf).reshape(parts, 2)
        self._number = number.reshape(parts, 2)
        self._cell_size = self._spacing.min(1)[elements.part_of_triangle] / CELLS_PER_SPACING

    def _divide_again(self, before: ElementLookup, again: NDArray[np.bool_]) -> bool:
        """Divides some triangles (T,) anew, the others as before; tells whether there are few enough cells for that."""
        table, cell = self._scene.triangles, self._cell_size
        self._slack, self.divisions = before._slack, before.divisions.copy()
        wanted = wanted_divisions(table.positions[again], table.areas[again], cell[again], self._slack)
        self.divisions[again] = steady_divisions(wanted, before.divisions[again])
        return bool((self.divisions.astype(np.int64) ** 2).sum() <= 1.5 * (MOST_CELLS + len(cell)))

    def _make_room(self, again: NDArray[np.bool_]) -> None:
        """Makes the tables, with nothing in them."""
        squares = self.divisions.astype(np.int64) ** 2
        self.first_cell = (np.cumsum(squares) - squares).astype(np.uint32)
        self.entry_of_cell = np.full((2, int(squares.sum())), NONE, np.uint32)
        self.elements_of_entry = np.full((0, PER_ENTRY), NONE, np.uint32)
        self.kept_from: ElementLookup | None = None  # with what stayed as it was there:
        self.kept_entries = np.zeros(0, np.int64)  # (k,) there, of the first k entries
        self.done_again = again  # (T,)
        self._cell_of_entry = np.zeros(0, np.int64)  # (entries,) that stands for its others, + C on the back
        self._reach_of_entry = np.zeros(0, np.float32)  # (entries,) within which something can hide its elements
        self._middle_of_entry = np.zeros((0, 3), np.float32)  # (entries, 3) of that cell

    def _fill(self, tracer: RayTracer, asked: list[tuple[NDArray, ...]]) -> None:
        """Gives cells of triangles that are done again their entries, and all that are asked for their elements.

        Args:
            asked: entries (n,) and cells (n,) of those that stayed and are named again.
        """
        if not len(self._elements):
            return
        cells = np.flatnonzero(np.repeat(self.done_again, self.divisions.astype(np.int64) ** 2))
        triangle, position, shading, _ = self._cells(cells)
        part, total = self._elements.part_of_triangle[triangle], self.entry_of_cell.shape[1]
        first = len(self.elements_of_entry)
        for side in (0, 1):
            sign = 1 - 2 * side
            lit = np.flatnonzero(np.isfinite(self._spacing[part, side]))
            # Cells of small triangles may share with others of their group, those of large ones among
            # themselves only: between two large triangles there may be a wall.
            small = self.divisions[triangle[lit]] <= SMALL
            owner = np.where(small, -1 - part[lit], triangle[lit])
            rows, entry = share_cells(position[lit], sign * shading[lit], owner, self._spacing[part[lit], side])
            self.entry_of_cell[side, cells[lit]] = entry + first
            asked.append((np.arange(first, first + len(rows)), cells[lit[rows]] + side * total))
            first += len(rows)
        self._name(tracer, first, *(np.concatenate(x) for x in zip(*asked, strict=True)))

    def _cells(self, cells: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Triangle (n,), centre (n, 3), unit shading and face normal (n, 3) of some cells (n,), on the front."""
        table = self._scene.triangles
        triangle = (np.searchsorted(self.first_cell, cells, side="right") - 1).astype(np.int32)
        bary = cell_centres(cells - self.first_cell[triangle].astype(np.int64), self.divisions[triangle])
        position = interpolate(table.positions, triangle, bary)
        shading = interpolate(table.normals, triangle, bary)
        face = table.face_normals[triangle]
        shading *= np.where((shading * face).sum(1, keepdims=True) < 0, -1, 1)
        shading /= np.maximum(np.linalg.norm(shading, axis=1, keepdims=True), 1e-20)
        return triangle, position, shading, face

    def _name(self, tracer: RayTracer, count: int, entry: NDArray, cell: NDArray) -> None:
        """Names the elements of some entries (n,), of `count`, whose cells (n,), + C on the back, stand for them."""
        total = self.entry_of_cell.shape[1]
        more = count - len(self.elements_of_entry)
        self.elements_of_entry = np.concatenate([self.elements_of_entry, np.full((more, PER_ENTRY), NONE, np.uint32)])
        self._cell_of_entry = np.concatenate([self._cell_of_entry, np.zeros(more, np.int64)])
        self._reach_of_entry = np.concatenate([self._reach_of_entry, np.zeros(more, np.float32)])
        self._middle_of_entry = np.concatenate([self._middle_of_entry, np.zeros((more, 3), np.float32)])
        triangle, position, shading, face = self._cells(cell % total)
        back = cell >= total
        sign = np.where(back, -1, 1)[:, None]
        near, reach = near_elements(
            tracer,
            self._elements,
            self._group,
            position,
            sign * shading,
            sign * face,
            self._elements.part_of_triangle[triangle] * 2 + back,
            self._spacing.ravel(),
        )
        self.elements_of_entry[entry], self._cell_of_entry[entry] = near, cell
        self._reach_of_entry[entry], self._middle_of_entry[entry] = reach, position

    def _parts_to_do(self, now: ElementLookup, moved: Moved) -> NDArray[np.bool_]:
        """Tells which parts have moved, or elements on a side that had none, or another spacing than before."""
        todo = ((self._number == 0) != (now._number == 0)).any(1)
        with np.errstate(invalid="ignore"):
            steady = np.abs(self._spacing - now._spacing) <= SAME_SPACING * self._spacing
        todo |= ~(steady | (self._spacing == now._spacing)).all(1)
        part_of_triangle = now._elements.part_of_triangle
        todo[part_of_triangle[moved.meshes[now._scene.triangles.mesh]]] = True
        return todo

    def _keep(self, kept: ElementLookup, again: NDArray, moved: Moved) -> tuple[NDArray, NDArray]:
        """Takes over the cells of triangles that are not done again (T,).

        Returns: entry (n,) and cell (n,) of those that what moved hid elements from, or may hide them from now, and
            of those that new elements are near to.
        """
        old = np.flatnonzero(np.repeat(~again, kept.divisions.astype(np.int64) ** 2))
        new = np.flatnonzero(np.repeat(~again, self.divisions.astype(np.int64) ** 2))
        entries = kept.entry_of_cell[:, old]
        used = np.zeros(len(kept.elements_of_entry) + 1, bool)  # the last stands for none
        used[np.minimum(entries, len(used) - 1)] = True
        used = used[:-1]
        place = np.append(np.cumsum(used, dtype=np.int64) - 1, int(NONE)).astype(np.uint32)
        self.entry_of_cell[:, new] = place[np.minimum(entries, len(used))]
        self.kept_from, self.kept_entries = kept, np.flatnonzero(used)
        self.elements_of_entry = kept.elements_of_entry[used]
        self._reach_of_entry = kept._reach_of_entry[used]
        # The cell that stands for an entry stays too: entries are not shared between parts.
        total, there = self.entry_of_cell.shape[1], kept.entry_of_cell.shape[1]
        new_of_old = np.zeros(there, np.int64)
        new_of_old[old] = new
        back = kept._cell_of_entry[used] >= there
        cell = new_of_old[kept._cell_of_entry[used] % there]
        position = self._middle_of_entry = kept._middle_of_entry[used]
        self._cell_of_entry = cell + np.where(back, total, 0)
        near = moved.is_within(position, self._reach_of_entry)
        elements, known = self._elements, len(kept._elements)
        if len(elements) > known:
            triangle = np.searchsorted(self.first_cell, cell, side="right") - 1
            side = elements.part_of_triangle[triangle] * 2 + back
            new_side = elements.part[known:] * 2 + (elements.side[known:] < 0)
            rows = np.flatnonzero(np.isin(side, new_side))
            away = tree_of(elements.position[known:]).query(position[rows])[0]
            near[rows] |= away <= self._reach_of_entry[rows]
        at = np.flatnonzero(near)
        return at, self._cell_of_entry[at]

    @property
    def nbytes(self) -> int:
        """Bytes of the tables."""
        return sum(a.nbytes for a in (self.divisions, self.first_cell, self.entry_of_cell, self.elements_of_entry))

    def entry(self, triangle: NDArray, barycentric: NDArray, side: NDArray) -> NDArray[np.uint32]:
        """Returns the entry (n,) of points on triangles, NONE on sides that have no elements."""
        tri = np.asarray(triangle)
        cell = self.first_cell[tri] + cell_of(np.asarray(barycentric, np.float32), self.divisions[tri])
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
        unreached = entry == NONE
        if not len(self.elements_of_entry):
            return np.zeros((len(tri), BLEND), np.int64), np.zeros((len(tri), BLEND), np.float32)
        near = self.elements_of_entry[np.where(unreached, 0, entry)]  # (n, PER_ENTRY)
        point = interpolate(self._scene.triangles.positions, tri, np.asarray(barycentric)).astype(np.float32)
        missing = near == NONE
        near = self._filled(near)
        gap = self._elements.position[near] - point[:, None]
        distance = np.where(missing, np.float32(np.inf), np.sqrt((gap * gap).sum(2)))
        order = np.argsort(distance, 1, kind="stable")[:, : BLEND + 1]
        near = np.take_along_axis(near, order, 1)
        distance = np.take_along_axis(distance, order, 1)
        weight = blend_weights(distance)
        weight[unreached] = 0
        return near[:, :BLEND].astype(np.int64), weight

    @staticmethod
    def _filled(near: NDArray[np.uint32]) -> NDArray[np.uint32]:
        return np.where(near == NONE, near[:, :1], near)

    def upload(self, device: Device) -> DeviceLookup:
        """Copies the tables to a device; what is empty gets a row of zeros, which rays that miss may look at."""
        some = lambda a: device.upload(a if len(a) else np.zeros((1, *a.shape[1:]), a.dtype))  # noqa: E731
        return DeviceLookup(
            cells_of_triangle_d=some(np.stack([self.first_cell, self.divisions.astype(np.uint32)], 1)),
            face_normal_d=some(self._scene.triangles.face_normals),
            entry_of_cell_d=device.upload(self.entry_of_cell),
            elements_of_entry_d=some(self._filled(self.elements_of_entry)),
            position_d=some(self._elements.position),
            frames_d=some(self._elements.frame),
            corners_d=some(self._scene.triangles.positions),
            cell_count=np.uint32(self.entry_of_cell.shape[1]),
        )


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
