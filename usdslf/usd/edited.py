"""A shot as a look layer changes it, without writing to either."""

from __future__ import annotations

import os

from pxr import Sdf, Usd

from usdslf.errors import InputError
from usdslf.replacing import is_file
from usdslf.usd.border import reading
from usdslf.usd.read.read import open_stage


def open_edited(shot: str | os.PathLike[str], look: str | os.PathLike[str]) -> Usd.Stage:
    """Opens the shot with a look layer over it, as an anonymous session layer.

    Raises: StageError for the shot, InputError for the look.
    """
    plain = open_stage(shot)
    name = os.fspath(look)
    if not is_file(name):
        raise InputError(f"there is no look layer {name}; make one with: usdslf solve")
    session = Sdf.Layer.CreateAnonymous(".usda")
    with reading(name, InputError, "make a look with usdslf solve"):
        layer = Sdf.Layer.FindOrOpen(name)
        if layer is None:
            raise InputError(f"{name} is not a readable USD file, make a look with usdslf solve")
        session.subLayerPaths.append(layer.realPath)
        return Usd.Stage.Open(plain.GetRootLayer(), session, load=Usd.Stage.LoadAll)
