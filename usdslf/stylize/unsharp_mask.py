"""Stylize: unsharp masking of the light field of a whole scene, as a valid reflectance of everything in it.

The wanted light is L + amount (L - B), B the mean of what surrounds a place as the same far-off eye sees it
(kernels/unsharp_mask.cl).  Light is compared in one direction of the world, not of each element's own frame: then an
edge of the light field is an edge of the picture, from every view, and a highlight is compared with the surface
beside it rather than with the same highlight on an element that is turned otherwise.  B takes in whatever lies near
in space, on any gprim (surroundings.py).  Only reflected light counts: emission cannot change, and a lamp would
blacken all around it.  Each element is then given the reflectance that explains what is wanted there best
(element_solve.py): noise does not move all its parameters, for more of them cost more, and what light hardly shows
stays as it is, for a price that grows with the change; a metal stays one.  The light goes round, and it is asked
again under the new light.

Source: Nguyen et al. 2013, 7 and figure 22; Ritschel et al. 2008, 3D unsharp masking.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.edits import FREED
from usdslf.elements.elements import Elements
from usdslf.errors import AuthorError, InputError
from usdslf.gpu.launch import GROUP, groups
from usdslf.light_field.light_field import LightField
from usdslf.light_field.renewal import renew
from usdslf.light_field.storage import constants_of
from usdslf.light_field.surface import Surface
from usdslf.progress import tell
from usdslf.sampling.blue_noise import surface_coordinates
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F64, Scene
from usdslf.stylize.element_solve import (
    OWN,
    ElementCandidates,
    choose_candidates,
    enumerate_elements,
    follows_f0,
    joined,
)
from usdslf.stylize.surroundings import Surroundings
from usdslf.surfaces.reflectance import Parameters

AMOUNT, MOST_AMOUNT = 1.0, 10.0
RADIUS = 0.1  # of the scene's diagonal
FEWEST = 4  # places that the surroundings of most elements must have
MOST_ROUNDS = 2  # of light going round
CONVERGED = 0.01  # relative change of the residual between rounds
FACTORS = {"l0": (1.0, 1.0, np.inf, np.inf), "mixed": (1.0, 1.0, 1.6, 2.6), "l2": (1.0, 1.0, 1.0, 1.0)}
"""Of the misfit where none, one, two, three parameters of an element change."""
HOLD = (1e-3, 1e-2, 2e-3)  # price of diffuse, F0, roughness that moves by one, relative to the light there, squared
MISFIT = 5e-3  # relative, below which nothing needs to change
NOISE = 0.01  # relative misfit that is no reason to change one more parameter
SEEN = (0.004, 0.004, 0.01)  # a change of diffuse, specular, roughness at an element that counts as one
SMOOTH_OVER, SMOOTH_WITHIN = 10, 1.5  # elements and spacings that changes are averaged over
ALIKE = 0.2  # a difference of reflectance that counts as one spacing
SPARSE = 0.1  # of a material's area: what changes on less of it stays as it is everywhere


@dataclass(frozen=True)
class MaterialStyle:
    """What became of one material: means over its elements by area, and how well it explains what was wanted."""

    material: int  # into Scene.materials
    elements: NDArray[np.int64]  # (n,) its elements
    freed: tuple[str, ...]  # which of diffuse, specular, glossiness changed
    before: dict[str, NDArray]  # diffuse (3,), specular (3,), roughness (1,)
    after: dict[str, NDArray]
    residual_before: float  # relative RMS over its elements and all directions
    residual_after: float  # with the reflectance of the elements
    residual_as_written: float = float("nan")  # with what a look layer shows there

    @property
    def got_worse(self) -> bool:
        """Whether it changed and explains less than before: other surfaces changed its light."""
        return bool(self.freed) and self.residual_after >= self.residual_before

    @property
    def is_worse_as_written(self) -> bool:
        """Whether it changed and explains no more than before where a look layer shows it."""
        return bool(self.freed) and self.residual_as_written >= self.residual_before


@dataclass(frozen=True)
class Stylized:
    """What unsharp masking made of a scene."""

    amount: float
    radius: float  # of the scene's diagonal
    before: Surface
    after: Surface
    styles: tuple[MaterialStyle, ...]  # of each material that may change and is seen by light
    rounds: tuple[float, ...]  # residual over the scene after each
    wanted_d: Any = None  # light that was asked for, on the device (N, D, 3); None: the light as it is
    light: LightField | None = None  # of a state near `after`, which nobody changes any more: what is near starts there

    def change_at(self, rows: NDArray) -> tuple[F64, F64, F64]:
        """Returns the changes of diffuse (n, 3), F0 (n, 3) and roughness (n,) at elements."""
        take = lambda s, name: getattr(s, name)[rows].astype(np.float64)  # noqa: E731
        change = lambda name: take(self.after, name) - take(self.before, name)  # noqa: E731
        return change("diffuse"), change("f0"), change("roughness")

    def as_written(self, field: LightField) -> Stylized:
        """Returns the same, with the residuals of the light field of now, that of a look layer read back."""
        if self.wanted_d is None:
            return self
        misfit = take_misfit(field, self.wanted_d)
        return replace(
            self,
            styles=tuple(replace(s, residual_as_written=_residual(misfit[s.elements])) for s in self.styles),
        )

    def without(self, styles: Sequence[MaterialStyle]) -> Stylized:
        """Returns the same with some materials left as they were."""
        left = {s.material for s in styles}
        return replace(
            self, styles=tuple(replace(s, freed=(), after=s.before) if s.material in left else s for s in self.styles)
        )


def check_numbers(amount: float, radius: float) -> None:
    """Raises InputError for numbers that no scene can be stylized with."""
    if not 0 <= amount <= MOST_AMOUNT:
        raise InputError(f"the amount {amount:g} is not in 0 .. {MOST_AMOUNT:g}; 1 adds as much contrast as there is")
    if not 0 < radius <= 1:
        raise InputError(f"the radius {radius:g} is not in 0 .. 1; it is a share of the scene's diagonal, say 0.1")


def check_surroundings(near: Surroundings, scene: Scene) -> None:
    """Raises InputError where most elements have next to no surroundings."""
    if np.median(near.count) < FEWEST:
        raise InputError(
            f"the radius {near.radius / scene.diagonal:.3g} of the scene's diagonal is less than its elements are "
            "apart; give a larger radius or more elements"
        )


def editable_materials(scene: Scene, materials: Sequence[int], warnings: list[str]) -> list[int]:
    """Returns those of the materials that can be edited; names the others in warnings.

    Raises: AuthorError where none can.
    """
    kept = {m: scene.materials[m].why_not_editable for m in materials if scene.materials[m].why_not_editable}
    shown = scene.triangles
    for m, why in kept.items():
        gprims = [scene.meshes[i].path for i in np.unique(shown.mesh[shown.material == m])]
        more = f" and {len(gprims) - 3} more" if len(gprims) > 3 else ""
        warnings.append(f"the material of {', '.join(gprims[:3])}{more} stays: {why}")
    if len(kept) == len(materials):
        why = next(iter(kept.values()), "it has no surfaces")
        raise AuthorError(f"nothing in {scene.stage} can be stylized, none of its materials can be edited: {why}")
    return [m for m in materials if m not in kept]


def mask_light(field: LightField, near: Surroundings, amount: float) -> Any:
    """Returns the wanted light, a device array (N, D, 3): reflected light, unsharp masked over its surroundings."""
    device, n = field.device, len(field.elements)
    size = 4 * n * D * 4
    device.require(12 * n * D * 4, f"stylizing {n} elements", size)
    first_d, other_d, weight_d = (device.upload(x) for x in (near.first, near.other, near.weight))
    parts = D // 16
    shown_d, detail_d = device.empty((parts, n, 4, 16), np.float32), device.empty((parts, n, 3, 16), np.float32)
    wanted_d, asked_d = device.empty((n, D, 3), np.float32), device.empty((parts, n), np.int32)
    place_d, bins_d = device.empty((n, D), np.uint16), device.empty((n, D), np.int16)
    position_d = device.upload(np.ascontiguousarray(field.elements.position, np.float32))
    directions_d = device.upload(bin_directions().astype(np.float32))
    stored = constants_of(field.outgoing_d)
    kernel = lambda name, *a: device.kernel("unsharp_mask", name, **stored)((D, n), (GROUP, 1), *a)  # noqa: E731
    light, links = (field.emission_d, field.outgoing_d), (field.hit_d, position_d, np.float32(near.radius))
    count = np.uint32(n)
    kernel("place_bins", field.frames_d, directions_d, *links, count, place_d)
    for below in (0, 1):
        half = (field.frames_d, directions_d, np.int32(1 - 2 * below))
        kernel("turn_bins", *half, count, bins_d)
        for hidden in (0, 1):
            number = np.int32(below + 2 * hidden)
            device.clear(asked_d)
            kernel("ask", place_d, number, count, asked_d)
            kernel("show", bins_d, *half, *light, *links, np.int32(hidden), count, shown_d)
            device.kernel("unsharp_mask", "take_surroundings", **stored)(
                (*groups(n), parts), (GROUP, 1), first_d, other_d, weight_d, shown_d, asked_d, count, detail_d
            )
            kernel("add_detail", place_d, *light, number, count, detail_d, np.float32(amount), wanted_d)
            device.finish()
            tell()
    return wanted_d


def stylize_light(
    field: LightField, near: Surroundings, amount: float, radius: float, free: Sequence[int], bounces: int,
    norm: str = "mixed",
) -> Iterator[Stylized]:  # fmt: skip
    """Finds the reflectance of each element that looks unsharp masked; yields it after each round of light.

    A parameter that would change on a small part of a material only stays as it is: the look would say more than
    is seen; so does a material that its change makes no better.  A round that fits worse is not accepted.  The
    light field is left in the state of the last round, as near as renewal.py says.

    Args:
        field: of the shot as it is.
        free: materials that may change.
        norm: l0 | mixed | l2.
    """
    elements, start = field.elements, field.surface
    if amount == 0:
        none = np.zeros((len(elements), 2))
        yield Stylized(amount, radius, start, start, tuple(_style(m, field, start, none, none) for m in free), (0.0,))
        return
    may_change = np.repeat(np.isin(elements.material, free)[:, None], 3, 1)
    may_change[follows_f0(field), 0] = False
    counted = np.isin(elements.material, free)
    wanted_d = mask_light(field, near, amount)
    before = take_misfit(field, wanted_d)
    kept: Stylized | None = None
    for _ in range(MOST_ROUNDS):
        now = field.surface
        found, scale = ask_elements(field, wanted_d, may_change)
        if kept is None:
            after = choose_surface(field, found, scale, may_change, norm)
            for m in free:
                may_change[elements.material == m] &= _is_common(m, field, start, after)
        after = smooth_changes(elements, now, choose_surface(field, found, scale, may_change, norm))
        misfit = _under_new_light(field, after, wanted_d, bounces)
        worse = [m for m in free if _style(m, field, start, before, misfit).got_worse]
        if worse:
            rows = np.isin(elements.material, worse)
            may_change[rows] = False
            after = after.with_rows(rows, **{k: getattr(start, k)[rows] for k in ("diffuse", "f0", "f90", "roughness")})
            misfit = _under_new_light(field, after, wanted_d, bounces)
        residual = _residual(misfit[counted])
        rounds = (*(kept.rounds if kept else ()), residual)
        if kept is not None and residual >= kept.rounds[-1]:
            return
        is_done = kept is not None and kept.rounds[-1] - residual < CONVERGED * kept.rounds[-1]
        styles = tuple(_style(m, field, start, before, misfit) for m in free)
        kept = Stylized(amount, radius, start, after, styles, rounds, wanted_d, field)
        yield kept
        if is_done:
            return


def ask_elements(field: LightField, wanted_d: Any, may_change: NDArray) -> tuple[ElementCandidates, F64]:
    """Returns candidates of the elements that may change and miss what is wanted, and the light (n,) there, squared.

    That light is what is wanted, what is missing and what is emitted: what is wanted alone may be darkness.

    Args:
        may_change: (N, 3) which of diffuse, specular, glossiness.
    """
    glow = D * (np.asarray(field.surface.emission, np.float64) ** 2).sum(1)
    misfit = take_misfit(field, wanted_d)
    scale = misfit.sum(1) + glow
    rows = np.flatnonzero((misfit[:, 0] > MISFIT**2 * scale) & may_change.any(1))
    rows = rows[np.argsort(field.surface.roughness[rows], kind="stable")]
    hold = scale[rows, None] / 3 * HOLD[:2]
    return joined(list(enumerate_elements(field, rows, wanted_d, hold=hold))), scale[rows]


def choose_surface(field: LightField, found: ElementCandidates, scale: F64, may_change: NDArray, norm: str) -> Surface:
    """Returns the best valid reflectance of all elements, with no change that `may_change` (N, 3) forbids."""
    s, e = field.surface, found.element
    moved = [(x - x[:, OWN:, :1]).astype(np.float64) ** 2 for x in (found.diffuse, found.f0)]
    turned = (found.roughness - found.roughness[:, OWN:]) ** 2
    price = HOLD[0] * moved[0].mean(-1) + HOLD[1] * moved[1].mean(-1) + HOLD[2] * turned[..., None]
    change = choose_candidates(found, FACTORS[norm], may_change[e], NOISE**2 * scale, scale[:, None, None] * price)
    f90 = np.where(follows_f0(field)[e, None] & change.changed[:, 1:2], change.f0, s.f90[e])
    return s.with_rows(e, diffuse=change.diffuse, f0=change.f0, f90=f90, roughness=change.roughness)


def _under_new_light(field: LightField, after: Surface, wanted_d: Any, bounces: int) -> F64:
    """Lets the light follow a reflectance, where it changes; returns its misfit."""
    field.set_surface(after)
    renew(field, bounces)
    return take_misfit(field, wanted_d)


def smooth_changes(elements: Elements, before: Surface, after: Surface) -> Surface:
    """Averages changes over the next elements that lie on the same surface and look alike.

    Light that a few rays brought to an element is uneven, and masking sharpens that too.  What differs before keeps
    its difference, within 0..1.
    """
    n = len(elements)
    group = elements.part * 2 + (elements.side < 0)
    number = np.bincount(group)
    spacing = np.sqrt(np.bincount(group, elements.area) / np.maximum(number, 1))
    place = surface_coordinates(elements.position, elements.normal, group, spacing[group])
    look = Parameters.of(before).packed / ALIKE
    distance, near = tree_of(np.concatenate([place, look], 1)).query(
        np.concatenate([place, look], 1), k=min(SMOOTH_OVER, n), distance_upper_bound=SMOOTH_WITHIN
    )
    distance, near = distance.reshape(n, -1), near.reshape(n, -1)
    weight = np.where(near < n, (1 - np.minimum(distance / SMOOTH_WITHIN, 1) ** 2) ** 2, 0)
    weight /= weight.sum(1, keepdims=True)
    near = np.minimum(near, n - 1)

    def mean(name: str) -> NDArray:
        was = np.asarray(getattr(before, name), np.float64)
        change = np.einsum("nk,nk...->n...", weight, (getattr(after, name) - was)[near])
        return np.clip(was + change, 0, 1).astype(np.float32)

    return replace(after, **{name: mean(name) for name in ("diffuse", "f0", "f90", "roughness")})


def take_misfit(field: LightField, wanted_d: Any) -> F64:
    """Takes squared distances (N, 2) of the reflected light of now from what is wanted, and of that from darkness."""
    device, n = field.device, len(field.elements)
    misfit_d = device.empty((n, 2), np.float32)
    device.kernel("unsharp_mask", "misfit", **constants_of(field.outgoing_d))(
        groups(n), (GROUP,), field.emission_d, field.outgoing_d, wanted_d, np.uint32(n), misfit_d
    )
    return np.asarray(device.download(misfit_d), np.float64)


def _residual(misfit: NDArray) -> float:
    apart, wanted = misfit.sum(0)
    return float(np.sqrt(apart / max(wanted, 1e-30)))


def _moved(before: Surface, after: Surface, rows: NDArray) -> NDArray[np.bool_]:
    """Which elements (n, 3) changed their diffuse, specular, glossiness."""
    moved = (np.abs(after.diffuse - before.diffuse).max(1), np.abs(after.f0 - before.f0).max(1))
    roughness = np.abs(after.roughness - before.roughness)
    return np.stack([m[rows] > s for m, s in zip((*moved, roughness), SEEN)], 1)


def _is_common(material: int, field: LightField, before: Surface, after: Surface) -> NDArray[np.bool_]:
    """Whether each kind of change (3,) covers more than SPARSE of a material."""
    rows = np.flatnonzero(field.elements.material == material)
    area = field.elements.area[rows]
    share: NDArray[np.bool_] = area @ _moved(before, after, rows) > SPARSE * area.sum()
    return share


def _style(material: int, field: LightField, start: Surface, before: F64, after: F64) -> MaterialStyle:
    """What became of a material, from `start` to what the field has now, with its misfits (N, 2)."""
    rows = np.flatnonzero(field.elements.material == material)
    area = field.elements.area[rows].astype(np.float64)

    def means(s: Surface) -> dict[str, NDArray]:
        values = {"diffuse": s.diffuse, "specular": s.f0, "roughness": s.roughness[:, None]}
        return {k: np.atleast_1d(area @ v[rows] / area.sum()) for k, v in values.items()}

    moved = _moved(start, field.surface, rows)
    freed = tuple(c for i, c in enumerate(FREED) if moved[:, i].any())
    return MaterialStyle(
        material, rows, freed, means(start), means(field.surface), _residual(before[rows]), _residual(after[rows])
    )
