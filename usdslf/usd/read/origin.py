"""Where a shot's own coordinates begin: near the world's origin there, far from it in the middle of what is shown.

Positions are kept in 32 bits: a million units away from the origin they are .06 units apart.  A shot that is small
for its distance is therefore read relative to a place inside it, subtracted while numbers have 64 bits.
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

Origin = tuple[float, float, float]
HERE: Origin = (0.0, 0.0, 0.0)
FAR = 256.0  # distance over size: beyond it, 32 bits resolve less than 1/65000 of the shot
STEP = 8.0  # sizes: origins are multiples of a power of two about as large, so that most frames have the same one


def scene_origin(stage: Usd.Stage, time: Usd.TimeCode) -> Origin:
    """Returns the place (3,) [stage units] that positions are to be relative to: 0 for a shot near it."""
    cache = UsdGeom.BBoxCache(time, [UsdGeom.Tokens.default_, UsdGeom.Tokens.render])
    box = Gf.Range3d()
    for prim in _bounded(stage):
        box.UnionWith(cache.ComputeWorldBound(prim).ComputeAlignedRange())
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


def _bounded(stage: Usd.Stage) -> list[Usd.Prim]:
    """The prims whose bounds are those of a stage: its root, or its gprims where USD cannot bound an instancer.

    It fails at a PointInstancer whose prototypes are not there, and does not end at one that instances itself.
    """
    anywhere = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
    prims = list(Usd.PrimRange(stage.GetPseudoRoot(), anywhere))
    holds: dict[Sdf.Path, set[Sdf.Path]] = {}  # instancer -> instancers that its prototypes are or hold
    instancers = [p for p in prims if p.IsA(UsdGeom.PointInstancer)]
    below: dict[Sdf.Path, set[Sdf.Path]] = {}  # any prim -> instancers that it is or has below it
    for path in (p.GetPath() for p in instancers):
        for above in path.GetPrefixes():
            below.setdefault(above, set()).add(path)
    for prim in instancers:
        roots = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
        if not all(stage.GetPrimAtPath(r) for r in roots):
            return [p for p in prims if p.IsA(UsdGeom.Gprim)]
        holds[prim.GetPath()] = set().union(*(below.get(r, ()) for r in roots))
    while ends := {at for at, inside in holds.items() if not inside}:
        holds = {at: inside - ends for at, inside in holds.items() if at not in ends}
    return [p for p in prims if p.IsA(UsdGeom.Gprim)] if holds else [stage.GetPseudoRoot()]


def moved_to(world: np.ndarray, origin: Origin) -> np.ndarray:
    """Returns a matrix (4, 4) of column vectors into the world, made one into coordinates relative to an origin."""
    if origin == HERE:
        return world
    out = np.array(world, np.float64)
    out[:3, 3] -= origin
    return out
