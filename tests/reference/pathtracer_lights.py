"""UsdLux lights of a stage as emitters of Mitsuba 3.

L = intensity 2^exposure color [blackbody] / sizeFactor      Source: UsdLux schema text
"""

from __future__ import annotations

import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux
from reference.pathtracer_materials import read_texels

LARGEST_DISTANT_HALF_ANGLE = math.pi / 4
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # Mitsuba emits along +Z, UsdLux along -Z


class LightReader:
    """Collects lights with `read`; `emitters` gives them all, once the bounds of the scene are known."""

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode, warnings: list[str]) -> None:
        self.stage, self.time, self.warnings = stage, time, warnings
        self._near: list[dict] = []
        self._distant: list[
            tuple[NDArray, NDArray, float]
        ] = []  # direction, radiance or irradiance, half angle
        self._domes: list[tuple[NDArray | None, NDArray, NDArray]] = []  # texels, radiance, rotation

    def read(self, prim: Usd.Prim, world_from_light: NDArray) -> None:
        """Adds one light."""
        self._warn_of_unsupported(prim)
        kind = str(prim.GetTypeName())
        linear = world_from_light[:3, :3]
        radiance, is_normalized = self._radiance(prim)
        if kind in ("RectLight", "DiskLight", "SphereLight", "CylinderLight"):
            add = getattr(self, "_" + kind.removesuffix("Light").lower())
            add(prim, world_from_light, linear, radiance, is_normalized)
        elif kind == "DistantLight":
            direction = -world_from_light[:3, 2] / np.linalg.norm(world_from_light[:3, 2])
            half = math.radians(min(max(float(self._value(prim, "angle")), 0), 360)) / 2
            if is_normalized and half > 0:
                s2 = math.sin(half) ** 2
                radiance = radiance / (math.pi * (s2 if half <= math.pi / 2 else 2 - s2))
            self._distant.append((direction, radiance, half))
        elif kind in ("DomeLight", "DomeLight_1"):
            self._dome(prim, kind, linear, radiance)
        else:
            self.warnings.append(f"light {kind} {prim.GetPath()}")

    def emitters(self, center: NDArray, radius: float) -> list[dict]:
        """Returns the dictionaries of all lights, for a scene inside the given sphere."""
        found = list(self._near)
        for direction, radiance, half in self._distant:
            found.append(_distant_emitter(direction, radiance, half, center, radius))
            if half > LARGEST_DISTANT_HALF_ANGLE:
                self.warnings.append("a distant light wider than 90 degrees: taken as parallel")
        textured = [dome for dome in self._domes if dome[0] is not None]
        if textured:
            if len(self._domes) > 1:
                self.warnings.append("several domes: only the first textured one is used")
            found.append(_environment(*textured[0]))
        elif self._domes:
            total = sum(radiance for _, radiance, _ in self._domes)
            found.append({"type": "constant", "radiance": {"type": "rgb", "value": list(total)}})
        return found

    def _value(self, prim: Usd.Prim, name: str) -> Any:
        return prim.GetAttribute("inputs:" + name).Get(self.time)

    def _radiance(self, prim: Usd.Prim) -> tuple[NDArray, bool]:
        api = UsdLux.LightAPI(prim)
        scale = api.GetIntensityAttr().Get(self.time) * 2 ** api.GetExposureAttr().Get(self.time)
        color = np.array(api.GetColorAttr().Get(self.time), np.float64)
        if api.GetEnableColorTemperatureAttr().Get(self.time):
            kelvin = api.GetColorTemperatureAttr().Get(self.time)
            color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
        return scale * color, bool(api.GetNormalizeAttr().Get(self.time))

    def _rect(self, prim: Usd.Prim, world: NDArray, linear: NDArray, radiance: NDArray, norm: bool) -> None:
        w, h = self._value(prim, "width"), self._value(prim, "height")
        if norm:
            radiance = radiance / (w * h * np.linalg.norm(np.cross(linear[:, 0], linear[:, 1])))
        if self._value(prim, "texture:file"):
            self.warnings.append(f"texture on {prim.GetPath()}")
        to_world = mi.ScalarTransform4f(world @ FLIP) @ mi.ScalarTransform4f().scale([w / 2, h / 2, 1])
        self._near.append({"type": "rectangle", "to_world": to_world, **_emits(radiance)})

    def _disk(self, prim: Usd.Prim, world: NDArray, linear: NDArray, radiance: NDArray, norm: bool) -> None:
        r = self._value(prim, "radius")
        if norm:
            radiance = radiance / (math.pi * r * r * np.linalg.norm(np.cross(linear[:, 0], linear[:, 1])))
        to_world = mi.ScalarTransform4f(world @ FLIP) @ mi.ScalarTransform4f().scale([r, r, 1])
        self._near.append({"type": "disk", "to_world": to_world, **_emits(radiance)})

    def _sphere(self, prim: Usd.Prim, world: NDArray, linear: NDArray, radiance: NDArray, norm: bool) -> None:
        r = float(self._value(prim, "radius") * self._uniform_scale(prim, linear))
        area = 4 * math.pi * r * r
        if norm:
            radiance = radiance / area
        center = world[:3, 3].tolist()
        if prim.GetAttribute("treatAsPoint").Get(self.time):
            intensity = {"type": "rgb", "value": (radiance * area / 4).tolist()}
            self._near.append({"type": "point", "position": center, "intensity": intensity})
        else:
            self._near.append({"type": "sphere", "center": center, "radius": r, **_emits(radiance)})

    def _cylinder(
        self, prim: Usd.Prim, world: NDArray, linear: NDArray, radiance: NDArray, norm: bool
    ) -> None:
        r, length = self._value(prim, "radius"), self._value(prim, "length")
        scale = self._uniform_scale(prim, linear)
        if norm:
            radiance = radiance / (2 * math.pi * r * length * scale**2)
        ends = {"p0": [-length / 2, 0, 0], "p1": [length / 2, 0, 0], "radius": r}
        to_world = mi.ScalarTransform4f(world)
        self._near.append({"type": "cylinder", **ends, "to_world": to_world, **_emits(radiance)})

    def _dome(self, prim: Usd.Prim, kind: str, linear: NDArray, radiance: NDArray) -> None:
        rotation = linear / np.cbrt(np.linalg.det(linear))
        if kind == "DomeLight_1":
            pole = prim.GetAttribute("poleAxis").Get()
            if pole == "Z" or (pole == "scene" and UsdGeom.GetStageUpAxis(self.stage) == "Z"):
                # Pole +Y -> +Z, and latitude 0, longitude 0 (+Z) -> -Y.
                rotation = rotation @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
        asset = self._value(prim, "texture:file")
        texels = None
        if asset and (asset.resolvedPath or asset.path):
            if self._value(prim, "texture:format") not in ("automatic", "latlong"):
                self.warnings.append(f"dome texture format on {prim.GetPath()}")
            texels = read_texels(asset.resolvedPath or asset.path, "auto")
            if texels is None:
                self.warnings.append(f"unreadable dome texture {asset.path}")
        self._domes.append((texels, radiance, rotation))

    def _uniform_scale(self, prim: Usd.Prim, linear: NDArray) -> float:
        scales = np.linalg.svd(linear)[1]
        if scales.max() / scales.min() > 1.0001:
            self.warnings.append(f"non-uniform scale on {prim.GetPath()}")
        return float(scales.mean())

    def _warn_of_unsupported(self, prim: Usd.Prim) -> None:
        path = prim.GetPath()
        for name in ("diffuse", "specular"):
            if self._value(prim, name) not in (None, 1.0):
                self.warnings.append(f"inputs:{name} on {path}")
        for name in ("shaping:focus", "shaping:ies:file"):
            attribute = prim.GetAttribute("inputs:" + name)
            if attribute and attribute.HasAuthoredValue():
                self.warnings.append(f"inputs:{name} on {path}")
        cone = self._value(prim, "shaping:cone:angle")
        if cone is not None and cone < 90:
            self.warnings.append(f"shaping:cone on {path}")
        for name in ("lightLink", "shadowLink"):
            link = Usd.CollectionAPI(prim, name)
            if link and (link.GetIncludesRel().GetTargets() or link.GetExcludesRel().GetTargets()):
                self.warnings.append(f"{name} on {path}")


def _emits(radiance: NDArray) -> dict:
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": [float(x) for x in radiance]}}
    return {"bsdf": {"type": "null"}, "emitter": emitter}


def _distant_emitter(
    direction: NDArray, radiance: NDArray, half: float, center: NDArray, radius: float
) -> dict:
    """A far disk that subtends the angle with constant radiance; parallel light where that cannot be."""
    if half == 0 or half > LARGEST_DISTANT_HALF_ANGLE:
        # At angle 0 UsdLux's radiance is the irradiance.
        factor = math.pi * math.sin(min(half, math.pi / 2)) ** 2 if half else 1.0
        irradiance = {"type": "rgb", "value": (radiance * factor).tolist()}
        return {"type": "directional", "direction": direction.tolist(), "irradiance": irradiance}
    distance = 1000 * radius
    up = [0, 1, 0] if abs(direction[1]) < 0.9 else [1, 0, 0]
    look = mi.ScalarTransform4f().look_at((center - direction * distance).tolist(), center.tolist(), up)
    size = distance * math.tan(half)
    return {
        "type": "disk",
        "to_world": look @ mi.ScalarTransform4f().scale([size, size, 1]),
        **_emits(radiance),
    }


def _environment(texels: NDArray, radiance: NDArray, rotation: NDArray) -> dict:
    """A latlong dome.  Mitsuba puts the first and last row on the poles; texels are centres of cells."""
    image = texels[..., :3].astype(np.float64) * radiance
    rows = image.shape[0]
    y = np.clip(np.arange(2 * rows + 1) / 2 - 0.5, 0, rows - 1)
    first = np.minimum(y.astype(int), rows - 2)
    weight = (y - first)[:, None, None]
    image = image[first] * (1 - weight) + image[first + 1] * weight
    to_world = np.eye(4)
    to_world[:3, :3] = rotation
    bitmap = mi.Bitmap(np.ascontiguousarray(image, np.float32))
    return {"type": "envmap", "bitmap": bitmap, "to_world": mi.ScalarTransform4f(to_world)}
