"""Domes whose texture cannot be read: what shines in its place, as somebody chose.

    MISSING_DOME                                  ignore | white | color
    with_missing_domes(scene, choice) -> Scene

A dome's texture multiplies its colour and intensity, which are made for it: an intensity of hundreds over a dark
picture is a white dome that blows out the shot, which is what the colour alone gives and UsdLux means.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from usdslf.scene.records import Light, Scene

MISSING_DOME = ("color", "white", "ignore")  # the dome's own colour and intensity | radiance 1 | no light at all
_OTHERWISE = "--missing-dome ignore leaves it out, white makes its radiance 1"


def with_missing_domes(scene: Scene, choice: str) -> Scene:
    """Returns a scene whose domes without their texture shine as was chosen; what stands for them is said."""
    domes = {x.path: x for x in scene.lights if x.unread and x.kind == "dome"}
    if not domes:
        return scene
    lights = tuple(_shining(x, choice) if x.path in domes else x for x in scene.lights)
    words = {
        "color": f"; {_OTHERWISE}",
        "white": "it is taken as white, radiance 1",
        "ignore": "the dome is left out",
    }[choice]
    missing = tuple(
        replace(m, stands_for_it=m.stands_for_it + words if choice == "color" else words) if m.prim in domes else m
        for m in scene.missing
    )
    return replace(scene, lights=tuple(x for x in lights if x is not None), missing=missing)


def _shining(dome: Light, choice: str) -> Light | None:
    if choice == "ignore":
        return None
    return replace(dome, radiance=(1.0, 1.0, 1.0)) if choice == "white" else dome
