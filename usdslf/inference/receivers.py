"""Indirect strokes: the change is wanted where it was painted, and made elsewhere.

Judged at the receiver: the samples of the stroke, and of every fixate stroke, keep their own reflectance.  For each
material that they see, the basis fields X, Y, A, B that its elements would send out are carried along the samples'
rays and through the samples' own reflectance to the painted direction; that gives the same four tables P, U, V, W
as a direct stroke has, and the same candidates are fitted to them, now for every material in sight.

Source: Nguyen et al. 2013, 4.2 and figures 5, 17 to 19; which carries the difference backwards instead, so that an
element cannot know of the fixate strokes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.bilinear import TEXTURED, Bilinear, Tables
from usdslf.inference.evidence import Evidence, evaluate_columns, mean_by, unchanging_radiance
from usdslf.inference.residuals import relative_scale
from usdslf.inference.sample_rays import SHARPEST
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import element_of, is_link
from usdslf.light_field.surface import Surface
from usdslf.scene.records import Scene
from usdslf.surfaces.reflectance import column_weights, columns, is_metal, lobe_parameter, model_of

if TYPE_CHECKING:
    from usdslf.inference.answers import Painted

F64 = NDArray[np.float64]
Response = Callable[[NDArray, NDArray], F64]  # weights (r, 4, 3) and roughness (r,) -> what the dabs see of it (n, 3)
LEVELS = (0.1, 0.2, 0.3, 0.45, 0.65, 0.9)  # roughness that is asked first
MOST_MATERIALS = 6
LEAST_SHARE = 0.01  # of what a stroke sees, for a material to be asked
UNIFORM = 1e-4  # a reflectance that varies less over a material is one


@dataclass(frozen=True)
class Receiver:
    """What carries light from rays to the painted direction.  S samples, K rays, n dabs."""

    painted: Painted
    dab_of_sample: NDArray[np.int64]  # (S,) 0..n-1; n and above are not the stroke's
    carry: NDArray[np.float32]  # (S, K, 3) painted radiance per radiance of each ray
    target: F64  # (n, 3)
    place: F64  # (n, 3) position of the dabs
    sees: dict[int, float]  # material -> share of what the dabs see
    elements: NDArray[np.int64]  # that its rays are tied to
    is_held: bool  # wants what it has
    has_one_color: bool  # one colour was painted on all of it


def make_receiver(painted: Painted, evidence: Evidence, field: LightField, is_fixed: bool) -> Receiver:
    """Prepares a stroke as a receiver; a fixate stroke wants what it has now."""
    samples, surface = painted.samples, evidence.surface
    count, light = samples.light.rays, samples.light
    local = field.device.download(light.towards_d)[:, :, :count].transpose(0, 2, 1)
    width = lobe_parameter(field.model, np.maximum(surface.roughness, SHARPEST))[:, None]
    x = columns(field.model, width, samples.eye[:, None], local)  # (S, K, 4)
    weight = column_weights(field.model, surface.diffuse, surface.f0, surface.f90)  # (S, 4, 3)
    carry = np.einsum("skc,scr->skr", x, weight) * field.device.download(light.gain_d).reshape(len(x), count, 3)
    all_links = field.device.download(light.links_d)
    elements = np.unique(element_of(all_links[is_link(all_links)])).astype(np.int64)
    links = all_links[:, 0].reshape(len(x), count)
    n = len(evidence.target)
    on_dab = evidence.dab_of_sample < n
    seen = is_link(links) & on_dab[:, None]
    material = field.elements.material[element_of(links[seen])]
    share = np.bincount(material, carry.sum(2)[seen], minlength=1) / max(float(carry[on_dab].sum()), 1e-30)
    sees = {int(m): float(share[m]) for m in np.flatnonzero(share > LEAST_SHARE)}
    place = mean_by(surface.position.astype(np.float64), evidence.dab_of_sample)[:n]
    target = present_radiance(painted, field) if is_fixed else evidence.target
    has_one_color = not is_fixed and n > 2 and bool(np.ptp(target, 0).max() <= 0.01 * target.mean() + 1e-9)
    return Receiver(
        painted, evidence.dab_of_sample, carry.astype(np.float32), target, place, sees, elements, is_fixed,
        has_one_color,
    )  # fmt: skip


def present_radiance(painted: Painted, field: LightField) -> F64:
    """Returns what a stroke's dabs (n, 3) send to the eye under the light of now."""
    samples, n = painted.samples, len(painted.rows)
    s = samples.surface
    found = evaluate_columns(samples, field, s.roughness[:, None].astype(np.float64))[:, 0]
    weight = column_weights(field.model, s.diffuse, s.f0, s.f90)
    radiance = np.einsum("scr,scr->sr", weight, found) + unchanging_radiance(samples, field)
    return mean_by(radiance, samples.dab)[:n]


def materials_in_sight(receivers: list[Receiver], scene: Scene, kept: set[int]) -> list[int]:
    """Returns the materials that may change, most seen first: editable, not fixated, not the receivers' own."""
    total: dict[int, float] = {}
    for r in receivers:
        for m, share in r.sees.items():
            total[m] = total.get(m, 0.0) + share
    free = [m for m in total if m not in kept and not scene.materials[m].why_not_editable]
    return sorted(free, key=lambda m: -total[m])[:MOST_MATERIALS]


def rows_in_sight(receivers: list[Receiver], material: int, field: LightField) -> NDArray[np.int64]:
    """Returns the elements of a material that receivers are tied to."""
    rows = np.unique(np.concatenate([r.elements for r in receivers]))
    return rows[field.elements.material[rows] == material]


def carried(receivers: list[Receiver], field: LightField, field_d: object) -> F64:
    """Carries a field along all receivers' rays to their dabs, in order: (n, 3)."""
    arriving = []
    for r in receivers:
        light = r.painted.samples.light
        radiance = field.follow_links(light.links_d, light.weights_d, field_d)
        sent = (radiance.reshape(r.carry.shape) * r.carry).sum(1, dtype=np.float64)
        arriving.append(mean_by(sent, r.dab_of_sample)[: len(r.target)])
    return np.concatenate(arriving)


def receiver_tables(
    receivers: list[Receiver], material: int, original: Surface, field: LightField, levels: NDArray | None = None
) -> tuple[Tables, Tables | None]:
    """Builds the tables of one material's change, as the receivers see it, under the light of now.

    Args:
        original: reflectance that the change counts from; the light field may have another one now.
        levels: (J,) roughness to look at; default LEVELS.

    Returns: the tables, and those of the metal that the material might become, of which p and v only count; None
    for what is a metal already or is textured.
    """
    rows = rows_in_sight(receivers, material, field)
    d, f0, f90, rough = (getattr(original, k)[rows] for k in ("diffuse", "f0", "f90", "roughness"))
    metal = is_metal(d, f0, f90)
    levels = np.array(LEVELS) if levels is None else levels
    mean_rough = float(np.average(rough))
    all_levels = [np.clip(rough + (r - mean_rough), 0.001, 1) for r in levels] + [rough]
    now = field.surface

    def seen(weights: NDArray, roughness: NDArray) -> F64:
        return carried(receivers, field, field.respond(rows, weights, roughness))

    present = column_weights(field.model, now.diffuse[rows], now.f0[rows], now.f90[rows])
    total = np.concatenate([present_radiance(r.painted, field) for r in receivers])
    base = total - seen(present, now.roughness[rows])
    is_uniform = max(float(x.std(0).max()) for x in (d, f0, f90)) < UNIFORM
    parts = _uniform_parts if is_uniform else _varying_parts
    found = parts(seen, field.model, d, f0, f90, all_levels, metal)
    j = len(all_levels)
    spread = lambda x: np.repeat(x[:, None], j, 1)  # noqa: E731
    dabs = Bilinear(base[:, None] + found.p, spread(found.u), found.v, spread(found.w))
    all_means = np.concatenate([levels, [mean_rough]])
    tables = Tables(
        **_asked(receivers),
        dabs=dabs,
        factor_u=spread(found.factor_u),
        factor_w=spread(found.factor_w),
        factor_v=found.factor_v,
        background=Bilinear.empty(j),
        background_scale=np.zeros((0, 3)),
        elsewhere=Bilinear.empty(j),
        dab_levels=np.broadcast_to(all_means, (len(base), j)),
        levels=all_means,
        diffuse=d.mean(0).astype(np.float64),
        f0=f0.mean(0).astype(np.float64),
        roughness=mean_rough,
        is_metal=metal,
        is_textured=bool(d.std(0).max() > TEXTURED),
        is_textured_f0=bool(f0.std(0).max() > TEXTURED),
    )
    if found.metal_v is None:
        return tables, None
    nothing = np.zeros_like(dabs.u)
    as_metal = replace(
        tables, dabs=Bilinear(base[:, None] + tables.f0 * found.metal_v, nothing, found.metal_v, nothing),
        factor_u=nothing, factor_w=nothing, factor_v=nothing, is_textured_f0=False, diffuse=np.zeros(3), is_metal=True,
    )  # fmt: skip
    return tables, as_metal


def _asked(receivers: list[Receiver]) -> dict[str, Any]:
    """What the dabs of all receivers ask for, by the names of Tables."""
    target = np.concatenate([r.target for r in receivers])
    # who holds a place makes no error of brightness over the stroke: each dab stands for itself
    number = np.concatenate([np.full(len(r.target), i) for i, r in enumerate(receivers)])
    held = np.concatenate([np.full(len(r.target), r.is_held) for r in receivers])
    mean = np.array([target[number == s].mean() for s in number])
    stroke = np.where(held, len(receivers) + np.arange(len(number)), number)
    one_color = np.concatenate([np.full(len(r.target), r.has_one_color) for r in receivers])
    return {
        "target": target,
        "scale": relative_scale(target, mean[:, None]),
        "place": np.concatenate([r.place for r in receivers]),
        "stroke": stroke,
        "has_one_color": one_color,
        "swatch": np.where(one_color, number, -1),
    }


@dataclass(frozen=True)
class _Parts:
    """What the dabs (n) see of a material: P and V at J levels, U, W and those of a factor at the own one."""

    p: F64  # (n, J, 3)
    u: F64  # (n, 3)
    v: F64  # (n, J, 3)
    w: F64  # (n, 3)
    factor_u: F64  # (n, 3)
    factor_w: F64  # (n, 3)
    factor_v: F64  # (n, J, 3) of a factor on F0
    metal_v: F64 | None = None  # (n, J, 3) V of the metal that the material might become


def _uniform_parts(
    seen: Response, model: str, d: NDArray, f0: NDArray, f90: NDArray, levels: list[NDArray], is_metal: bool
) -> _Parts:
    """The parts for a material of one colour: from its X, Y, A and B."""
    zero, one = np.zeros_like(d), np.ones_like(d)
    d_, f0_, f90_ = (x.mean(0).astype(np.float64) for x in (d, f0, f90))
    has_fresnel = model_of(model).has_fresnel
    alone = lambda k: np.stack([one if i == k else zero for i in range(4)], 1)  # noqa: E731
    x = seen(alone(0), levels[-1])
    y = seen(alone(1), levels[-1]) if has_fresnel else np.zeros_like(x)
    a = np.stack([seen(alone(2), r) for r in levels], 1)
    b = np.stack([seen(alone(3), r) for r in levels], 1) if has_fresnel else np.zeros_like(a)
    all_columns = np.stack(np.broadcast_arrays(x[:, None], y[:, None], a, b), 2)  # (n, J, 4, 3)
    p, u, v, w = model_of(model).bilinear(all_columns, d_, f0_, f90_, is_metal)
    u, w = u[:, 0], w[:, 0]  # of the diffuse columns alone, the same at all levels
    could_be_metal = has_fresnel and not is_metal
    return _Parts(p, u, v, w, d_ * u, d_ * w, f0_ * v, a + b if could_be_metal else None)


def _varying_parts(
    seen: Response, model: str, d: NDArray, f0: NDArray, f90: NDArray, levels: list[NDArray], is_metal: bool
) -> _Parts:
    """The same for a material whose colours vary over its elements."""
    # the weights of the columns are bilinear in d and F0 as radiance is: their parts are those of unit columns
    unit = np.broadcast_to(np.eye(4)[:, None, :, None], (4, len(d), 4, 3))
    each = [model_of(model).bilinear(c, d, f0, f90, is_metal) for c in unit]
    _, u_weights, v_weights, w_weights = (np.stack(x, 1).astype(d.dtype) for x in zip(*each, strict=True))
    own = levels[-1]
    p = np.stack([seen(column_weights(model, d, f0, f90), r) for r in levels], 1)
    v = np.stack([seen(v_weights, r) for r in levels], 1)
    factor_u, factor_w = (seen(x * d[:, None], own) for x in (u_weights, w_weights))
    factor_v = np.zeros_like(v)
    if f0.std(0).max() > TEXTURED:
        factor_v = np.stack([seen(v_weights * f0[:, None], r) for r in levels], 1)
    return _Parts(p, seen(u_weights, own), v, seen(w_weights, own), factor_u, factor_w, factor_v)
