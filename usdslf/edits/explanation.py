"""Explanation: one way to explain strokes, as reports, looks and reviews name it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Explanation:
    """One way to explain what was painted.

    Attributes:
        id: parameters that it frees, joined by "+"; "none".
        cost: of it, without a unit: the least is chosen; None: not admitted by the norm.
        probability: 0..1 that it is what was meant, given that one of them is.
        after: mean `diffuse` and `specular` (three numbers each) and `roughness` over what was painted.
    """

    id: str
    cost: float | None
    probability: float
    after: Mapping[str, Any]

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"id": self.id, "cost": self.cost, "probability": self.probability, "after": dict(self.after)}
