"""A tiny shot that has some of everything, and its way through all steps, so that every kernel runs on it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from kit.stage_parts import StageBuilder, TextureInput, box, checker, rectangle, sky
from pxr import UsdLux

from usdslf.cli.bench import copy_bandwidth, multiply_add_rate
from usdslf.gpu.device import Device
from usdslf.inference import evidence, samples
from usdslf.light_field import visibility
from usdslf.light_field.preconvolution import build_level, fresnel_diffuse, integrate_rows
from usdslf.light_field.renewal import renew
from usdslf.light_field.storage import Storage
from usdslf.pictures import live_picture, render_shot
from usdslf.render.live import noise
from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import Material, constant
from usdslf.shot import Shot
from usdslf.solution import find_solution, find_style
from usdslf.strokes.paint import paint_stroke
from usdslf.strokes.stroke import Stroke
from usdslf.stylize import element_solve, unsharp_mask
from usdslf.surfaces.reflectance import roughness_levels

ELEMENTS, FEW, BOUNCES = 8, 4, 1
SIZE = (4, 3)
CAMERA = "/World/camera"
MODELS = ("preview_surface", "phong")
SHARP, ROUGH = 0.1, 0.5  # levels


@contextmanager
def few_work_items() -> Iterator[None]:
    """Lets steps that work on many rays or levels at once work on few, for a simulator is slow."""
    levels = np.array([SHARP, ROUGH])
    few = {
        (visibility, "BATCH"): 2, (samples, "RAYS"): 64, (samples, "SAMPLES"): (2, 4), (samples, "ELSEWHERE"): 2,
        (evidence, "BACKGROUND"): 2, (element_solve, "OWN"): len(levels), (unsharp_mask, "OWN"): len(levels),
        (element_solve, "gloss_levels"): lambda model: levels, (noise, "BUDGET"): 4.0,
        (unsharp_mask, "FEWEST"): 0, (unsharp_mask, "MOST_ROUNDS"): 1,
    }  # fmt: skip
    usual = {place: getattr(*place) for place in few}
    try:
        for (module, name), value in few.items():
            setattr(module, name, value)
        yield
    finally:
        for (module, name), value in usual.items():
            setattr(module, name, value)


def tiny_stage(folder: Path) -> Path:
    """A floor with a texture, a coated box, a see-through card, a panel that glows, under lights of all kinds."""
    b = StageBuilder(folder)
    b.image("checker.exr", checker((0.5, 0.3, 0.2), (0.3, 0.3, 0.4)))
    floor = b.material("floor", diffuseColor=TextureInput("checker.exr"), roughness=ROUGH)
    coated = b.material(
        "coated", diffuseColor=(0.3, 0.1, 0.1), roughness=ROUGH, clearcoat=1.0, clearcoatRoughness=SHARP
    )
    metal = b.material("metal", diffuseColor=(0.8, 0.7, 0.4), metallic=1.0, roughness=SHARP)
    card = b.material("card", diffuseColor=(0.2, 0.4, 0.2), roughness=ROUGH, opacity=0.6)
    glow = b.material("glow", diffuseColor=(0.0, 0.0, 0.0), emissiveColor=(2.0, 1.5, 1.0), roughness=ROUGH)
    b.mesh("floor", rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4)), floor)
    b.mesh("box", box(0.7, 0.7, 0.7), coated, (-0.6, 0, 0), 20)
    b.mesh("plate", box(0.6, 0.3, 0.6), metal, (0.7, 0, 0.2), 10)
    b.mesh("card", rectangle((-0.2, 0, 0.8), (0.8, 0, 0), (0, 0.6, 0)), card)
    b.mesh("panel", rectangle((-0.5, 1.9, -1.5), (1, 0, 0), (0, -0.5, 0)), glow)
    b.rect_light("rect", (0.5, 2.0, 1.0), (0, 0, 0), 0.6, 0.5, (4, 3.6, 3))
    b.sphere_light("ball", (-1.2, 1.6, 0.8), 0.1, (2, 2, 2))
    b.distant_light("sun", (0.4, -1, -0.3), 1.0, 0.5)
    b.dome_light("dome", 0.3, texture=b.image("sky.exr", sky(1, sun=8.0)))
    disk = UsdLux.DiskLight.Define(b.stage, "/World/disk")
    disk.CreateRadiusAttr(0.2)
    disk.AddTranslateOp().Set((0.0, 1.8, 1.5))
    tube = UsdLux.CylinderLight.Define(b.stage, "/World/tube")
    tube.CreateRadiusAttr(0.05)
    tube.CreateLengthAttr(0.8)
    tube.AddTranslateOp().Set((0.0, 1.7, -1.0))
    b.camera((0.2, 1.2, 3.2), (0, 0.35, 0), 40)
    return b.save()


def plain_stage(folder: Path) -> Path:
    """A wall on a floor under a lamp."""
    b = StageBuilder(folder)
    floor, wall = (b.material(name, diffuseColor=(0.4, 0.3, 0.2), roughness=ROUGH) for name in ("floor", "wall"))
    b.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), floor)
    b.mesh("wall", rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0)), wall)
    b.rect_light("rect", (0.5, 2.0, 1.0), (0, 0, 0), 0.6, 0.5, (4, 3.6, 3))
    b.camera((0.2, 1.2, 3.2), (0, 0.35, 0), 40)
    return b.save()


def keep_weights(device: Device) -> None:
    """Lets a quick device compute the weights of levels, which are kept in the user's cache."""
    for model in MODELS:
        fresnel_diffuse(device, model)
        for roughness in roughness_levels():
            build_level(device, model, float(roughness))


def all_steps(device: Device, folder: Path) -> Iterator[str]:
    """Opens, lights, paints, solves, stylizes and pictures the tiny shot, and does the same with the paper's model.

    Yields: what was done.
    """
    for name in ("tiny", "plain"):
        (folder / name).mkdir()
    stage, plain = tiny_stage(folder / "tiny"), plain_stage(folder / "plain")
    for model in MODELS:
        for roughness in (SHARP, ROUGH):
            integrate_rows(device, model, roughness, np.array([5]), side=8)
    copy_bandwidth(device, 1 << 12)
    multiply_add_rate(device, 64, 2)
    yield "weights"
    shot = Shot.open(str(stage), device=device, elements=ELEMENTS, bounces=BOUNCES)
    field = shot.light_field
    field.with_emission(field.surface.emission + 0.1)
    yield "light field"
    find_solution(shot, painted(shot))
    yield "answers"
    look_at_it_live(shot)
    yield "live picture"
    render_shot(shot, CAMERA, None, SIZE, ("direct", "indirect", "albedo", "normal", "alpha"), 1)
    yield "final picture"
    rays = camera_rays(shot.camera(CAMERA), [(0.3, 0.7), (0.5, 0.6), (0.7, 0.8)], SIZE[0] / SIZE[1])
    hits = shot.tracer.intersect(rays.origin, rays.direction)
    field.radiance_from_hits(hits.triangle, hits.barycentric, rays.direction)
    yield "what rays see of the light field"
    opened = partial(Shot.open, str(plain), device=device, elements=FEW, bounces=BOUNCES)
    find_style(opened(), radius=1.0)
    yield "style"
    by_phong = opened(model="phong")
    find_solution(by_phong, painted(by_phong))
    render_shot(by_phong, CAMERA, None, (2, 2), samples=1)
    yield "phong"
    memory = 1.05 * FEW * Storage(np.float16, True).bytes_of_element / 2**30
    within = opened(memory=memory)
    surface = within.light_field.surface
    renew(within.light_field.with_surface(replace(surface, diffuse=surface.diffuse * 0.5)), 1)
    render_shot(within, CAMERA, None, (2, 2), samples=1)
    yield "half floats, streamed"


def painted(shot: Shot) -> list[Stroke]:
    """A dab on the floor."""
    brush = shot.scene, shot.tracer, shot.camera(CAMERA)
    return [paint_stroke(*brush, [[(0.4, 0.82)]], 0.03, (0.6, 0.1, 0.1), name="stroke_0001")]


def look_at_it_live(shot: Shot) -> None:
    """A live picture that gets better, whose materials and light change, and that is looked at from elsewhere."""
    picture = live_picture(shot, CAMERA, None, SIZE)
    for _ in picture.frames(2):
        pass
    red = with_inputs(shot, diffuse_color=constant(0.6, 0.1, 0.1))
    picture.with_materials(red).now()
    for _ in picture.with_materials(red, shot.light_field.with_surface(shot.light_field.surface)).frames(2):
        pass
    for _ in picture.with_materials(with_inputs(shot, roughness=constant(0.4))).frames(2, (1, 1, 3, 3)):
        pass
    next(picture.seen_by(shot.camera(CAMERA), (3, 2)).frames(1))


def with_inputs(shot: Shot, **inputs: Any) -> tuple[Material, ...]:
    """The shot's materials with others inputs of the coated one."""
    return tuple(replace(m, **inputs) if m.path.endswith("coated") else m for m in shot.scene.materials)
