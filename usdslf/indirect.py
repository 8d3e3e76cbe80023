"""Indirect strokes: the change is wanted where it was painted, and made elsewhere.

Judged at the receiver: the samples of the stroke, and of every fixate stroke, keep their own reflectance.  For each
material that they see, the basis fields that its elements would send out are carried along the samples' rays and
through the samples' own reflectance to the painted direction; that gives the same four tables P, U, V, W as a
direct stroke has, and the same candidates are fitted to them, now for every material in sight.

Source: Nguyen et al. 2013, 4.2 and figures 5, 17 to 19; which carries the difference backwards instead, so that an
element cannot know of the fixate strokes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.evidence import Evidence, mean_by
from usdslf.light_field import LightField, Surface
from usdslf.reflectance import column_weights, columns, lobe_parameter
from usdslf.scene import Scene
from usdslf.solve import Tables

if TYPE_CHECKING:
    from usdslf.infer import Painted

LEVELS = (0.1, 0.2, 0.3, 0.45, 0.65, 0.9)  # roughness that is asked first
NO_LINK = 0xFFFFFFFE  # what is packed below is a link
MOST_MATERIALS = 5
LEAST_SHARE = 0.01  # of what a stroke sees, for a material to be asked


@dataclass(frozen=True)
class Receiver:
    """What carries light from rays to the painted direction.  S samples, K rays, n dabs."""

    painted: Painted
    evidence: Evidence
    carry: NDArray[np.float32]  # (S, K, 3) painted radiance per radiance of each ray
    target: NDArray[np.float64]  # (n, 3)
    sees: dict[int, float]  # material -> share of what the dabs see
    elements: NDArray[np.int64]  # that its rays are tied to


def make_receiver(painted: Painted, evidence: Evidence, field: LightField, is_fixed: bool) -> Receiver:
    """Prepares a stroke as a receiver; a fixate stroke wants what it has now."""
    samples, surface = painted.samples, evidence.surface
    count = samples.ray_count
    local = field.device.download(samples.towards_d)[:, :, :count].transpose(0, 2, 1)
    width = lobe_parameter(field.model, surface.roughness)[:, None]
    x = columns(field.model, width, samples.eye[:, None], local)  # (S, K, 4)
    weight = column_weights(field.model, surface.diffuse, surface.f0, surface.f90)  # (S, 4, 3)
    carry = np.einsum("skc,scr->skr", x, weight) * samples.gain[:, :count, None]
    all_links = field.device.download(samples.links_d)
    elements = np.unique(all_links[all_links < NO_LINK] >> 10).astype(np.int64)
    links = all_links[:, 0].reshape(len(x), count)
    on_dab = evidence.dab_of_sample < len(evidence.target)
    seen = (links < NO_LINK) & on_dab[:, None]
    material = field.elements.material[links[seen] >> 10]
    share = np.bincount(material, carry.sum(2)[seen], minlength=1) / max(float(carry[on_dab].sum()), 1e-30)
    sees = {int(m): float(share[m]) for m in np.flatnonzero(share > LEAST_SHARE)}
    target = present_radiance(evidence) if is_fixed else evidence.target
    return Receiver(painted, evidence, carry.astype(np.float32), target, sees, elements)


def present_radiance(e: Evidence) -> NDArray[np.float64]:
    """Returns what the dabs (n, 3) send to the eye now."""
    weight = column_weights("preview_surface", e.surface.diffuse, e.surface.f0, e.surface.f90)
    radiance = np.einsum("scr,scr->sr", weight, e.columns[:, -1]) + e.coat
    return mean_by(radiance, e.dab_of_sample)[: len(e.target)]


def materials_in_sight(receivers: list[Receiver], scene: Scene, kept: set[int]) -> list[int]:
    """Returns the materials that may change, most seen first: editable, not fixated, not the receivers' own."""
    total: dict[int, float] = {}
    for r in receivers:
        for m, share in r.sees.items():
            total[m] = total.get(m, 0.0) + share
    free = [m for m in total if m not in kept and not scene.materials[m].why_not_editable]
    return sorted(free, key=lambda m: -total[m])[:MOST_MATERIALS]


def receiver_tables(
    receivers: list[Receiver], material: int, original: Surface, field: LightField, levels: NDArray | None = None
) -> Tables:
    """Builds the tables of one material's change, as the receivers see it, under the light of now.

    Args:
        original: reflectance that the change counts from; the light field may have another one now.
        levels: (J,) roughness to look at; default LEVELS.
    """
    rows = np.unique(np.concatenate([r.elements for r in receivers]))
    rows = rows[field.elements.material[rows] == material]
    d, f0, f90, rough = (getattr(original, k)[rows] for k in ("diffuse", "f0", "f90", "roughness"))
    is_metal = bool(np.abs(f90 - f0).max() < 2e-3 and d.max() < 0.02)
    is_textured = bool(d.std(0).max() > 5e-3)
    levels = np.array(LEVELS) if levels is None else levels
    mean_rough = float(np.average(rough))
    zero, one = np.zeros_like(d), np.ones_like(d)

    def seen(weights: NDArray, roughness: NDArray) -> list[NDArray]:
        field_d = field.respond(rows, weights, roughness)
        return [_carried(r, field, field_d) for r in receivers]

    def columns_of(dx: NDArray, dy: NDArray, a: NDArray, b: NDArray) -> NDArray:
        return np.stack([dx, dy, a, b], 1)

    phong = field.model == "phong"
    u_weights = columns_of(one if phong else 1 - f0, zero if phong else 1 - f90, zero, zero)
    w_weights = columns_of(zero if phong else one, one if is_metal and not phong else zero, zero, zero)
    now = field.surface
    present = column_weights(field.model, now.diffuse[rows], now.f0[rows], now.f90[rows])
    base_weights = column_weights(field.model, d, f0, f90)
    v_weights = columns_of(zero if phong else -d, zero, one, one if is_metal and not phong else zero)
    base = [
        total - sent
        for total, sent in zip(
            [present_total(r, field) for r in receivers], seen(present, now.roughness[rows]), strict=True
        )
    ]
    u, w = seen(u_weights, rough), seen(w_weights, rough)
    tint_u, tint_w = (u, w)
    if is_textured:
        tint_u, tint_w = seen(u_weights * d[:, None], rough), seen(w_weights * d[:, None], rough)
    all_levels = [np.clip(rough + (r - mean_rough), 0.001, 1) for r in levels] + [rough]
    p = [[b + s for b, s in zip(base, seen(base_weights, r), strict=True)] for r in all_levels]
    v = [seen(v_weights, r) for r in all_levels]
    j = len(all_levels)
    every = range(len(receivers))
    stack = lambda x: np.concatenate([np.stack([x[k][i] for k in range(j)], 1) for i in every])  # noqa: E731
    spread = lambda x: np.repeat(np.concatenate(x)[:, None], j, 1)  # noqa: E731
    target = np.concatenate([r.target for r in receivers])
    stroke = np.concatenate([np.full(len(r.target), i) for i, r in enumerate(receivers)])
    mean = np.array([target[stroke == s].mean() for s in stroke])
    flat = np.array([len(r.target) > 2 and bool(np.ptp(r.target, 0).max() < 1e-9) for r in receivers])
    place = np.concatenate([_places(r) for r in receivers])
    none = np.zeros((0, j, 3))
    return Tables(
        target, np.abs(target) + 0.1 * mean[:, None] + 1e-6, place, stroke, flat[stroke], stack(p), spread(u), stack(v),
        spread(w), spread(tint_u), spread(tint_w), (none, none, none, none, np.zeros((0, 3))), (none, none, none, none),
        np.concatenate([levels, [mean_rough]]), d.mean(0).astype(np.float64), f0.mean(0).astype(np.float64), mean_rough,
        is_metal, is_textured,
    )  # fmt: skip


def present_total(r: Receiver, field: LightField) -> NDArray[np.float64]:
    """Returns what the dabs (n, 3) of a receiver send to the eye under the light of now."""
    return present_radiance(r.painted.evidence(field))


def _places(r: Receiver) -> NDArray[np.float64]:
    position = r.evidence.surface.position.astype(np.float64)
    return mean_by(position, r.evidence.dab_of_sample)[: len(r.target)]


def _carried(r: Receiver, field: LightField, field_d: object) -> NDArray[np.float64]:
    """Carries a field along a receiver's rays to its dabs (n, 3)."""
    radiance = field.follow_links(r.painted.samples.links_d, r.painted.samples.weights_d, field_d)
    arriving = (radiance.reshape(r.carry.shape) * r.carry).sum(1, dtype=np.float64)
    return mean_by(arriving, r.evidence.dab_of_sample)[: len(r.target)]
