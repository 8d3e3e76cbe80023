"""Live pictures of scenes of a few records."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from kit.light_field_scenes import of_elements

from usdslf.elements.elements import sample_elements
from usdslf.gpu.device import Device
from usdslf.lights.sources import LightSet
from usdslf.rays import RayTracer
from usdslf.render.live.picture import LivePicture
from usdslf.render.picture import LitScene
from usdslf.scene.records import Camera, Material, Scene

SIZE = (48, 32)


def lit_scene(
    scene: Scene, device: Device, elements: int = 200, model: str = "preview_surface", bounces: int = 8
) -> LitScene:
    """A scene with its light field."""
    tracer = RayTracer(scene)
    made = of_elements(
        device, scene, tracer, sample_elements(scene, tracer, elements, np.random.default_rng(0)), model, bounces
    )
    return LitScene(scene, tracer, made.field, scene.lights, device)


def live(lit: LitScene, camera: Camera, size: tuple[int, int] = SIZE, **options: Any) -> LivePicture:
    """A live picture of it, without a frame yet."""
    return LivePicture.of(lit, LightSet(lit.scene, lit.lights), camera, size, **options)


def after(picture: LivePicture, frames: int) -> np.ndarray:
    """What a live picture shows after some frames (height, width, 3)."""
    *_, last = picture.frames(frames)
    assert last.number == frames and last.share == 1
    return last.picture


def changed(lit: LitScene, material: int, **inputs: Any) -> tuple[Material, ...]:
    """The materials of a scene with some inputs of one of them changed."""
    materials = list(lit.scene.materials)
    materials[material] = replace(materials[material], **inputs)
    return tuple(materials)
