"""The surface light field: outgoing radiance of every element in every bin, bounce by bounce.

L_o = L_e + K (L_fixed + G L_o), iterated from the light field at hand.  Elements are put into blocks of sixteen between
the same two roughness levels (blocks.py).  Levels and weights: preconvolution.py; kernels: light_field.cl.

Source: Nguyen et al. 2013, section 3 (rendering equation), 5.2, 6.2.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import Elements
from usdslf.elements.lookup import DeviceLookup, ElementLookup
from usdslf.gpu.device import Device, Kernel
from usdslf.gpu.launch import GROUP, groups
from usdslf.lazy import Later
from usdslf.light_field.blocks import LANES, Blocks, Chunk, blocks_of_surface, blocks_of_weights
from usdslf.light_field.incoming import Incoming
from usdslf.light_field.links import follow_links, link_rays
from usdslf.light_field.preconvolution import LevelKernel, build_level, fresnel_diffuse
from usdslf.light_field.scratch import CHUNK_BLOCKS, Scratch, taken
from usdslf.light_field.storage import USUAL, Storage, constants_of, require_device
from usdslf.light_field.surface import CHANGED, Surface, changed_rows, relative_changes
from usdslf.light_field.symmetry import ALIKE, SIZES, H, blocks_of
from usdslf.light_field.visibility import Visibility
from usdslf.progress import tell
from usdslf.sampling.hemisphere import SIDE, D, bin_directions
from usdslf.surfaces.reflectance import roughness_levels

MOST_SPARE = 1 << 28  # bytes of a light field that is kept to be lent again
ROWS = 2 * SIDE  # bins that a work-item gathers
LAUNCHED = 4  # chunks that are waited for, so that work can be cancelled between them


class LightField:
    """Outgoing radiance `outgoing_d` (N, D, 3) of the elements, and the bounce that renews it."""

    def __init__(
        self,
        device: Device,
        elements: Elements,
        lookup: ElementLookup,
        visibility: Visibility | Callable[[], Visibility],
        fixed: NDArray | Callable[[], NDArray],
        model: str = "preview_surface",
        storage: Storage = USUAL,
        radiance_d: Any = None,
    ) -> None:
        """Uploads what stays.

        Args:
            visibility, fixed: links and fixed light (N, D, 3), or what gives them when a bounce asks first.
            model, storage: of reflectance; of light on the device.
            radiance_d: of all bounces, as stored on the device; None: it starts in the dark.

        Raises: MemoryError_ where it does not fit the device.
        """
        n = len(elements.position)
        self.device, self.elements, self.lookup, self.model = device, elements, lookup, model
        require_device(device, n, storage)
        self.storage = storage
        links = visibility if callable(visibility) else Later.of(visibility)
        light = fixed if callable(fixed) else Later.of(fixed)
        self.incoming = Incoming(device, lambda: links().hit, light, storage)
        self.frames_d = device.upload(np.ascontiguousarray(elements.frame, np.float32))
        self.outgoing_d = device.zeros((n, D, 3), storage.dtype) if radiance_d is None else radiance_d
        self._scratch_d: Scratch | None = None
        self._idle: deque[Scratch] = deque(maxlen=1)  # for the next one that is lent, whose pages are there already
        z = bin_directions()[:, 2]
        self.cosine_d = device.upload((z / z.sum()).astype(np.float32))
        y, y_scale = fresnel_diffuse(device, model)
        self.y_d, self.y_scale_d = device.upload(y), device.upload(y_scale)
        self.folded_y_d = device.upload(blocks_of(y))
        self._levels: dict[float, tuple[LevelKernel, dict[str, Any]]] = {}
        self.surface = Surface.of(elements)
        self._blocks: list[Blocks] | None = None  # of all elements, from the first bounce on
        # light that came since each element reflected: renewal.py
        self.waits = np.full(n, CHANGED if radiance_d is None else 0, np.float32)
        self.renewed: list[NDArray[np.int64]] | None = []  # elements that reflected anew, by renewal; None: all did
        self._spare: deque[tuple[LightField, Any]] = deque(maxlen=1)  # to be lent, and the radiance that it is of
        self._rooms: deque[Later[Any]] = deque(maxlen=1)  # for the outgoing radiance of the next copy
        self.set_surface(self.surface)

    def with_surface(self, surface: Surface) -> LightField:
        """Returns a light field of another reflectance, whose iterations start from the light of now.

        Links, fixed light and what comes with them are shared and never change; outgoing radiance is its own, so that
        neither is seen by who looks at the other.
        """
        vars(self).setdefault("sent", self.sent)  # found once, the copy has it too
        other = copy(self)
        room = taken(self._rooms)
        other.outgoing_d = room() if room else self.device.empty(self.outgoing_d.shape, self.outgoing_d.dtype)
        self.device.copy(other.outgoing_d, self.outgoing_d)
        other._scratch_d, other.waits, other.renewed = None, self.waits.copy(), []
        other._spare, other._idle, other._rooms = deque(maxlen=1), deque(maxlen=1), deque(maxlen=1)
        if surface is not self.surface:
            other.set_surface(surface)
        return other

    def with_elements(self, elements: Elements) -> LightField:
        """Returns `with_surface` of the same elements, in the same places, with another reflectance."""
        other = self.with_surface(Surface.of(elements))
        other.elements = elements
        return other

    def lend_soon(self) -> None:
        """Begins, on a thread of its own, to make room for what `lent` will lend: fresh pages cost more than a copy."""
        of = self.outgoing_d
        if not self._spare and not self._rooms and of.nbytes <= MOST_SPARE:
            room = Later(partial(self.device.touched, of.shape, of.dtype))
            room.begin()
            self._rooms.append(room)

    @contextmanager
    def lent(self) -> Iterator[LightField]:
        """Lends a light field that is as this one, for changes that nobody keeps.

        What they renewed is put back, so that the next one costs no copy; one is kept, if it is not large.
        """
        before = self.outgoing_d
        try:
            other, of = self._spare.pop()
        except IndexError:
            other, of = self.with_surface(self.surface), before
            other._scratch_d = taken(self._idle)
        if of is not before:
            other = self.with_surface(self.surface)
        other.renewed = []
        yield other
        if other.renewed is None or before.nbytes > MOST_SPARE or self.outgoing_d is not before:
            return
        rows = np.unique(np.concatenate([np.zeros(0, np.int64), *other.renewed]))
        self._kernel("put_back")(
            groups(len(rows) * D), (GROUP,), self.device.upload(rows.astype(np.int32)), np.uint32(len(rows) * D),
            before, other.outgoing_d,
        )  # fmt: skip
        other.surface, other.emission_d, other._blocks = self.surface, self.emission_d, self._blocks
        other.waits[:] = self.waits
        self._spare.append((other, before))

    def with_emission(self, emission: NDArray) -> LightField:
        """Returns a light field whose elements emit something else (N, 3), and reflect what they do now."""
        other = self.with_surface(replace(self.surface, emission=emission))
        n = len(self.elements)
        change_d = self.device.upload(np.asarray(emission - self.surface.emission, np.float32))
        self._kernel("emit_more")(
            groups(n * D), (GROUP,), change_d, np.uint32(n * D), other.outgoing_d
        )
        return other

    def radiance(self) -> NDArray[np.float32]:
        """Returns the outgoing radiance (N, D, 3) of now."""
        return self.device.download(self.outgoing_d).astype(np.float32, copy=False)

    def rest(self) -> None:
        """Gives memory back that only bounces need; what is not large stays for one that is lent."""
        if self._scratch_d and self.outgoing_d.nbytes <= MOST_SPARE:
            self._idle.append(self._scratch_d)
        self._scratch_d = None

    def gather(self, chunk: Chunk, light_d: Any) -> None:
        """Gathers the light that arrives now at the elements of a chunk of blocks: (blocks, D, 3, LANES)."""
        hit_d, fixed_d, is_streamed = self.incoming.of_chunk(chunk)
        kernel = self._kernel("gather", **({"STREAMED": 1} if is_streamed else {}))
        kernel(
            (D // ROWS, chunk.count), (D // ROWS, 1), chunk.order_d, hit_d, fixed_d, self.outgoing_d,
            np.int32(chunk.first), light_d,
        )  # fmt: skip

    @property
    def hit_d(self) -> Any:
        """Links (N, D) on the device; streamed ones as long as they are held."""
        return self.incoming.hit_d

    @property
    def fixed_d(self) -> Any:
        """Light (N, D, 3) that no edit changes, on the device; streamed as long as it is held."""
        return self.incoming.fixed_d

    def _kernel(self, name: str, **constants: int) -> Kernel:
        return self.device.kernel("light_field", name, **constants_of(self.outgoing_d), **constants)

    @property
    def _scratch(self) -> Scratch:
        if self._scratch_d is None:
            idle = taken(self._idle)
            self._scratch_d = idle or Scratch.of(self.device, len(self.elements), self.storage)
        return self._scratch_d

    @property
    def next_d(self) -> Any:
        """Array (N, D, 3) that the next light field, or a part of it, is made in; nobody's between bounces."""
        return self._scratch.next_d

    def set_surface(self, surface: Surface) -> None:
        """Gives the elements another reflectance; the light field follows with the next bounces.

        What a small change brings is foreseen, and waits with the light that came before.
        """
        rows = np.flatnonzero(changed_rows(self.surface, surface))
        if len(rows):
            found = relative_changes(self.surface, surface, rows)
            small = found < CHANGED
            self.waits[rows[~small]] = CHANGED
            self.waits[rows[small]] += found[small] * self.sent_by(rows[small])
        self.surface, self._blocks = surface, None
        self.emission_d = self.device.upload(surface.emission)

    def level(self, j: int) -> tuple[LevelKernel, dict[str, Any]]:
        """Returns the weights of a roughness level, and its arrays on the device by name."""
        return self.level_of(float(roughness_levels()[j]))

    def level_of(self, roughness: float) -> tuple[LevelKernel, dict[str, Any]]:
        """Returns the same of any one roughness; each is kept."""
        if roughness not in self._levels:
            level = build_level(self.device, self.model, roughness)
            arrays = {k: self.device.upload(v) for k, v in vars(level).items() if v is not None}
            if level.coarse:
                arrays |= {f"folded_{k}": self.device.upload(blocks_of(getattr(level, k))) for k in "ab"}
            self._levels[roughness] = (level, arrays)
            tell()
        return self._levels[roughness]

    def bounce(self) -> float:
        """Sends the light once more; returns the relative change of the light field (L1)."""
        device, n, scratch = self.device, len(self.elements.position), self._scratch
        if self._blocks is None:
            self._blocks = blocks_of_surface(device, self.surface, self.model, np.arange(n))
        self.reflect(self._blocks)
        self._kernel("difference")(
            groups(n), (GROUP,), self.outgoing_d, scratch.next_d, np.uint32(n), scratch.difference_d
        )
        self.outgoing_d, scratch.next_d = scratch.next_d, self.outgoing_d
        self.waits[:], self.renewed = 0, None
        apart, total = device.download(scratch.difference_d).sum(0, dtype=np.float64)
        return float(apart / total) if total > 0 else 0.0

    def products(self) -> float:
        """Returns how many multiply-adds of weights and light a bounce of all elements is."""
        if self._blocks is None:
            self._blocks = blocks_of_surface(self.device, self.surface, self.model, np.arange(len(self.elements)))
        folded, total = float(sum(n * n for n in SIZES)), 0.0
        for blocks in self._blocks:
            levels = [self.level(j)[0] for j in blocks.levels]
            of_lobes = sum(2 * folded if level.tap is None else 2 * len(level.tap) for level in levels)
            total += blocks.count * LANES * 3 * (folded + of_lobes)
        return total

    def respond(self, element: NDArray, weights: NDArray, roughness: NDArray) -> Any:
        """What some elements would send out with other weights of the columns, from the light that arrives now.

        Args:
            element: (r,) distinct; weights: (r, 4, 3) of X, Y, A, B; roughness: (r,).

        Returns: device array (N, D, 3), zero for all others; good until the next bounce or response.
        """
        self.device.clear(self._scratch.next_d)
        self.reflect(blocks_of_weights(self.device, element, weights, roughness, adds=True))
        return self._scratch.next_d

    def reflect(self, chosen: list[Blocks]) -> None:
        """Writes to `next_d` what the elements of blocks send out, under the light that arrives now."""
        launched = 0
        for blocks in chosen:
            levels = [self.level(j) for j in blocks.levels]
            for first in range(0, blocks.count, CHUNK_BLOCKS):
                self._reflect_chunk(blocks, levels, first, min(CHUNK_BLOCKS, blocks.count - first))
                launched += 1
                if launched % LAUNCHED == 0:
                    self.device.finish()
                    tell()

    def _reflect_chunk(
        self, blocks: Blocks, levels: list[tuple[LevelKernel, dict[str, Any]]], first: int, count: int
    ) -> None:  # fmt: skip
        """The same of some blocks that have the same levels."""
        scratch, at, fold_y = self._scratch, np.int32(first), self.folded_y_d
        sharp, rough = ([w for level, w in levels if level.coarse == is_rough] for is_rough in (False, True))
        hit_d, fixed_d, is_streamed = self.incoming.of_chunk(blocks.of_chunk(first, count))
        kernel = partial(self._kernel, ROUGH=len(rough), SHARP=len(sharp))
        kernel("gather_folded", **({"STREAMED": 1} if is_streamed else {}))(
            (H, count), (H, 1), blocks.order_d, hit_d, fixed_d, self.outgoing_d, self.cosine_d, at,
            scratch.folded_d, scratch.cells_d, scratch.e_part_d, scratch.light_d,
        )  # fmt: skip
        kernel("fold_swapped")((ALIKE, count), (ALIKE, 1), scratch.cells_d, scratch.folded_d)
        matrices = [w[name] for w in rough for name in ("folded_a", "folded_b")]
        scales = [w["fine_scale"] for w in rough]
        kernel("reflect_folded")(
            (D // 4, count), (64, 1), scratch.folded_d, fold_y, *matrices, *[fold_y] * (4 - len(matrices)),
            scratch.e_part_d, scratch.e_pi_d, scratch.answer_d,
        )  # fmt: skip
        for number, w in enumerate(sharp):
            kernel("reflect_sharp")(
                (D, count), (64, 1), scratch.light_d, w["first"], w["tap"], w["a"], w["b"], blocks.parameters_d, at,
                np.int32(number), scratch.sharp_d,
            )  # fmt: skip
        kernel("unfold")(
            (H, count), (H, 1), scratch.answer_d, scratch.sharp_d, scratch.e_pi_d, self.y_scale_d, *scales,
            *[self.y_scale_d] * (2 - len(scales)), blocks.parameters_d, self.emission_d, blocks.order_d, at,
            np.int32(blocks.adds), scratch.next_d,
        )  # fmt: skip

    def converge(self, bounces: int = 8, tolerance: float = 2e-3) -> Iterator[float]:
        """Bounces until the change falls below `tolerance`, `bounces` times at most; yields each change."""
        for _ in range(bounces):
            change = self.bounce()
            yield change
            if change < tolerance:
                return

    def settle(self, bounces: int) -> LightField:
        """Sends the light round as `converge` does, telling each bounce; returns itself."""
        for number, _ in enumerate(self.converge(bounces)):
            tell((number + 1) / bounces)
        return self

    @cached_property
    def sent(self) -> NDArray[np.float64]:
        """Light that each element (N,) sent when this was asked first: what tolerances are of; others start with it."""
        return self.sent_by(np.arange(len(self.elements))).astype(np.float64)

    def sent_by(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """Returns the light that some elements (r,) send now, over bins and channels."""
        device, n = self.device, len(rows)
        rows_d, sum_d = device.upload(rows.astype(np.int32)), device.empty((max(n, 1),), np.float32)
        self._kernel("sum_of_elements")(groups(n), (GROUP,), rows_d, self.outgoing_d, np.uint32(n), sum_d)
        found: NDArray[np.float32] = device.download(sum_d)[:n]
        return found

    def start_from(self, other: LightField) -> None:
        """Starts the iterations from another light field, element by element; those beyond it start dark.

        The fixed point is the same from any start.
        """
        n = min(len(self.elements), len(other.elements))
        self.device.clear(self.outgoing_d)
        if other.storage.dtype == self.storage.dtype:
            self.outgoing_d[:n] = other.outgoing_d[:n]
        else:
            self.outgoing_d[:n] = self.device.upload(other.radiance()[:n].astype(self.storage.dtype))
        self.waits[:] = CHANGED

    def incident(self, element: NDArray) -> NDArray[np.float32]:
        """Returns the light (n, D, 3) that arrives now in the bins of some elements (n,)."""
        count = -(-len(element) // LANES)
        order = np.full(count * LANES, -1, np.int32)
        order[: len(element)] = element
        light_d = self.device.empty((count, D, 3, LANES), np.float32)
        self.gather(Chunk(order, self.device.upload(order), 0, count), light_d)
        light = self.device.download(light_d).transpose(0, 3, 1, 2).reshape(-1, D, 3)
        return np.ascontiguousarray(light[: len(element)])

    @cached_property
    def lookup_d(self) -> DeviceLookup:
        """Tables of the near elements on the device, for hits."""
        return self.lookup.upload(self.device)

    def link_hits(self, triangle: NDArray, barycentric: NDArray, direction: NDArray) -> tuple[Any, Any]:
        """Ties hits to the light field: near elements, and the bin in which each sends light back along the ray.

        Args:
            triangle: (n,) row of Scene.triangles, -1 for a miss; barycentric: (n, 2).
            direction: (n, 3) of travel, unit, world.

        Returns: device arrays `links_d` (n, 4) uint32 and `weights_d` (n, 4), for `follow_links`.
        """
        return link_rays(self.device, self.lookup_d, triangle, barycentric, direction)

    def follow_links(self, links_d: Any, weights_d: Any, field_d: Any = None) -> NDArray[np.float32]:
        """Returns the radiance (n, 3) that arrives along the rays of `link_hits`; zero for misses.

        Args:
            field_d: (N, D, 3) that sends it; default the light field of now.
        """
        return follow_links(self.device, links_d, weights_d, self.outgoing_d if field_d is None else field_d)

    def radiance_from_hits(self, triangle: NDArray, barycentric: NDArray, direction: NDArray) -> NDArray[np.float32]:
        """Returns the outgoing radiance (n, 3) of the surfaces that rays hit, interpolated between near elements."""
        if len(triangle) == 0:
            return np.zeros((0, 3), np.float32)
        return self.follow_links(*self.link_hits(triangle, barycentric, direction))
