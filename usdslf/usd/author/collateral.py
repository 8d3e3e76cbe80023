"""What a look changes beyond what it says it is meant to, by the whole reading path: the shot with the look over it.

    look_collateral(shot, scene, look, reading) -> list[Collateral]          of a look that was just written
    collateral_between(below, over, look, reading, scene) -> list[Collateral]      of one that is composed already

What a person added to the look is a person's wish: it belongs to what the look is held against.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

from pxr import Sdf, Usd

from usdslf.edits.collateral import Collateral, collateral_of
from usdslf.scene.records import Scene
from usdslf.usd.author.read_back import stage_under
from usdslf.usd.border import quiet_usd
from usdslf.usd.layer.hand_edits import added_by_hand, what_is_by_hand
from usdslf.usd.layer.meant import meant
from usdslf.usd.layer.wins import compose_over
from usdslf.usd.read.read import read_scene


@dataclass(frozen=True)
class Reading:
    """How a shot was read."""

    frame: float | None  # time code
    refine: int = 1  # levels of subdivision
    ocio: str | None = None  # OpenColorIO config


def look_collateral(
    shot: Usd.Stage, scene: Scene, look: str | os.PathLike[str], reading: Reading, shown: Scene | None = None
) -> list[Collateral]:
    """Reads a shot with a look over it, and returns what each material that shows something else was not meant to.

    Args:
        shot: without the look, in a file or in memory.
        scene: the shot as it was read.
        look: its file.
        reading: how the shot was read.
        shown: the shot with the look as it was read, if the caller has it.
    """
    with quiet_usd():
        layer = Sdf.Layer.FindOrOpen(os.fspath(look))
        return collateral_between(shot, stage_under(shot, look), layer, reading, scene, shown)


def collateral_between(
    below: Usd.Stage, over: Usd.Stage, look: Sdf.Layer, reading: Reading, scene: Scene | None = None,
    shown: Scene | None = None,
) -> list[Collateral]:  # fmt: skip
    """Returns what each material that shows something else was not meant to; nothing of a look that says no meaning.

    Args:
        below: the shot without the look.
        over: the shot with it.
        scene, shown: `below` and `over` as they were read, if the caller has them.
    """
    by_hand = added_by_hand(look)
    if what_is_by_hand(by_hand):
        below, scene = compose_over(below, by_hand), None
    shown = shown or _read(over, reading)
    moves = meant(over, look, [m.path for m in shown.materials])
    return collateral_of(scene or _read(below, reading), shown, moves) if moves else []


def _read(stage: Usd.Stage, reading: Reading) -> Scene:
    return read_scene(stage, reading.frame, refine=reading.refine, ocio=reading.ocio)
