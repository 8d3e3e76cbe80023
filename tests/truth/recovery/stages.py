"""Stages of the recovery suite: a layout, a light, and one subject whose material is to change.

Layouts: `single` (an object on a ground), `table` (several objects on a table before a wall), `room` (a box
with one red and one green wall), `corner` (two walls and a floor, seen from above).
Lights: `area`, `dome` (constant), `sky` (textured dome), `distant`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from kit.stage_parts import (
    InputValue,
    MeshData,
    StageBuilder,
    TextureInput,
    Triple,
    ball,
    blob,
    bottle,
    box,
    capsule,
    checker,
    noise,
    rectangle,
    sky,
    teapot,
    torus,
    vase,
)

SUBJECT = "/World/mtl/subject"
CAMERA = "/World/camera"
SIZE = (192, 144)


@dataclass(frozen=True)
class Case:
    """One change of one parameter of one material."""

    name: str
    layout: str  # single | table | room | corner
    subject: str  # sphere ball box cube vase torus ring teapot blob bottle capsule pair floor wall
    light: str  # area | dome | sky | distant
    parameter: str  # diffuse | specular | glossiness
    inputs: dict[str, InputValue]  # of the subject's material, before
    changed: dict[str, InputValue]  # inputs that differ afterwards
    texture: str = ""  # "" | checker | noise: file texture.png, for a TextureInput on diffuseColor
    seed: int = 0
    up: str = "Y"
    units_per_meter: float = 1.0
    set_name: str = "tuning"  # tuning | twin
    notes: tuple[str, ...] = field(default=())

    @property
    def workflow(self) -> str:
        """metal or specular."""
        return "specular" if self.inputs.get("useSpecularWorkflow") else "metal"


def build_stage(case: Case, folder: Path, changed: bool = False) -> Path:
    """Writes the stage of a case before or after its change; returns the path of the file."""
    folder.mkdir(parents=True, exist_ok=True)
    builder = StageBuilder(folder, case.up, case.units_per_meter)
    rng = np.random.default_rng(case.seed)
    if case.texture:
        low, high = sorted(rng.uniform(0.25, 0.9, (2, 3)), key=lambda c: float(c.sum()))
        make = {
            "checker": lambda: checker(tuple(low), tuple(high)),
            "noise": lambda: noise(low, high, case.seed),
        }
        builder.image("texture.png", make[case.texture]())
    subject = builder.material("subject", **{**case.inputs, **(case.changed if changed else {})})
    LAYOUTS[case.layout](builder, case, subject, rng)
    LIGHTS[case.light](builder, case, rng)
    return builder.save()


def subject_mesh(kind: str, seed: int) -> MeshData:
    """The mesh of a subject about one metre high or wide."""
    makers: dict[str, Callable[[], MeshData]] = {
        "ball": lambda: ball(0.5),
        "box": lambda: box(0.75, 0.7, 0.6),
        "vase": lambda: vase(0.95, 0.38),
        "torus": lambda: torus(0.45, 0.2),
        "ring": lambda: torus(0.4, 0.12, lying=False),
        "teapot": lambda: teapot(1.0),
        "blob": lambda: blob(0.5, 0.14, seed),
        "bottle": lambda: bottle(1.05, 0.3),
        "capsule": lambda: capsule(0.35, 0.32),
    }
    return makers[kind]()


def _add_subject(builder: StageBuilder, kind: str, material: str, at: Triple, seed: int) -> None:
    if kind == "sphere":
        builder.sphere("subject", 0.5, material, (at[0], at[1] + 0.5, at[2]))
    elif kind == "cube":
        builder.cube("subject", (0.7, 0.6, 0.7), material, at, 30.0)
    elif kind == "pair":
        builder.sphere("subject", 0.4, material, (at[0] - 0.45, at[1] + 0.4, at[2]))
        builder.mesh("subject_two", vase(0.9, 0.3), material, (at[0] + 0.45, at[1], at[2] + 0.1))
    else:
        turns = {"box": 28.0, "teapot": -25.0, "ring": 20.0}
        builder.mesh("subject", subject_mesh(kind, seed), material, at, turns.get(kind, 0.0))


def _grey(rng: np.random.Generator, low: float, high: float) -> Triple:
    r, g, b = rng.uniform(low, high) * (1 + rng.uniform(-0.12, 0.12, 3))
    return float(r), float(g), float(b)


def _bright(rng: np.random.Generator) -> Triple:
    color = rng.uniform(0.05, 0.25, 3)
    color[rng.integers(3)] = rng.uniform(0.45, 0.75)
    r, g, b = color.tolist()
    return r, g, b


def _single(builder: StageBuilder, case: Case, subject: str, rng: np.random.Generator) -> None:
    ground = builder.material("ground", diffuseColor=_grey(rng, 0.25, 0.5), roughness=0.6)
    if case.subject == "floor":
        builder.mesh("subject", rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), 8.0), subject)
        chrome = builder.material("post", diffuseColor=_bright(rng), roughness=0.4)
        builder.mesh("post", ball(0.4), chrome, (0.3, 0, -0.3))
        builder.camera((0.0, 1.3, 2.6), (0.0, 0.15, 0.0), 36)
        return
    builder.plane("ground", 8.0, 8.0, ground)
    _add_subject(builder, case.subject, subject, (0, 0, 0), case.seed)
    builder.camera((rng.uniform(-0.6, 0.6), rng.uniform(0.9, 1.3), 2.9), (0, 0.45, 0), 28)


def _table(builder: StageBuilder, case: Case, subject: str, rng: np.random.Generator) -> None:
    wood = builder.material("wood", diffuseColor=(0.36, 0.22, 0.12), roughness=0.35)
    wall = builder.material("wall", diffuseColor=_grey(rng, 0.45, 0.7), roughness=0.8)
    left = builder.material("left", diffuseColor=_bright(rng), roughness=0.3)
    metal = (0.85, 0.83, 0.8)
    right = builder.material("right", diffuseColor=metal, metallic=1.0, roughness=0.25)
    top = subject if case.subject == "floor" else wood
    top_name = "subject" if case.subject == "floor" else "top"
    builder.mesh(top_name, box(3.0, 0.08, 1.8), top, (0, -0.08, 0))
    for i, (x, z) in enumerate(((-1.4, -0.8), (1.4, -0.8), (-1.4, 0.8), (1.4, 0.8))):
        builder.cube(f"leg{i}", (0.1, 0.7, 0.1), wood, (x, -0.78, z))
    builder.plane("floor", 7.0, 7.0, wall, -0.78)
    back = rectangle((-3.5, -0.78, -1.5), (7, 0, 0), (0, 3.2, 0), 3.0)
    builder.mesh(
        "subject" if case.subject == "wall" else "back", back, subject if case.subject == "wall" else wall
    )
    builder.mesh("bowl", ball(0.26), left, (-0.85 + rng.uniform(-0.1, 0.1), 0, 0.1))
    builder.mesh("can", box(0.32, 0.55, 0.32), right, (0.85, 0, rng.uniform(-0.3, 0.1)), rng.uniform(10, 60))
    if case.subject not in ("floor", "wall"):
        _add_subject(builder, case.subject, subject, (0, 0, 0), case.seed)
    builder.camera((rng.uniform(-0.5, 0.5), 1.25, 3.2), (0, 0.38, 0), 30)


def _room(builder: StageBuilder, case: Case, subject: str, rng: np.random.Generator) -> None:
    white = builder.material("white", diffuseColor=_grey(rng, 0.65, 0.75), roughness=0.7)
    red = builder.material("red", diffuseColor=(0.6, 0.08, 0.06), roughness=0.6)
    green = builder.material("green", diffuseColor=(0.1, 0.45, 0.12), roughness=0.6)
    grey = builder.material("grey", diffuseColor=_grey(rng, 0.3, 0.5), roughness=0.3)
    w, h, d = 1.5, 2.6, 1.5
    is_floor, is_wall = case.subject == "floor", case.subject == "wall"
    floor = rectangle((-w, 0, d), (2 * w, 0, 0), (0, 0, -2 * d), 4.0)
    builder.mesh("subject" if is_floor else "floor", floor, subject if is_floor else white)
    builder.mesh("back", rectangle((-w, 0, -d), (2 * w, 0, 0), (0, h, 0)), white)
    left = rectangle((-w, 0, d), (0, 0, -2 * d), (0, h, 0), 3.0)
    builder.mesh("subject" if is_wall else "left", left, subject if is_wall else red)
    builder.mesh("right", rectangle((w, 0, -d), (0, 0, 2 * d), (0, h, 0)), green)
    if case.light == "area":
        builder.mesh("ceiling", rectangle((-w, h, -d), (2 * w, 0, 0), (0, 0, 2 * d)), white)
    x = 0.0 if not (is_floor or is_wall) else 0.3
    builder.mesh("block", box(0.55, 1.25, 0.5), grey, (0.75, 0, -0.85), 20.0 + rng.uniform(-8, 8))
    if is_floor or is_wall:
        builder.mesh(
            "post",
            ball(0.38),
            builder.material("post", diffuseColor=_bright(rng), roughness=0.3),
            (x, 0, 0.2),
        )
    else:
        _add_subject(builder, case.subject, subject, (-0.25, 0, 0.15), case.seed)
    builder.camera((rng.uniform(-0.2, 0.2), 1.2, 5.2), (0, 0.95, 0), 30 if is_wall or is_floor else 26)


def _corner(builder: StageBuilder, case: Case, subject: str, rng: np.random.Generator) -> None:
    """Two walls that meet behind the objects, seen from above."""
    walls = [builder.material(f"wall{i}", diffuseColor=_bright(rng), roughness=0.5) for i in range(2)]
    stone = builder.material("stone", diffuseColor=_grey(rng, 0.35, 0.55), roughness=0.45)
    lacquer = builder.material("lacquer", diffuseColor=_bright(rng), roughness=0.2)
    is_floor = case.subject == "floor"
    floor = rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), 3.0)
    builder.mesh("subject" if is_floor else "floor", floor, subject if is_floor else stone)
    builder.mesh("wall_left", rectangle((-2, 0, 2), (2, 0, -3.2), (0, 2.4, 0)), walls[0])
    builder.mesh("wall_right", rectangle((0, 0, -1.2), (2, 0, 3.2), (0, 2.4, 0)), walls[1])
    builder.mesh("hoop", torus(0.28, 0.09), lacquer, (0.75, 0, 0.45))
    builder.sphere("marble", 0.22, stone, (-0.7, 0.22, 0.55))
    if not is_floor:
        _add_subject(builder, case.subject, subject, (0, 0, 0.1), case.seed)
    builder.camera((rng.uniform(-0.3, 0.3), 1.9, 3.6), (0, 0.4, 0), 31)


def _area(builder: StageBuilder, case: Case, rng: np.random.Generator) -> None:
    if case.layout == "room":
        builder.rect_light("lamp", (0, 2.59, 0.1), (0, 0, 0.1), 0.9, 0.7, (13.0, 12.0, 10.5))
        return
    if case.layout == "corner":
        builder.sphere_light("bulb", (rng.uniform(-0.9, -0.5), 2.1, 1.3), 0.16, (45.0, 42.0, 38.0))
        builder.dome_light("fill", 0.08, (0.8, 0.9, 1.0))
        return
    eye = (-1.8 + rng.uniform(-0.4, 0.4), 2.6, 1.8 + rng.uniform(-0.5, 0.5))
    builder.rect_light("key", eye, (0, 0.4, 0), 1.1, 0.9, (11.0, 10.5, 10.0))
    builder.rect_light("fill", (2.8, 1.6, 1.4), (0, 0.4, 0), 1.8, 1.8, (0.9, 1.0, 1.15))


def _dome(builder: StageBuilder, case: Case, rng: np.random.Generator) -> None:
    builder.dome_light("dome", 1.0, (1.0, 0.97, 0.93))


def _sky(builder: StageBuilder, case: Case, rng: np.random.Generator) -> None:
    name = builder.image("sky.exr", sky(case.seed + 100, sun=40.0))
    builder.dome_light("dome", 1.0, texture=name, turn=float(rng.uniform(-40, 40)))


def _distant(builder: StageBuilder, case: Case, rng: np.random.Generator) -> None:
    direction = (float(rng.uniform(0.35, 0.7)), -1.0, float(rng.uniform(-0.8, -0.5)))
    builder.distant_light("sun", direction, 3.0, 2.8)
    builder.dome_light("fill", 0.22, (0.8, 0.9, 1.0))


LAYOUTS: dict[str, Callable[[StageBuilder, Case, str, np.random.Generator], None]] = {
    "single": _single,
    "table": _table,
    "room": _room,
    "corner": _corner,
}
LIGHTS: dict[str, Callable[[StageBuilder, Case, np.random.Generator], None]] = {
    "area": _area,
    "dome": _dome,
    "sky": _sky,
    "distant": _distant,
}

__all__ = ["CAMERA", "SIZE", "SUBJECT", "Case", "TextureInput", "build_stage"]
