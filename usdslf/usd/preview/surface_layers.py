"""A surface in the terms that all models share: layers, before they are written as a UsdPreviewSurface.

    Layers, ONE, NOTHING
    f0_of(ior) -> float, is_number(value, number) -> bool
"""

from __future__ import annotations

from dataclasses import dataclass

from usdslf.usd.preview.driven import Driven, constant

ONE, NOTHING = constant(1.0), constant(0.0)


@dataclass
class Layers:
    """A surface in the terms that all models share."""

    diffuse: Driven
    metalness: Driven
    dielectric_f0: Driven
    metal_f0: Driven
    roughness: Driven
    coat: Driven = NOTHING
    coat_roughness: Driven = NOTHING
    coat_f0: float = 0.04
    opacity: Driven = ONE
    transmission: Driven = NOTHING
    emission: Driven = NOTHING


def f0_of(ior: float) -> float:
    """Returns what a dielectric reflects head-on, 0..1."""
    return ((ior - 1) / (ior + 1)) ** 2 if ior > 0 else 1.0


def is_number(value: Driven, number: float) -> bool:
    """Whether a value is a number, in all of its components, and which."""
    return value.number is not None and all(abs(v - number) < 1e-9 for v in value.number)
