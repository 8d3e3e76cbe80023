"""Brush: what the next stroke is painted with."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

RECENT = 12  # colours that are kept
LEAST, MOST = 0.002, 0.25  # radius, of the picture's height
STEP = 1.2  # factor of one press of a key
Rgb = tuple[float, float, float]
PALETTE: tuple[Rgb, ...] = (
    (0.02, 0.02, 0.02), (0.18, 0.18, 0.18), (0.5, 0.5, 0.5), (0.85, 0.85, 0.85), (2.0, 2.0, 2.0),
    (0.45, 0.04, 0.02), (0.55, 0.20, 0.02), (0.50, 0.40, 0.05), (0.08, 0.30, 0.05), (0.03, 0.25, 0.30),
    (0.03, 0.08, 0.40), (0.20, 0.04, 0.30), (0.40, 0.18, 0.12), (0.60, 0.42, 0.30), (0.95, 0.72, 0.35),
    (0.25, 0.14, 0.07),
)  # fmt: skip
"""Colours to begin with, scene-linear: greys, a highlight, paints, skin, gold, leather."""


@dataclass(frozen=True)
class Brush:
    """What a stroke means, and how wide it is.

    Attributes:
        radius: of the picture's height.
        strength: 0..1.
        color: scene-linear, in the working space.
        space: scene | reflectance: what the colour means.
        tool, mode, norm, scope: as of `usdslf.Stroke`.
        uses_pressure: a pen's pressure makes it narrower.
        recent: colours that were painted with, the last one first.
        clone_source: (3,) the point that tool clone copies from [stage units]; None: not chosen yet.
    """

    radius: float = 0.02
    strength: float = 1.0
    color: Rgb = (0.5, 0.05, 0.03)
    space: str = "scene"
    tool: str = "replace"
    mode: str = "direct"
    norm: str = "mixed"
    scope: str = "material"
    uses_pressure: bool = True
    recent: tuple[Rgb, ...] = field(default=())
    clone_source: Rgb | None = None

    def resized(self, radius: float) -> Brush:
        """Returns it with another radius, within LEAST and MOST."""
        return replace(self, radius=min(max(radius, LEAST), MOST))

    def used(self) -> Brush:
        """Returns it with its colour as the most recent one."""
        others = tuple(c for c in self.recent if c != self.color)
        return replace(self, recent=(self.color, *others)[:RECENT])
