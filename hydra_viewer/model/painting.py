"""Painting: the path of a pen on the picture, and the stroke that it becomes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydra_viewer.model.brush import Brush
from usdslf import Camera, Shot, Stroke, paint_stroke, project_points

LEAST_PRESSURE = 0.1  # of the brush's width that is left where a pen hardly touches


@dataclass
class PenPath:
    """Where a pen went on the picture while it was down.

    Attributes:
        places: x, y in 0..1 of the picture, origin top left, and the pressure 0..1, of each.
    """

    places: list[tuple[float, float, float]] = field(default_factory=list)

    def add(self, x: float, y: float, pressure: float = 1.0) -> None:
        """Goes on to a place."""
        self.places.append((x, y, pressure))

    def straighten(self, x: float, y: float, pressure: float = 1.0) -> None:
        """Makes it a straight line from where it began."""
        self.places[1:] = [(x, y, pressure)]


def stroke_of(shot: Shot, camera: Camera, path: PenPath, brush: Brush, aspect: float, name: str) -> Stroke:
    """Returns the stroke that a path on the picture paints.

    Args:
        shot: that is painted on.
        camera: that the picture is of.
        path: of the pen.
        brush: as it was while the pen was down.
        aspect: width / height of the picture.
        name: of the stroke.

    Raises: StrokeError where no surface is hit, or what is painted cannot be meant.
    """
    places = np.array(path.places, np.float64)
    offset: Any = (0.0, 0.0, 0.0)
    meant: dict[str, Any] = {name: getattr(brush, name) for name in ("tool", "mode", "norm", "scope", "space")}
    if brush.tool == "clone" and brush.clone_source is not None:
        first = _first_point(shot, camera, places[:1, :2], brush, aspect)
        offset = tuple(np.subtract(brush.clone_source, first).tolist())
    stroke = paint_stroke(
        shot.scene, shot.tracer, camera, [places[:, :2]], brush.radius, brush.color, aspect=aspect, name=name,
        strength=brush.strength, clone_offset=offset, **meant,
    )  # fmt: skip
    if brush.uses_pressure and (places[:, 2] < 1).any():
        stroke = replace(stroke, widths=stroke.widths * _pressure_at(stroke, camera, places, aspect))
    return stroke


def _first_point(shot: Shot, camera: Camera, at: NDArray, brush: Brush, aspect: float) -> NDArray:
    return paint_stroke(shot.scene, shot.tracer, camera, [at], brush.radius, brush.color, aspect=aspect).points[0]


def _pressure_at(stroke: Stroke, camera: Camera, places: NDArray, aspect: float) -> NDArray[np.float32]:
    """The pen's pressure (n,) where the path passed nearest to each point of the stroke."""
    at, _ = project_points(camera, stroke.points, aspect)
    gap = (at[:, None] - places[None, :, :2]) * [aspect, 1.0]
    nearest = (gap**2).sum(2).argmin(1)
    return np.clip(places[nearest, 2], LEAST_PRESSURE, 1.0).astype(np.float32)
