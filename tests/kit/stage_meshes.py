"""Meshes of test stages, with smooth normals; they stand on y = 0 around the y axis, in metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class MeshData:
    """A polygon mesh.  V vertices."""

    positions: NDArray  # (V, 3)
    counts: NDArray  # (faces,)
    indices: NDArray  # (sum of counts,)
    normals: NDArray | None = None  # (V, 3); none: flat
    uvs: NDArray | None = None  # (V, 2)

    def moved(self, offset: Triple) -> MeshData:
        """The same mesh elsewhere."""
        return MeshData(self.positions + np.array(offset), self.counts, self.indices, self.normals, self.uvs)


def joined(*parts: MeshData) -> MeshData:
    """One mesh of several smooth ones."""
    first = np.cumsum([0, *[len(p.positions) for p in parts]])
    return MeshData(
        np.concatenate([p.positions for p in parts]),
        np.concatenate([p.counts for p in parts]),
        np.concatenate([p.indices + f for p, f in zip(parts, first)]),
        np.concatenate([p.normals for p in parts if p.normals is not None]),
        np.concatenate([p.uvs for p in parts if p.uvs is not None]),
    )


def grid(positions: NDArray, closes: bool = False) -> MeshData:
    """A smooth mesh over a (rows, columns, 3) grid; normals follow from differences.

    Columns run around, the last one repeats the first where `closes`.  With rows running up and columns
    counter-clockwise seen from above, faces look outwards.
    """
    rows, columns = positions.shape[:2]
    if closes:
        around = np.concatenate([positions[:, -2:-1], positions, positions[:, 1:2]], axis=1)
        along_u = around[:, 2:] - around[:, :-2]
    else:
        along_u = np.gradient(positions, axis=1)
    along_v = np.gradient(positions, axis=0)
    normals = np.cross(along_v, along_u)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    # A pole has no tangent around: take the mean of the neighbouring ring.
    for pole, ring in ((0, 1), (-1, -2)):
        if length[pole].min() < 1e-9:
            normals[pole] = normals[ring].mean(0)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    quads = np.stack([a, d, c, b], -1).reshape(-1, 4)
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    flat = positions.reshape(-1, 3)
    faces = [_without_repeats(flat, quad) for quad in quads]
    counts = np.array([len(f) for f in faces])
    keep = counts >= 3
    return MeshData(
        flat,
        counts[keep],
        np.concatenate([f for f, k in zip(faces, keep) if k]),
        normals.reshape(-1, 3),
        np.stack([u, v], -1).reshape(-1, 2),
    )


def _without_repeats(positions: NDArray, quad: NDArray) -> NDArray:
    corners = positions[quad]
    same = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) < 1e-9
    return quad[~same]


def lathe(profile: NDArray, segments: int = 48) -> MeshData:
    """Revolves a profile (k, 2) of (radius, height), running upwards outside, about the y axis."""
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    r, y = profile[:, 0:1], profile[:, 1:2]
    return grid(np.stack([r * np.sin(angle), y + 0 * angle, r * np.cos(angle)], -1), closes=True)


def _spline(points: list[tuple[float, float]], count: int) -> NDArray:
    """A Catmull-Rom curve through (radius, height) points."""
    p = np.array(points)
    p = np.concatenate([[2 * p[0] - p[1]], p, [2 * p[-1] - p[-2]]])
    t = np.linspace(0, len(points) - 1 - 1e-9, count)
    i, f = t.astype(int), (t % 1)[:, None]
    a, b, c, d = p[i], p[i + 1], p[i + 2], p[i + 3]
    return 0.5 * (2 * b + (c - a) * f + (2 * a - 5 * b + 4 * c - d) * f**2 + (3 * b - a - 3 * c + d) * f**3)


def ball(radius: float = 0.5, segments: int = 48) -> MeshData:
    """A sphere as a mesh with texture coordinates, standing on y = 0."""
    t = np.linspace(0, np.pi, segments // 2 + 1)
    profile = np.stack([np.abs(radius * np.sin(t)), radius * (1 - np.cos(t))], -1)
    profile[[0, -1], 0] = 0
    return lathe(profile, segments)


def vase(height: float = 1.0, width: float = 0.32) -> MeshData:
    """A vase with a lip and the upper part of its inside."""
    outer = [(0.55, 0), (0.8, 0.08), (1, 0.3), (0.92, 0.5), (0.5, 0.78), (0.45, 0.88), (0.6, 0.98)]
    inner = [(0.57, 1.0), (0.5, 0.96), (0.36, 0.86), (0.4, 0.75), (0.7, 0.5)]
    curve = _spline(outer + inner, 56) * np.array([width, height])
    return lathe(np.concatenate([[[0.0, 0.0]], np.maximum(curve, [[1e-4, 0]])]))


def bottle(height: float = 1.0, width: float = 0.26) -> MeshData:
    """A closed bottle with a straight body and a narrow neck."""
    body = [(0.0, 0.0), (0.85, 0.0), (0.97, 0.02), (1.0, 0.06), (1.0, 0.3), (0.98, 0.5), (0.7, 0.64)]
    neck = [(0.4, 0.72), (0.36, 0.85), (0.42, 0.88), (0.42, 0.97), (0.3, 1.0), (0.0, 1.0)]
    curve = np.maximum(_spline([*body[1:], *neck[:-1]], 60), 0) * np.array([width, height])
    return lathe(np.concatenate([[[0, 0]], curve, [[0, height]]]))


def capsule(length: float = 0.6, radius: float = 0.3) -> MeshData:
    """A cylinder with round ends, standing."""
    t = np.linspace(0, np.pi / 2, 13)
    low = np.stack([radius * np.sin(t), radius * (1 - np.cos(t))], -1)
    middle = np.stack([np.full(8, radius), radius + length * np.arange(1, 9) / 9], -1)
    high = np.stack([radius * np.cos(t), radius + length + radius * np.sin(t)], -1)
    profile = np.concatenate([low, middle, high])
    profile[[0, -1], 0] = 0
    return lathe(profile)


def torus(radius: float = 0.42, tube: float = 0.16, lying: bool = True) -> MeshData:
    """A ring, lying on y = 0 or standing on it in the x-y plane."""
    around = np.linspace(0, 2 * np.pi, 65)
    across = np.linspace(0, 2 * np.pi, 33)
    r = radius + tube * np.cos(across)[:, None]
    y = tube * np.sin(across)[:, None] + 0 * around
    positions = np.stack([r * np.sin(around), y, r * np.cos(around)], -1)
    # The grid's ends across the tube meet: differences there are taken over the seam.
    mesh = grid(positions, closes=True)
    normals = np.stack(
        [
            np.cos(across)[:, None] * np.sin(around),
            np.sin(across)[:, None] + 0 * around,
            np.cos(across)[:, None] * np.cos(around),
        ],
        -1,
    ).reshape(-1, 3)
    if lying:
        return MeshData(mesh.positions + np.array([0, tube, 0]), mesh.counts, mesh.indices, normals, mesh.uvs)
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
    stood = mesh.positions @ turn.T + np.array([0, radius + tube, 0])
    return MeshData(stood, mesh.counts, mesh.indices, normals @ turn.T, mesh.uvs)


def tube(path: NDArray, radii: NDArray, segments: int = 20) -> MeshData:
    """A tube about a planar path (k, 3) in the x-y plane."""
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.array([0, 0, 1.0])
    up = np.cross(across, tangent)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.cos(angle)[None, :, None] * up[:, None] - np.sin(angle)[None, :, None] * across
    mesh = grid(path[:, None] + radii[:, None, None] * ring, closes=True)
    outward = ring.reshape(-1, 3)
    flipped = (np.sum(mesh.normals * outward, axis=1) < 0).mean() > 0.5
    indices = mesh.indices
    if flipped:  # quads only: turn each face around
        indices = indices.reshape(-1, 4)[:, ::-1].ravel()
    return MeshData(mesh.positions, mesh.counts, indices, outward, mesh.uvs)


def teapot(size: float = 1.0) -> MeshData:
    """A pot with lid, spout and handle, in one mesh whose parts pass through each other."""
    body = [(0.28, 0), (0.42, 0.06), (0.5, 0.25), (0.44, 0.45), (0.3, 0.55), (0.28, 0.57)]
    lid = [(0.2, 0.62), (0.06, 0.66), (0.05, 0.7), (0.08, 0.75), (0.04, 0.8)]
    curve = np.concatenate([[[0, 0]], np.maximum(_spline(body + lid, 48), 1e-3), [[0, 0.805]]])
    t = np.linspace(0, 1, 16)[:, None]
    a, b, c, d = [np.array(p) for p in ([0.38, 0.2, 0], [0.66, 0.2, 0], [0.6, 0.48, 0], [0.82, 0.56, 0])]
    spout = a * (1 - t) ** 3 + 3 * b * t * (1 - t) ** 2 + 3 * c * t**2 * (1 - t) + d * t**3
    s = np.linspace(-0.5, 0.5, 20) * 1.15 * np.pi
    handle = np.stack([-0.48 - 0.26 * np.cos(s), 0.3 + 0.17 * np.sin(s), 0 * s], -1)
    parts = joined(lathe(curve), tube(spout, np.linspace(0.11, 0.05, 16)), tube(handle, np.full(len(s), 0.045)))
    return MeshData(parts.positions * size, parts.counts, parts.indices, parts.normals, parts.uvs)


def blob(radius: float = 0.45, bumps: float = 0.16, seed: int = 0) -> MeshData:
    """A smooth lumpy ball."""
    rng = np.random.default_rng(seed)
    t, p = np.meshgrid(np.linspace(0, np.pi, 41), np.linspace(0, 2 * np.pi, 73), indexing="ij")
    d = np.stack([np.sin(t) * np.sin(p), -np.cos(t), np.sin(t) * np.cos(p)], -1)
    wave = sum(np.cos(d @ rng.normal(0, 2.6, 3) + rng.uniform(0, 6)) for _ in range(5)) / 5
    wave[[0, -1]] = wave[[0, -1]].mean(1, keepdims=True)
    wave[:, -1] = wave[:, 0]
    positions = d * (radius * (1 + bumps * 2 * wave[..., None]))
    positions[[0, -1], :, 0] = 0
    positions[[0, -1], :, 2] = 0
    mesh = grid(positions, closes=True)
    return mesh.moved((0, -float(positions[..., 1].min()), 0))


def box(x: float, y: float, z: float) -> MeshData:
    """A box standing on y = 0 with flat faces and texture coordinates on each."""
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = np.zeros((4, 3))
            corners[:, axis] = side
            corners[:, u] = [-1, 1, 1, -1]
            corners[:, v] = [-1, -1, 1, 1]
            faces.append(corners if side > 0 else corners[::-1])
    positions = np.concatenate(faces) * [x / 2, y / 2, z / 2] + np.array([0, y / 2, 0])
    uvs = np.tile([[0, 0], [1, 0], [1, 1], [0, 1.0]], (6, 1))
    return MeshData(positions, np.full(6, 4), np.arange(24), None, uvs)


def rectangle(corner: Triple, u: Triple, v: Triple, repeat: float = 1.0) -> MeshData:
    """One quad from a corner and two edges; its normal is u x v."""
    c, du, dv = np.array(corner, float), np.array(u, float), np.array(v, float)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]) * repeat
    return MeshData(np.stack([c, c + du, c + du + dv, c + dv]), np.array([4]), np.arange(4), None, uvs)
