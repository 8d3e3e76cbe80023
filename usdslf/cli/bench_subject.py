"""What the bench measures: the demo with its strokes, or any stage with strokes on what its camera sees most of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import InputError
from usdslf.gallery import still_life
from usdslf.gallery.play import Play
from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import F32, Camera
from usdslf.session import Session
from usdslf.strokes.paint import paint_stroke
from usdslf.strokes.stroke import Stroke

MOVER, WALL, VASE = "/still_life/ball", "/still_life/materials/plaster", "/still_life/materials/pewter"
LIFT = (0.1, 0.3, 0.2)  # of the demo's ball
GRID = (64, 32)  # places that a stage's camera is asked what it sees at
STROKES, DABS, RADIUS = 3, 6, 0.01  # of a stage
COLORS = (0.5, 0.2, 0.1), (0.15, 0.3, 0.5), (0.3, 0.45, 0.2)  # reflectances that they ask for
LIFTED = 0.2  # of a moved object's diagonal


@dataclass(frozen=True)
class Chosen:
    """What is moved and edited: indices of the scene's meshes and materials."""

    mover: int
    lift: F32  # (3,) [stage units]
    recolored: int
    reroughened: int


@dataclass(frozen=True)
class Subject:
    """A shot of which nothing is made yet."""

    session: Session
    view: str | None  # path of its camera; None: the first
    paint: Callable[[], list[Stroke]]  # STROKES strokes
    choose: Callable[[], Chosen]

    @property
    def camera(self) -> Camera:
        """What it is seen by."""
        return self.session.camera(self.view)


def demo(folder: Path, **options: Any) -> Subject:
    """Writes the demo's stage into a folder.

    Args:
        options: device, ocio, say, elements, as of `Session`.
    """
    play = Play(still_life.ENTRY, folder, **options)

    def choose() -> Chosen:
        scene = play.session.scene
        mesh = next(i for i, m in enumerate(scene.meshes) if m.path == MOVER)
        number = {m.path: i for i, m in enumerate(scene.materials)}
        return Chosen(mesh, np.array(LIFT, np.float32), number[WALL], number[VASE])

    return Subject(play.session, play.shot.view_path(), lambda: list(still_life.paint(play)), choose)


def staged(stage: str, aspect: float, **options: Any) -> Subject:
    """Opens a stage.

    Args:
        aspect: width / height of the picture that is looked at.
        options: as of `demo`.

    Raises, when it is painted on: InputError where its camera sees nothing.
    """
    session = Session(stage, **options)

    def paint() -> list[Stroke]:
        at, _, material = _seen(session, aspect)
        most = _by_area(material)
        strokes = []
        for k in range(STROKES):
            here = at[material == most[k % len(most)]][k // len(most) :]
            dabs = here[np.unique(np.linspace(0, len(here) - 1, DABS + 2).astype(int)[1:-1])]
            strokes.append(
                paint_stroke(
                    session.scene, session.tracer, session.camera(), [[dab] for dab in dabs], RADIUS, COLORS[k],
                    aspect=aspect, name=f"stroke_{k + 1:04d}", space="reflectance",
                )
            )  # fmt: skip
        return strokes

    def choose() -> Chosen:
        _, mesh, material = _seen(session, aspect)
        size = {int(i): float(np.linalg.norm(np.ptp(session.scene.meshes[i].positions, 0))) for i in np.unique(mesh)}
        mover, most = min(size, key=size.__getitem__), _by_area(material)
        lift = LIFTED * size[mover] * np.asarray(session.scene.up, np.float32)
        return Chosen(mover, lift, most[0], most[min(1, len(most) - 1)])

    return Subject(session, None, paint, choose)


def _seen(session: Session, aspect: float) -> tuple[NDArray[np.float64], NDArray, NDArray]:
    """Places (n, 2) of the picture at which a surface is seen, and its mesh and its material (n,)."""
    x, y = np.meshgrid(*((np.arange(n) + 0.5) / n for n in GRID))
    at = np.stack([x.ravel(), y.ravel()], 1)
    rays = camera_rays(session.camera(), at, aspect)
    triangle = session.tracer.intersect(np.broadcast_to(rays.origin, rays.direction.shape), rays.direction).triangle
    there, table = triangle >= 0, session.scene.triangles
    if not there.any():
        raise InputError("the stage's camera sees no surface that could be painted on; choose another --stage")
    return at[there], table.mesh[triangle[there]], table.material[triangle[there]]


def _by_area(material: NDArray) -> list[int]:
    """Materials, the one that is seen most first."""
    return [int(m) for m in np.argsort(-np.bincount(material), kind="stable")[: len(np.unique(material))]]
