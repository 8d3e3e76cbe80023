"""The cases of the recovery suite: what changes, on what, in which light.

Names: layout (or `textured`), subject, light, parameter, workflow.  `m` stands for the metal workflow,
`s` for the specular workflow.
"""

from __future__ import annotations

from typing import Any

from truth.recovery.stages import Case, InputValue, TextureInput
from truth.recovery.textured_cases import TEXTURED, TexturedCase

TEXTURE = "texture.png"


def _grey(value: float) -> tuple[float, float, float]:
    return value, value, value


def _s(diffuse: InputValue, specular: tuple | float, roughness: float) -> dict[str, InputValue]:
    """A material of the specular workflow."""
    f0 = specular if isinstance(specular, tuple) else _grey(specular)
    return {"useSpecularWorkflow": 1.0, "diffuseColor": diffuse, "specularColor": f0, "roughness": roughness}


def _m(diffuse: InputValue, roughness: float, metallic: float = 0.0, ior: float = 1.5) -> dict[str, InputValue]:
    """A material of the metal workflow."""
    return {"diffuseColor": diffuse, "metallic": metallic, "roughness": roughness, "ior": ior}


def _tex(*scale: float) -> TextureInput:
    return TextureInput(TEXTURE, (scale[0], scale[1], scale[2]) if scale else (1.0, 1.0, 1.0))


def _case(
    layout: str,
    subject: str,
    light: str,
    parameter: str,
    inputs: dict[str, InputValue],
    changed: dict[str, InputValue],
    seed: int,
    texture: str = "",
    set_name: str = "tuning",
    up: str = "Y",
    units: float = 1.0,
) -> Case:
    workflow = "s" if inputs.get("useSpecularWorkflow") else "m"
    name = "_".join([layout, *(["textured"] if texture else []), subject, light, parameter, workflow])
    return Case(name, layout, subject, light, parameter, inputs, changed, texture, seed, up, units, set_name)


D, S, G = "diffuse", "specular", "glossiness"


def _d(*color: float) -> dict[str, InputValue]:
    return {"diffuseColor": (color[0], color[1], color[2])}


def _f0(*color: float) -> dict[str, InputValue]:
    return {"specularColor": (color[0], color[1], color[2]) if len(color) == 3 else _grey(color[0])}


def _r(roughness: float) -> dict[str, InputValue]:
    return {"roughness": roughness}


def _ior(ior: float) -> dict[str, InputValue]:
    return {"ior": ior}


GOLD, COPPER, SILVER = (0.95, 0.75, 0.35), (0.9, 0.5, 0.35), (0.93, 0.92, 0.9)

TUNING = [
    # The first ten are varied: one of each kind that matters.
    _case("single", "sphere", "area", D, _s((0.6, 0.15, 0.1), 0.04, 0.4), _d(0.1, 0.3, 0.6), 1),
    _case("table", "sphere", "area", S, _s((0.3, 0.1, 0.08), 0.04, 0.25), _f0(0.3), 2),
    _case("single", "torus", "sky", G, _m(GOLD, 0.2, 1.0), _r(0.5), 3),
    _case("room", "vase", "area", G, _m(SILVER, 0.5, 1.0), _r(0.2), 4),
    _case("single", "sphere", "distant", S, _m(SILVER, 0.35, 1.0), _d(*COPPER), 5),
    _case("table", "vase", "distant", D, _s((0.2, 0.4, 0.25), 0.06, 0.35), _d(0.55, 0.4, 0.15), 6),
    _case("room", "floor", "area", S, _m((0.3, 0.28, 0.25), 0.25), _ior(2.4), 7),
    _case("single", "vase", "sky", S, _s((0.2, 0.05, 0.05), 0.04, 0.2), _f0(0.5, 0.35, 0.1), 8),
    _case("single", "ball", "area", D, _m(_tex(), 0.4), {"diffuseColor": _tex(0.9, 0.45, 0.3)}, 9, "checker"),
    _case("single", "teapot", "dome", D, _m(_grey(0.5), 0.4), _d(0.7, 0.3, 0.2), 10),
    # One object on a ground.
    _case("single", "vase", "area", S, _m((0.25, 0.25, 0.3), 0.25), _ior(2.4), 11),
    _case("single", "torus", "area", G, _m(GOLD, 0.45, 1.0), _r(0.2), 12),
    _case("single", "ring", "area", S, _s(_grey(0.1), 0.6, 0.3), _f0(0.2), 13),
    _case("single", "sphere", "sky", S, _s((0.1, 0.15, 0.3), 0.04, 0.15), _f0(0.35), 14),
    _case("single", "vase", "sky", G, _s((0.3, 0.2, 0.15), 0.3, 0.5), _r(0.15), 15),
    _case("single", "blob", "sky", D, _m(_grey(0.06), 0.45), _d(0.55, 0.5, 0.45), 16, up="Z"),
    _case("single", "sphere", "sky", G, _m(SILVER, 0.08, 1.0), _r(0.35), 17),
    _case("single", "box", "distant", D, _m((0.6, 0.5, 0.2), 0.5), _d(0.15, 0.35, 0.5), 18),
    _case("single", "teapot", "distant", G, _s(_grey(0.25), 0.12, 0.2), _r(0.45), 19),
    _case("single", "blob", "distant", S, _m((0.2, 0.1, 0.05), 0.3, 0.0, 2.4), _ior(1.4), 20),
    _case("single", "torus", "dome", D, _s((0.1, 0.2, 0.5), 0.08, 0.3), _d(0.5, 0.2, 0.1), 21, units=100),
    _case("single", "ball", "dome", G, _s((0.2, 0.2, 0.2), 0.4, 0.2), _r(0.6), 22),
    # Several objects on a table.
    _case("table", "vase", "area", D, _m((0.15, 0.2, 0.5), 0.3), _d(0.6, 0.55, 0.5), 23),
    _case("table", "box", "area", G, _s((0.2, 0.25, 0.2), 0.25, 0.15), _r(0.4), 24),
    _case("table", "sphere", "area", S, _m(_grey(0.5), 0.15, 1.0), _d(0.95, 0.9, 0.85), 25),
    _case("table", "torus", "sky", D, _s((0.5, 0.5, 0.5), 0.04, 0.25), _d(0.6, 0.2, 0.35), 26),
    _case("table", "teapot", "sky", S, _m(SILVER, 0.3, 1.0), _d(*GOLD), 27, up="Z"),
    _case("table", "sphere", "sky", G, _m(COPPER, 0.12, 1.0), _r(0.4), 28),
    _case("table", "floor", "sky", G, _s((0.2, 0.12, 0.08), 0.15, 0.5), _r(0.15), 29),
    _case("table", "sphere", "distant", S, _m((0.35, 0.08, 0.08), 0.35), _ior(2.4), 30),
    _case("table", "torus", "distant", G, _m((0.12, 0.15, 0.12), 0.5, 0.0, 2.0), _r(0.25), 31),
    _case("table", "cube", "dome", D, _m((0.3, 0.5, 0.2), 0.5), _d(0.5, 0.15, 0.12), 32),
    # A room with colour bleeding.
    _case("room", "sphere", "area", D, _m((0.7, 0.65, 0.3), 0.3), _d(0.2, 0.3, 0.6), 33),
    _case("room", "wall", "area", D, _s((0.6, 0.1, 0.08), 0.04, 0.6), _d(0.1, 0.15, 0.6), 34),
    _case("room", "box", "area", S, _s((0.25, 0.2, 0.15), 0.04, 0.3), _f0(0.45, 0.3, 0.15), 35),
    _case("room", "floor", "area", G, _s((0.25, 0.22, 0.2), 0.2, 0.5), _r(0.15), 36),
    _case("room", "pair", "area", D, _s((0.5, 0.45, 0.4), 0.05, 0.35), _d(0.5, 0.15, 0.4), 37, units=100),
    _case("room", "teapot", "area", D, _m((0.5, 0.4, 0.3), 0.4), _d(0.66, 0.4, 0.3), 38),
    _case("room", "teapot", "sky", D, _s((0.15, 0.3, 0.4), 0.06, 0.2), _d(0.45, 0.3, 0.1), 39),
    _case("room", "sphere", "sky", S, _m(COPPER, 0.25, 1.0), _d(*SILVER), 40),
    _case("room", "torus", "sky", G, _s((0.1, 0.1, 0.1), 0.5, 0.15), _r(0.4), 41),
    _case("room", "floor", "distant", D, _m((0.5, 0.45, 0.4), 0.5), _d(0.25, 0.35, 0.5), 42),
    _case("room", "vase", "distant", S, _s((0.15, 0.25, 0.15), 0.04, 0.3), _f0(0.4), 43),
    _case("room", "sphere", "distant", G, _m(GOLD, 0.15, 1.0), _r(0.4), 44),
    # Textured.
    _case("table", "vase", "area", D, _m(_tex(), 0.35), {"diffuseColor": _tex(0.4, 0.6, 1.0)}, 45, "noise"),
    _case("single", "ball", "area", S, _s(_tex(0.5, 0.5, 0.5), 0.04, 0.25), _f0(0.3), 46, "checker"),
    _case("room", "ball", "area", G, _m(_tex(0.4, 0.4, 0.4), 0.45, 0.0, 2.2), _r(0.15), 47, "noise"),
    _case("room", "floor", "area", D, _m(_tex(), 0.4), {"diffuseColor": _tex(0.4, 0.45, 0.8)}, 48, "checker"),
    _case("single", "box", "sky", D, _s(_tex(), 0.05, 0.4), {"diffuseColor": _tex(0.35, 0.8, 0.45)}, 49, "noise"),
    _case("table", "ball", "sky", S, _m(_tex(0.5, 0.5, 0.5), 0.2), _ior(2.5), 50, "checker"),
    _case("single", "vase", "sky", G, _s(_tex(0.6, 0.6, 0.6), 0.2, 0.5), _r(0.2), 51, "noise", up="Z"),
    _case(
        "single",
        "floor",
        "distant",
        D,
        _s(_tex(), 0.04, 0.4),
        {"diffuseColor": _tex(0.9, 0.5, 0.4)},
        52,
        "checker",
    ),
    _case("table", "torus", "distant", S, _s(_tex(0.5, 0.5, 0.5), 0.04, 0.35), _f0(0.4, 0.4, 0.4), 53, "noise"),
    _case("single", "ball", "distant", G, _m(_tex(0.5, 0.5, 0.5), 0.25, 0.0, 2.0), _r(0.5), 54, "checker"),
    _case(
        "single",
        "teapot",
        "sky",
        S,
        _m(_tex(), 0.3, 1.0),
        {"diffuseColor": _tex(1.0, 0.7, 0.35)},
        55,
        "noise",
    ),
]

IRON, BRASS = (0.56, 0.55, 0.53), (0.88, 0.72, 0.4)


def _twin(*args: Any, **options: Any) -> Case:
    return _case(*args, set_name="twin", **options)


# Made after the others, with other seeds, shapes and colours; never looked at while tuning.
TWINS = [
    _twin("corner", "bottle", "area", D, _m((0.45, 0.15, 0.12), 0.35), _d(0.2, 0.45, 0.4), 201),
    _twin("corner", "capsule", "sky", G, _m(BRASS, 0.15, 1.0), _r(0.45), 202),
    _twin("corner", "bottle", "distant", S, _s((0.1, 0.25, 0.12), 0.05, 0.28), _f0(0.35), 203),
    _twin("single", "capsule", "area", S, _m((0.4, 0.2, 0.35), 0.3), _ior(2.2), 204),
    _twin("table", "bottle", "sky", S, _m(BRASS, 0.22, 1.0), _d(*IRON), 205, units=100),
    _twin("room", "capsule", "area", G, _s((0.2, 0.3, 0.4), 0.3, 0.18), _r(0.5), 206),
    _twin("corner", "floor", "sky", D, _m(_tex(), 0.5), {"diffuseColor": _tex(0.5, 0.7, 0.35)}, 207, "noise"),
    _twin("corner", "bottle", "area", G, _s(_tex(0.6, 0.6, 0.6), 0.25, 0.45), _r(0.18), 208, "checker"),
    _twin("table", "ring", "dome", D, _s((0.3, 0.3, 0.35), 0.05, 0.5), _d(0.6, 0.45, 0.1), 209, up="Z"),
    _twin("room", "bottle", "sky", S, _s((0.12, 0.1, 0.2), 0.5, 0.25), _f0(0.12), 210),
    _twin("single", "bottle", "distant", G, _m(COPPER, 0.5, 1.0), _r(0.22), 211),
    _twin(
        "corner",
        "capsule",
        "distant",
        S,
        _s(_tex(0.6, 0.6, 0.6), 0.04, 0.3),
        _f0(0.45, 0.3, 0.2),
        212,
        "noise",
    ),
]


def _colored(*args: Any, **options: Any) -> Case:
    return _case(*args, set_name="colored", **options)


# Dielectrics whose specular becomes slightly coloured, which grey explains nearly: exact paint tells them apart.
COLORED = [
    _colored("single", "box", "area", S, _s((0.2, 0.22, 0.25), 0.04, 0.3), _f0(0.35, 0.3, 0.2), 301),
    _colored("table", "box", "sky", S, _s((0.3, 0.1, 0.08), 0.05, 0.25), _f0(0.35, 0.3, 0.2), 302),
    _colored("room", "sphere", "area", S, _s((0.1, 0.2, 0.15), 0.04, 0.2), _f0(0.2, 0.3, 0.4), 303),
]

# Cases that no method can decide, with the reason.
UNDECIDABLE: dict[str, str] = {}

CASES = TUNING + TWINS + COLORED
SETS: dict[str, list[Case] | list[TexturedCase]] = {
    "tuning": TUNING,
    "twin": TWINS,
    "colored": COLORED,
    "all": TUNING + TWINS,
    "textured": TEXTURED,  # on the real assets, see textured_cases.py
}
