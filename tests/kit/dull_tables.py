"""Tables of one stroke on a dull surface, in light that differs from dab to dab."""

from __future__ import annotations

import numpy as np

from usdslf.inference.bilinear import Bilinear, Tables
from usdslf.inference.residuals import relative_scale

N = 24
BEFORE = np.array([0.3, 0.4, 0.2])  # diffuse colour


def dull_tables(rng: np.random.Generator, n: int = N) -> Tables:
    """Returns tables of n dabs that were painted as they are, each with a colour of its own."""
    x = rng.uniform(0.5, 2.0, (n, 1, 1)) * np.ones((n, 1, 3))
    none = np.zeros_like(x)
    dabs = Bilinear(BEFORE * x + 0.05, x, 0.3 * x, none)
    return Tables(
        target=dabs.p[:, 0], scale=relative_scale(dabs.p[:, 0]), place=rng.random((n, 3)), stroke=np.zeros(n, np.int64),
        has_one_color=np.zeros(n, bool), swatch=np.full(n, -1), dabs=dabs, factor_u=none, factor_w=none, factor_v=none,
        background=Bilinear.empty(1), background_scale=np.zeros((0, 3)), elsewhere=Bilinear.empty(1),
        dab_levels=np.full((n, 1), 0.5), levels=np.array([0.5]), diffuse=BEFORE, f0=np.full(3, 0.04),
        roughness=0.5, is_metal=False, is_textured=False,
    )  # fmt: skip
