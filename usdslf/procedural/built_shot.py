"""A shot built in code, as records without USD: what usd/build_stage.py writes as a stage.

+Y is up, a unit is a metre.  Radiances are on the UsdLux scale.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from usdslf.procedural.shapes import QuadMesh

Vec3 = tuple[float, float, float]
Inputs = Mapping[str, Any]
"""Inputs of a UsdPreviewSurface: a float, an int, three floats, or the file of a texture in the shot's folder.

A texture of `normal` is a tangent-space normal map; of one-channel inputs its red channel counts."""


@dataclass(frozen=True)
class Part:
    """A mesh with one material."""

    name: str
    shape: QuadMesh
    material: str


@dataclass(frozen=True)
class Lamp:
    """A UsdLux light; rect, disk and distant ones shine from `at` towards `toward`."""

    name: str
    kind: str  # rect | disk | sphere | distant | dome
    radiance: Vec3 = (1.0, 1.0, 1.0)
    at: Vec3 = (0.0, 1.0, 0.0)
    toward: Vec3 = (0.0, 0.0, 0.0)
    size: tuple[float, float] = (0.5, 0.5)  # rect: width and height; disk, sphere: radius first
    angle_deg: float = 0.53  # distant
    file: str = ""  # dome: a latlong picture in the shot's folder


@dataclass(frozen=True)
class View:
    """A camera with a film of 36 x 20.25."""

    name: str
    eye: Vec3
    at: Vec3
    focal_length: float = 44.0


@dataclass(frozen=True)
class BuiltShot:
    """All of a shot.  The first view is the one that is painted in."""

    name: str
    materials: Mapping[str, Inputs]
    parts: Sequence[Part]
    lamps: Sequence[Lamp]
    views: Sequence[View]

    def view_path(self, number: int = 0) -> str:
        """Path of a view's camera in the stage."""
        return f"/{self.name}/{self.views[number].name}"

    def changed(self, changes: Mapping[str, Inputs]) -> BuiltShot:
        """Returns the shot with other inputs of some materials: the truth that strokes are painted from."""
        merged = {m: {**inputs, **changes.get(m, {})} for m, inputs in self.materials.items()}
        return replace(self, materials=merged)
