"""Scenes of a few records, built without USD."""

import numpy as np

from usdslf.scene.records import Light, Material, Mesh, Scene


def make_mesh(positions, triangles, material=0, path="/m"):
    """One flat-shaded mesh of the given corners."""
    p = np.asarray(positions, np.float32)
    t = np.asarray(triangles, np.int32).reshape(-1, 3)
    c = np.nan_to_num(p[t].astype(float), posinf=0, neginf=0)
    n = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
    return Mesh(
        path=path,
        positions=p,
        triangles=t,
        corner_normals=np.repeat(n[:, None], 3, 1).astype(np.float32),
        face_of_triangle=np.arange(len(t), dtype=np.int32) // 2,
        triangle_in_face=np.arange(len(t), dtype=np.int32) % 2,
        material_of_triangle=np.full(len(t), material, np.int32),
    )


def make_scene(*meshes, materials=None, lights=()):
    return Scene("", np.nan, tuple(meshes), tuple(materials or [Material("")]), tuple(lights), ())


def quad(origin, a, b, **kw):
    """A parallelogram of two triangles, facing along a x b."""
    o, a, b = (np.asarray(x, float) for x in (origin, a, b))
    return make_mesh([o, o + a, o + a + b, o + b], [[0, 1, 2], [0, 2, 3]], **kw)


def box(low=(0, 0, 0), high=(1, 1, 1), inward=False, **kw):
    """A box of 12 triangles, facing outwards or inwards; the last two are its top in z."""
    c = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    p = np.asarray(low, float) + c * (np.asarray(high, float) - np.asarray(low, float))
    f = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    t = [[q[0], q[i], q[i + 1]] for q in f for i in (1, 2)]
    return make_mesh(p, [x[::-1] for x in t] if inward else t, **kw)


def band(outer, inner, height, n=48, **kw):
    """Two upright walls about the y axis with a ring on top, open below, from y = 0 up."""
    a = 2 * np.pi * np.arange(n) / n
    profile = [(outer, 0), (outer, height), (inner, height), (inner, 0)]
    p = np.concatenate([np.stack([r * np.cos(a), np.full(n, y), r * np.sin(a)], 1) for r, y in profile])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    q = [(k * n + i, k * n + n + i, k * n + n + j, k * n + j) for k in range(3)]
    return make_mesh(p, np.concatenate([np.stack([f[0], f[m], f[m + 1]], 1) for f in q for m in (1, 2)]), **kw)


def sphere(radius, center=(0, 0, 0), rows=24, **kw):
    """A smooth-shaded sphere of latitudes and longitudes."""
    mesh = _grid(rows, 2 * rows, lambda u, v: _polar(u, v), **kw)
    normals = mesh.positions[mesh.triangles] / np.linalg.norm(
        mesh.positions[mesh.triangles], axis=2, keepdims=True
    )
    made = make_mesh(mesh.positions * radius + np.asarray(center), mesh.triangles, **kw)
    return type(made)(**{**vars(made), "corner_normals": normals.astype(np.float32)})


def corrugated(n=40, **kw):
    """A wavy sheet of 2 n^2 triangles in a unit square, at z = 5."""
    return _grid(n, n, lambda u, v: np.stack([u, v, 5 + 0.05 * np.sin(12 * u)], -1), **kw)


def lamp(height=1.0, at=(0.0, 0.0), size=0.2, up=False):
    """A rect light at (x, y, height) that shines down, or up, along z."""
    m = np.diag([1.0, -1.0, -1.0, 1.0]) if up else np.eye(4)
    m[:3, 3] = *at, height
    return Light("/lamp", "rect", (1.0, 1.0, 1.0), m, width=size, height=size)


def _polar(u, v):
    a, b = np.pi * u, 2 * np.pi * v
    return np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)], -1)


def _grid(rows, columns, point, **kw):
    u, v = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a = (i * (columns + 1) + j).ravel()
    b, c, d = a + columns + 1, a + columns + 2, a + 1
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return make_mesh(point(u, v).reshape(-1, 3), triangles, **kw)
