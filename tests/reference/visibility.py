"""What elements see, in float64, by trying everything: all triangles for a ray, all elements for a hit."""

import numpy as np


def first_hits(corners, origins, directions):
    """Solves o + t d = P0 + u E1 + v E2 for all pairs: triangle (n,) or -1, (u, v) (n, 2), distance (n,)."""
    c, o, d = (np.asarray(x, np.float64) for x in (corners, origins, directions))
    e1, e2 = c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]
    normal = np.cross(e1, e2)
    out = np.full(len(d), -1), np.zeros((len(d), 2)), np.full(len(d), np.inf)
    for k in range(len(c)):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (c[k, 0] - o) @ normal[k] / (d @ normal[k])
            p = o + t[:, None] * d - c[k, 0]
            u = np.cross(p, e2[k]) @ normal[k] / (normal[k] @ normal[k])
            v = np.cross(e1[k], p) @ normal[k] / (normal[k] @ normal[k])
            first = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < out[2])
        out[0][first], out[1][first], out[2][first] = k, np.stack([u, v], 1)[first], t[first]
    return out


def square_cells(local, side=32):
    """Bins (n,) of unit vectors (n, 3): polar angles of the four wedges of Shirley and Chiu 1997."""
    x, y, z = np.asarray(local, np.float64).T
    r = np.sqrt(np.clip(1 - z, 0, 1))
    phi = np.mod(np.arctan2(y, x) + np.pi / 4, 2 * np.pi) - np.pi / 4  # -45 .. 315 degrees
    wedge = np.floor((phi + np.pi / 4) / (np.pi / 2)).astype(int)
    a = np.choose(wedge, [r, -(phi - np.pi / 2) * r * 4 / np.pi, -r, (phi - 1.5 * np.pi) * r * 4 / np.pi])
    b = np.choose(wedge, [phi * r * 4 / np.pi, r, -(phi - np.pi) * r * 4 / np.pi, -r])
    ix, iy = (np.clip(((s + 1) * side / 2).astype(int), 0, side - 1) for s in (a, b))
    return iy * side + ix


def nearest_elements(points, normals, mesh, elements):
    """The nearest element (n,) to points (n, 3) of a mesh (n,) among those whose normal is the same."""
    gap = np.linalg.norm(points[:, None] - elements.position[None].astype(np.float64), axis=2)
    same = (mesh[:, None] == elements.mesh) & (
        normals @ elements.geometric_normal.T.astype(np.float64) > 0.99
    )
    gap = np.where(same, gap, np.inf)
    return gap.argmin(1), gap
