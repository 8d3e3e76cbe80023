"""Irradiance of lights in textbook form, float64, one point at a time.

Every function is for radiance 1; `normal` is a unit vector.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def clip_above(corners: NDArray, point: NDArray, normal: NDArray) -> NDArray:
    """The part of a convex polygon (k, 3) above the horizon of a point."""
    out = []
    height = (corners - point) @ normal
    for i in range(len(corners)):
        a, b, ha, hb = corners[i], corners[(i + 1) % len(corners)], height[i], height[(i + 1) % len(corners)]
        if ha >= 0:
            out.append(a)
        if ha * hb < 0:
            out.append(a + (b - a) * ha / (ha - hb))
    return np.array(out)


def polygon_irradiance(corners: ArrayLike, point: ArrayLike, normal: ArrayLike) -> float:
    """Lambert 1760: the sum over the edges of the angle times the cosine of the edge's plane, halved."""
    point, normal = np.asarray(point, float), np.asarray(normal, float)
    v = clip_above(np.asarray(corners, float), point, normal)
    if len(v) < 3:
        return 0.0
    v = v - point
    v /= np.linalg.norm(v, axis=1)[:, None]
    total = 0.0
    for a, b in zip(v, np.roll(v, -1, 0)):
        cross = np.cross(a, b)
        sine = np.linalg.norm(cross)
        if sine > 0:
            total += math.atan2(sine, a @ b) * (cross @ normal) / sine
    return abs(total) / 2


def polygon_solid_angle(corners: ArrayLike, point: ArrayLike) -> float:
    """Van Oosterom and Strackee 1983, triangle by triangle of a fan."""
    v = np.asarray(corners, float) - np.asarray(point, float)
    v /= np.linalg.norm(v, axis=1)[:, None]
    total = 0.0
    a = v[0]
    for b, c in pairwise(v[1:]):
        total += 2 * math.atan2(a @ np.cross(b, c), 1 + a @ b + b @ c + c @ a)
    return abs(total)


def disk_irradiance(radius: float, height: float, offset: float) -> float:
    """A disk seen from a parallel plane `height` away, `offset` off its axis (Howell's catalogue, B-13)."""
    h2, a2, r2 = height**2, offset**2, radius**2
    return math.pi / 2 * (1 - (h2 + a2 - r2) / math.sqrt((h2 + a2 + r2) ** 2 - 4 * a2 * r2))


def sphere_irradiance(radius: float, distance: float, cos: float) -> float:
    """A sphere wholly above the horizon."""
    return math.pi * (radius / distance) ** 2 * cos


def cone_irradiance(half_angle: float, cos: float) -> float:
    """A cone of directions wholly above the horizon, its axis `cos` off the normal."""
    return math.pi * math.sin(half_angle) ** 2 * cos


def cylinder_irradiance(
    radius: float, length: float, point: ArrayLike, normal: ArrayLike, steps: int = 300
) -> float:
    """The outside of a cylinder along x around the origin, by the midpoint rule over its surface."""
    point, normal = np.asarray(point, float), np.asarray(normal, float)
    phi = 2 * np.pi * (np.arange(steps) + 0.5) / steps
    x = length * ((np.arange(steps) + 0.5) / steps - 0.5)
    x, phi = np.meshgrid(x, phi)
    outward = np.stack([np.zeros_like(x), np.cos(phi), np.sin(phi)], -1)
    at = radius * outward + np.stack([x, np.zeros_like(x), np.zeros_like(x)], -1)
    to = at - point
    d2 = (to**2).sum(-1)
    w = to / np.sqrt(d2)[..., None]
    seen = np.maximum(w @ normal, 0) * np.maximum(-(w * outward).sum(-1), 0) / d2
    return float(seen.sum() * radius * (2 * np.pi / steps) * (length / steps))


def gradient_irradiance(slope: ArrayLike, normal: ArrayLike) -> float:
    """An environment of radiance 1 + slope . w: pi (1 + 2/3 slope . n)."""
    return math.pi * (1 + 2 / 3 * float(np.dot(slope, normal)))


def shaping(
    off_axis: float,
    cone_angle: float,
    cone_softness: float,
    focus: float,
    focus_tint: ArrayLike,
) -> NDArray:
    """Factor (3,) of UsdLux ShapingAPI at an angle [rad] off the axis, as its schema states it."""
    cutoff = math.radians(cone_angle)
    start = cutoff + (0 - cutoff) * cone_softness
    if off_axis > cutoff:
        cone = 0.0
    elif off_axis <= start:
        cone = 1.0
    else:
        t = (off_axis - start) / (cutoff - start)
        cone = 1 - t * t * (3 - 2 * t)
    factor = abs(math.cos(off_axis)) ** focus
    tint = np.asarray(focus_tint, float)
    return cone * (tint + (1 - tint) * factor)


def latlong_direction(row: ArrayLike, column: ArrayLike, height: int, width: int) -> NDArray:
    """Directions (., 3) of places in a latlong picture.

    Row 0 is latitude +90, column 0 longitude +180; longitude 0 is +Z, longitude 90 is +X (UsdLux).
    """
    latitude, longitude = np.broadcast_arrays(
        np.radians(90 - 180 * np.asarray(row, float) / height),
        np.radians(180 - 360 * np.asarray(column, float) / width),
    )
    across = np.cos(latitude)
    return np.stack([across * np.sin(longitude), np.sin(latitude), across * np.cos(longitude)], -1)


def fibonacci_cone(count: int, half_angle: float = math.pi) -> tuple[NDArray, float]:
    """Even directions (count, 3) of a cone around +Z (all of the sphere: pi), and the solid angle of each."""
    i = np.arange(count) + 0.5
    height = 1 - math.cos(half_angle)
    z = 1 - height * i / count
    phi = i * math.pi * (3 - math.sqrt(5))
    s = np.sqrt(np.maximum(1 - z * z, 0))
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], 1), 2 * math.pi * height / count


def shape_points(light: Any, steps: int = 40) -> tuple[NDArray, NDArray]:
    """Points (n, 3) of a rect, disk, sphere or cylinder in the world, and outward normals (n, 3) as long as areas.

    By the midpoint rule over each shape's own two parameters, tangents by the light's matrix.
    """
    s, t = (x.reshape(-1, 1) for x in np.meshgrid(*[(np.arange(steps) + 0.5) / steps] * 2))
    one, none = np.ones_like(s), np.zeros_like(s)
    turn, radius = 2 * np.pi * t, light.radius
    if light.kind == "rect":
        at = light.width * (s - 0.5), light.height * (t - 0.5), none
        ds, dt = (light.width, 0, 0), (0, -light.height, 0)
    elif light.kind == "disk":
        at = radius * s * np.cos(turn), radius * s * np.sin(turn), none
        ds = radius * np.cos(turn), radius * np.sin(turn), none
        dt = 2 * np.pi * radius * s * np.sin(turn), -2 * np.pi * radius * s * np.cos(turn), none
    elif light.kind == "sphere":
        up = np.pi * s
        at = radius * np.sin(up) * np.cos(turn), radius * np.sin(up) * np.sin(turn), radius * np.cos(up)
        ds = tuple(np.pi * radius * x for x in (np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), -np.sin(up)))
        dt = -2 * np.pi * at[1], 2 * np.pi * at[0], none
    else:
        at = light.length * (s - 0.5), radius * np.cos(turn), radius * np.sin(turn)
        ds, dt = (-light.length, 0, 0), (none, -2 * np.pi * at[2], 2 * np.pi * at[1])
    frame = np.asarray(light.world_from_light, float)
    place, ds, dt = (np.concatenate([x * one for x in v], 1) for v in (at, ds, dt))
    normal = np.cross(ds @ frame[:3, :3].T, dt @ frame[:3, :3].T) / steps**2
    return place @ frame[:3, :3].T + frame[:3, 3], normal
