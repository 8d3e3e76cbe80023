"""A bitmap of Mitsuba 3 with a constant border: OpenGL's GL_CLAMP_TO_BORDER, without its half texel of blend.

Source: UsdPreviewSurface specification 2.5, wrapS and wrapT: `black`.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
from reference.mitsuba_setup import set_variant

set_variant()


class BorderedTexture(mi.Texture):
    """`inner` where its coordinates, m (u, v, 1) with m 2 x 3, are in 0..1, else `border`."""

    def __init__(self, props: Any) -> None:
        mi.Texture.__init__(self, props)
        self.inner = props["inner"]
        self.border = mi.Color3f(props["border"])
        self.m = [float(props[f"m{i}"]) for i in range(6)]

    def _is_inside(self, si: Any) -> Any:
        m, u, v = self.m, si.uv.x, si.uv.y
        s, t = m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]
        return (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)

    def eval(self, si: Any, active: Any = True) -> Any:
        """Colour at a hit."""
        return dr.select(self._is_inside(si), mi.Color3f(self.inner.eval(si, active)), self.border)

    def eval_1(self, si: Any, active: Any = True) -> Any:
        """Number at a hit."""
        return dr.select(self._is_inside(si), self.inner.eval_1(si, active), self.border.x)

    def eval_3(self, si: Any, active: Any = True) -> Any:
        """Colour at a hit, without conversion."""
        return dr.select(self._is_inside(si), mi.Color3f(self.inner.eval_3(si, active)), self.border)

    def is_spatially_varying(self) -> bool:
        """It varies."""
        return True

    def to_string(self) -> str:
        """A short name."""
        return f"Bordered[{self.inner}]"


def register() -> None:
    """Makes the plug-in known to Mitsuba as `bordered`."""
    mi.register_texture("bordered", lambda props: BorderedTexture(props))
