"""What each opinion of a look layer is for and stands on: said on the opinion itself, so that each can be taken alone.

    note_opinion(spec, target, ...) -> None       writes it
    targets_of(spec) -> tuple[str, ...]           "/World/mtl/ball.inputs:roughness"; "/World/mtl/ball" for all of them
    channels_of(spec) -> {target: channels}       which of four numbers are for which
    base_of(spec) -> value or None                what the shot said there when it was solved
    texture_of(spec) -> (file, digest)            the texture that a scale or bias acts on, as it was then
    file_digest(path) -> str                      of a texture's bytes, "" where it cannot be read

Stands in customData.usdslf of the property: `of` and `channels` (string[]), `base`, `texture`, `textureHash`.  An
opinion
that is relative to another one (scale and bias of a texture) means something else when that changes.
"""

from __future__ import annotations

import os
from functools import lru_cache
from typing import Any

import numpy as np
from pxr import Sdf, Vt

from usdslf.contents import file_hash
from usdslf.replacing import is_file
from usdslf.usd.look_data import KEY, our_data, texts


def note_opinion(
    spec: Sdf.PropertySpec, target: str, base: Any = None, texture: tuple[str, str] = ("", ""), channels: str = ""
) -> None:
    """Says on a property of a look what it is for.

    Args:
        target: Material and input that shows it, or the Material alone; added to those that are there.
        base: what was there before, as JSON holds it; what is noted already stays.
        texture: file, and digest, of the texture that it is relative to.
        channels: of a texture, that the input takes: rgb | r | g | b | a; "" for all of the value.
    """
    data = our_data(spec.customData)
    of = channels_of(spec) | {target: channels}
    data["of"] = Vt.StringArray(list(of))
    if any(of.values()):
        data["channels"] = Vt.StringArray(list(of.values()))
    if base is not None and "base" not in data:
        data["base"] = _as_usd(base)
    if texture[0]:
        data["texture"], data["textureHash"] = texture
    spec.SetInfo("customData", {**spec.customData, KEY: data})


def targets_of(spec: Sdf.PropertySpec) -> tuple[str, ...]:
    """Returns what an opinion is for; nothing of one that a person or an older version wrote."""
    return tuple(texts(our_data(spec.customData).get("of")))


def channels_of(spec: Sdf.PropertySpec) -> dict[str, str]:
    """Returns by target which channels of a texture an opinion is for, "" where it is for all of the value."""
    targets, channels = targets_of(spec), texts(our_data(spec.customData).get("channels"))
    return dict(zip(targets, channels, strict=True)) if len(channels) == len(targets) else dict.fromkeys(targets, "")


def base_of(spec: Sdf.PropertySpec) -> Any:
    """Returns what the shot said where an opinion stands when it was solved, as JSON holds it; None: not known."""
    value = our_data(spec.customData).get("base")
    if value is None or isinstance(value, str | bool | int | float):
        return value
    try:
        return [float(x) for x in np.ravel(np.asarray(value, np.float64))]
    except (TypeError, ValueError):
        return None


def texture_of(spec: Sdf.PropertySpec) -> tuple[str, str]:
    """Returns file and digest of the texture that an opinion is relative to, empty where it is to none."""
    data = our_data(spec.customData)
    return str(data.get("texture", "")), str(data.get("textureHash", ""))


def file_digest(path: str) -> str:
    """Returns the digest of a file, 12 hexadecimal digits; "" where there is none."""
    if not path or not is_file(path):
        return ""
    found = os.stat(path)
    return _digest(path, found.st_mtime_ns, found.st_size)


@lru_cache(maxsize=256)
def _digest(path: str, changed: int, size: int) -> str:
    """Of the file as it was then: with another time or size it is read anew."""
    return file_hash(path)[:12]


def _as_usd(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return Vt.DoubleArray([float(x) for x in value])
    return value
