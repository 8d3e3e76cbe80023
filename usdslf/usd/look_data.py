"""What a look layer says of itself under the key `usdslf`, taken with care: people and programs rewrite layers.

    is_look(layer) -> bool               whether usdslf wrote it
    our_data(custom) -> dict             what stands under the key in customData or customLayerData, {} for none
    texts(value) -> list[str]            a value that should be a list of strings
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pxr import Sdf, Vt

KEY = "usdslf"


def is_look(layer: Sdf.Layer) -> bool:
    """Whether a layer says that usdslf wrote it."""
    return bool(our_data(layer.customLayerData))


def our_data(custom: Mapping[str, Any]) -> dict[str, Any]:
    """Returns what stands under our key, {} where that is nothing or no dictionary."""
    found = custom.get(KEY)
    return dict(found) if isinstance(found, Mapping) else {}


def texts(value: Any) -> list[str]:
    """Returns the strings of a list, [] where the value is none."""
    return [str(v) for v in value] if isinstance(value, list | tuple | Vt.StringArray | Vt.TokenArray) else []
