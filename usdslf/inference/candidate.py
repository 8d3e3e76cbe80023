"""Candidate: one way to change a material, with what it frees, what it changes and what that costs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.bilinear import Tables
from usdslf.scene.records import F64

GROUPS = ("diffuse", "specular", "glossiness")


@dataclass(frozen=True)
class Candidate:
    """One explanation: a change of some parameters, and what it costs."""

    freed: tuple[str, ...]
    delta_diffuse: F64 = field(default_factory=lambda: np.zeros(3))
    delta_f0: F64 = field(default_factory=lambda: np.zeros(3))
    roughness_shift: float = 0.0
    is_tint: bool = False  # the delta of the diffuse colour, else of the specular one, is a factor less one
    level: int = -1
    misfit: float = 0.0
    freedoms: int = 0
    cost: float = 0.0
    is_metallic: bool = False  # a dielectric becomes a metal: no diffuse reflection, F90 follows F0

    @property
    def id(self) -> str:
        """Name in reports: the freed parameters joined by '+', or 'none'."""
        return "+".join(self.freed) or "none"

    def diffuse_of(self, d: NDArray) -> NDArray:
        """Applies the change to diffuse colours (..., 3)."""
        changed = d * (1 + self.delta_diffuse) if self.is_tint else d + self.delta_diffuse
        return np.clip(changed, 0, 1) if "diffuse" in self.freed else d

    def f0_of(self, f0: NDArray) -> NDArray:
        """Applies the change to specular colours (..., 3)."""
        changed = f0 * (1 + self.delta_f0) if self.is_tint_f0 else f0 + self.delta_f0
        return np.clip(changed, 0, 1) if "specular" in self.freed else f0

    def delta_of(self, parameter: str) -> F64:
        """Returns the change (3,) of diffuse or specular, of glossiness (1,) the shift of roughness."""
        shift = np.array([self.roughness_shift])
        return {"diffuse": self.delta_diffuse, "specular": self.delta_f0, "glossiness": shift}[parameter]

    @property
    def is_tint_f0(self) -> bool:
        """Whether delta_f0 is a factor less one."""
        return self.is_tint and "diffuse" not in self.freed

    def as_terms(self, t: Tables) -> Candidate:
        """Returns the change with terms for factors, as they are for the mean colours."""
        if not self.is_tint:
            return self
        if self.is_tint_f0:
            return replace(self, delta_f0=self.delta_f0 * t.f0, is_tint=False)
        return replace(self, delta_diffuse=self.delta_diffuse * t.diffuse, is_tint=False)

    def roughness_of(self, r: NDArray) -> NDArray:
        """Applies the change to roughness."""
        return np.clip(r + self.roughness_shift, 0.001, 1) if "glossiness" in self.freed else r


def ways_of(c: Candidate) -> tuple[str, str, bool]:
    """Returns how a candidate was fitted: `diffuse`, `specular` and `free_gloss` of `fit`."""
    specular = "" if "specular" not in c.freed else "grey" if is_grey(c) else "color"
    return "color" if "diffuse" in c.freed else "", specular, "glossiness" in c.freed


def is_grey(c: Candidate) -> bool:
    """Whether the channels of a specular change have one value."""
    of_diffuse = 3 * ("diffuse" in c.freed and not c.is_metallic)
    return "specular" in c.freed and c.freedoms - of_diffuse - ("glossiness" in c.freed) == 1
