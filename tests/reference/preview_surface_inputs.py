"""UsdPreviewSurface's inputs -> its reflectance, in float64, as previewSurface.glslfx of OpenUSD writes it.

The twin of usdslf/surfaces/preview_surface.py, written from the shader and without its code.
"""

from __future__ import annotations

import math
from typing import Any

FALLBACKS: dict[str, Any] = {
    "diffuseColor": (0.18, 0.18, 0.18),
    "useSpecularWorkflow": 0,
    "specularColor": (0.0, 0.0, 0.0),
    "metallic": 0.0,
    "ior": 1.5,
    "roughness": 0.5,
}


def mix(a: float, b: float, t: float) -> float:
    return a * (1 - t) + b * t


def reflectance(**inputs: Any) -> dict[str, Any]:
    """Returns d, F0 and F90, three floats each, and roughness."""
    unknown = set(inputs) - set(FALLBACKS)
    assert not unknown, unknown
    v = FALLBACKS | inputs
    color = [float(x) for x in v["diffuseColor"]]
    if v["useSpecularWorkflow"]:
        f0, f90, d = [float(x) for x in v["specularColor"]], [1.0] * 3, color
    else:
        metallic = float(v["metallic"])
        root = (1 - v["ior"]) / (1 + v["ior"])
        f90 = [mix(1.0, c, metallic) for c in color]
        f0 = [mix(root * root * s, s, metallic) for s in f90]
        d = [c * (1 - metallic) for c in color]
    return {"d": d, "f0": f0, "f90": f90, "roughness": max(0.001, float(v["roughness"]))}


def fresnel_at_normal(ior: float) -> float:
    """Reflectance of a smooth dielectric, from Snell's law at a vanishing angle (a check on R^2)."""
    angle = 1e-4
    inside = math.asin(math.sin(angle) / ior)
    s = math.sin(angle - inside) / math.sin(angle + inside)
    return s * s
