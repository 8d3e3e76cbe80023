"""Files that results go to: checked before the work, written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import color_of
from usdslf.errors import InputError
from usdslf.render.picture import AOVS
from usdslf.replacing import check_place, replacing
from usdslf.scene.records import Scene
from usdslf.textures.images import write_image

PICTURE_TYPES = (".exr", ".png")
SIMILARITY = "similarity"  # to strokes: no layer of the renderer; a PNG can hold it alone, in grey
LAYERS = (*AOVS, SIMILARITY)
"""Names of all layers that a picture may hold beside its colours."""
_LETTERS = {1: ("Y",), 3: ("R", "G", "B")}


def check_picture(path: str | Path, aovs: Sequence[str]) -> None:
    """Raises InputError for a picture that could not be written, or layers that it cannot hold."""
    suffix = Path(path).suffix.lower()
    if suffix not in PICTURE_TYPES:
        raise InputError(f"{path} is no picture; end its name in {' or '.join(PICTURE_TYPES)}")
    if aovs and suffix != ".exr" and tuple(aovs) != (SIMILARITY,):
        raise InputError(f"{path} cannot hold the layers {', '.join(aovs)}; end its name in .exr")
    unknown = [a for a in aovs if a not in LAYERS]
    if unknown:
        raise InputError(f"there is no AOV '{unknown[0]}'; choose from {', '.join(LAYERS)}")
    check_place(path)


def write_picture(
    path: str | Path,
    pictures: Mapping[str, NDArray],
    scene: Scene,
    aovs: Sequence[str] = (),
    exposure: float = 0.0,
) -> None:
    """Writes a rendered picture: an EXR scene-linear with its layers, a PNG through the display.

    Args:
        pictures: name -> (h, w, channels), with `color`; a PNG of `similarity` alone is without.
        aovs: names of the further layers; their channels are called name.R and so on.
        exposure: [stops] of a PNG.
    """
    color = color_of(scene.ocio or None, scene.working_space)
    note = {"usdslf:ocioConfig": color.config_name, "usdslf:workingSpace": scene.working_space}
    if Path(path).suffix.lower() == ".png":
        grey = "color" not in pictures
        write_image(path, pictures[SIMILARITY] if grey else color.display(pictures["color"], exposure), metadata=note)
        return
    layers = {"": pictures["color"], **{f"{name}.": pictures[name] for name in aovs if name != "color"}}
    channels = [prefix + letter for prefix, p in layers.items() for letter in _LETTERS[p.shape[-1]]]
    pixels = np.concatenate(list(layers.values()), -1)
    write_image(path, pixels, scene.working_space, channels, half=not aovs, metadata=note)


def write_json(path: str | Path, values: Any) -> None:
    """Writes JSON through a temporary file.  Raises InputError where the place cannot be written."""
    path = Path(path)
    check_place(path)
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
