"""Values of shader inputs, whatever a file holds in place of a number.

    floats(value) -> tuple or None
    holds(kind, count) -> bool          whether a type of attribute is one of so many numbers
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Sdf


def floats(value: Any) -> tuple[float, ...] | None:
    """Returns the numbers of a value of USD; None for text, paths, arrays, and what is not finite."""
    if value is None or isinstance(value, str | Sdf.AssetPath) or type(value).__name__.endswith("Array"):
        return None
    try:
        found = np.ravel(np.asarray(value, np.float64))
    except (TypeError, ValueError):  # values that USD has no type for
        return None
    return tuple(float(x) for x in found) if np.isfinite(found).all() else None


def holds(kind: Sdf.ValueTypeName, count: int) -> bool:
    """Whether an attribute of a type holds so many numbers."""
    found = floats(kind.defaultValue)
    return not kind.isArray and found is not None and len(found) == count
