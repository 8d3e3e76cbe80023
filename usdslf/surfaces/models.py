"""Names of the reflectance models, the usual one first: read by the command line before anything large is loaded."""

from __future__ import annotations

PREVIEW_SURFACE, PHONG = "preview_surface", "phong"
MODEL_NAMES = (PREVIEW_SURFACE, PHONG)
