"""Implicit surfaces -> polygons with exact normals: sphere, cube, cylinder, cone, capsule, plane.

Round ones are profiles turned about an axis.  Points lie on the surface and normals are those of the
surface, so that a sphere shades like a sphere; its outline is short of the true one by 0.05 % of the radius.
"""

from __future__ import annotations

import math

import numpy as np

from usdslf.geometry.shape import Polygons, Values
from usdslf.scene.records import F64

AROUND = 96  # segments of a full turn


def sphere(radius: float) -> Polygons:
    """A sphere about the origin, poles on Z."""
    angle = np.linspace(-math.pi / 2, math.pi / 2, AROUND // 2 + 1)
    return _turned([(radius * _arc(angle), _arc(angle))])


def cylinder(bottom: float, top: float, height: float) -> Polygons:
    """A closed cylinder along Z, its middle at the origin; a radius of zero makes a cone."""
    h = height / 2
    side = np.array([[bottom, -h], [top, h]])
    out = np.array([height, bottom - top])
    parts = [(side, np.tile(out / max(np.hypot(*out), 1e-300), (2, 1)))]
    if bottom > 0:
        parts.insert(0, (np.array([[0.0, -h], [bottom, -h]]), np.array([[0.0, -1.0]] * 2)))
    if top > 0:
        parts.append((np.array([[top, h], [0.0, h]]), np.array([[0.0, 1.0]] * 2)))
    return _turned(parts)


def cone(radius: float, height: float) -> Polygons:
    """A closed cone along Z, tip at +height/2."""
    return cylinder(radius, 0.0, height)


def capsule(bottom: float, top: float, height: float) -> Polygons:
    """A capsule along Z: a tube of `height` and the spheres that are tangent to it at its ends.

    Source: the drawing in OpenUSD's geomUtil for different radii.
    """
    slope = (bottom - top) / height if height > 0 else 0.0
    turn = math.atan(slope)
    ends = []
    for radius, z, low, high in (
        (bottom, -height / 2, -math.pi / 2, turn),
        (top, height / 2, turn, math.pi / 2),
    ):
        count = max(2, round(AROUND / 2 * (high - low) / math.pi))
        arc = _arc(np.linspace(low, high, count + 1))
        ends.append((radius * math.hypot(1, slope) * arc + [0.0, z - slope * radius], arc))
    return _turned([(np.concatenate([p for p, _ in ends]), np.concatenate([n for _, n in ends]))])


def cube(size: float) -> Polygons:
    """A cube about the origin."""
    s = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]) * size / 2
    faces = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
    return Polygons(s, np.full(6, 4), np.array(faces), np.arange(6))


def plane(width: float, length: float) -> Polygons:
    """A rectangle that faces +Z, `width` along X and `length` along Y."""
    s = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [width / 2, length / 2, 0]
    return Polygons(s, np.array([4]), np.arange(4), np.arange(1))


def along(polygons: Polygons, axis: str) -> Polygons:
    """The same polygons with their Z on another axis, X and Y on the two that follow it."""
    shift = {"X": 1, "Y": 2, "Z": 0}[axis]
    normals = polygons.normals
    if normals is not None:
        normals = Values(normals.interpolation, np.roll(normals.values, shift, axis=1), normals.indices)
    return Polygons(
        np.roll(polygons.points, shift, axis=1),
        polygons.counts,
        polygons.indices,
        polygons.face,
        left_handed=polygons.left_handed,
        normals=normals,
    )


def _arc(latitude: F64) -> F64:
    """Points (n, 2), distance from the axis and height, of the unit circle."""
    out = np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
    return np.where(np.abs(out) < 1e-15, 0.0, out)


def _turned(parts: list[tuple[F64, F64]]) -> Polygons:
    """Turns profiles (n, 2), distance from the axis and height with their normals, about Z.

    Each profile runs from low to high with the outside at its right; profiles share no points.  Points on
    the axis are given once for each segment, so that every segment has its own normal there.
    """
    points, normals, faces, base = [], [], [], 0
    turn = 2 * math.pi * np.arange(AROUND) / AROUND
    for profile, normal in parts:
        n = len(profile)
        at_tip = (profile[:, 0] == 0)[:, None]
        angle = np.where(at_tip, turn + math.pi / AROUND, turn)  # (n, A); tips look between their neighbours
        points.append(_around(profile, np.broadcast_to(turn, angle.shape)))
        normals.append(_around(normal, angle))
        i, j = np.meshgrid(np.arange(n - 1), np.arange(AROUND), indexing="ij")
        k = (j + 1) % AROUND
        low, high = base + i * AROUND, base + (i + 1) * AROUND
        quads = np.stack([low + j, low + k, high + k, high + j], axis=2).reshape(-1, 4)
        faces.append(quads)
        base += n * AROUND
    p, quads = np.concatenate(points), np.concatenate(faces)
    indices, counts = _without_tips(p, quads)
    return Polygons(
        p, counts, indices, np.arange(len(counts)), normals=Values("vertex", np.concatenate(normals))
    )


def _around(rz: F64, angle: F64) -> F64:
    """Turns (n, 2) by angles (n, A) -> (n A, 3)."""
    r, z = rz[:, :1], rz[:, 1:]
    return np.stack([r * np.cos(angle), r * np.sin(angle), z + 0 * angle], axis=2).reshape(-1, 3)


def _without_tips(points: F64, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quads (n, 4) with an edge on the axis lose one of its two equal corners; indices, counts."""
    keep = np.ones(quads.shape, bool)
    keep[:, 1] = (points[quads[:, 0]] != points[quads[:, 1]]).any(1)
    keep[:, 2] = (points[quads[:, 2]] != points[quads[:, 3]]).any(1)
    # The tip that stays must be the one of this segment: corner 0 below, corner 3 above.
    return quads[keep], keep.sum(1)
