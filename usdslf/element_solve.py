"""Element solve: the paper's solver, one element at a time, as it stands in its Listing 1.

For every element and each of 20 roughness levels (and its own) the light that arrives is reflected, and nothing,
the diffuse, the specular or both reflectances are fitted in closed form to the wanted light of its 1024 directions:
4 (n_c + 1) candidates.  What is negative becomes zero and what reflects more than arrives is scaled down before the
residual is taken.  Then the norm says which candidates count, and a factor for the number of parameters that they
change which of them is best: 1, 5 and 25 in the paper.

Strokes are not solved this way: one element sees too little of a stroke to tell a highlight from a colour
(`solve.py` pools all samples of a stroke).  This is here to be compared with the paper, and for its figures.

Where the paper is not definite: Eq. 2 has W outside of the square and C has it once, so W is the weight of squared
differences in C, d and the residual alike; a negative component becomes zero by itself; a candidate that frees one
parameter lowers this one alone to preserve energy; the choice is shared by the colour channels; parallel columns
leave out the candidate that frees both.

Source: Nguyen et al. 2013, 5.3 (Eqs. 2 to 6) and Listing 1; kernels: element_solve.cl, element_fit.cl.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.directions import D
from usdslf.light_field import CHUNK_BLOCKS, LANES, NEAR, LightField, levels_of
from usdslf.preconvolution import LevelKernel
from usdslf.reflectance import LEVEL_COUNT, gloss_levels
from usdslf.scene import F64

PAPER_WEIGHTS = (1.0, 5.0, 25.0)  # of a residual where one, two, three parameters change
FITTED = ("none", "diffuse", "specular", "diffuse+specular")  # at each level
OWN = LEVEL_COUNT  # row of an element's own roughness
TIE = 1e-9  # of the wanted light's square: residuals below are alike


@dataclass(frozen=True)
class ElementCandidates:
    """All candidates of n elements; J = 21 levels, the last of which is the element's own roughness."""

    element: NDArray[np.int64]  # (n,)
    roughness: F64  # (n, J)
    diffuse: NDArray[np.float32]  # (n, J, 4, 3) in the order of FITTED
    f0: NDArray[np.float32]  # (n, J, 4, 3)
    residual: NDArray[np.float32]  # (n, J, 4) sum over bins and channels of W times the squared difference
    wanted: F64  # (n,) the same of the wanted light alone

    @property
    def residual_before(self) -> NDArray[np.float32]:
        """Residual (n,) of the reflectance as it is."""
        return self.residual[:, OWN, 0]


@dataclass(frozen=True)
class ElementChange:
    """What was chosen for n elements."""

    element: NDArray[np.int64]  # (n,)
    diffuse: NDArray[np.float32]  # (n, 3)
    f0: NDArray[np.float32]  # (n, 3)
    roughness: F64  # (n,)
    changed: NDArray[np.bool_]  # (n, 3) of diffuse, specular, glossiness
    residual_before: NDArray[np.float32]  # (n,)
    residual_after: NDArray[np.float32]  # (n,)


def freed_of_candidates() -> NDArray[np.bool_]:
    """Returns which of diffuse, specular, glossiness each candidate frees: (J, 4, 3)."""
    freed = np.zeros((OWN + 1, len(FITTED), 3), bool)
    freed[:, [1, 3], 0] = freed[:, [2, 3], 1] = True
    freed[:OWN, :, 2] = True
    return freed


def enumerate_elements(
    field: LightField, element: NDArray, wanted: NDArray, weight: NDArray | None = None
) -> Iterator[ElementCandidates]:
    """Fits all candidates of elements under the light that arrives now; yields them chunk by chunk.

    Args:
        element: (n,) distinct.
        wanted: (n, D, 3) outgoing radiance that is wanted, emission and coat included.
        weight: (n, D) diagonal of W = I + sigma_m diag(m); None: ones.
    """
    chunk = CHUNK_BLOCKS * LANES
    for first in range(0, len(element), chunk):
        rows = slice(first, first + chunk)
        w = np.ones((len(element[rows]), D)) if weight is None else weight[rows]
        yield _enumerate_chunk(field, np.asarray(element[rows], np.int64), wanted[rows], w)


def choose_candidates(
    found: ElementCandidates, norm: str = "mixed", weights: tuple[float, float, float] = PAPER_WEIGHTS
) -> ElementChange:
    """Picks the candidate of the smallest residual (Eq. 4) among those that a norm admits.

    Args:
        norm: l2 frees all three parameters, l0 at most one, mixed any number, for which `weights` are the factors.
    """
    number = freed_of_candidates().sum(-1)
    factor = np.array([min(weights), *weights])[number]
    if norm == "l2":
        factor = np.where(number == 3, 1.0, np.inf)
    elif norm == "l0":
        factor = np.where(number <= 1, 1.0, np.inf)
    n = len(found.element)
    with np.errstate(invalid="ignore"):
        price = (found.residual + TIE * found.wanted[:, None, None]) * factor
    price = np.where(np.isfinite(price), price, np.inf)
    at = price.reshape(n, -1).argmin(1)
    level, kind = np.divmod(at, len(FITTED))
    is_possible = np.isfinite(price.reshape(n, -1).min(1))
    level, kind = np.where(is_possible, level, OWN), np.where(is_possible, kind, 0)
    r = np.arange(n)
    return ElementChange(
        found.element, found.diffuse[r, level, kind], found.f0[r, level, kind], found.roughness[r, level],
        freed_of_candidates()[level, kind], found.residual_before, found.residual[r, level, kind],
    )  # fmt: skip


def solve_elements(
    field: LightField, element: NDArray, wanted: NDArray, weight: NDArray | None = None, norm: str = "mixed",
    weights: tuple[float, float, float] = PAPER_WEIGHTS,
) -> ElementChange:  # fmt: skip
    """Solves elements one by one: `enumerate_elements`, then `choose_candidates`."""
    parts = [choose_candidates(c, norm, weights) for c in enumerate_elements(field, element, wanted, weight)]
    join = lambda name: np.concatenate([getattr(p, name) for p in parts])  # noqa: E731
    return ElementChange(**{name: join(name) for name in ElementChange.__dataclass_fields__})


def _enumerate_chunk(field: LightField, element: NDArray, wanted: NDArray, weight: NDArray) -> ElementCandidates:
    device, s, n = field.device, field.surface, len(element)
    count = -(-n // LANES)
    size, is_phong = np.int32(count), int(field.model == "phong")
    kernel = lambda stem, name, **c: device.kernel(stem, name, **c)  # noqa: E731
    light_kernel = lambda name: device.kernel("light_field", name, NEAR=NEAR, LOBE=0)  # noqa: E731
    block = (count, D, 3, LANES)
    light_d, coarse_d = device.empty(block, np.float32), device.empty((count, D // 4, 3, LANES), np.float32)
    e_pi_d = device.empty((count, 3, LANES), np.float32)
    order = np.full(count * LANES, -1, np.int32)
    order[:n] = element
    light_kernel("gather")(
        (D, count), (64, 1), device.upload(order), field.hit_d, field.fixed_d, field.outgoing_d, np.int32(0), light_d
    )
    light_kernel("coarsen")((D // 4, count), (64, 1), light_d, coarse_d)
    light_kernel("irradiance")((3, count), None, light_d, field.cosine_d, e_pi_d)
    xy_d, ab_d = device.empty((2, *block), np.float32), device.empty((2, *block), np.float32)
    own_d = device.zeros((2, *block), np.float32)
    kernel("element_fit", "diffuse_columns")(
        (D // 4, count), (64, 1), coarse_d, e_pi_d, field.y_d, field.y_scale_d, size, xy_d
    )

    target = np.asarray(wanted, np.float32) - s.emission[element][:, None] - _coat(field, element)
    wanted_d, weight_d = device.upload(_by_lanes(target)), device.upload(_by_lanes(weight[..., None])[:, :, 0])
    present_d = device.upload(_by_lanes(_present(field, element)[:, None])[:, 0])
    out_d = device.empty((count * LANES, len(FITTED), 7), np.float32)

    def reflect(level: LevelKernel, w: dict[str, Any]) -> None:
        """A and B of one level, into `ab_d`."""
        if level.coarse:
            kernel("element_fit", "coarse_columns")(
                (D // 4, count), (64, 1), coarse_d, w["a"], w["b"], w["fine_scale"], size, ab_d
            )
        else:
            kernel("element_fit", "sharp_columns")(
                (D, count), (64, 1), light_d, w["first"], w["tap"], w["a"], w["b"], size, ab_d
            )

    def fit(columns_d: Any) -> NDArray[np.float32]:
        kernel("element_solve", "fit_level", PHONG=is_phong)(
            (count * LANES,), (LANES,), xy_d, columns_d, wanted_d, weight_d, present_d, np.uint32(count), out_d
        )
        return np.asarray(device.download(out_d)[:n])

    levels = gloss_levels(field.model)
    tables = []
    for roughness in levels:
        reflect(*field.level_of(float(roughness)))
        tables.append(fit(ab_d))
    low, share = levels_of(s.roughness[element])
    for j in np.unique([low, low + 1]):
        of_own = np.where(low == j, 1 - share, np.where(low + 1 == j, share, 0))
        reflect(*field.level(int(j)))
        share_d = device.upload(_by_lanes(of_own[:, None, None])[:, 0, 0])
        add = kernel("element_solve", "add_share", PHONG=is_phong)
        add((D, count), (64, 1), ab_d, share_d, np.uint32(count), own_d)
    tables.append(fit(own_d))
    table = np.stack(tables, 1)
    roughness = np.concatenate([np.tile(levels, (n, 1)), s.roughness[element][:, None]], 1)
    square = np.einsum("nd,ndc->n", weight.astype(np.float64), target.astype(np.float64) ** 2)
    return ElementCandidates(element, roughness, table[..., :3], table[..., 3:6], table[..., 6], square)


def _present(field: LightField, element: NDArray) -> NDArray[np.float32]:
    """d, F0, F90 (n, 9) as the model reflects them, and whether F90 follows F0."""
    s = field.surface
    d, f0, f90 = (np.asarray(x[element], np.float32) for x in (s.diffuse, s.f0, s.f90))
    if field.model == "phong":
        d = np.minimum(d, 1)
        f0, is_tied = np.minimum(f0, 1 - d), np.zeros(len(d), bool)
    else:
        is_tied = (np.abs(f90 - f0).max(1) < 2e-3) & (d.max(1) < 0.02)
    return np.concatenate([d, f0, f90, is_tied[:, None]], 1)


def _coat(field: LightField, element: NDArray) -> NDArray[np.float32] | float:
    """Radiance (n, D, 3) of the clear coats, which stay; zero where there are none, as in the paper's model."""
    s = field.surface
    coated = element[s.clearcoat[element] > 0]
    if field.model == "phong" or not len(coated):
        return 0.0
    weights = np.zeros((len(coated), 4, 3), np.float32)
    weights[:, 2], weights[:, 3] = (s.clearcoat * s.coat_f0)[coated, None], s.clearcoat[coated, None]
    sent_d = field.respond(coated, weights, s.clearcoat_roughness[coated])
    return np.asarray(field.device.download(sent_d)[element])


def _by_lanes(rows: NDArray) -> NDArray[np.float32]:
    """Lays rows (n, k, c) out as (blocks, k, c, 16); empty lanes are zero."""
    n, k, c = rows.shape
    out = np.zeros((-(-n // LANES) * LANES, k, c), np.float32)
    out[:n] = rows
    return np.ascontiguousarray(out.reshape(-1, LANES, k, c).transpose(0, 2, 3, 1))
