"""Lit stages for comparing pictures with the path tracer: what each holds, and how well it is to agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from kit.stage_parts import (
    InputValue,
    StageBuilder,
    TextureInput,
    ball,
    blob,
    box,
    checker,
    noise,
    rectangle,
    sky,
    teapot,
    torus,
    vase,
)

CAMERA = "/World/camera"
SIZE = (160, 120)
WHITE, RED, GREEN = (0.7, 0.69, 0.66), (0.6, 0.08, 0.06), (0.1, 0.45, 0.12)


@dataclass(frozen=True)
class LitScene:
    """A stage that is made by `build`; `tolerance` is of the mean relative error after averaging."""

    name: str
    tolerance: float
    build: Callable[[StageBuilder], None]
    up: str = "Y"
    units_per_meter: float = 1.0

    def write(self, folder: Path) -> Path:
        """Writes the stage into an existing folder."""
        builder = StageBuilder(folder, self.up, self.units_per_meter)
        self.build(builder)
        return builder.save()


def _matte(color: tuple[float, float, float]) -> dict[str, InputValue]:
    """As diffuse as UsdPreviewSurface can be."""
    return {
        "useSpecularWorkflow": 1.0,
        "diffuseColor": color,
        "specularColor": (0.0, 0.0, 0.0),
        "roughness": 1.0,
    }


def _walls(b: StageBuilder, inputs: Callable[[tuple], dict], with_ceiling: bool = True) -> None:
    """A room of 3 x 2.6 x 3 metres, open towards the camera."""
    white, red, green = (
        b.material(name, **inputs(color))
        for name, color in (("white", WHITE), ("red", RED), ("green", GREEN))
    )
    b.mesh("floor", rectangle((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3)), white)
    b.mesh("back", rectangle((-1.5, 0, -1.5), (3, 0, 0), (0, 2.6, 0)), white)
    b.mesh("left", rectangle((-1.5, 0, 1.5), (0, 0, -3), (0, 2.6, 0)), red)
    b.mesh("right", rectangle((1.5, 0, -1.5), (0, 0, 3), (0, 2.6, 0)), green)
    if with_ceiling:
        b.mesh("ceiling", rectangle((-1.5, 2.6, -1.5), (3, 0, 0), (0, 0, 3)), white)
    b.camera((0, 1.2, 5.3), (0, 0.95, 0), 26)


def _room_diffuse(b: StageBuilder) -> None:
    _walls(b, _matte)
    grey = b.material("grey", **_matte((0.5, 0.5, 0.55)))
    b.mesh("block", box(0.7, 1.3, 0.6), grey, (0.55, 0, -0.6), 20)
    b.mesh("ball", ball(0.45), grey, (-0.55, 0, 0.2))
    b.rect_light("lamp", (0, 2.58, 0.0), (0, 0, 0.0), 0.9, 0.7, (14, 13, 11))


def _room_glossy(b: StageBuilder) -> None:
    _walls(b, lambda c: {"diffuseColor": c, "roughness": 0.45})
    coat = b.material(
        "coat",
        useSpecularWorkflow=1.0,
        diffuseColor=(0.1, 0.2, 0.5),
        specularColor=(0.15,) * 3,
        roughness=0.25,
    )
    b.mesh("vase", vase(1.1, 0.45), coat, (-0.5, 0, 0.3))
    b.mesh(
        "block",
        box(0.7, 1.2, 0.6),
        b.material("steel", diffuseColor=(0.8, 0.8, 0.82), metallic=1.0, roughness=0.3),
        (0.6, 0, -0.5),
        25,
    )
    b.rect_light("lamp", (0, 2.58, 0.0), (0, 0, 0.0), 0.9, 0.7, (14, 13, 11))


def _table(b: StageBuilder, texture: str = "") -> None:
    wood: InputValue = TextureInput(texture) if texture else (0.36, 0.22, 0.12)
    b.mesh("top", box(3.2, 0.1, 2.2), b.material("wood", diffuseColor=wood, roughness=0.4), (0, -0.1, 0))
    b.plane("floor", 9, 9, b.material("ground", diffuseColor=(0.4, 0.4, 0.42), roughness=0.8), -0.8)
    b.camera((0.2, 1.5, 3.4), (0, 0.3, 0), 32)


def _metals_sky(b: StageBuilder) -> None:
    _table(b)
    colors = (
        ("gold", (0.95, 0.75, 0.35), 0.15),
        ("copper", (0.9, 0.5, 0.35), 0.3),
        ("steel", (0.7, 0.7, 0.72), 0.5),
    )
    for i, (name, color, roughness) in enumerate(colors):
        metal = b.material(name, diffuseColor=color, metallic=1.0, roughness=roughness)
        b.sphere(name, 0.36, metal, (-0.9 + 0.9 * i, 0.36, 0.1 * i))
    b.dome_light("dome", 1.0, texture=b.image("sky.exr", sky(3, sun=20.0)), turn=25)


def _glossy_distant(b: StageBuilder) -> None:
    _table(b)
    b.mesh(
        "pot",
        teapot(0.9),
        b.material("glaze", diffuseColor=(0.5, 0.12, 0.1), ior=2.0, roughness=0.3),
        (-0.4, 0, 0),
        -20,
    )
    b.mesh(
        "ring",
        torus(0.35, 0.12),
        b.material("rubber", diffuseColor=(0.1, 0.3, 0.15), roughness=0.5),
        (0.75, 0, 0.3),
    )
    b.distant_light("sun", (0.6, -1.0, -0.5), 2.0, 3.0)
    b.dome_light("fill", 0.2, (0.7, 0.85, 1.0))


def _diffuse_dome(b: StageBuilder) -> None:
    ground = b.material("ground", **_matte((0.5, 0.48, 0.45)))
    b.plane("floor", 9, 9, ground)
    for i, color in enumerate(((0.7, 0.2, 0.15), (0.2, 0.6, 0.25), (0.75, 0.7, 0.3))):
        matte = b.material(f"matte{i}", **_matte(color))
        b.mesh(f"lump{i}", blob(0.4, 0.14, i), matte, (-0.95 + 0.95 * i, 0, 0.15 * (i % 2)))
    b.dome_light("dome", 1.0, (1.0, 0.96, 0.9))
    b.camera((0, 1.3, 3.4), (0, 0.35, 0), 32)


def _textured_sky(b: StageBuilder) -> None:
    b.image("noise.png", noise((0.3, 0.18, 0.1), (0.8, 0.7, 0.5), 2))
    _table(b, "noise.png")
    b.image("checker.png", checker((0.85, 0.3, 0.25), (0.9, 0.85, 0.7)))
    painted = b.material("painted", diffuseColor=TextureInput("checker.png", (0.8, 0.9, 1.0)), roughness=0.5)
    b.mesh("ball", ball(0.45), painted, (-0.6, 0, 0))
    b.mesh("crate", box(0.7, 0.6, 0.6), painted, (0.6, 0, 0), 35)
    b.dome_light("dome", 1.0, texture=b.image("sky.exr", sky(5, sun=40.0)), turn=-60)


def _lamps(b: StageBuilder) -> None:
    """Sphere and disk lights, normalized, in a stage in centimetres."""
    b.plane("floor", 9, 9, b.material("ground", diffuseColor=(0.5, 0.48, 0.45), roughness=0.6))
    b.mesh(
        "wall",
        rectangle((-3, 0, -1.4), (6, 0, 0), (0, 3, 0)),
        b.material("wall", diffuseColor=(0.3, 0.4, 0.55), roughness=0.7),
    )
    b.sphere(
        "ball",
        0.4,
        b.material(
            "lacquer", diffuseColor=(0.6, 0.1, 0.1), clearcoat=1.0, clearcoatRoughness=0.2, roughness=0.6
        ),
        (-0.5, 0.4, 0),
    )
    b.cube(
        "cube",
        (0.6, 0.6, 0.6),
        b.material("plain", diffuseColor=(0.5, 0.5, 0.5), roughness=0.4),
        (0.6, 0, -0.2),
        30,
    )
    b.sphere_light("bulb", (-1.2, 1.8, 0.9), 0.12, (22, 20, 16))
    b.rect_light("softbox", (2.2, 1.8, 1.5), (0, 0.3, 0), 1.0, 1.0, (3.0, 3.3, 4.0))
    b.camera((0.1, 1.1, 3.5), (0, 0.5, 0), 32)


def _emissive(b: StageBuilder) -> None:
    """Light from an emissive panel only: closed, since renderers differ on whether back faces shine."""
    _walls(b, lambda c: {"diffuseColor": c, "roughness": 0.7})
    glow = b.material("glow", diffuseColor=(0.0, 0.0, 0.0), emissiveColor=(6.0, 5.0, 3.5))
    b.mesh("panel", box(1.0, 0.06, 1.2), glow, (0, 2.4, 0.3))
    b.mesh(
        "vase",
        vase(1.0, 0.4),
        b.material("clay", diffuseColor=(0.55, 0.4, 0.3), roughness=0.5),
        (0.1, 0, 0.2),
    )


DIFFUSE, GLOSSY = 0.05, 0.08
SCENES = {
    s.name: s
    for s in (
        LitScene("room_diffuse_area", DIFFUSE, _room_diffuse),
        LitScene("room_glossy_area", GLOSSY, _room_glossy),
        LitScene("metals_textured_dome", GLOSSY, _metals_sky),
        LitScene("glossy_distant", GLOSSY, _glossy_distant),
        LitScene("diffuse_dome", DIFFUSE, _diffuse_dome),
        LitScene("textured_sky_z_up", DIFFUSE, _textured_sky, "Z"),
        LitScene("lamps_centimetres", GLOSSY, _lamps, "Y", 100.0),
        LitScene("emissive_panel", DIFFUSE, _emissive),
    )
}
