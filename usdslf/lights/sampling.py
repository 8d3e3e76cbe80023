"""One UsdLux light seen from points: drawing directions towards it, meeting it with rays.

Radiance follows UsdLux: `Light.radiance` is what the light emits; shaping multiplies it by

    off axis  a = angle(emission, -Z);  cone c = cone_angle, start s = c (1 - cone_softness)
    cone      1 - smoothstep(a, s, c)          (a hard edge where softness is 0)
    focus     f = |cos a|^focus;  lerp(f, focus_tint, white)

for every kind of light.  A cone of exactly 90 degrees without softness is the unauthored default and cuts
nothing; 180 and above never does.  A rect's texture is upright for whom it shines on: its first pixel is
at (+X, +Y).
Rect and disk shine along -Z only, spheres and cylinders outward only (inside them is dark).

Shapes are sampled in the light's frame, where a transform A makes them ellipses, ellipsoids and
sheared rects: a local direction w becomes A w / |A w|, and a solid angle grows by |det A| / |A w|^3.

`Light.diffuse` and `Light.specular` are not applied by `sample_light` and `intersect_light`: whoever
shades knows which of them it needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color, color_of
from usdslf.lights import shapes
from usdslf.scene.records import F32, F64, Light, LightTexture
from usdslf.textures.files import stamp_of
from usdslf.textures.images import load_latlong

if TYPE_CHECKING:
    from collections.abc import Callable

PARALLEL = 1e-6  # a distant light's angle [rad] below which its rays are parallel


@dataclass(frozen=True)
class LightSample:
    """A direction towards a light from each of n points.

    Estimate of reflected light: f cos radiance / pdf.  Where `pdf` is 0 the light is not seen from the
    point: radiance is 0 too, and direction and distance mean nothing.  With `delta` the light comes from this
    one direction: `radiance` is the irradiance on a surface that faces it, and `pdf` is 1.
    """

    direction: F32  # (n, 3) unit, towards the light
    distance: F32  # (n,) inf for distant lights
    radiance: F32  # (n, 3)
    pdf: F32  # (n,) [1/sr]
    delta: bool = False


class LightHit(NamedTuple):
    """Where n rays meet a light; the density is that of `sample_light` for the same direction."""

    distance: F32  # (n,) inf where missed
    radiance: F32  # (n, 3)
    pdf: F32  # (n,) [1/sr]


def is_delta(light: Light) -> bool:
    """Tells whether all light comes from one direction, so that rays never meet the light."""
    return (light.kind == "sphere" and light.treat_as_point) or (
        light.kind == "distant" and light.angle < PARALLEL
    )


def sample_light(light: Light, points: NDArray, u: NDArray) -> LightSample:
    """Draws a direction to a light from each point.

    Rects are sampled uniformly in solid angle, spheres and distant lights in their cone, disks and
    cylinders nearly so (see light_shapes.py).

    Args:
        light: any kind but dome (see `Dome.sample`).
        points: (n, 3) world space.
        u: (n, 2) in [0, 1).
    """
    u = np.asarray(u, np.float64)
    axis = _axis(light)
    if light.kind == "distant":
        return _sample_distant(light, len(u), u, axis)
    if light.treat_as_point and light.kind == "sphere":
        return _sample_point(light, np.asarray(points, np.float64), axis)
    frame = light_frame(light)
    if frame is None:
        return LightSample(*_unseen(len(u)))
    p = frame.local_points(points)
    w, local_distance, local_pdf = frame.sample(p, u, *frame.size)
    seen = local_pdf > 0
    direction, length = frame.linear @ w, np.ones(len(u))
    if not frame.is_rigid:
        length = np.sqrt(np.einsum("in,in->n", direction, direction))
        direction /= length
    pdf = local_pdf * length**3 / frame.volume
    with np.errstate(invalid="ignore"):
        radiance = _emission(light, frame, p, w, local_distance, direction, axis)
    radiance = np.where(seen, radiance, 0)
    return LightSample(
        np.ascontiguousarray(direction.T, np.float32),
        np.where(seen, local_distance * length, np.inf).astype(np.float32),
        np.ascontiguousarray(radiance.T, np.float32),
        pdf.astype(np.float32),
    )


def intersect_light(light: Light, origins: NDArray, directions: NDArray) -> LightHit:
    """Meets a light with rays: the inverse of `sample_light`.  Delta lights and domes are never met.

    Args:
        light: of any kind.
        origins: (n, 3) world space.
        directions: (n, 3) unit.
    """
    d = np.asarray(directions, np.float64).T
    n = d.shape[1]
    frame = None if light.kind in ("distant", "dome") else light_frame(light)
    if light.kind == "distant" and not is_delta(light):
        axis = _axis(light)
        off = d + axis[:, None]  # towards the light is -axis
        one_minus_cos = _cone_of(light)
        seen = np.einsum("in,in->n", off, off) <= 2 * one_minus_cos
        radiance = np.where(seen, _shaped(light, d, axis), 0)
        return LightHit(
            np.full(n, np.inf, np.float32),
            np.ascontiguousarray(radiance.T, np.float32),
            np.where(seen, 1 / (2 * np.pi * one_minus_cos), 0).astype(np.float32),
        )
    if frame is None or is_delta(light):
        return LightHit(*_unseen(n)[1:])
    p = frame.local_points(origins)
    w, stretch = frame.inverse @ d, np.ones(n)
    if not frame.is_rigid:
        stretch = 1 / np.sqrt(np.einsum("in,in->n", w, w))  # |A w| of the unit w
        w = w * stretch
    _, local_distance, local_pdf = frame.meet(p, w, *frame.size)
    seen = local_pdf > 0
    with np.errstate(invalid="ignore"):
        radiance = _emission(light, frame, p, w, local_distance, d, _axis(light))
    return LightHit(
        np.where(seen, local_distance * stretch, np.inf).astype(np.float32),
        np.ascontiguousarray(np.where(seen, radiance, 0).T, np.float32),
        (local_pdf * stretch**3 / frame.volume).astype(np.float32),
    )


# ── frames ───────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class LightFrame:
    """A light's shape and the linear map that takes it to the world."""

    linear: F64  # (3, 3) world from local
    inverse: F64
    centre: F64  # (3,)
    volume: float  # |det linear|
    is_rigid: bool
    size: tuple[float, ...]  # rect: width, height; cylinder: radius, length; else: radius
    sample: Callable[..., shapes.ShapeSample]  # (p, u, *size)
    meet: Callable[..., shapes.ShapeSample]  # (p, w, *size)

    def local_points(self, points: NDArray) -> F64:
        return self.inverse @ (np.asarray(points, np.float64) - self.centre).T


def light_frame(light: Light) -> LightFrame | None:
    """The frame of an area light; None where it has no area.

    Flat lights get a frame of unit columns, so that their scale goes into their size and only shear and, for
    disks, uneven scale are left to the map.  Their third column is the normal, on the side of +Z.
    """
    m = np.asarray(light.world_from_light, np.float64)
    a = m[:3, :3]
    size: tuple[float, ...]
    if light.kind in ("rect", "disk"):
        normal = np.cross(a[:, 0], a[:, 1])
        area = float(np.linalg.norm(normal))
        if not area > 0:
            return None
        normal *= (-1 if normal @ a[:, 2] < 0 else 1) / area
        x, y = np.linalg.norm(a[:, :2], axis=0) if light.kind == "rect" else np.full(2, np.sqrt(area))
        a = np.stack([a[:, 0] / x, a[:, 1] / y, normal], 1)
        size = (light.width * x, light.height * y) if light.kind == "rect" else (light.radius * x,)
    else:
        assert light.kind in ("sphere", "cylinder"), light.kind
        scale = abs(float(np.linalg.det(a))) ** (1 / 3)
        if not scale > 0:
            return None
        a = a / scale
        size = (light.radius * scale, light.length * scale)[: 1 + (light.kind == "cylinder")]
    if min(size) <= 0 or not (np.isfinite(a).all() and np.isfinite(size).all()):
        return None
    draw, meet = _SHAPES[light.kind]
    is_rigid = bool(np.abs(a.T @ a - np.eye(3)).max() < 1e-9)
    size = tuple(float(s) for s in size)
    return LightFrame(a, np.linalg.inv(a), m[:3, 3], abs(float(np.linalg.det(a))), is_rigid, size, draw, meet)


_SHAPES: dict[str, tuple[Callable[..., shapes.ShapeSample], Callable[..., shapes.ShapeSample]]] = {
    "rect": (shapes.sample_rect, shapes.meet_rect),
    "disk": (shapes.sample_disk, shapes.meet_disk),
    "sphere": (shapes.sample_sphere, shapes.meet_sphere),
    "cylinder": (shapes.sample_cylinder, shapes.meet_cylinder),
}


def _axis(light: Light) -> F64:
    """World direction (3,) of the light's -Z."""
    z = -np.asarray(light.world_from_light, np.float64)[:3, 2]
    length = np.linalg.norm(z)
    return z / length if length > 0 else np.array([0.0, 0.0, -1.0])


def _unseen(n: int) -> tuple[F32, F32, F32, F32]:
    up = np.zeros((n, 3), np.float32)
    up[:, 2] = 1
    return up, np.full(n, np.inf, np.float32), np.zeros((n, 3), np.float32), np.zeros(n, np.float32)


# ── emission ─────────────────────────────────────────────────────────────────────────────────────


def _emission(light: Light, frame: LightFrame, p: F64, w: F64, distance: F64, direction: F64, axis: F64) -> F64:
    """Radiance (3, n) that leaves the light against world directions (3, n), without visibility."""
    out = _shaped(light, direction, axis)
    if light.kind == "rect" and light.texture:
        pixels = light_picture(light.texture)
        q = p[:2] + np.where(np.isfinite(distance), distance, 0) * w[:2]
        out = out * _read_picture(pixels, 0.5 - q[0] / frame.size[0], 0.5 - q[1] / frame.size[1])
    return out


def shaping_of(light: Light) -> tuple[F64, tuple[float, float] | None, float]:
    """Returns the axis (3,) along which a light shines, its cone and its focus.

    The cone: angles off the axis [rad] from which on there is no light, and from which on it fades; None: no cone.
    """
    softness = min(max(light.cone_softness, 0.0), 1.0)
    has_cone = light.cone_angle < 180 and not (light.cone_angle == 90 and softness == 0)
    cutoff = float(np.radians(max(light.cone_angle, 0.0)))
    return _axis(light), (cutoff, cutoff * (1 - softness)) if has_cone else None, light.focus


def _shaped(light: Light, direction: F64, axis: F64) -> F64:
    """Radiance (3, n) or (3, 1) of the light after shaping, seen along `direction` (3, n)."""
    out = np.asarray(light.radiance, np.float64)[:, None]
    _, cone, focus = shaping_of(light)
    if cone is None and focus <= 0:
        return out
    cos = np.clip(-(axis @ direction), -1, 1)
    if cone is not None:
        off, (cutoff, start) = np.arccos(cos), cone
        if cutoff > start:
            t = np.clip((off - start) / (cutoff - start), 0, 1)
            out = out * (1 - t * t * (3 - 2 * t))
        else:
            out = out * (off <= cutoff)
    if focus > 0:
        tint = np.asarray(light.focus_tint, np.float64)[:, None]
        out = out * (tint + (1 - tint) * np.abs(cos) ** focus)
    return out


def light_picture(texture: LightTexture) -> F32:
    """The picture (H, W, 3) of a rect light, read again when its file or its OpenColorIO config has changed."""
    return _read_rect(texture, stamp_of(texture.path), color_of(texture.ocio, texture.working_space))


@lru_cache(maxsize=8)
def _read_rect(texture: LightTexture, stamp: tuple[int, int], color: Color) -> F32:
    return load_latlong(texture.path, "latlong", texture.color_space, color)


def _read_picture(pixels: F32, s: F64, t: F64) -> F64:
    """Reads pixels (H, W, 3) bilinearly at s from the left and t from the top, both 0..1: (3, n)."""
    height, width = pixels.shape[:2]
    x, y = np.clip(s * width - 0.5, 0, width - 1), np.clip(t * height - 0.5, 0, height - 1)
    i, j = x.astype(np.int64), y.astype(np.int64)
    i1, j1 = np.minimum(i + 1, width - 1), np.minimum(j + 1, height - 1)
    fx, fy = (x - i)[:, None], (y - j)[:, None]
    upper = pixels[j, i] * (1 - fx) + pixels[j, i1] * fx
    lower = pixels[j1, i] * (1 - fx) + pixels[j1, i1] * fx
    return (upper * (1 - fy) + lower * fy).T


# ── lights without a surface ─────────────────────────────────────────────────────────────────────


def _cone_of(light: Light) -> float:
    """1 - cos of the half angle of a distant light; the angle is limited to 360 degrees."""
    return float(2 * np.sin(min(light.angle, 2 * np.pi) / 4) ** 2)


def _sample_distant(light: Light, n: int, u: F64, axis: F64) -> LightSample:
    towards = np.broadcast_to(-axis[:, None], (3, n))
    if is_delta(light):
        # Parallel rays: radiance is the irradiance they bring, which for a tiny angle is its cone's.
        cone = np.pi * np.sin(light.angle / 2) ** 2 if light.angle > 0 else 1.0
        direction, radiance, pdf = towards, cone * _shaped(light, towards, axis), np.ones(n)
    else:
        one_minus_cos = _cone_of(light)
        direction = shapes.sample_cone(towards, one_minus_cos, u)
        radiance = _shaped(light, direction, axis)
        pdf = np.full(n, 1 / (2 * np.pi * one_minus_cos))
    return LightSample(
        np.ascontiguousarray(direction.T, np.float32),
        np.full(n, np.inf, np.float32),
        np.ascontiguousarray(np.broadcast_to(radiance, (3, n)).T, np.float32),
        pdf.astype(np.float32),
        is_delta(light),
    )


def _sample_point(light: Light, points: F64, axis: F64) -> LightSample:
    """A sphere taken as a point: its intensity is radiance x projected area, pi r^2 |det A| |A^-1 w|."""
    m = np.asarray(light.world_from_light, np.float64)
    to = (m[:3, 3] - points).T
    d2 = np.einsum("in,in->n", to, to)
    seen = d2 > 0
    distance = np.sqrt(np.where(seen, d2, 1))
    direction = np.where(seen, to / distance, np.array([[0.0], [0.0], [1.0]]))
    det = abs(float(np.linalg.det(m[:3, :3])))
    if det > 0:
        across = np.linalg.norm(np.linalg.inv(m[:3, :3]) @ direction, axis=0) * det
    else:
        across = np.zeros(len(d2))
    factor = np.where(seen, np.pi * light.radius**2 * across / distance**2, 0)
    return LightSample(
        np.ascontiguousarray(direction.T, np.float32),
        np.where(seen, distance, np.inf).astype(np.float32),
        np.ascontiguousarray((factor * _shaped(light, direction, axis)).T, np.float32),
        seen.astype(np.float32),
        True,
    )
