"""Smooth polygon shapes for the demo scene: points, quads, normals and texture coordinates, no USD.

All shapes are closed and wound counter-clockwise seen from outside; +Y is up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class QuadMesh:
    """A polygon mesh of quads.  V points, F faces."""

    points: F64  # (V, 3)
    quads: NDArray[np.int32]  # (F, 4)
    normals: F64  # (V, 3) unit
    st: F64  # (V, 2)

    def moved(self, by: ArrayLike) -> QuadMesh:
        """Returns the shape translated by a vector (3,)."""
        return QuadMesh(self.points + np.asarray(by, np.float64), self.quads, self.normals, self.st)


def join(*shapes: QuadMesh) -> QuadMesh:
    """Puts shapes together as one mesh."""
    first = np.cumsum([0, *(len(s.points) for s in shapes[:-1])])
    return QuadMesh(
        np.concatenate([s.points for s in shapes]),
        np.concatenate([s.quads + f for s, f in zip(shapes, first)]).astype(np.int32),
        np.concatenate([s.normals for s in shapes]),
        np.concatenate([s.st for s in shapes]),
    )


def grid_quads(rows: int, columns: int) -> NDArray[np.int32]:
    """Returns the quads ((rows - 1) (columns - 1), 4) of a grid of points in row order."""
    i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    return np.stack([i, i + 1, i + columns + 1, i + columns], 1).astype(np.int32)


def curve(knots: ArrayLike, steps: int) -> F64:
    """Returns `steps` points of the Catmull-Rom curve through `knots` (k, dim), ends included."""
    p = np.asarray(knots, np.float64)
    p = np.concatenate([[2 * p[0] - p[1]], p, [2 * p[-1] - p[-2]]])
    t = np.linspace(0, len(p) - 3, steps)
    i = np.minimum(t.astype(int), len(p) - 4)
    t = (t - i)[:, None]
    a, b, c, d = p[i], p[i + 1], p[i + 2], p[i + 3]
    return 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)


def lathe(profile: F64, segments: int = 64) -> QuadMesh:
    """Turns a profile (k, 2) of (radius, height), listed bottom to top on its outer side, about the Y axis."""
    k = len(profile)
    tangent = np.gradient(profile, axis=0)
    across = np.stack([tangent[:, 1], -tangent[:, 0]], 1)  # points outwards when the profile runs upwards
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    turn = np.linspace(0, 2 * np.pi, segments + 1)
    c, s = np.cos(turn), np.sin(turn)

    def turned(r: F64, y: F64) -> F64:
        columns = np.broadcast_to(y[:, None], (k, segments + 1))
        return np.stack([r[:, None] * s, columns, r[:, None] * c], -1).reshape(-1, 3)

    run = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    v, u = np.meshgrid(run / run[-1], turn / (2 * np.pi), indexing="ij")
    points, normals = turned(*profile.T), turned(*across.T)
    return QuadMesh(points, grid_quads(k, segments + 1), normals, np.stack([u.ravel(), v.ravel()], 1))


def tube(path: F64, radius: ArrayLike, segments: int = 24) -> QuadMesh:
    """Sweeps a circle along a path (k, 3); `radius` is one number or (k,).  Its ends are open."""
    radius = np.broadcast_to(np.asarray(radius, np.float64), len(path))
    ahead = np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    # The frame is carried along (projected, not turned about the path), so that the tube does not twist.
    side = np.empty_like(path)
    start = np.eye(3)[np.argmin(np.abs(ahead[0]))]
    for i in range(len(path)):
        start = start - ahead[i] * (ahead[i] @ start)
        side[i] = start = start / np.linalg.norm(start)
    other = np.cross(ahead, side)
    turn = np.linspace(0, 2 * np.pi, segments + 1)[None, :, None]
    normals = np.cos(turn) * side[:, None] + np.sin(turn) * other[:, None]
    # On a tube whose radius changes the normals lean along the path.
    step = np.maximum(np.linalg.norm(np.gradient(path, axis=0), axis=1), 1e-12)
    lean = (np.gradient(radius) / step)[:, None, None]
    points = path[:, None] + radius[:, None, None] * normals
    normals = normals - lean * ahead[:, None]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    v, u = np.meshgrid(np.linspace(0, 1, len(path)), np.linspace(0, 1, segments + 1), indexing="ij")
    st = np.stack([u.ravel(), v.ravel()], 1)
    return QuadMesh(points.reshape(-1, 3), grid_quads(len(path), segments + 1), normals.reshape(-1, 3), st)


def torus(ring: float, thickness: float, segments: int = 96) -> QuadMesh:
    """A ring about the Y axis; its centre line has radius `ring`, its section radius `thickness`."""
    turn = np.linspace(-np.pi / 2, 3 * np.pi / 2, 33)
    # Runs up on the outer side and down on the inner one: the outside stays on the right.
    return lathe(np.stack([ring + thickness * np.cos(turn), thickness * np.sin(turn)], 1), segments)


def rounded_box(size: ArrayLike, radius: float, steps: int = 6) -> QuadMesh:
    """A box of full `size` (3,) about the origin, its edges rounded with `radius`."""
    inner = np.asarray(size, np.float64) / 2 - radius
    slope = np.tan(np.linspace(-np.pi / 4, 0, steps))
    corner = np.repeat([-1.0, 1.0], steps)
    slope = np.concatenate([slope, -slope[::-1]])
    n = len(slope)
    parts = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            direction, centre = np.zeros((n, n, 3)), np.zeros((n, n, 3))
            direction[..., axis], centre[..., axis] = sign, sign * inner[axis]
            # Columns run along u, rows along v; turned about on the negative side, to keep the winding.
            direction[..., u], centre[..., u] = sign * slope, sign * corner * inner[u]
            direction[..., v], centre[..., v] = slope[:, None], corner[:, None] * inner[v]
            direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
            points = centre + radius * direction
            st = (points[..., [u, v]] / np.asarray(size, np.float64)[[u, v]] + 0.5).reshape(-1, 2)
            parts.append(QuadMesh(points.reshape(-1, 3), grid_quads(n, n), direction.reshape(-1, 3), st))
    return join(*parts)


def panel(corner: ArrayLike, along_s: ArrayLike, along_t: ArrayLike, repeat: float = 1.0) -> QuadMesh:
    """A flat rectangle from a corner and its two sides; faces along_s x along_t."""
    c, s, t = (np.asarray(x, np.float64) for x in (corner, along_s, along_t))
    normal = np.cross(s, t)
    normal /= np.linalg.norm(normal)
    points = np.stack([c, c + s, c + s + t, c + t])
    st = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float64) * repeat
    return QuadMesh(points, np.array([[0, 1, 2, 3]], np.int32), np.tile(normal, (4, 1)), st)


def ball(radius: float, rows: int = 40, segments: int = 80) -> QuadMesh:
    """A sphere about the origin."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, rows + 1)
    shape = lathe(np.stack([np.cos(turn), np.sin(turn)], 1) * radius, segments)
    return QuadMesh(shape.points, shape.quads, shape.points / radius, shape.st)


def turned_about(shape: QuadMesh, axis: int, angle: float) -> QuadMesh:
    """Returns the shape turned about a coordinate axis by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = c
    turn[i, j], turn[j, i] = -s, s
    return QuadMesh(shape.points @ turn.T, shape.quads, shape.normals @ turn.T, shape.st)
