"""Lights: UsdLux prims -> Light records.

    L = intensity * 2^exposure / sizeFactor * color [* blackbody(colorTemperature)]
    sizeFactor = 1 unless normalize; then the world-space area of the light, scale included;
    distant, t = radians(angle) / 2:  t = 0 -> 1;  t <= pi/2 -> pi sin^2 t;  else pi (2 - sin^2 t)

A dome's radiance multiplies its texture.  A distant light of angle 0 has irradiance in place of radiance.
Source: UsdLux schema documentation of OpenUSD 26.11.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux

from usdslf.color import USD_DEFAULT_SPACE, Color
from usdslf.scene.records import F64, Light, LightTexture
from usdslf.textures import images
from usdslf.usd.notes import Notes
from usdslf.usd.read.input_values import floats
from usdslf.usd.read.materials import color_space_of
from usdslf.usd.read.origin import HERE, Origin, moved_to

KINDS = {
    "RectLight": "rect",
    "DiskLight": "disk",
    "SphereLight": "sphere",
    "CylinderLight": "cylinder",
    "DistantLight": "distant",
    "DomeLight": "dome",
    "DomeLight_1": "dome",
}
# Sizes that the area of a light is made of.
_SIZES = {"rect": ("width", "height"), "disk": ("radius",), "sphere": ("radius",), "cylinder": ("radius", "length")}
FORMATS = ("automatic", "latlong", "mirroredBall", "angular", "cubeMapVerticalCross")  # of a dome's texture
MOST_STOPS = 64.0  # of exposure: more is no number in single precision any more
_OLD_NAMES = "since USD 21.02 the inputs of lights begin with inputs:"
# Turns code that knows a +Y pole with longitude 0 at +Z to a +Z pole with longitude 0 at -Y.
_Z_POLE = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def read_lights(stage: Usd.Stage, time: Usd.TimeCode, color: Color, notes: Notes, origin: Origin = HERE) -> list[Light]:
    """Returns the visible lights of a stage, instances included, relative to an origin."""
    transforms = UsdGeom.XformCache(time)
    found = []
    prims = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
    for prim in prims:
        below_instancer = prim.IsA(UsdGeom.PointInstancer)
        if below_instancer:
            lights = [p for p in Usd.PrimRange(prim) if p.HasAPI(UsdLux.LightAPI)]
            for p in lights:
                notes.add("light {} below a PointInstancer is not shown", p.GetPath())
            prims.PruneChildren()
            continue
        if not prim.HasAPI(UsdLux.LightAPI) or not _is_shown(prim, time):
            continue
        if prim.GetTypeName() in KINDS:
            world = np.array(transforms.GetLocalToWorldTransform(prim), np.float64).T
            found.append(_read_light(prim, moved_to(world, origin), time, color, notes))
        else:
            reason = f"light {{}} ({prim.GetTypeName()}) is not supported, use an emissive material"
            notes.add(reason, prim.GetPath())
    return found


def _is_shown(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    image = UsdGeom.Imageable(prim)
    if not image:
        return True
    purpose = image.ComputePurpose()
    hidden = image.ComputeVisibility(time) == UsdGeom.Tokens.invisible
    return not hidden and purpose not in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy)


class _Inputs:
    """What is authored on a light, whatever it holds in place of a number."""

    def __init__(self, prim: Usd.Prim, time: Usd.TimeCode, notes: Notes) -> None:
        self.prim, self.time, self.notes = prim, time, notes

    def get(self, name: str, fallback: Any) -> Any:
        attribute = self.prim.GetAttribute(name)
        value = attribute.Get(self.time) if attribute else None
        return fallback if value is None else value

    def numbers(self, name: str, *fallback: float) -> tuple[float, ...]:
        found = floats(self.get(name, fallback))
        if found is None or len(found) != len(fallback):
            words = ", ".join(f"{v:g}" for v in fallback)
            self.notes.add(f"{name} of light {{}} has no usable value: {words} is taken", self.prim.GetPath())
            return fallback
        return found

    def number(self, name: str, fallback: float) -> float:
        return self.numbers(name, fallback)[0]

    def stops(self) -> float:
        stops = self.number("inputs:exposure", 0.0)
        if stops > MOST_STOPS:
            say = f"inputs:exposure of light {{}} is more than {MOST_STOPS:g} stops, which are taken"
            self.notes.add(say, self.prim.GetPath())
        return min(stops, MOST_STOPS)


def _read_light(prim: Usd.Prim, world: F64, time: Usd.TimeCode, color: Color, notes: Notes) -> Light:
    kind = KINDS[prim.GetTypeName()]
    read = _Inputs(prim, time, notes)
    get, number, numbers = read.get, read.number, read.numbers
    size = {
        "width": number("inputs:width", 1.0),
        "height": number("inputs:height", 1.0),
        "radius": number("inputs:radius", 0.5),
        "length": number("inputs:length", 1.0),
        "angle": math.radians(min(max(number("inputs:angle", 0.0), 0.0), 360.0)),
    }
    is_point = bool(get("treatAsPoint", False)) and kind == "sphere"
    if not is_point and min((size[n] for n in _SIZES.get(kind, ())), default=1.0) <= 0:
        notes.add("light {} has no area, and gives no light: its size is not a positive number", prim.GetPath())
    level = number("inputs:intensity", 1.0) * 2.0 ** read.stops()
    if get("inputs:normalize", False):
        factor = size_factor(kind, world, **size)
        if factor > 0:
            level /= factor
        else:
            notes.add("normalize of light {} has no effect: it has no area", prim.GetPath())
    rgb = np.asarray(numbers("inputs:color", 1.0, 1.0, 1.0), np.float64)
    attribute = prim.GetAttribute("inputs:color")
    space = color_space_of(attribute) if attribute else USD_DEFAULT_SPACE
    rgb = color.to_working(rgb[None], space)[0].astype(np.float64)
    if get("inputs:enableColorTemperature", False):
        black = UsdLux.BlackbodyTemperatureAsRgb(number("inputs:colorTemperature", 6500.0))
        rgb = rgb * color.to_working(np.asarray(black)[None], USD_DEFAULT_SPACE)[0]
    if prim.GetTypeName() == "DomeLight_1":
        pole = get("poleAxis", "scene")
        if pole == "Z" or (pole == "scene" and UsdGeom.GetStageUpAxis(prim.GetStage()) == "Z"):
            world = world @ _Z_POLE
    tint = numbers("inputs:shaping:focusTint", 0.0, 0.0, 0.0)
    _note_unsupported(prim, kind, time, notes)
    texture = _texture(prim, kind, time, color, notes)
    r, g, b = (float(x) for x in level * rgb)
    return Light(
        path=str(prim.GetPath()),
        kind=kind,
        radiance=(r, g, b),
        world_from_light=world,
        treat_as_point=is_point,
        diffuse=number("inputs:diffuse", 1.0),
        specular=number("inputs:specular", 1.0),
        texture=texture,
        unread=notes.missing.get(str(prim.GetPath()), ("", ""))[0],
        cone_angle=number("inputs:shaping:cone:angle", 90.0),
        cone_softness=number("inputs:shaping:cone:softness", 0.0),
        focus=number("inputs:shaping:focus", 0.0),
        focus_tint=(tint[0], tint[1], tint[2]),
        **size,
    )


def size_factor(
    kind: str, world: F64, width: float, height: float, radius: float, length: float, angle: float
) -> float:
    """Returns what `normalize` divides by.

    Args:
        kind: of Light.
        world: (4, 4) world from light.
        width, height, radius, length: [light's own units].
        angle: full angle of a distant light [rad].
    """
    x, y, z = np.asarray(world, np.float64)[:3, :3].T
    if kind == "rect":
        return width * height * float(np.linalg.norm(np.cross(x, y)))
    if kind == "disk":
        return math.pi * radius**2 * float(np.linalg.norm(np.cross(x, y)))
    if kind == "sphere":  # Thomsen's formula, exact for equal axes, else within 1.1 %
        a, b, c = (radius * float(np.linalg.norm(v)) for v in (x, y, z))
        p = 1.6075
        mean = ((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3
        return 4 * math.pi * mean ** (1 / p)
    if kind == "cylinder":  # without caps; Ramanujan's perimeter, exact for equal axes
        a, b = radius * float(np.linalg.norm(y)), radius * float(np.linalg.norm(z))
        perimeter = math.pi * (3 * (a + b) - math.sqrt((3 * a + b) * (a + 3 * b)))
        return length * float(np.linalg.norm(x)) * perimeter
    if kind == "distant":
        t = angle / 2
        if t == 0:
            return 1.0
        return math.pi * (math.sin(t) ** 2 if t <= math.pi / 2 else 2 - math.sin(t) ** 2)
    return 1.0


def _texture(prim: Usd.Prim, kind: str, time: Usd.TimeCode, color: Color, notes: Notes) -> LightTexture | None:
    """Returns the texture of a dome or rect light; none where it cannot be used."""
    attribute = prim.GetAttribute("inputs:texture:file")
    asset = attribute.Get(time) if attribute and kind in ("dome", "rect") else None
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return None
    path = str(asset.resolvedPath)
    why = images.why_unreadable(path) if path else "it cannot be found"
    if why:
        reason = f"texture {asset.path} of light {{}} cannot be read ({why}): its colour is used"
        notes.add(reason, prim.GetPath())
        notes.missing[str(prim.GetPath())] = asset.path, why
        return None
    space = attribute.GetColorSpace() if attribute.HasColorSpace() else "auto"
    if space != "auto" and not color.knows(space):
        notes.add(f"colour space {space} of light {{}} is unknown: taken as auto", prim.GetPath())
        space = "auto"
    for words in images.what_was_taken(path, space):
        notes.add(f"texture {asset.path} of light {{}}: {words}", prim.GetPath())
    format = prim.GetAttribute("inputs:texture:format")
    shape = str((format.Get(time) if format else None) or "automatic")
    if shape not in FORMATS:
        notes.add(f"texture:format {shape} of light {{}} is not known: latlong is taken", prim.GetPath())
        shape = "latlong"
    return LightTexture(path, shape, space, color.config, color.working_space)


def _note_unsupported(prim: Usd.Prim, kind: str, time: Usd.TimeCode, notes: Notes) -> None:
    """Notes what a light asks for and does not get."""
    path = prim.GetPath()
    old = [n for n in prim.GetAuthoredPropertyNames() if prim.HasAttribute(f"inputs:{n}")]
    if old:
        notes.add(f"{', '.join(old)} of light {{}} {'is' if len(old) == 1 else 'are'} ignored: {_OLD_NAMES}", path)
    for name in ("lightLink", "shadowLink"):
        links = Usd.CollectionAPI(prim, name)
        if not links:
            continue
        targets = links.GetIncludesRel().GetTargets() or links.GetExcludesRel().GetTargets()
        if targets or links.GetIncludeRootAttr().Get() is False:
            notes.add(f"{name} of light {{}} is not supported: it lights everything", path)
    if UsdLux.LightAPI(prim).GetFiltersRel().GetTargets():
        notes.add("light filters of {} are not supported: it is unfiltered", path)
    ies = prim.GetAttribute("inputs:shaping:ies:file")
    if ies and ies.Get(time) and ies.Get(time).path:
        notes.add(f"IES profile {ies.Get(time).path} of light {{}} is not supported: it is ignored", path)
    shadow = prim.GetAttribute("inputs:shadow:enable")
    if shadow and shadow.Get(time) is False:
        notes.add("shadow:enable = false of light {} is not supported: it casts shadows", path)
    portals = prim.GetRelationship("portals")
    if kind == "dome" and portals and portals.GetTargets():
        notes.add("portals of dome light {} are not needed: it shines from everywhere", path)
