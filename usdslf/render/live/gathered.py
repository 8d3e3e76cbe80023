"""What the rows of a view have gathered, material by material, so that pictures of other materials share the rest.

The rows of one material under one set of lobes are a `Share`: which of them have how many frames.  A view's columns of
light are in one place, `Gathered`, where one share of each material is at hand; the columns of another one are kept
aside meanwhile, for as long as a picture holds it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from weakref import ReferenceType, ref

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.render.live import records as r
from usdslf.render.live.gather import Columns
from usdslf.render.live.scene import LiveScene
from usdslf.render.live.view import Rows, View, Window

WINDOW = 8  # pixels on a side that the filter looks at: those that share a set of numbers
BORDER = WINDOW // 2  # pixels about a part of a picture that it depends on


@dataclass
class Group:
    """Rows (n,) of a part of a view that have the same number of frames."""

    part: int
    rows: NDArray[np.uint32]
    frames: int = 0
    begun: int = 0  # rows that have had the next frame already
    inside: Window | None = None  # that all of the rows are known to lie in
    outside: Window | None = None  # or none


@dataclass(eq=False)
class Share:
    """What one material's rows have."""

    groups: list[Group] = field(default_factory=list)
    parts: int = 0  # of the view that the groups are of
    kept: dict[int, Shared] = field(default_factory=dict)  # columns of its rows by part, while others are at hand

    def complete(self, material: int, parts: list[Rows]) -> None:
        """Takes rows that were added to the view."""
        for p in range(self.parts, len(parts)):
            rows = parts[p].of_material(material)
            if len(rows):
                self.groups.append(Group(p, rows))
        self.parts = len(parts)

    def split(self, window: Window, view: View) -> list[Group]:
        """Returns the groups inside a window, after groups that lie across its border were split."""
        out: list[Group] = []
        for group in self.groups:
            if group.inside == window or group.outside == window or group.begun:
                out.append(group)
                continue
            x, y = view.window.places(view.parts[group.part].pixel.host[group.rows])
            is_in = (x >= window.x) & (x < window.x + window.width) & (y >= window.y) & (y < window.y + window.height)
            if is_in.all():
                out.append(replace(group, inside=window))
            elif not is_in.any():
                out.append(replace(group, outside=window))
            else:
                out.append(replace(group, rows=group.rows[is_in], inside=window, outside=None))
                out.append(replace(group, rows=group.rows[~is_in], inside=None, outside=window))
        self.groups = out
        return [g for g in out if g.outside != window]

    def join(self) -> None:
        """Joins groups that have become alike."""
        if len(self.groups) < 2:
            return
        alike: dict[tuple[int, int, int], list[Group]] = {}
        for k, group in enumerate(self.groups):
            alike.setdefault((group.part, group.frames, k if group.begun else -1), []).append(group)
        self.groups = [
            g[0] if len(g) == 1 else Group(part, np.sort(np.concatenate([one.rows for one in g])), frames)
            for (part, frames, _), g in alike.items()
        ]


class Gathered:
    """The columns of a view, and the light that is made of them."""

    def __init__(self, scene: LiveScene, former: list[Shared] | None = None) -> None:
        """Begins with nothing gathered.

        Args:
            scene: with its light.
            former: of each part of the view, what was shown before the light changed: it fades out.
        """
        self.scene, self.former = scene, former or []
        self.columns: list[Columns] = []
        self.light: list[tuple[Shared, Shared, Shared]] = []  # of each part: mean, filtered along rows, filtered
        self.at_hand: dict[int, ReferenceType[Share]] = {}
        self.stale: list[list[NDArray[np.uint32]]] = []  # rows of each part whose light has changed
        self.is_split = False  # some rows of a material may have changed, and others not

    def complete(self, view: View) -> None:
        """Makes room for rows that were added to a view."""
        device = self.scene.geometry.device
        for part in view.parts[len(self.columns) :]:
            shape = (max(part.count, 1), r.LIGHT)
            self.columns.append(Columns(self.scene.geometry, part.count))
            a, b, c = (Shared(device, shape, np.float32, is_clean=False) for _ in range(3))
            self.light.append((a, b, c))
            self._forget(len(self.columns) - 1, part.all)
            self.stale.append([part.there])

    def take(self, shares: Mapping[int, Share], view: View) -> None:
        """Puts the columns of shares, by material, in their place."""
        self.complete(view)
        for m, share in shares.items():
            share.complete(m, view.parts)
            known = self.at_hand.get(m)
            other = known() if known else None
            if other is share:
                continue
            for p, part in enumerate(view.parts):
                rows = part.of_material(m)
                if not len(rows):
                    continue
                if other is not None and p < other.parts:
                    other.kept[p] = self._moved(p, part.listed(rows), None)
                if p in share.kept:
                    self._moved(p, part.listed(rows), share.kept.pop(p))
                elif known is not None:
                    self._forget(p, part.listed(rows))
                self.stale[p].append(rows)
            self.at_hand[m] = ref(share)

    def _moved(self, p: int, rows: Shared, kept: Shared | None) -> Shared:
        """Copies columns of rows of a part to what is kept, or back."""
        g, n = self.scene.geometry, len(rows.host)
        out = kept or Shared(g.device, (n, r.KEPT), np.float32, is_clean=False)
        g.kernel("live_combine", "move_rows")(
            groups(n), (GROUP,), np.uint32(n), np.int32(kept is not None), rows, self.columns[p].sums,
            self.columns[p].moments, out,
        )  # fmt: skip
        return out

    def _forget(self, p: int, rows: Shared) -> None:
        g, n = self.scene.geometry, len(rows.host)
        g.kernel("live_combine", "forget_rows")(
            groups(n), (GROUP,), np.uint32(n), rows, self.columns[p].sums, self.columns[p].moments
        )

    def average(self, view: View) -> None:
        """Makes light of all frames so far, filtered while they are few, where it has changed."""
        g = self.scene.geometry
        changed = [_union(rows, part) for rows, part in zip(self.stale, view.parts)]
        if view.lit_by is not self:
            for part in view.parts:
                part.unshaded.append(part.there)
            view.lit_by = self
        if not any(len(rows) for rows in changed):
            return
        for p, rows in _listed(changed, view):
            part, n = view.parts[p], len(rows.host)
            g.kernel("live_combine", "mean_columns")(
                groups(n), (GROUP,), np.uint32(n), rows, part.surface, self.columns[p].sums, part.soft, g.fresnel_d,
                self.light[p][0],
            )  # fmt: skip
        if self.is_split:
            changed = _about(changed, view)
        width = np.int32(view.window.width)
        for step in (0, 1):  # along rows, which only the grid has, then along columns
            for p, rows in _listed(changed, view):
                if not step and p:
                    continue
                part, n = view.parts[p], len(rows.host)
                g.kernel("live_combine", "filter_light")(
                    groups(n), (GROUP,), np.uint32(n), rows, width, np.int32(step), np.int32(WINDOW), np.int32(p == 0),
                    np.int32(step), part.pixel, part.alike, self.light[p][0], self.light[0][step],
                    self.light[p][step + 1],
                )  # fmt: skip
        for stale, filtered, part in zip(self.stale, changed, view.parts):
            stale.clear()
            part.unshaded.append(filtered)

    def shade(self, view: View) -> None:
        """Makes the radiance of rows whose light or colours have changed."""
        g = self.scene.geometry
        for p, rows in _listed([_union(part.unshaded, part) for part in view.parts], view):
            part, n = view.parts[p], len(rows.host)
            has_former = p < len(self.former)
            g.kernel("live_combine", "shade")(
                groups(n), (GROUP,), np.uint32(n), rows, part.surface, self.light[p][2], np.int32(has_former),
                self.former[p] if has_former else part.radiance, part.soft, g.fresnel_d, part.radiance,
            )  # fmt: skip
            part.unshaded.clear()

    def kept_as_former(self, shares: Mapping[int, Share], view: View) -> list[Shared]:
        """Returns what is shown of some materials, for the time when their light changes."""
        g, out = self.scene.geometry, []
        for p, part in enumerate(view.parts):
            former = Shared(g.device, self.light[p][2].host.shape, np.float32)
            rows = _union([part.of_material(m) for m in shares], part)
            n = len(rows)
            if n:
                listed = part.listed(rows)
                has_former = p < len(self.former)
                g.kernel("live_combine", "keep_former")(
                    groups(n), (GROUP,), np.uint32(n), listed, part.surface, self.light[p][2], np.int32(has_former),
                    self.former[p] if has_former else former, part.soft, g.fresnel_d, former,
                )  # fmt: skip
            out.append(former)
        return out


def fewest_frames(all_groups: Iterable[Group]) -> int | None:
    """Returns the frames that all groups have; None where there is no group."""
    return min((g.frames for g in all_groups), default=None)


def _union(rows: list[NDArray[np.uint32]], part: Rows) -> NDArray[np.uint32]:
    """Each row once, in order; all of them show something."""
    if len(rows) == 1:
        return rows[0]
    for some in rows:
        if len(some) == part.shown:
            return some
    is_in = np.zeros(part.count, bool)
    for some in rows:
        is_in[some] = True
    return np.flatnonzero(is_in).astype(np.uint32)


def _listed(changed: list[NDArray[np.uint32]], view: View) -> Iterator[tuple[int, Shared]]:
    for p, rows in enumerate(changed):
        if len(rows):
            yield p, view.parts[p].listed(rows)


def _about(changed: list[NDArray[np.uint32]], view: View) -> list[NDArray[np.uint32]]:
    """Rows whose filter looks at some rows of the grid, besides those that changed themselves."""
    from scipy.ndimage import maximum_filter1d  # late: a first frame does without scipy, see sampling/nearest.py

    is_in = np.zeros((view.window.height, view.window.width), bool)
    is_in.reshape(-1)[changed[0]] = True
    for axis in (0, 1):
        is_in = maximum_filter1d(is_in, 2 * BORDER + 1, axis=axis, mode="constant")
    near = is_in.reshape(-1)
    out = []
    for rows, part in zip(changed, view.parts):
        chosen = near[part.pixel.host[: part.count]] & (part.hits.triangle.host[: part.count] >= 0)
        chosen[rows] = True
        out.append(np.flatnonzero(chosen).astype(np.uint32))
    return out
