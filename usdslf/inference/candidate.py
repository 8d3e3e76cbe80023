"""Candidate: one way to change a material, with what it frees, what it changes and what that costs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.bilinear import Tables
from usdslf.scene.records import F64
from usdslf.surfaces.reflectance import Parameters, moved_roughness

GROUPS = ("diffuse", "specular", "glossiness")


@dataclass(frozen=True)
class Candidate:
    """One explanation: a change of some parameters, and what it costs."""

    freed: tuple[str, ...]
    delta_diffuse: F64 = field(default_factory=lambda: np.zeros(3))
    delta_f0: F64 = field(default_factory=lambda: np.zeros(3))
    roughness_shift: float = 0.0
    is_factor: bool = False  # the delta of the diffuse colour, else of the specular one, is a factor less one
    level: int = -1
    misfit: float = 0.0
    freedoms: int = 0
    cost: float = 0.0
    is_admitted: bool = True  # by the norm; what is not can be chosen by its name alone
    is_metallic: bool = False  # a dielectric becomes a metal: no diffuse reflection, F90 follows F0
    roughness_mean: float = 0.0  # where the shift is that of a factor on roughness which varies: its mean, else 0

    @property
    def id(self) -> str:
        """Name in reports: the freed parameters joined by '+', or 'none'."""
        return "+".join(self.freed) or "none"

    @property
    def rank(self) -> tuple[bool, float]:
        """What candidates of one pool are sorted by, the best first."""
        return not self.is_admitted, self.cost

    def diffuse_of(self, d: NDArray) -> NDArray:
        """Applies the change to diffuse colours (..., 3)."""
        changed = d * (1 + self.delta_diffuse) if self.is_factor else d + self.delta_diffuse
        return np.clip(changed, 0, 1) if "diffuse" in self.freed else d

    def f0_of(self, f0: NDArray) -> NDArray:
        """Applies the change to specular colours (..., 3)."""
        changed = f0 * (1 + self.delta_f0) if self.is_factor_f0 else f0 + self.delta_f0
        return np.clip(changed, 0, 1) if "specular" in self.freed else f0

    def apply(self, p: Parameters, is_metal: bool | NDArray[np.bool_]) -> Parameters:
        """Applies the change to the parameters of n surfaces; F90 goes with F0 in a metal.

        Args:
            is_metal: of all, or (n,) of each.
        """
        f0 = self.f0_of(p.f0)
        follows = (np.asarray(is_metal) | self.is_metallic) & ("specular" in self.freed)
        return Parameters(
            self.diffuse_of(p.diffuse), f0, np.where(follows[..., None], f0, p.f90), self.roughness_of(p.roughness)
        )

    def delta_of(self, parameter: str) -> F64:
        """Returns the change (3,) of diffuse or specular, of glossiness (1,) the shift of roughness."""
        shift = np.array([self.roughness_shift])
        return {"diffuse": self.delta_diffuse, "specular": self.delta_f0, "glossiness": shift}[parameter]

    @property
    def is_factor_f0(self) -> bool:
        """Whether delta_f0 is a factor less one."""
        return self.is_factor and "diffuse" not in self.freed

    @property
    def is_factor_diffuse(self) -> bool:
        """Whether delta_diffuse is a factor less one."""
        return self.is_factor and "diffuse" in self.freed

    def radiance(self, t: Tables) -> F64:
        """Returns the radiance (n, 3) of the dabs that the candidate gives at its level."""
        b = t.with_factors(self.is_factor_diffuse, self.is_factor_f0)
        return b.at_level(self.level).predict(self.delta_diffuse, self.delta_f0)

    def as_terms(self, t: Tables) -> Candidate:
        """Returns the change with terms for factors, as they are for the mean colours."""
        if not self.is_factor:
            return self
        if self.is_factor_f0:
            return replace(self, delta_f0=self.delta_f0 * t.f0, is_factor=False)
        return replace(self, delta_diffuse=self.delta_diffuse * t.diffuse, is_factor=False)

    def roughness_of(self, r: NDArray) -> NDArray:
        """Applies the change to roughness."""
        return moved_roughness(r, self.roughness_shift, self.roughness_mean) if "glossiness" in self.freed else r


def is_grey(c: Candidate) -> bool:
    """Whether the channels of a specular change have one value."""
    of_diffuse = 3 * ("diffuse" in c.freed and not c.is_metallic)
    return "specular" in c.freed and c.freedoms - of_diffuse - ("glossiness" in c.freed) == 1
