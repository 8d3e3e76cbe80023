"""Light shapes in their own frame: drawing directions towards them, and meeting them with rays.

All functions are in the light's local frame, where UsdLux describes the shape: rect and disk in the
plane z = 0 shining towards -z, the cylinder along x, everything centred at the origin.  Arrays are
(3, n) float64 (one row a coordinate), densities are in local solid angle.  `sample_*` and `meet_*`
are exact inverses: both return the same density for the same direction.  A density of 0 means that
nothing of the light is seen.

Each sampler is (nearly) uniform in solid angle, so that a point close to the light gets as little
noise as one far away.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usdslf.sampling.frames import tangents

F64 = NDArray[np.float64]
Bool = NDArray[np.bool_]

SMALL_RECT = 1e-6  # solid angle [sr] below which the spherical rectangle loses digits: sample its area


class ShapeSample(NamedTuple):
    """Directions from n points to a shape, in the shape's frame."""

    direction: F64  # (3, n) unit
    distance: F64  # (n,) inf where missed
    pdf: F64  # (n,) [1/sr]; 0 where nothing is seen


def concentric_disk(u: F64) -> tuple[F64, F64]:
    """Maps (n, 2) of the unit square to x, y of the unit disk, keeping areas (Shirley and Chiu 1997)."""
    a, b = 2 * u[:, 0] - 1, 2 * u[:, 1] - 1
    wide = np.abs(a) > np.abs(b)
    r = np.where(wide, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        phi = np.where(wide, np.pi / 4 * (b / a), np.pi / 2 - np.pi / 4 * (a / b))
    phi = np.where(r == 0, 0.0, phi)
    return r * np.cos(phi), r * np.sin(phi)


def sample_cone(axis: F64, one_minus_cos: F64 | float, u: F64) -> F64:
    """Draws directions (3, n) uniform in solid angle from cones around `axis` (3, n)."""
    k = u[:, 0] * one_minus_cos  # 1 - cos of the angle off the axis
    sin = np.sqrt(np.maximum(k * (2 - k), 0))
    phi = 2 * np.pi * u[:, 1]
    s, t = tangents(axis)
    return s * (sin * np.cos(phi)) + t * (sin * np.sin(phi)) + axis * (1 - k)


# ── sphere ───────────────────────────────────────────────────────────────────────────────────────


def _sphere_cone(p: F64, radius: float) -> tuple[F64, F64]:
    """Distance to the centre, and 1 - cos of the cone that the sphere fills; 0 inside."""
    d = np.sqrt(np.einsum("in,in->n", p, p))
    s2 = (radius / np.maximum(d, 1e-300)) ** 2
    return d, np.where(s2 < 1, s2 / (1 + np.sqrt(np.maximum(1 - s2, 0))), 0.0)


def sample_sphere(p: F64, u: F64, radius: float) -> ShapeSample:
    """Draws from the cone that the sphere fills.  Light leaves a sphere outward: inside, nothing is seen."""
    d, one_minus_cos = _sphere_cone(p, radius)
    seen = one_minus_cos > 0
    axis = np.where(seen, -p / np.maximum(d, 1e-300), np.array([[0.0], [0.0], [1.0]]))
    w = sample_cone(axis, one_minus_cos, u)
    k = u[:, 0] * one_minus_cos
    distance = d * (1 - k) - np.sqrt(np.maximum(radius**2 - d * d * k * (2 - k), 0))
    pdf = np.where(seen, 1 / (2 * np.pi * np.where(seen, one_minus_cos, 1)), 0.0)
    return ShapeSample(w, np.where(seen, distance, np.inf), pdf)


def meet_sphere(p: F64, w: F64, radius: float) -> ShapeSample:
    """Meets the sphere from outside with rays p + t w."""
    _, one_minus_cos = _sphere_cone(p, radius)
    along = -np.einsum("in,in->n", p, w)
    off = p + along * w
    inside = radius**2 - np.einsum("in,in->n", off, off)
    seen = (one_minus_cos > 0) & (along > 0) & (inside >= 0)
    distance = np.where(seen, along - np.sqrt(np.maximum(inside, 0)), np.inf)
    return ShapeSample(w, distance, np.where(seen, 1 / (2 * np.pi * np.where(seen, one_minus_cos, 1)), 0.0))


# ── rect ─────────────────────────────────────────────────────────────────────────────────────────


def _rect_angles(x0: F64, x1: F64, y0: F64, y1: F64, h: F64) -> tuple[F64, F64, F64, F64]:
    """The spherical rectangle [x0, x1] x [y0, y1] at height h: solid angle S, k, b0, b1 of Urena 2013."""
    rx0, rx1, ry0, ry1 = np.hypot(x0, h), np.hypot(x1, h), np.hypot(y0, h), np.hypot(y1, h)
    g0 = np.arccos(np.clip(y0 * x1 / (ry0 * rx1), -1, 1))
    g1 = np.arccos(np.clip(-x1 * y1 / (rx1 * ry1), -1, 1))
    g2 = np.arccos(np.clip(x0 * y1 / (ry1 * rx0), -1, 1))
    g3 = np.arccos(np.clip(-x0 * y0 / (rx0 * ry0), -1, 1))
    k = 2 * np.pi - g2 - g3
    return g0 + g1 - k, k, -y0 / ry0, y1 / ry1


def sample_rect(p: F64, u: F64, width: float, height: float) -> ShapeSample:
    """Draws uniformly from the solid angle of a rectangle.

    Source: Urena, Fajardo and King 2013, "An area-preserving parametrization for spherical rectangles".
    Below `SMALL_RECT` the area is sampled instead, which is then the same thing.
    """
    front = p[2] < 0
    h = np.where(front, -p[2], 1.0)
    x0, x1, y0, y1 = -width / 2 - p[0], width / 2 - p[0], -height / 2 - p[1], height / 2 - p[1]
    s, k, b0, b1 = _rect_angles(x0, x1, y0, y1, h)

    # Column: the strip [x0, x] holds the share u0 of the solid angle.
    with np.errstate(divide="ignore", invalid="ignore"):
        au = u[:, 0] * s + k
        fu = (np.cos(au) * b0 - b1) / np.sin(au)
        x = np.where(fu > 0, h, -h) / np.sqrt(np.maximum(fu * fu + b0 * b0 - 1, 0))
    x = np.clip(np.nan_to_num(x, nan=0.0), x0, x1)

    # Row: within a column, the sine of the elevation is uniform.
    d2 = x * x + h * h
    h0, h1 = y0 / np.sqrt(d2 + y0 * y0), y1 / np.sqrt(d2 + y1 * y1)
    hv = h0 + u[:, 1] * (h1 - h0)
    y = np.clip(hv * np.sqrt(d2 / np.maximum(1 - hv * hv, 1e-300)), y0, y1)

    small = s < SMALL_RECT
    x = np.where(small, x0 + u[:, 0] * width, x)
    y = np.where(small, y0 + u[:, 1] * height, y)
    distance = np.sqrt(x * x + y * y + h * h)
    pdf = np.where(small, distance**3 / (width * height * h), 1 / np.where(small, 1.0, s))
    w = np.stack([x, y, h]) / distance
    return ShapeSample(w, np.where(front, distance, np.inf), np.where(front, pdf, 0.0))


def meet_rect(p: F64, w: F64, width: float, height: float) -> ShapeSample:
    """Meets the shining side of the rectangle with rays p + t w."""
    seen = (p[2] < 0) & (w[2] > 0)
    h = np.where(seen, -p[2], 1.0)
    distance = h / np.where(seen, w[2], 1.0)
    q = p + distance * w
    seen &= (np.abs(q[0]) <= width / 2) & (np.abs(q[1]) <= height / 2)
    s, *_ = _rect_angles(-width / 2 - p[0], width / 2 - p[0], -height / 2 - p[1], height / 2 - p[1], h)
    small = s < SMALL_RECT
    pdf = np.where(small, distance**3 / (width * height * h), 1 / np.where(small, 1.0, s))
    return ShapeSample(w, np.where(seen, distance, np.inf), np.where(seen, pdf, 0.0))


# ── disk ─────────────────────────────────────────────────────────────────────────────────────────
# In polar coordinates (rho, phi) around the foot of the point, which is d from the centre, a wedge at
# phi reaches from rho_1 to rho_2 and has the solid angle W = h / r_1 - h / r_2 per radian.  Given phi,
# the cosine is uniform.  phi itself is that of a point uniform on the disk (right far away); above the
# disk it is mixed with a uniform one (right near the disk).


def _disk_wedge(p: F64, radius: float, cos: F64, sin: F64) -> tuple[F64, F64, F64]:
    """Density of phi (0 towards the centre), 1 - cos at the wedge's near end, and its solid angle W."""
    h, d = -p[2], np.hypot(p[0], p[1])
    above = d < radius
    root = np.sqrt(np.maximum(radius**2 - (d * sin) ** 2, 0))
    rho1 = np.where(above, 0.0, np.maximum(d * cos - root, 0))
    rho2 = np.maximum(d * cos + root, 0)
    area = np.where(above, rho2**2, 4 * np.maximum(d * cos, 0) * root)  # rho_2^2 - rho_1^2
    r1, r2 = np.hypot(rho1, h), np.hypot(rho2, h)
    wedge = h * area / (r1 * r2 * (r1 + r2))
    mix = np.where(above, 1 - h / np.hypot(h, radius), 0.0)
    density = (mix + (1 - mix) * area / radius**2) / (2 * np.pi)
    return density, rho1**2 / (r1 * (r1 + h)), wedge


def _disk_axis(p: F64) -> tuple[F64, F64]:
    """Unit vector (2,) from each point's foot to the centre."""
    d = np.hypot(p[0], p[1])
    away = d > 0
    safe = np.where(away, d, 1.0)
    return np.where(away, -p[0] / safe, 1.0), np.where(away, -p[1] / safe, 0.0)


def sample_disk(p: F64, u: F64, radius: float) -> ShapeSample:
    """Draws from a disk, nearly uniformly in solid angle (see above)."""
    front = p[2] < 0
    p = np.where(front, p, np.array([[0.0], [0.0], [-1.0]]))
    h, d = -p[2], np.hypot(p[0], p[1])
    above = d < radius
    mix = np.where(above, 1 - h / np.hypot(h, radius), 0.0)
    even = u[:, 0] < mix
    with np.errstate(divide="ignore", invalid="ignore"):
        u0 = np.where(even, u[:, 0] / mix, (u[:, 0] - mix) / (1 - mix))
    a, b = concentric_disk(np.stack([u0, u[:, 1]], 1))

    # phi, and v: which share of the wedge lies before the sample.
    x, y = d + radius * a, radius * b
    rho = np.hypot(x, y)
    turn = np.arctan2(y, x)
    beside = np.arcsin(np.clip(a * radius / np.maximum(d, radius), -1, 1))
    phi = np.where(even, 2 * np.pi * u0, np.where(above, turn, beside))
    cos, sin = np.cos(phi), np.sin(phi)
    reach = d * cos + np.sqrt(np.maximum(radius**2 - (d * sin) ** 2, 0))
    half = np.sqrt(np.maximum(1 - a * a, 1e-300))
    share = np.where(above, (rho / np.maximum(reach, 1e-300)) ** 2, 0.5 + 0.5 * b / half)
    v = np.clip(np.where(even, u[:, 1], share), 0, 1)

    density, near, wedge = _disk_wedge(p, radius, cos, sin)
    k = near + v * wedge  # 1 - cos
    across = np.sqrt(np.maximum(k * (2 - k), 0))
    ex, ey = _disk_axis(p)
    w = np.stack([(cos * ex - sin * ey) * across, (cos * ey + sin * ex) * across, 1 - k])
    seen = front & (wedge > 0) & (w[2] > 0)
    distance = np.where(seen, h / np.where(seen, w[2], 1.0), np.inf)
    return ShapeSample(w, distance, np.where(seen, density / np.where(seen, wedge, 1.0), 0.0))


def meet_disk(p: F64, w: F64, radius: float) -> ShapeSample:
    """Meets the shining side of the disk with rays p + t w."""
    seen = (p[2] < 0) & (w[2] > 0)
    p = np.where(seen, p, np.array([[0.0], [0.0], [-1.0]]))
    distance = -p[2] / np.where(seen, w[2], 1.0)
    q = p + distance * w
    seen &= q[0] ** 2 + q[1] ** 2 <= radius**2
    across = np.hypot(w[0], w[1])
    x, y = w[0] / np.maximum(across, 1e-300), w[1] / np.maximum(across, 1e-300)
    ex, ey = _disk_axis(p)
    upright = across == 0
    cos, sin = np.where(upright, 1.0, x * ex + y * ey), np.where(upright, 0.0, y * ex - x * ey)
    density, _, wedge = _disk_wedge(p, radius, cos, sin)
    seen &= wedge > 0
    pdf = np.where(seen, density / np.where(seen, wedge, 1.0), 0.0)
    return ShapeSample(w, np.where(seen, distance, np.inf), pdf)


# ── cylinder ─────────────────────────────────────────────────────────────────────────────────────
# Seen along its axis the cylinder is a circle that fills the angles [-alpha_max, alpha_max]; alpha is
# uniform in them.  In the half plane at alpha the near wall is a line at distance D, and the sine of the
# elevation is uniform between its ends, which is uniform in solid angle since d omega = d alpha d sin.


def _cylinder_wall(p: F64, radius: float, length: float, cos: F64, sin: F64) -> tuple[F64, F64, F64]:
    """Distance D of the near wall across the axis, and the sines of the elevations of its two ends."""
    rho = np.hypot(p[1], p[2])
    wall = rho * cos - np.sqrt(np.maximum(radius**2 - (rho * sin) ** 2, 0))
    a, b = -length / 2 - p[0], length / 2 - p[0]
    safe = np.maximum(wall, 1e-300)
    return wall, a / np.hypot(a, safe), b / np.hypot(b, safe)


def sample_cylinder(p: F64, u: F64, radius: float, length: float) -> ShapeSample:
    """Draws from the side of a cylinder that faces the point (no caps; light leaves outward)."""
    rho = np.hypot(p[1], p[2])
    seen = rho > radius
    safe = np.where(seen, rho, 2 * radius)
    ey, ez = np.where(seen, -p[1] / safe, 1.0), np.where(seen, -p[2] / safe, 0.0)
    p = np.where(seen, p, np.stack([np.zeros_like(rho), -safe, np.zeros_like(rho)]))
    limit = np.arcsin(radius / safe)
    alpha = (2 * u[:, 0] - 1) * limit
    cos, sin = np.cos(alpha), np.sin(alpha)
    wall, s0, s1 = _cylinder_wall(p, radius, length, cos, sin)
    up = s0 + u[:, 1] * (s1 - s0)
    flat = np.sqrt(np.maximum(1 - up * up, 0))
    w = np.stack([up, flat * (cos * ey - sin * ez), flat * (cos * ez + sin * ey)])
    seen &= (s1 > s0) & (flat > 0)
    distance = np.where(seen, wall / np.where(seen, flat, 1.0), np.inf)
    return ShapeSample(w, distance, np.where(seen, 1 / (2 * limit * np.where(seen, s1 - s0, 1.0)), 0.0))


def meet_cylinder(p: F64, w: F64, radius: float, length: float) -> ShapeSample:
    """Meets the outer side of the cylinder with rays p + t w."""
    rho, flat = np.hypot(p[1], p[2]), np.hypot(w[1], w[2])
    seen = (rho > radius) & (flat > 0)
    r, f = np.where(seen, rho, 1.0), np.where(seen, flat, 1.0)
    cos = -(p[1] * w[1] + p[2] * w[2]) / (r * f)
    sin = (p[2] * w[1] - p[1] * w[2]) / (r * f)
    seen &= (cos > 0) & (np.abs(sin) * r <= radius)
    wall, s0, s1 = _cylinder_wall(p, radius, length, cos, sin)
    distance = wall / f
    seen &= (np.abs(p[0] + distance * w[0]) <= length / 2) & (s1 > s0)
    limit = np.arcsin(np.clip(radius / r, -1, 1))
    pdf = np.where(seen, 1 / np.where(seen, 2 * limit * (s1 - s0), 1.0), 0.0)
    return ShapeSample(w, np.where(seen, distance, np.inf), pdf)
