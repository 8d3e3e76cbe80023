"""Textured cases of the recovery suite: changes of real assets' materials, under real light.

A textured input is changed by a factor of its texture's `scale`, of the channel that it reads alone, so that
the truth is the same factor everywhere; an input without a texture is set.
Names: shot, light, material, parameter, number.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kit.asset_shots import APARTMENT, COURTYARD, SHOTS, STUDIO, Shot, build_shot
from pxr import Usd, UsdShade

ASSETS = Path(__file__).resolve().parents[4] / "shared/assets"
HULL = "/root/_materials/dutch_ship_medium_hull"
SAILS = "/root/_materials/dutch_ship_medium_sails"
RIGGING = "/root/_materials/dutch_ship_medium_rigging"
PORCELAIN = "/Teapot/Materials/PorcelainFlowers"
AVOCADO = "/_materials/_256_Avocado_d"
CAR = "/vehicleVariant/tractorFullAsset/tractor/materials"
POT = "/teapot/mtl/default_material"
PLATES = "/scene/mtl"

D, S, G = "diffuse", "specular", "glossiness"
LIGHTS = {"studio": (STUDIO, 0.4), "courtyard": (COURTYARD, 1.0), "apartment": (APARTMENT, 1.0)}


@dataclass(frozen=True)
class Change:
    """One input of one shader that is changed."""

    attribute: str  # path
    value: Any  # float or tuple
    is_factor: bool  # else the value is set


@dataclass(frozen=True)
class TexturedCase:
    """One change of one parameter of one material of an asset."""

    name: str
    shot: Shot
    material: str  # in the asset
    parameter: str  # diffuse | specular | glossiness
    changes: tuple[Change, ...]
    seed: int
    set_name: str = "textured"

    def build(self, folder: Path, changed: bool = False, copy: str = "") -> Path:
        """Writes the stage before or after the change, of one copy or of all; returns the path of the file."""
        changes = {c["attribute"]: c["is"] for c in self.changed_values()} if changed else {}
        return build_shot(self.shot, ASSETS, folder, changes, copy)

    def changed_values(self) -> list[dict[str, Any]]:
        """Returns attribute, `was`, `is`, and what was done, of all changes."""
        stage = Usd.Stage.Open(str(ASSETS / self.shot.asset))
        for prim, name, choice in self.shot.variants:
            stage.GetPrimAtPath(prim).GetVariantSet(name).SetVariantSelection(choice)
        return [_value_of(stage, change) for change in self.changes]


def _value_of(stage: Usd.Stage, change: Change) -> dict[str, Any]:
    prim, name = change.attribute.split(".")
    shader = UsdShade.Shader(stage.GetPrimAtPath(prim))
    found = shader.GetInput(name.removeprefix("inputs:"))
    was = found.Get() if found else None
    if not change.is_factor:
        old = None if was is None else (list(was) if hasattr(was, "__len__") else float(was))
        return {"attribute": change.attribute, "was": old, "is": change.value, "how": "set"}
    old = [1.0] * 4 if was is None else [float(x) for x in was]
    bias = shader.GetInput("bias")
    assert not bias or not any(bias.Get() or ()), f"{prim} has a bias, which a factor would have to change too"
    new = tuple(a * b for a, b in zip(old, change.value, strict=True))
    return {"attribute": change.attribute, "was": old, "is": new, "how": f"texture times {change.value}"}


def _times(shader: str, *factors: float) -> Change:
    return Change(f"{shader}.inputs:scale", (*factors, 1.0)[:4], True)


def _set(shader: str, name: str, value: Any) -> Change:
    return Change(f"{shader}.inputs:{name}", value, False)


def _case(
    shot: str, light: str, material: str, parameter: str, change: Change, seed: int, turn: float = 0
) -> TexturedCase:
    hdri, intensity = LIGHTS[light]
    short = material.rsplit("/", 1)[-1].removeprefix("dutch_ship_medium_").removeprefix("_256_")
    scene = replace(SHOTS[shot], hdri=hdri, intensity=intensity, turn=SHOTS[shot].turn + turn)
    name = f"{shot}_{light}_{short}_{parameter}_{seed}"
    return TexturedCase(name, scene, material, parameter, (change,), seed)


def _ship(material: str) -> tuple[str, str, str]:
    return f"{material}/Image_Texture", f"{material}/Image_Texture_001", f"{material}/Principled_BSDF"


HULL_D, HULL_R, HULL_M = _ship(HULL)
SAILS_D, SAILS_R, SAILS_M = _ship(SAILS)
RIG_D, RIG_R, RIG_M = _ship(RIGGING)
POT_D, POT_R, POT_M = (f"{PORCELAIN}/UsdPreview/{x}" for x in ("img_diffuseColor", "img_ARM", "usdpreviewsurface"))
PEAR_D, PEAR_M = f"{AVOCADO}/preview/Image_Texture", f"{AVOCADO}/preview/Principled_BSDF"

TEXTURED = [
    # Normal map; a mirror-like dielectric.
    _case("avocado", "studio", AVOCADO, D, _times(PEAR_D, 0.5, 0.7, 0.6), 301),
    _case("avocado", "apartment", AVOCADO, D, _times(PEAR_D, 1.3, 0.6, 0.5), 302),
    _case("avocado", "courtyard", AVOCADO, S, _set(PEAR_M, "ior", 2.3), 303),
    _case("avocado", "studio", AVOCADO, S, _set(PEAR_M, "ior", 1.9), 304, 90),
    # Normal maps and packed maps, part of them metal.
    _case("hull", "apartment", HULL, D, _times(HULL_D, 2.5, 2.0, 1.5), 311),
    _case("hull", "courtyard", HULL, D, _times(HULL_D, 0.6, 1.4, 2.5), 312),
    _case("hull", "apartment", HULL, G, _times(HULL_R, 1, 0.4, 1), 313, 60),
    _case("hull", "courtyard", HULL, G, _times(HULL_R, 1, 0.5, 1), 314),
    _case("hull", "apartment", HULL, S, _set(HULL_M, "ior", 2.6), 315),
    _case("hull", "courtyard", HULL, S, _set(HULL_M, "ior", 2.1), 316, 40),
    _case("rigging", "apartment", SAILS, D, _times(SAILS_D, 1.5, 0.6, 0.5), 321),
    _case("rigging", "courtyard", SAILS, D, _times(SAILS_D, 1.8, 1.8, 1.6), 322),
    _case("rigging", "apartment", SAILS, G, _times(SAILS_R, 1, 0.45, 1), 323),
    _case("rigging", "apartment", SAILS, S, _set(SAILS_M, "ior", 2.5), 324, 120),
    _case("rigging", "courtyard", HULL, D, _times(HULL_D, 2.0, 2.2, 2.4), 325),
    _case("rigging", "apartment", RIGGING, D, _times(RIG_D, 2.5, 2.5, 3.0), 326),
    _case("rigging", "apartment", RIGGING, S, _set(RIG_M, "ior", 2.6), 327, 30),
    # Glossy porcelain; packed map.
    _case("fancy_teapot", "apartment", PORCELAIN, D, _times(POT_D, 0.4, 0.6, 0.9), 331),
    _case("fancy_teapot", "courtyard", PORCELAIN, D, _times(POT_D, 0.8, 0.45, 0.4), 332),
    _case("fancy_teapot", "apartment", PORCELAIN, S, _set(POT_M, "ior", 2.2), 333),
    _case("fancy_teapot", "courtyard", PORCELAIN, S, _set(POT_M, "ior", 1.8), 334),
    _case("fancy_teapot", "apartment", PORCELAIN, G, _times(POT_R, 1, 4.0, 1), 335),
    _case("fancy_teapot", "courtyard", PORCELAIN, G, _times(POT_R, 1, 6.0, 1), 336),
    # Palette textures.
    _case("car", "courtyard", f"{CAR}/redMaterial", D, _times(f"{CAR}/redMaterial/redTexture", 0.3, 4.0, 8.0), 341),
    _case("car", "courtyard", f"{CAR}/redMaterial", S, _set(f"{CAR}/redMaterial/redShader", "ior", 2.4), 342),
    _case("car", "apartment", f"{CAR}/redMaterial", G, _set(f"{CAR}/redMaterial/redShader", "roughness", 0.15), 343),
    _case("car", "apartment", f"{CAR}/windowMaterial", D,
          _times(f"{CAR}/windowMaterial/windowTexture", 2.5, 1.5, 1.0), 344),
    # Instances.
    _case("fleet", "courtyard", HULL, D, _times(HULL_D, 2.5, 2.0, 1.8), 351),
    _case("fleet", "apartment", HULL, G, _times(HULL_R, 1, 0.4, 1), 352),
    _case("fleet", "apartment", SAILS, D, _times(SAILS_D, 0.5, 0.9, 1.8), 353),
    _case("teapots_instanced", "apartment", POT, D,
          _set(f"{POT}/default_shader", "diffuseColor", (0.5, 0.3, 0.1)), 354),
    _case("teapots_instanced", "apartment", POT, S, _set(f"{POT}/default_shader", "ior", 2.3), 355),
    _case("teapots_instanced", "courtyard", POT, G, _set(f"{POT}/default_shader", "roughness", 0.5), 356),
    # Cut-out.
    _case("opacity", "courtyard", f"{PLATES}/opacityThreshold_050", D,
          _set(f"{PLATES}/opacityThreshold_050/surface", "diffuseColor", (0.4, 0.3, 0.1)), 361),
    _case("opacity", "courtyard", f"{PLATES}/opacityThreshold_025", S,
          _set(f"{PLATES}/opacityThreshold_025/surface", "ior", 2.6), 362),
]  # fmt: skip
