"""Weights: what a candidate pays for its misfit, for what it frees and for what it leaves unsaid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

from usdslf.errors import InputError

POSITIVE = ("dab_error", "drift_length", "tail", "outlier", "visible")  # weights that are divided by


@dataclass(frozen=True)
class Options:
    """Weights of the choice; errors are relative to the painted radiance."""

    norm: str = "mixed"  # l2 | l0 | mixed
    dab_error: float = 0.06  # of each dab and channel, the light field's error included
    drift_error: float = 0.10  # of brightness, over the stroke
    drift_length: float = 0.5  # of the stroke's extent
    tint_error: float = 0.05  # of each channel
    flat_error: float = 30.0  # of each dab and channel, where one colour was painted on everything; its mean stays
    freedom: float = 3.0  # cost of a degree of freedom
    group: float = 16.0  # cost of a second and third parameter
    background: float = 0.05  # per dab, for unpainted directions that change by their own radiance
    kind: float = 6.0  # cost of a diffuse metal or of a coloured dielectric
    tail: float = 2.0  # misfit per dab beyond which it counts by its logarithm
    outlier: float = 20.0  # misfit of a single dab beyond which it counts by its logarithm
    place: float = 0.15  # per dab, for the change being where the stroke is
    nothing: float = 5.0  # cost of no change where what was painted is not there yet
    visible: float = 0.05  # relative change that is seen
    variation: float = 30.0  # cost of a change that varies over the surface
    factors: tuple[float, float, float] | None = None  # of the misfit by freed parameters, in place of all costs

    @staticmethod
    def of(weights: Mapping[str, float] | tuple[float, ...]) -> Options:
        """Returns options with other weights: three factors as in the paper (1, 5, 25), or costs by their names.

        Raises: InputError for a weight that is unknown or not finite and positive, or another number of factors.
        """
        values = weights.values() if isinstance(weights, Mapping) else weights
        if not all(math.isfinite(v) and v >= 0 for v in values):
            raise InputError(f"weights {', '.join(f'{v:g}' for v in values)}: each must be finite and not negative")
        if isinstance(weights, Mapping):
            known = [f.name for f in fields(Options) if f.name not in ("norm", "factors")]
            unknown = [name for name in weights if name not in known]
            if unknown:
                raise InputError(f"there is no weight '{unknown[0]}'; choose from {', '.join(known)}")
            if any(v == 0 for k, v in weights.items() if k in POSITIVE):
                raise InputError(f"the weights {', '.join(POSITIVE)} must be above zero")
            return replace(Options(), **weights)  # type: ignore[arg-type]
        if len(weights) != 3 or min(weights) <= 0:
            raise InputError("give three factors above zero, for one, two and three freed parameters, say 1,5,25")
        return replace(Options(), factors=(weights[0], weights[1], weights[2]))

    def in_words(self) -> str:
        """Returns what differs from the default, for provenance; "" where nothing does."""
        if self.factors is not None:
            return "factors " + ", ".join(f"{v:g}" for v in self.factors)
        other = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}
        return ", ".join(f"{k} {v if isinstance(v, str) else format(v, 'g')}" for k, v in other.items())
