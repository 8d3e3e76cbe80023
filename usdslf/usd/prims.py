"""Prims: the tree of a composed stage, as rows for who looks for something in it; its frames and its files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pxr import Usd, UsdGeom

from usdslf.usd.binding import bound_material
from usdslf.usd.border import quiet_usd, reading
from usdslf.usd.shot_metadata import shot_files


@dataclass(frozen=True)
class PrimRow:
    """A prim of a stage.

    Attributes:
        path: of the prim.
        name: its own.
        type_name: Mesh, Xform, Camera, Material, ...; "" for an untyped one.
        parent: index of its parent's row; -1 at the top.
        is_gprim: has a surface that can be painted.
        is_instance: shows what other instances show too; its children are instance proxies.
        material: path of the material that is bound to it for rendering; "" for none, or where it is no gprim.
    """

    path: str
    name: str
    type_name: str
    parent: int
    is_gprim: bool = False
    is_instance: bool = False
    material: str = ""


def stage_prims(stage: Any) -> list[PrimRow]:
    """Returns the prims of a stage, parents before children, in its order; instances with their proxies.

    Args:
        stage: Usd.Stage.
    """
    rows: list[PrimRow] = []
    row_of: dict[Any, int] = {}
    with quiet_usd():
        for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
            path = prim.GetPath()
            is_gprim = prim.IsA(UsdGeom.Gprim)
            bound = bound_material(prim) if is_gprim else None
            row_of[path] = len(rows)
            parent = row_of.get(path.GetParentPath(), -1)
            rows.append(
                PrimRow(
                    str(path), prim.GetName(), str(prim.GetTypeName()), parent, is_gprim, prim.IsInstance(),
                    str(bound.GetPath()) if bound else "",
                )
            )  # fmt: skip
    return rows


@dataclass(frozen=True)
class FrameRange:
    """The frames of a shot.

    Attributes:
        first, last: time codes.
        per_second: frames a second.
    """

    first: float
    last: float
    per_second: float


def frame_range(stage: Any) -> FrameRange | None:
    """Returns the frames of a shot; None where it does not say, or has one alone.

    Args:
        stage: Usd.Stage.
    """
    if not stage.HasAuthoredTimeCodeRange():
        return None
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    per_second = stage.GetFramesPerSecond() or stage.GetTimeCodesPerSecond() or 24.0
    if not (math.isfinite(first) and math.isfinite(last) and last > first):
        return None
    return FrameRange(first, last, per_second)


def stage_files(stage: Any) -> list[str]:
    """Returns the files of all layers of a stage, sorted.

    Args:
        stage: Usd.Stage.
    """
    return sorted(str(path) for path in shot_files(stage))


def reload_stage(stage: Any) -> None:
    """Reads all layers of a stage again that have changed on the disk.

    Args:
        stage: Usd.Stage; all that shares its layers changes with it, so nothing else may be reading them.

    Raises: StageError where one of them is no USD any more; it stays as it was read before.
    """
    with reading(str(stage.GetRootLayer().identifier)):
        stage.Reload()
