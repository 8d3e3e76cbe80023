"""Stylize: unsharp masking of the light field of a whole scene, as a valid reflectance of everything in it.

The wanted light is L + amount (L - B), B the mean of what surrounds a place as the same far-off eye sees it
(kernels/stylize.cl).  Light is compared in one direction of the world, not of each element's own frame: then an edge of
the light field is an edge of the picture, from every view, and a highlight is compared with the surface beside it
rather than with the same highlight on an element that is turned otherwise.  B takes in whatever lies near in space, on
any gprim (surroundings.py).  Only reflected light counts: emission cannot change, and a lamp would blacken all around
it.  Each element is then given the reflectance that explains what is wanted there best (element_fit.py); the light
goes round, and it is asked again under the new light.

Source: Nguyen et al. 2013, 7 and figure 22; Ritschel et al. 2008, 3D unsharp masking.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from usdslf.blue_noise import surface_coordinates
from usdslf.directions import D, bin_directions
from usdslf.element_fit import CHANGES, ElementFit, ElementFitter
from usdslf.element_products import Products, take_products
from usdslf.elements import Elements
from usdslf.errors import AuthorError, InputError
from usdslf.light_field import LightField, Surface
from usdslf.scene import F64, Scene
from usdslf.surroundings import Surroundings

AMOUNT, MOST_AMOUNT = 1.0, 10.0
RADIUS = 0.1  # of the scene's diagonal
FEWEST = 4  # places that the surroundings of most elements must have
ROUNDS = 2  # of light going round
CONVERGED = 0.01  # relative change of the residual between rounds
SEEN = (0.004, 0.004, 0.01)  # a change of diffuse, specular, roughness at an element that counts as one
SMOOTH_OVER, SMOOTH_WITHIN = 10, 1.5  # elements and spacings that changes are averaged over
ALIKE = 0.2  # a difference of reflectance that counts as one spacing
SPARSE = 0.1  # of a material's area: what changes on less of it stays as it is everywhere


@dataclass(frozen=True)
class MaterialStyle:
    """What became of one material: means over its elements by area, and how well it explains what was wanted."""

    material: int  # into Scene.materials
    elements: NDArray[np.int64]  # (n,) its elements
    freed: tuple[str, ...]  # which of CHANGES it underwent
    before: dict[str, NDArray]  # diffuse (3,), specular (3,), roughness (1,)
    after: dict[str, NDArray]
    residual_before: float  # relative RMS over its elements and all directions
    residual_after: float

    @property
    def got_worse(self) -> bool:
        """Whether it changed and explains less than before: other surfaces changed its light."""
        return bool(self.freed) and self.residual_after >= self.residual_before


@dataclass(frozen=True)
class Stylized:
    """What unsharp masking made of a scene."""

    amount: float
    radius: float  # of the scene's diagonal
    before: Surface
    fit: ElementFit  # the reflectance of all elements, after
    styles: tuple[MaterialStyle, ...]  # of each material that may change and is seen by light
    rounds: tuple[float, ...]  # residual over the scene after each

    def change_at(self, rows: NDArray) -> tuple[F64, F64, F64]:
        """Returns the changes of diffuse (n, 3), F0 (n, 3) and roughness (n,) at elements."""
        f, s = self.fit, self.before
        return f.diffuse[rows] - s.diffuse[rows], f.f0[rows] - s.f0[rows], f.roughness[rows] - s.roughness[rows]


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
    groups, up64 = D // 16, -(-n // 64) * 64
    shown_d, detail_d = device.empty((groups, n, 4, 16), np.float32), device.empty((groups, n, 3, 16), np.float32)
    wanted_d, asked_d = device.empty((n, D, 3), np.float32), device.empty((groups, n), np.int32)
    place_d, bins_d = device.empty((n, D), np.uint16), device.empty((n, D), np.int16)
    position_d = device.upload(np.ascontiguousarray(field.elements.position, np.float32))
    directions_d = device.upload(bin_directions().astype(np.float32))
    kernel = lambda name, *a: device.kernel("stylize", name)((D, n), (64, 1), *a)  # noqa: E731
    light, links = (field.emission_d, field.outgoing_d), (field.hit_d, position_d, np.float32(near.radius))
    count = np.uint32(n)
    kernel("place_bins", field.frames_d, directions_d, *links, count, place_d)
    for below in (0, 1):
        half = (field.frames_d, directions_d, np.int32(1 - 2 * below))
        kernel("turn_bins", *half, count, bins_d)
        for hidden in (0, 1):
            number = np.int32(below + 2 * hidden)
            asked_d.fill(np.int32(0))
            kernel("ask", place_d, number, count, asked_d)
            kernel("show", bins_d, *half, *light, *links, np.int32(hidden), count, shown_d)
            device.kernel("stylize", "take_surroundings")(
                (up64, groups), (64, 1), first_d, other_d, weight_d, shown_d, asked_d, count, detail_d
            )
            kernel("add_detail", place_d, *light, number, count, detail_d, np.float32(amount), wanted_d)
    return wanted_d


def stylize_light(
    field: LightField, near: Surroundings, amount: float, radius: float, free: Sequence[int], bounces: int,
    norm: str = "mixed",
) -> Iterator[Stylized]:  # fmt: skip
    """Finds the reflectance of each element that looks unsharp masked; yields it after each round of light.

    A parameter that would change on a small part of a material only stays as it is: the look would say more than
    is seen; so does a material that its change makes no better.  A round that fits worse is not accepted.  The
    light field is left in the state of the last round.

    Args:
        field: of the shot as it is.
        free: materials that may change.
        norm: l0 | mixed | l2.
    """
    elements, start = field.elements, field.surface
    is_free = np.isin(elements.material, free)
    solid = elements.opacity / np.maximum(elements.presence, 1e-6)
    fitter = ElementFitter(start, np.repeat(is_free[:, None], 3, 1), np.clip(solid, 0, 1), field.model, norm)
    if amount == 0:
        fit = _as_it_is(start)
        yield Stylized(amount, radius, start, fit, tuple(_style(m, field, start, fit) for m in free), (0.0,))
        return
    wanted_d = mask_light(field, near, amount)
    before = _misfit(field, wanted_d)
    kept: Stylized | None = None
    for _ in range(ROUNDS):
        products = _products(field, wanted_d)
        fit = fitter.fit(products)
        if kept is None:
            for m in free:
                fitter.free[elements.material == m] &= _is_common(m, field, start, fit)
            fit = fitter.fit(products)
        fit = smooth_changes(elements, start, fit)
        fit = _under_new_light(field, start, fit, wanted_d, bounces, before)
        worse = [m for m in free if _style(m, field, start, fit).got_worse]
        if worse:
            rows = np.isin(elements.material, worse)
            fitter.free[rows] = False
            fit = _under_new_light(field, start, _put_back(start, fit, rows), wanted_d, bounces, before)
        residual = _residual(fit.misfit_after[is_free], fit.wanted[is_free])
        rounds = (*(kept.rounds if kept else ()), residual)
        if kept is not None and residual >= kept.rounds[-1]:
            return
        is_done = kept is not None and kept.rounds[-1] - residual < CONVERGED * kept.rounds[-1]
        kept = Stylized(amount, radius, start, fit, tuple(_style(m, field, start, fit) for m in free), rounds)
        yield kept
        if is_done:
            return


def _under_new_light(
    field: LightField, start: Surface, fit: ElementFit, wanted_d: Any, bounces: int, before: F64
) -> ElementFit:
    """Sends the light round with a fitted reflectance; returns the fit with its misfit then."""
    values = {k: getattr(fit, k).astype(np.float32) for k in ("diffuse", "f0", "f90", "roughness")}
    field.set_surface(replace(start, **values))
    for _ in field.converge(bounces):
        pass
    return replace(fit, misfit_before=before, misfit_after=_misfit(field, wanted_d))


def _put_back(start: Surface, fit: ElementFit, rows: NDArray) -> ElementFit:
    """The fit with some elements (N,) as they were."""
    old = _as_it_is(start)
    column = rows[:, None]
    return replace(
        fit,
        diffuse=np.where(column, old.diffuse, fit.diffuse),
        f0=np.where(column, old.f0, fit.f0),
        f90=np.where(column, old.f90, fit.f90),
        roughness=np.where(rows, old.roughness, fit.roughness),
        changed=fit.changed & ~column,
    )


def smooth_changes(elements: Elements, start: Surface, fit: ElementFit) -> ElementFit:
    """Averages changes over the next elements that lie on the same surface and look alike.

    Light that a few rays brought to an element is uneven, and masking sharpens that too.  A mean of valid reflectances
    is valid.
    """
    n = len(elements)
    group = elements.part * 2 + (elements.side < 0)
    number = np.bincount(group)
    spacing = np.sqrt(np.bincount(group, elements.area) / np.maximum(number, 1))
    place = surface_coordinates(elements.position, elements.normal, group, spacing[group])
    look = np.concatenate([start.diffuse, start.f0, start.roughness[:, None]], 1) / ALIKE
    distance, near = cKDTree(np.concatenate([place, look], 1)).query(
        np.concatenate([place, look], 1), k=min(SMOOTH_OVER, n), distance_upper_bound=SMOOTH_WITHIN
    )
    distance, near = distance.reshape(n, -1), near.reshape(n, -1)
    weight = np.where(near < n, (1 - np.minimum(distance / SMOOTH_WITHIN, 1) ** 2) ** 2, 0)
    weight /= weight.sum(1, keepdims=True)
    near = np.minimum(near, n - 1)

    def mean(name: str) -> F64:
        before = np.asarray(getattr(start, name), np.float64)
        return before + np.einsum("nk,nk...->n...", weight, (getattr(fit, name) - before)[near])

    return replace(fit, diffuse=mean("diffuse"), f0=mean("f0"), f90=mean("f90"), roughness=mean("roughness"))


def _products(field: LightField, wanted_d: Any) -> Products:
    """Products with what is wanted of all but the clear coats."""
    device, s = field.device, field.surface
    coated = np.flatnonzero(s.clearcoat > 0) if field.model != "phong" else np.zeros(0, np.int64)
    if len(coated):
        weights = np.zeros((len(coated), 4, 3), np.float32)
        weights[:, 2], weights[:, 3] = (s.clearcoat * s.coat_f0)[coated, None], s.clearcoat[coated, None]
        coat_d = field.respond(coated, weights, s.clearcoat_roughness[coated])
        size = len(s.roughness) * D * 3
        rest_d = device.empty(wanted_d.shape, np.float32)
        device.kernel("stylize", "take_off")((size,), (64,), wanted_d, coat_d, np.uint64(size), rest_d)
        wanted_d = rest_d
    *_, products = take_products(field, wanted_d)
    assert isinstance(products, Products)
    return products


def _misfit(field: LightField, wanted_d: Any) -> F64:
    """Squared distance (N,) of the reflected light of now from what is wanted."""
    device, n = field.device, len(field.elements)
    misfit_d = device.empty((n,), np.float32)
    size = -(-n // 64) * 64
    device.kernel("stylize", "misfit")(
        (size,), (64,), field.emission_d, field.outgoing_d, wanted_d, np.uint32(n), misfit_d
    )
    return np.asarray(device.download(misfit_d), np.float64)


def _as_it_is(s: Surface) -> ElementFit:
    """The reflectance that is there, which explains the light that is there."""
    d, f0, f90, roughness = (np.asarray(x, np.float64) for x in (s.diffuse, s.f0, s.f90, s.roughness))
    none = np.zeros(len(roughness))
    return ElementFit(d, f0, f90, roughness, np.zeros((len(roughness), 3), bool), none, none, none)


def _residual(misfit: NDArray, wanted: NDArray) -> float:
    return float(np.sqrt(misfit.sum() / max(wanted.sum(), 1e-30)))


def _moved(start: Surface, fit: ElementFit, rows: NDArray) -> NDArray[np.bool_]:
    """Which elements (n, 3) underwent each of CHANGES."""
    moved = (np.abs(fit.diffuse - start.diffuse).max(1), np.abs(fit.f0 - start.f0).max(1))
    roughness = np.abs(fit.roughness - start.roughness)
    return np.stack([m[rows] > s for m, s in zip((*moved, roughness), SEEN)], 1)


def _is_common(material: int, field: LightField, start: Surface, fit: ElementFit) -> NDArray[np.bool_]:
    """Whether each of CHANGES (3,) covers more than SPARSE of a material."""
    rows = np.flatnonzero(field.elements.material == material)
    area = field.elements.area[rows]
    share: NDArray[np.bool_] = area @ _moved(start, fit, rows) > SPARSE * area.sum()
    return share


def _style(material: int, field: LightField, start: Surface, fit: ElementFit) -> MaterialStyle:
    rows = np.flatnonzero(field.elements.material == material)
    area = field.elements.area[rows].astype(np.float64)

    def means(s: Surface | ElementFit) -> dict[str, NDArray]:
        values = {"diffuse": s.diffuse, "specular": s.f0, "roughness": s.roughness[:, None]}
        return {k: np.atleast_1d(area @ v[rows] / area.sum()) for k, v in values.items()}

    moved = _moved(start, fit, rows)
    freed = tuple(c for i, c in enumerate(CHANGES) if moved[:, i].any())
    wanted = fit.wanted[rows]
    return MaterialStyle(
        material, rows, freed, means(start), means(fit),
        _residual(fit.misfit_before[rows], wanted), _residual(fit.misfit_after[rows], wanted),
    )  # fmt: skip
