"""Frames: what was placed and traced at one frame, taken to another.

    carry(placed, scene, tracer, device) -> PlacedFrame at the scene's frame, or why all has to start afresh

It starts from the frame that elements were laid at each time, so that errors do not add up from frame to frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from usdslf.animation.retrace import move_elements, retrace, why_not_spaced
from usdslf.animation.revealed import DarkProbes, reveal_elements
from usdslf.elements.elements import Elements, refresh_reflectance
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import Device
from usdslf.light_field.visibility import Visibility
from usdslf.rays import RayTracer
from usdslf.scene.difference import Afresh, find_moved, look_alike
from usdslf.scene.records import Scene


@dataclass(frozen=True)
class PlacedFrame:
    """A frame's scene, with what was placed and traced in it."""

    scene: Scene
    elements: Elements
    lookup: ElementLookup
    visibility: Visibility
    probes: DarkProbes  # of the frame that elements were laid at


def carry(first: PlacedFrame, scene: Scene, tracer: RayTracer, device: Device) -> PlacedFrame | Afresh:
    """Takes elements and visibility to another frame of meshes that are comparable (`difference.why_not_comparable`).

    Elements keep their places on what moved, surfaces that see light only now get new ones, and visibility is traced
    again where that can have changed it.

    Args:
        first: the frame that elements were laid at.
        scene, tracer: the other frame.

    Returns: the same things at the other frame, or why its elements have to be laid afresh.
    """
    before = first.scene
    moved = find_moved(before, scene)
    elements = first.elements
    if not (look_alike(before.materials, scene.materials) and _colours_alike(before, scene)):
        elements = refresh_reflectance(elements, before, scene)
    if _same_light(before, scene) and not moved.meshes.any():
        return replace(first, scene=scene, elements=elements)
    elements = move_elements(elements, before, scene, moved.meshes)
    reason = why_not_spaced(first.elements, elements)
    if reason is not None:
        return reason
    elements = reveal_elements(elements, first.probes, scene, tracer, np.random.default_rng(0))
    if len(elements) == len(first.elements) and not moved.meshes.any():
        return replace(first, scene=scene, elements=elements)
    lookup = first.lookup.after(scene, tracer, elements, moved)
    visibility = retrace(first.visibility, first.lookup, elements, lookup, tracer, device, moved)
    return PlacedFrame(scene, elements, lookup, visibility, first.probes)


def _same_light(before: Scene, after: Scene) -> bool:
    """Whether what can be alive on surfaces that did not move is the same."""
    return (
        look_alike(before.lights, after.lights)
        and look_alike(before.cameras, after.cameras)
        and look_alike([m.emissive_color for m in before.materials], [m.emissive_color for m in after.materials])
    )


def _colours_alike(before: Scene, after: Scene) -> bool:
    """Whether meshes have the same texture coordinates and primvars."""
    return all(
        look_alike((a.uvs, a.primvars), (b.uvs, b.primvars)) for a, b in zip(before.meshes, after.meshes, strict=True)
    )
