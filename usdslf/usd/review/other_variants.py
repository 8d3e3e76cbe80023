"""Other variants: what a look says within a variant that a shot has not chosen, where it shows nothing.

other_variants(stage, look) -> list[str]      a sentence for each
"""

from __future__ import annotations

import os

from pxr import Sdf, Usd

from usdslf.errors import InputError
from usdslf.usd.border import reading


def other_variants(stage: Usd.Stage, look: str | os.PathLike[str]) -> list[str]:
    """Returns the variants that a look edits and a shot has not chosen, each in a sentence.

    Args:
        stage: the shot.
        look: file of the look layer.

    Raises: InputError where the look cannot be read.
    """
    found: dict[tuple[str, str, str], None] = {}

    def visit(path: Sdf.Path) -> None:
        if path.IsPrimVariantSelectionPath() and path.GetVariantSelection()[1]:
            found[(str(path.GetPrimPath().StripAllVariantSelections()), *path.GetVariantSelection())] = None

    with reading(look, InputError, "make a look with usdslf solve"):
        layer = Sdf.Layer.FindOrOpen(os.fspath(look))
        if layer is None:
            raise InputError(f"{look} is not a readable USD file, make a look with usdslf solve")
        layer.Traverse(Sdf.Path.absoluteRootPath, visit)
        said = []
        for prim, group, variant in found:
            there = stage.GetPrimAtPath(prim)
            chosen = there.GetVariantSet(group).GetVariantSelection() if there else ""
            if chosen and chosen != variant:
                said.append(
                    f"the look edits {prim} in the variant {group}={variant}, and the shot shows {group}={chosen}"
                )
    return said
