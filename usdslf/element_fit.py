"""Element fit: for each element by itself, the valid reflectance that explains a wanted light best.

At each of 20 roughness levels, and at the roughness as it is, the least squares for diffuse, specular or both have a
closed form in the products of the columns.  What is not valid (below 0, above 1, more light than arrives) is scaled
down, all channels alike, which keeps its hue, *before* its misfit is taken.  The choice among nothing, diffuse,
specular, glossiness and their unions weighs the misfit by the number of parameters that change, so that noise does
not move them all; and what hardly changes the light stays as it is, for a price that grows with the change.

A metal (no diffuse reflection, F90 = F0) has specular and glossiness only, and F90 stays F0.  A grey F0 stays grey.

Source: Nguyen et al. 2013, 5.3: Eqs. (3) to (6), scaling to energy preservation, the mixed-norm solver, Listing 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.directions import D
from usdslf.element_products import A, B, Products, X, Y
from usdslf.light_field import Surface
from usdslf.reflectance import column_weights, roughness_levels
from usdslf.scene import F64

CHANGES = ("diffuse", "specular", "glossiness")
WEIGHTS = {"l0": (1.0, np.inf, np.inf), "mixed": (1.0, 1.6, 2.6), "l2": (1.0, 1.0, 1.0)}
# Price of a parameter that moves by one, relative to the light there, squared: where light says nothing, it stays.
HOLD_DIFFUSE, HOLD_SPECULAR, HOLD_ROUGHNESS = 1e-3, 1e-2, 2e-3
ROUNDS = 3  # between diffuse and specular where bounds hold one of them
SEEN = 5e-3  # relative misfit below which nothing needs to change
NOISE = 0.01  # relative misfit that is no reason to change one more parameter
NO_LIGHT = 1e-30


@dataclass(frozen=True)
class ElementFit:
    """The reflectance of N elements, and how well it explains the wanted light."""

    diffuse: F64  # (N, 3)
    f0: F64  # (N, 3)
    f90: F64  # (N, 3)
    roughness: F64  # (N,)
    changed: NDArray[np.bool_]  # (N, 3) which of CHANGES
    wanted: F64  # (N,) its square, summed over bins and channels
    misfit_before: F64  # (N,) the same of model less wanted
    misfit_after: F64  # (N,)


@dataclass(frozen=True)
class _State:
    """Parameters (N, 3) under way."""

    diffuse: F64
    f0: F64
    f90: F64


Freed = tuple[bool, bool, bool]


class ElementFitter:
    """Fits elements; knows what each is and may become."""

    def __init__(
        self, surface: Surface, free: NDArray, solid: NDArray, model: str = "preview_surface", norm: str = "mixed"
    ) -> None:
        """Takes the reflectance as it is.

        Args:
            free: (N, 3) which of CHANGES each element may undergo.
            solid: (N,) opacity of what is there: the diffuse reflectance cannot pass it.
            norm: l0 | mixed | l2: how many parameters of an element may change at once.
        """
        self.own = _State(*(np.asarray(x, np.float64) for x in (surface.diffuse, surface.f0, surface.f90)))
        self.roughness = np.asarray(surface.roughness, np.float64)
        self.free = np.asarray(free, bool)
        self.highest = np.maximum(np.asarray(solid, np.float64)[:, None], self.own.diffuse)
        self.glow = D * (np.asarray(surface.emission, np.float64) ** 2).sum(1)
        self.model, self.weights = model, WEIGHTS[norm]
        apart, paint = np.abs(self.own.f90 - self.own.f0).max(1), self.own.diffuse.max(1)
        self.is_metal = ((apart < 2e-3) & (paint < 0.02) & (model != "phong"))[:, None]
        self.is_grey = (np.ptp(self.own.f0, axis=1)[:, None] < 0.02) & ~self.is_metal

    def fit(self, products: Products) -> ElementFit:
        """Finds the best valid reflectance of each element, with no change that `free` forbids."""
        wanted = products.fixed[:, :, 5].sum(1)
        as_it_is = products.at(self.roughness)
        before = self._misfit(as_it_is, self.own)
        scale = wanted + before + self.glow  # of the light that is seen: what is wanted alone may be darkness
        best, level = self.own, self.roughness
        price, misfit = before + NOISE**2 * scale, before
        changed = np.zeros((len(wanted), 3), bool)
        is_wanting = before > SEEN**2 * scale
        for other in (None, *roughness_levels()):
            g = as_it_is if other is None else products.at(np.full(len(wanted), other))
            rough = self.roughness if other is None else other
            for freed, state in self._candidates(g, scale, other is not None):
                error = self._misfit(g, state)
                asked = (error + NOISE**2 * scale) * self.weights[sum(freed) - 1] + scale * self._moved(state, rough)
                take = is_wanting & (asked < price) & self.free[:, freed].all(1)
                price, misfit = np.where(take, asked, price), np.where(take, error, misfit)
                best = _State(*(np.where(take[:, None], new, old) for new, old in zip(_all(state), _all(best))))
                level = np.where(take, rough, level)
                changed[take] = freed
        return ElementFit(best.diffuse, best.f0, best.f90, level, changed, wanted, before, misfit)

    def _candidates(self, g: F64, scale: F64, other_level: bool) -> Iterator[tuple[Freed, _State]]:
        if other_level:
            yield (False, False, True), self.own
        hold = scale[:, None] / 3
        if np.isfinite(self.weights[int(other_level)]):
            yield (True, False, other_level), self._with_diffuse(g, hold, self.own)
            yield (False, True, other_level), self._with_specular(g, hold, self.own)
        if np.isfinite(self.weights[1 + int(other_level)]):
            yield (True, True, other_level), self._with_both(g, hold)

    def _misfit(self, g: F64, s: _State) -> F64:
        w = self._columns(s)
        return np.maximum(np.einsum("nci,ncij,ncj->n", w, g, w), 0)

    def _columns(self, s: _State) -> F64:
        """Weights (N, 3, 5) of X, Y, A, B, T whose sum is model less wanted."""
        w = column_weights(self.model, s.diffuse, s.f0, s.f90)
        return np.concatenate([np.moveaxis(w, 1, 2), np.full((len(w), 3, 1), -1.0)], 2)

    def _moved(self, s: _State, roughness: F64 | float) -> F64:
        """Price (N,) of the way to a state."""
        d = ((s.diffuse - self.own.diffuse) ** 2).mean(1)
        f0 = ((s.f0 - self.own.f0) ** 2).mean(1)
        return HOLD_DIFFUSE * d + HOLD_SPECULAR * f0 + HOLD_ROUGHNESS * (roughness - self.roughness) ** 2

    def _with_diffuse(self, g: F64, hold: F64, s: _State) -> _State:
        """Least squares for d, all else as in `s`."""
        w = self._columns(replace(s, diffuse=0 * s.diffuse))
        u = np.zeros_like(w)
        u[..., X], u[..., Y] = (1, 0) if self.model == "phong" else (1 - s.f0, 1 - s.f90)
        d = _least(g, u, w, HOLD_DIFFUSE * hold, self.own.diffuse)
        high = np.minimum(self.highest, 1 - s.f0) if self.model == "phong" else self.highest
        return replace(s, diffuse=np.where(self.is_metal, s.diffuse, _scaled_into(d, high)))

    def _with_specular(self, g: F64, hold: F64, s: _State) -> _State:
        """Least squares for F0, all else as in `s`; F90 goes with it for a metal."""
        w = self._columns(replace(s, f0=0 * s.f0, f90=np.where(self.is_metal, 0, s.f90)))
        v = np.zeros_like(w)
        v[..., A] = 1
        if self.model != "phong":
            v[..., X] = -s.diffuse
            v[..., B], v[..., Y] = np.where(self.is_metal, 1, 0), np.where(self.is_metal, -s.diffuse, 0)
        high = np.maximum(1 - s.diffuse, 0) if self.model == "phong" else np.ones(3)
        f0 = _scaled_into(_least(g, v, w, HOLD_SPECULAR * hold, self.own.f0, self.is_grey), high)
        return replace(s, f0=f0, f90=np.where(self.is_metal, f0, s.f90))

    def _with_both(self, g: F64, hold: F64) -> _State:
        """Diffuse and specular in turn, from where the unbounded least squares for both has its minimum."""
        s = replace(self.own, f0=np.where(self.is_metal, self.own.f0, self._specular_of_both(g, hold)))
        for _ in range(ROUNDS):
            s = self._with_specular(g, hold, self._with_diffuse(g, hold, s))
        return s

    def _specular_of_both(self, g: F64, hold: F64) -> F64:
        """F0 (N, 3) of the least squares for a = d (1 - F0) and F0 at once, a taken out; in its bounds."""
        w = self._columns(_State(0 * self.own.diffuse, 0 * self.own.f0, self.own.f90))
        if self.model != "phong":
            w[..., Y] = self.own.diffuse * (1 - self.own.f90)
        hold_x, hold_a = HOLD_DIFFUSE * hold, HOLD_SPECULAR * hold
        left = g[..., A, X] / np.maximum(g[..., X, X] + hold_x, NO_LIGHT)
        ra, rx = (np.einsum("ncj,ncj->nc", g[..., k, :], w) for k in (A, X))
        over = left * rx - ra + hold_a * self.own.f0 - left * hold_x * self.own.diffuse
        under = g[..., A, A] - left * g[..., A, X] + hold_a
        over, under = (np.where(self.is_grey, x.mean(1, keepdims=True), x) for x in (over, under))
        return np.clip(over / np.maximum(under, NO_LIGHT), 0, 0.99)


def _least(g: F64, u: F64, w: F64, hold: F64, present: F64, shared: NDArray | None = None) -> F64:
    """The p (N, 3) of least |p u + w|^2 + hold |p - present|^2; one for all channels of elements in `shared` (N, 1)."""
    gu = np.einsum("ncij,ncj->nci", g, u)
    over = hold * present - np.einsum("nci,nci->nc", gu, w)
    under = np.einsum("nci,nci->nc", gu, u) + hold
    if shared is not None:
        over, under = (np.where(shared, x.mean(1, keepdims=True), x) for x in (over, under))
    return np.where(under > NO_LIGHT, over / np.maximum(under, NO_LIGHT), present)


def _scaled_into(color: F64, high: F64) -> F64:
    """Colours (N, 3) from zero up, scaled down where any channel passes `high`."""
    color = np.maximum(color, 0)
    fits = np.where(color > high, high / np.maximum(color, NO_LIGHT), 1).min(1, keepdims=True)
    return color * fits


def _all(s: _State) -> tuple[F64, F64, F64]:
    return s.diffuse, s.f0, s.f90
