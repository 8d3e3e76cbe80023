"""Style changes: what became of each element -> textures or values at points that vary as it does (storage.py).

Where neither can hold a change, it is the mean over the material, and that is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color
from usdslf.edits.baked_texture import Baked
from usdslf.edits.edits import ByVertex, MaterialChange, Reflectance, material_change_to_input_edits
from usdslf.edits.moves import NAMES, Move
from usdslf.edits.representations import least_collateral
from usdslf.edits.storage import storage_of, store
from usdslf.elements.elements import Elements
from usdslf.errors import AuthorError
from usdslf.scene.records import F64, Scene
from usdslf.similarity.similarity import Places
from usdslf.similarity.upsample import upsampling_weights
from usdslf.stylize.unsharp_mask import MaterialStyle, Stylized
from usdslf.surfaces.reflectance import Parameters

FINER = 3  # texels between elements
SMALLEST, LARGEST = 64, 512  # texels on a side of a texture for an input that had none


@dataclass(frozen=True)
class StyleChange:
    """The change of one parameter of a material, known at its n elements.  C is 1 for roughness, else 3."""

    parameter: str  # diffuse | specular | glossiness
    places: Places  # (n)
    moved: F64  # (n, C)
    spacing: float  # of the elements [stage units]
    known: dict[bytes, tuple[NDArray[np.int64], F64]]  # weights by places, which all parameters share
    is_noisy: bool = True  # light that a few rays brought
    is_even: bool = False

    @property
    def is_grey(self) -> bool:
        """Whether it is a specular change with one value for all channels."""
        return self.parameter == "specular" and bool(np.ptp(self.moved, axis=1).max() < 1e-4)

    def at(self, x: Places) -> F64:
        """Returns the change (k, C) at places."""
        key = sha256(np.concatenate([x.position, x.normal, x.reflectance], 1).tobytes()).digest()
        if key not in self.known:
            self.known[key] = upsampling_weights(x, self.places, self.spacing)
        index, weight = self.known[key]
        return np.einsum("nk,nkc->nc", weight, self.moved[index])

    def of_dabs(self) -> F64:
        """Returns the change (n, C) at the elements themselves."""
        return self.moved


def with_styles(
    change: MaterialChange, style: MaterialStyle, stylized: Stylized, scene: Scene, elements: Elements, folder: Path,
    color: Color, warnings: list[str],
) -> MaterialChange:  # fmt: skip
    """Gives a stylized change its textures and values at points; names in `warnings` what changes by its mean."""
    at = style.elements
    places = Places(elements.position[at], elements.geometric_normal[at], Parameters.of(elements, at).packed)
    spacing = float(np.sqrt(np.mean(elements.area[at])))
    side = int(np.clip(2 ** np.ceil(np.log2(FINER * np.sqrt(len(at)))), SMALLEST, LARGEST))
    d, f0, roughness = stylized.change_at(at)
    found: dict[str, Baked | ByVertex] = {}
    known: dict[bytes, tuple[NDArray[np.int64], F64]] = {}
    at_points: dict[str, Places] = {}
    moves: dict[str, Move] = {}
    for parameter, moved in zip(("diffuse", "specular", "glossiness"), (d, f0, roughness[:, None])):
        if parameter not in change.freed:
            continue
        moves[NAMES[parameter]] = Move.within(moved)
        varying = StyleChange(parameter, places, moved, spacing, known)
        storage = storage_of(scene, style.material, change.targets, varying)
        if storage.why_not:
            warnings.append(f"{change.material.path}: {parameter} changes by its mean, for {storage.why_not}")
            continue
        found[storage.input] = store(scene, storage, varying, folder, color, warnings, (side, side), at_points)
    change = replace(
        change,
        baked={k: v for k, v in found.items() if isinstance(v, Baked)},
        by_vertex={k: v for k, v in found.items() if isinstance(v, ByVertex)},
        moves=moves,
    )
    stem = folder / change.material.path.rsplit("/", 1)[-1]
    try:
        change = least_collateral(scene, style.material, change, stem, color, warnings)
        material_change_to_input_edits(change)
    except AuthorError as error:  # what is left to the maps' meaning is not worth spoiling them
        warnings.append(f"{error}; its specular colour stays")
        change = replace(change, freed=tuple(f for f in change.freed if f != "specular"))
    return change


def restyled(styles: Sequence[MaterialStyle], scene: Scene) -> list[MaterialChange]:
    """Returns the changes of stylized materials: of all that show them."""
    return [
        MaterialChange(
            material=scene.materials[s.material],
            scope="material",
            targets=scene.shown_on(s.material),
            freed=s.freed,
            before=Reflectance.of(s.before),
            after=Reflectance.of(s.after),
            residual_before=s.residual_before,
            residual_after=s.residual_after,
        )
        for s in styles
        if s.freed
    ]
