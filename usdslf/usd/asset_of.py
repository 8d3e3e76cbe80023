"""Asset: where a material of a shot is defined, which all shots that show the asset share.

asset_of(stage, path) -> (file, path in it)
"""

from __future__ import annotations

import os

from pxr import Sdf, Usd

from usdslf.errors import StageError
from usdslf.usd.border import reading


def asset_of(stage: Usd.Stage, path: str) -> tuple[str, str]:
    """Returns the file of the layer that defines a prim, and the prim's path there.

    Raises: StageError where nothing on disk defines it.
    """
    with reading(stage.GetRootLayer().realPath):
        prim = stage.GetPrimAtPath(path)
        specs = prim.GetPrimStack() if prim else []
        defined = [s for s in specs if s.specifier == Sdf.SpecifierDef and s.layer.realPath]
    if not defined:
        raise StageError(f"{path or 'a surface without material'} is defined in no file that shots share; bind one")
    weakest = defined[-1]
    return os.path.realpath(weakest.layer.realPath), str(weakest.path.StripAllVariantSelections())
