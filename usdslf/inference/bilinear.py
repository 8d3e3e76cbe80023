"""Tables: the evidence about one material, pooled over strokes, bilinear in the change of its colours.

    pool_tables(evidences, material, model) -> Tables
    bilinear(columns, d, F0, F90, ...) -> P, U, V, W        L = P + dd U + dF V - dd dF W

Source: Nguyen et al. 2013, 5.3 (Eqs. 3 to 6), pooled over the stroke.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.evidence import Evidence, mean_by
from usdslf.scene.records import F64


@dataclass(frozen=True)
class Tables:
    """Evidence about one material, pooled.  n dabs, B background rows, J levels (the last: own roughness)."""

    target: F64  # (n, 3)
    scale: F64  # (n, 3) that makes residuals relative
    place: F64  # (n, 3) position of each dab
    stroke: NDArray[np.int64]  # (n,) which stroke
    flat: NDArray[np.bool_]  # (n,) its stroke has one colour
    p: F64  # (n, J, 3)
    u: F64
    v: F64
    w: F64
    tint_u: F64  # (n, J, 3) U and W of a factor on d, V of one on F0, instead of a term, for textured colours
    tint_w: F64
    tint_v: F64
    back: tuple[F64, F64, F64, F64, F64]  # P, U, V, W (B, J, 3) and scale (B, 3)
    elsewhere: tuple[F64, F64, F64, F64]  # P, U, V, W (E, J, 3) of unpainted points that the same eye sees
    dab_levels: F64  # (n, J) roughness of each dab at each level
    levels: F64  # (J,) their means
    diffuse: F64  # (3,) means over the dabs
    f0: F64
    roughness: float
    is_metal: bool  # F90 follows F0, no diffuse reflection
    is_textured: bool  # d varies
    is_textured_f0: bool = False
    most_diffuse: float = 1.0  # that the material can reflect: its opacity, where it is seen through
    is_phong: bool = False  # d + F0 <= 1 is for the fit to keep

    @property
    def own(self) -> int:
        """Level of the roughness as it is."""
        return len(self.levels) - 1


def pool_tables(evidences: list[Evidence], material: int, model: str = "preview_surface") -> Tables:
    """Sums the evidence of strokes about one material into tables over dabs."""
    parts = [_tables_of(e, material, i, model) for i, e in enumerate(evidences)]
    parts = [p for p in parts if len(p["target"])]
    assert parts, "no dab on the material"
    cat = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
    target = cat["target"]
    mean = np.array([np.mean(target[cat["stroke"] == s]) for s in cat["stroke"]])
    seen = np.array([np.abs(cat["p"][cat["stroke"] == s, -1]).mean() for s in cat["stroke"]])
    mean = np.where(mean > 1e-3 * seen, mean, seen)  # black paint: relative to what it covers
    back_p = cat["back_p"]
    back_scale = np.abs(back_p[:, -1]) + 0.1 * np.abs(back_p[:, -1]).mean() + 1e-9
    d, f0, f90 = cat["d"], cat["f0"], cat["f90"]
    return Tables(
        target=target,
        scale=np.abs(target) + 0.1 * mean[:, None] + 1e-6,
        place=cat["place"],
        stroke=cat["stroke"],
        flat=cat["flat"],
        p=cat["p"],
        u=cat["u"],
        v=cat["v"],
        w=cat["w"],
        tint_u=cat["tint_u"],
        tint_w=cat["tint_w"],
        tint_v=cat["tint_v"],
        back=(back_p, cat["back_u"], cat["back_v"], cat["back_w"], back_scale),
        elsewhere=tuple(cat[f"else_{k}"] for k in "puvw"),  # type: ignore[arg-type]
        dab_levels=cat["levels"],
        levels=cat["levels"].mean(0),
        diffuse=d.mean(0),
        f0=f0.mean(0),
        roughness=float(cat["levels"][:, -1].mean()),
        is_metal=bool(np.abs(f90 - f0).max() < 2e-3 and d.max() < 0.02),
        is_textured=bool(d.std(0).max() > 5e-3),
        is_textured_f0=bool(f0.std(0).max() > 5e-3),
        most_diffuse=float(np.clip(cat["opacity"].min(), 0, 1)),
        is_phong=model == "phong",
    )


def _tables_of(e: Evidence, material: int, index: int, model: str) -> dict[str, NDArray]:
    n = len(e.target)
    here = np.flatnonzero(e.material == material)
    mean = lambda x: mean_by(x, e.dab_of_sample)[:n][here]  # noqa: E731
    s = e.surface
    d, f0, f90 = (x.astype(np.float64) for x in (s.diffuse, s.f0, s.f90))
    if model == "phong":  # as the light field reflects it
        f0 = np.minimum(f0, np.maximum(1 - d, 0))
    tied = bool(np.abs(f90 - f0).max() < 2e-3 and d.max() < 0.02) if len(d) else False
    p, u, v, w = bilinear(e.columns, d, f0, f90, tied, model)
    p = p + e.coat[:, None]
    dd = d[:, None]
    row = e.background_sample
    keep = e.material[e.dab_of_sample[row]] == material
    other = (e.dab_of_sample >= n) & (s.material == material)
    bp, bu, bv, bw = (x[keep] for x in bilinear(e.background, d[row], f0[row], f90[row], tied, model))
    colors = e.target[here]
    flat = e.stroke.tool == "replace" and len(here) > 2 and bool((colors.std(0) <= 0.01 * colors.mean() + 1e-9).all())
    return {
        "target": colors,
        "place": mean(s.position.astype(np.float64)),
        "stroke": np.full(len(here), index),
        "flat": np.full(len(here), flat),
        "p": mean(p),
        "u": mean(u),
        "v": mean(v),
        "w": mean(w),
        "tint_u": mean(u * dd),
        "tint_w": mean(w * dd),
        "tint_v": mean(v * f0[:, None]),
        **{f"else_{k}": x[other] for k, x in zip("puvw", (p, u, v, w), strict=True)},
        "back_p": bp,
        "back_u": bu,
        "back_v": bv,
        "back_w": bw,
        "levels": mean(e.levels),
        "opacity": mean(s.opacity.astype(np.float64)),
        "d": mean(d),
        "f0": mean(f0),
        "f90": mean(f90),
    }


def bilinear(columns: F64, d: F64, f0: F64, f90: F64, tied: bool, model: str) -> tuple[F64, F64, F64, F64]:
    """Turns columns (n, J, 4, 3) into P, U, V, W (n, J, 3) about the present parameters (n, 3).

    Args:
        tied: F90 changes with F0, as in a metal of the metal workflow.
    """
    x, y, a, b = (columns[:, :, k] for k in range(4))
    d, f0, f90 = d[:, None], f0[:, None], f90[:, None]
    if model == "phong":
        return d * x + f0 * a, x, a, np.zeros_like(x)
    p = d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b
    u = (1 - f0) * x + (1 - f90) * y
    if tied:
        return p, u, a + b - d * (x + y), x + y
    return p, u, a - d * x, x
