"""Where a shot's own coordinates begin: near the world's origin there, far from it in the middle of what is shown.

Positions are kept in 32 bits: a million units away from the origin they are .06 units apart.  A shot that is small
for its distance is therefore read relative to a place inside it, subtracted while numbers have 64 bits.
"""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

Origin = tuple[float, float, float]
HERE: Origin = (0.0, 0.0, 0.0)
FAR = 256.0  # distance over size: beyond it, 32 bits resolve less than 1/65000 of the shot
STEP = 8.0  # sizes: origins are multiples of a power of two about as large, so that most frames have the same one


def scene_origin(stage: Usd.Stage, time: Usd.TimeCode) -> Origin:
    """Returns the place (3,) [stage units] that positions are to be relative to: 0 for a shot near it."""
    purposes = [UsdGeom.Tokens.default_, UsdGeom.Tokens.render]
    box = UsdGeom.BBoxCache(time, purposes).ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    if box.IsEmpty():
        return HERE
    low, high = np.array(box.GetMin()), np.array(box.GetMax())
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return HERE
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    if size == 0 or np.abs(middle).max() < FAR * size:
        return HERE
    step = 2.0 ** np.ceil(np.log2(STEP * size))
    x, y, z = (float(v) for v in np.round(middle / step) * step)
    return x, y, z


def moved_to(world: np.ndarray, origin: Origin) -> np.ndarray:
    """Returns a matrix (4, 4) of column vectors into the world, made one into coordinates relative to an origin."""
    if origin == HERE:
        return world
    out = np.array(world, np.float64)
    out[:3, 3] -= origin
    return out
