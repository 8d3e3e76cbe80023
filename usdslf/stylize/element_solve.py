"""Element solve: the paper's solver, one element at a time, as it stands in its Listing 1.

For every element and each of 20 roughness levels (and its own) the light that arrives is reflected, and nothing,
the diffuse, the specular or both reflectances are fitted in closed form to the wanted light of its 1024 directions:
4 (n_c + 1) candidates.  What is negative becomes zero and what reflects more than arrives is scaled down, all
channels alike, before the residual is taken.  Then the norm says which candidates count, and a factor for the number
of parameters that they change which of them is best: 1, 5 and 25 in the paper.

Strokes are not solved this way: one element sees too little of a stroke to tell a highlight from a colour
(`solve.py` pools all samples of a stroke).  This is here to be compared with the paper, for its figures, and for
`stylize.py`, which asks all elements of a scene for a light that each can see whole.

Where the paper is not definite: Eq. 2 has W outside of the square and C has it once, so W is the weight of squared
differences in C, d and the residual alike; a negative component becomes zero by itself; a candidate that frees one
parameter lowers this one alone to preserve energy; the choice is shared by the colour channels; parallel columns
leave out the candidate that frees both.

Source: Nguyen et al. 2013, 5.3 (Eqs. 2 to 6) and Listing 1; kernels: element_solve.cl.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from usdslf.light_field.blocks import LANES, Chunk, levels_of
from usdslf.light_field.light_field import LightField
from usdslf.light_field.preconvolution import LevelKernel
from usdslf.light_field.storage import constants_of
from usdslf.progress import tell
from usdslf.sampling.hemisphere import D
from usdslf.scene.records import F64
from usdslf.surfaces.reflectance import LEVEL_COUNT, are_metal, column_weights, gloss_levels, model_of

FACTORS = {"l2": (np.inf, np.inf, np.inf, 1.0), "l0": (1.0, 1.0, np.inf, np.inf), "mixed": (1.0, 1.0, 5.0, 25.0)}
"""Of a residual where none, one, two, three parameters change; the paper's weights are those of mixed."""
FITTED = ("none", "diffuse", "specular", "diffuse+specular")  # at each level
BLOCKS = 12  # of sixteen elements at a time: fewer are half done by the time that it takes to start a kernel
PARTS = 8  # of the bins, each summed by itself
OWN = LEVEL_COUNT  # row of an element's own roughness
GROUPS = {"take_products": (3, 1, 1), "take_residuals": (1, 1), "fit_level": (LANES,), "put_level": (LANES,)}
TIE = 1e-9  # of the wanted light's square: residuals below are alike


@dataclass(frozen=True)
class ElementCandidates:
    """All candidates of n elements; J = 21 levels, the last of which is the element's own roughness."""

    element: NDArray[np.int64]  # (n,)
    roughness: F64  # (n, J)
    diffuse: NDArray[np.float32]  # (n, J, 4, 3) in the order of FITTED
    f0: NDArray[np.float32]  # (n, J, 4, 3)
    residual: NDArray[np.float32]  # (n, J, 4) sum over bins and channels of W times the squared difference
    wanted: NDArray[np.float32]  # (n,) the same of the wanted light alone, without emission and clear coat

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
    field: LightField, element: NDArray, wanted_d: Any, weight: NDArray | None = None, hold: NDArray | None = None
) -> Iterator[ElementCandidates]:
    """Fits all candidates of elements under the light that arrives now; yields them chunk by chunk.

    Quickest where elements that follow each other have roughness alike.

    Args:
        element: (n,) distinct.
        wanted_d: device array (N, D, 3): reflected light, without emission, that is wanted of all elements; only
            rows of `element` are looked at.
        weight: (n, D) diagonal of W = I + sigma_m diag(m); None: ones.
        hold: (n, 2) price of moving diffuse and F0 by one, squared, in units of the residual.  With it, a fit of one
            parameter is least squares of the light, not of the normal equations as in Eqs. 5 and 6, and a grey F0
            stays grey.
    """
    chunk = BLOCKS * LANES
    work = _Work(field, max(min(BLOCKS, -(-len(element) // LANES)), 1), hold is not None)
    for first in range(0, max(len(element), 1), chunk):
        rows = slice(first, first + chunk)
        n = len(element[rows])
        yield work.enumerate(
            np.asarray(element[rows], np.int64), wanted_d, np.ones((n, D)) if weight is None else weight[rows],
            np.zeros((n, 2)) if hold is None else hold[rows],
        )  # fmt: skip
        tell()


def choose_candidates(
    found: ElementCandidates,
    factor: tuple[float, float, float, float] = FACTORS["mixed"],
    free: NDArray | None = None,
    noise: NDArray | None = None,
    price: NDArray | float = 0.0,
) -> ElementChange:
    """Picks the candidate of the smallest residual (Eq. 4) among those that a norm admits.

    Args:
        factor: of the residual where none, one, two, three parameters change; infinite: not admitted.
        free: (n, 3) which of diffuse, specular, glossiness may change; None: all.
        noise: (n,) added to residuals, which tells fits apart no finer than that; None: TIE of the wanted light.
        price: (n, J, 4) of a change by itself.
    """
    freed, n = freed_of_candidates(), len(found.element)
    noise = TIE * found.wanted if noise is None else noise
    with np.errstate(invalid="ignore"):
        asked = (found.residual + noise[:, None, None]) * np.array(factor)[freed.sum(-1)] + price
    is_possible = np.isfinite(asked)
    if free is not None:
        is_possible &= ~np.einsum("jkp,np->njk", freed, ~free.astype(bool))
    asked = np.where(is_possible, asked, np.inf).reshape(n, freed[..., 0].size)
    level, kind = np.divmod(asked.argmin(1), len(FITTED))
    any_possible = np.isfinite(asked.min(1))
    level, kind = np.where(any_possible, level, OWN), np.where(any_possible, kind, 0)
    r = np.arange(n)
    return ElementChange(
        found.element, found.diffuse[r, level, kind], found.f0[r, level, kind], found.roughness[r, level],
        freed[level, kind], found.residual_before, found.residual[r, level, kind],
    )  # fmt: skip


Found = TypeVar("Found", ElementCandidates, ElementChange)


def joined(parts: Sequence[Found]) -> Found:
    """Puts the elements of all parts into one."""
    kind = type(parts[0])
    return kind(**{k: np.concatenate([getattr(p, k) for p in parts]) for k in kind.__dataclass_fields__})


def follows_f0(field: LightField) -> NDArray[np.bool_]:
    """Returns the elements (N,) whose F90 goes with F0: metals."""
    s = field.surface
    return are_metal(s.diffuse, s.f0, s.f90) & model_of(field.model).has_fresnel


class _Work:
    """Arrays of a chunk of blocks, and the kernels that go over them."""

    def __init__(self, field: LightField, blocks: int, least: bool) -> None:
        self.field, self.device, self.least = field, field.device, least
        empty = lambda *shape: field.device.empty((*shape, LANES), np.float32)  # noqa: E731
        block = (blocks, D, 3)
        self.light_d, self.coarse_d, self.e_pi_d = empty(*block), empty(blocks, D // 4, 3), empty(blocks, 3)
        self.xy_d, self.ab_d, self.own_d = (empty(2, *block) for _ in range(3))
        self.target_d = empty(*block)
        self.products_d, self.left_d = empty(blocks, PARTS, 3, 15), empty(blocks, PARTS, len(FITTED))
        self.candidates_d, self.columns_d = empty(blocks, len(FITTED), 7), empty(blocks, len(FITTED), 12)
        self.square_d = empty(blocks)
        self.table_d = field.device.empty((blocks * LANES, OWN + 1, len(FITTED), 7), np.float32)

    def run(self, name: str, size: tuple[int, ...], *args: Any) -> None:
        constants = {**model_of(self.field.model).constants, "LEAST": int(self.least)}
        constants |= constants_of(self.field.outgoing_d)
        local = GROUPS.get(name, (64, 1))  # small ones, for few blocks are to keep all processors busy
        self.device.kernel("element_solve", name, **constants)(size, local, *args)

    def enumerate(self, element: NDArray, wanted_d: Any, weight: NDArray, hold: NDArray) -> ElementCandidates:
        field, s, n = self.field, self.field.surface, len(element)
        count = -(-n // LANES)
        blocks = np.uint32(count)
        order = np.full(count * LANES, -1, np.int32)
        order[:n] = element
        order_d, upload = self.device.upload(order), self.device.upload
        light_kernel = lambda name: self.device.kernel("light_field", name)  # noqa: E731
        field.gather(Chunk(order, order_d, 0, count), self.light_d)
        light_kernel("coarsen")((D // 4, count), (64, 1), self.light_d, self.coarse_d)
        light_kernel("irradiance")((3, count), None, self.light_d, field.cosine_d, self.e_pi_d)
        light = (self.coarse_d, self.e_pi_d, field.y_d, field.y_scale_d)
        self.run("diffuse_columns", (D // 4, count), *light, blocks, self.xy_d)
        weight_d = upload(_by_lanes(weight[..., None]))
        present_d = upload(_by_lanes(_present(field, element, hold, self.least)[..., None]))

        self.device.clear(self.own_d)
        low, share = levels_of(s.roughness[element])
        for j in np.unique([low, low + 1]):
            of_own = np.where(low == j, 1 - share, np.where(low + 1 == j, share, 0))
            if of_own.any():
                self._reflect(*field.level(int(j)), count)
                share_d = upload(_by_lanes(of_own[:, None, None]))
                self.run("add_share", (D, count), self.ab_d, share_d, blocks, self.own_d)
        weights = column_weights(field.model, s.diffuse[element], s.f0[element], s.f90[element])
        weights_d = upload(_by_lanes(weights.reshape(n, 12, 1)))
        self.run(
            "take_target", (D, count), order_d, weights_d, self.xy_d, self.own_d, field.emission_d, field.outgoing_d,
            wanted_d, blocks, self.target_d,
        )  # fmt: skip
        self._fit(OWN, self.own_d, weight_d, present_d, count)
        levels = gloss_levels(field.model)
        for j, roughness in enumerate(levels):
            self._reflect(*field.level_of(float(roughness)), count)
            self._fit(j, self.ab_d, weight_d, present_d, count)
        table = self.device.download(self.table_d)[:n]
        square = self.device.download(self.square_d).reshape(-1)[:n]
        roughness = np.concatenate([np.tile(levels, (n, 1)), s.roughness[element][:, None]], 1)
        return ElementCandidates(element, roughness, table[..., :3], table[..., 3:6], table[..., 6], square)

    def _reflect(self, level: LevelKernel, w: dict[str, Any], count: int) -> None:
        """A and B of one level."""
        blocks = np.uint32(count)
        if level.coarse:
            self.run(
                "coarse_columns", (D // 4, count), self.coarse_d, w["a"], w["b"], w["fine_scale"], blocks, self.ab_d
            )
        else:
            self.run("sharp_columns", (D, count), self.light_d, w["first"], w["tap"], w["a"], w["b"], blocks, self.ab_d)

    def _fit(self, level: int, ab_d: Any, weight_d: Any, present_d: Any, count: int) -> None:
        """The candidates of a level, into its row of the table."""
        blocks, lanes = np.uint32(count), (count * LANES,)
        columns = (self.xy_d, ab_d, self.target_d, weight_d)
        self.run("take_products", (3, PARTS, count), *columns, blocks, self.products_d)
        self.run(
            "fit_level", lanes, self.products_d, present_d, blocks, self.candidates_d, self.columns_d, self.square_d
        )
        self.run("take_residuals", (PARTS, count), *columns, self.columns_d, blocks, self.left_d)
        row = (np.uint32(level), np.uint32(OWN + 1))
        self.run("put_level", lanes, self.candidates_d, self.left_d, blocks, *row, self.table_d)


def _present(field: LightField, element: NDArray, hold: NDArray, is_grey_kept: bool) -> NDArray[np.float32]:
    """What each element is and may become (n, 14), as element_solve.cl takes it."""
    s, e = field.surface, field.elements
    d, f0, f90 = (np.asarray(x[element], np.float32) for x in (s.diffuse, s.f0, s.f90))
    d, f0 = model_of(field.model).held(d, f0)
    tied = follows_f0(field)[element]
    alike = is_grey_kept & (np.ptp(f0, axis=1) < 0.02) & ~tied
    solid = np.clip(e.opacity[element] / np.maximum(e.presence[element], 1e-6), 0, 1)
    return np.concatenate([d, f0, f90, np.stack([tied, alike, solid], 1), hold], 1).astype(np.float32)


def _by_lanes(rows: NDArray) -> NDArray[np.float32]:
    """Lays rows (n, k, c) out as (blocks, k, c, 16); empty lanes are zero."""
    n, k, c = rows.shape
    out = np.zeros((-(-n // LANES) * LANES, k, c), np.float32)
    out[:n] = rows
    return np.ascontiguousarray(out.reshape(-1, LANES, k, c).transpose(0, 2, 3, 1))
