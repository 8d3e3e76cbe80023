"""What attributes of a stroke may say: read by the command line before anything large is loaded."""

from __future__ import annotations

TOOLS = ("replace", "clone", "brighten", "darken", "blur", "sharpen", "fixate")
MODES = ("direct", "indirect")
SPACES = ("scene", "reflectance")
NORMS = ("l2", "l0", "mixed")
SCOPES = ("stroke", "prim", "material", "similar")
