"""Shading normals of polygons: smooth within groups that sharp edges part, or those of the limit surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.geometry.subdivision import Net
from usdslf.scene.arrays import cross
from usdslf.scene.records import F64

I64 = NDArray[np.int64]
_VALENCE_MAX = 64  # vertices with more edges take the mean of their faces


def face_normals(net: Net, points: F64) -> F64:
    """Unit Newell normals (F, 3); zero where a face has no area."""
    links = net.links
    p = points[net.indices] - points[net.indices[links.first]][links.face]
    normal: F64 = np.add.reduceat(cross(p, p[links.next]), links.first, axis=0)
    return _unit(normal)


def corner_normals(net: Net, points: F64) -> F64:
    """Returns unit normals of corners (C, 3), smooth across every edge of sharpness below 1.

    Faces are weighted by the angle at the corner.
    """
    links = net.links
    p = points[net.indices]
    to_next = _unit(p[links.next] - p)
    to_previous = -to_next[links.previous]
    angle: F64 = np.arccos(np.clip(np.einsum("ci,ci->c", to_next, to_previous), -1, 1))
    weighted = face_normals(net, points)[links.face] * angle[:, None]
    group = _groups(net)
    size = int(group.max(initial=-1)) + 1
    total: F64 = np.stack([np.bincount(group, weighted[:, i], size) for i in range(3)], axis=1)
    return _unit(total)[group]


def _groups(net: Net) -> I64:
    """Numbers (C,) the sets of corners that share a normal: same vertex, joined by smooth edges."""
    links = net.links
    corner, twin = _twins(net)
    joined = net.edge_sharpness[links.edge[corner]] < 1
    if len(corner) == len(net.indices) and joined.all():
        return net.indices
    # Vertices all of whose edges are joined are one group; only the corners at the others are sorted out.
    parted = np.ones(len(links.ends), bool)
    parted[links.edge[corner[joined]]] = False
    at_parted = np.zeros(net.vertex_count, bool)
    at_parted[links.ends[parted].ravel()] = True
    torn = np.flatnonzero(at_parted[net.indices])
    number = np.zeros(len(net.indices), np.int64)
    number[torn] = np.arange(len(torn))
    joined &= at_parted[net.indices[corner]]
    # Corner and twin run along one edge in opposite directions.
    a, b = number[corner[joined]], number[links.next[twin[joined]]]
    out = net.indices.copy()
    out[torn] = net.vertex_count + _components(a, b, len(torn))
    return out


def _components(a: I64, b: I64, count: int) -> I64:
    """Numbers (count,) the sets of things that pairs (n,), (n,) of them join."""
    if not len(a):
        return np.arange(count)
    from scipy import sparse  # late: its import would be a third of the start of `usdslf info`

    graph = sparse.csr_array((np.ones(len(a), np.int8), (a, b)), (count, count))
    found: I64 = sparse.csgraph.connected_components(graph, directed=False)[1]
    return found


def _twins(net: Net) -> tuple[I64, I64]:
    """Corners whose edge has two faces wound alike, and the corner that runs the other way."""
    links = net.links
    order = np.argsort(links.edge, kind="stable")
    order = order[links.faces_of_edge[links.edge[order]] == 2]
    a, b = order[0::2], order[1::2]
    alike = net.indices[a] == net.indices[links.next[b]]
    alike &= net.indices[b] == net.indices[links.next[a]]
    a, b = a[alike], b[alike]
    return np.concatenate([a, b]), np.concatenate([b, a])


def limit_normals(net: Net, points: F64, scheme: str) -> F64:
    """Returns unit normals of corners (C, 3) of a refined net.

    Inner smooth vertices get the normal of the limit surface, by the tangent masks of Halstead et al.
    1993 (catmullClark, quads) and Loop 1987; all others the mean of `corner_normals`.
    Bilinear: the normal of the patch at the corner.
    """
    links = net.links
    if scheme == "bilinear":
        p = points[net.indices]
        own = _unit(cross(p[links.next] - p, p[links.previous] - p))
        flat = face_normals(net, points)[links.face]
        return np.where((own * flat).sum(1, keepdims=True) > 0, own, flat)
    out = corner_normals(net, points)
    if not len(net.indices):
        return out

    corner, twin = _twins(net)
    twin_of = np.full(len(net.indices), -1)
    twin_of[corner] = twin
    turn = twin_of[links.previous]  # the next corner, counter-clockwise, around the same vertex
    valence = np.bincount(net.indices, minlength=net.vertex_count)
    edges = np.bincount(links.ends.ravel(), minlength=net.vertex_count)
    bad = np.bincount(net.indices[turn < 0], minlength=net.vertex_count) > 0
    bad |= np.bincount(links.ends[net.edge_sharpness > 0].ravel(), minlength=net.vertex_count) > 0
    bad |= (net.vertex_sharpness > 0) | (valence < 3) | (valence > _VALENCE_MAX) | (edges != valence)
    start = np.zeros(net.vertex_count, np.int64)
    start[net.indices] = np.arange(len(net.indices))
    vertex = np.flatnonzero(~bad)
    at, n = start[vertex], valence[vertex]

    # c2 and c3: sums over the ring of edge points e_i and face points f_i, i = 0 .. n-1.
    cos = np.cos(2 * np.pi / n)
    a_n = 1 + cos + np.cos(np.pi / n) * np.sqrt(2 * (9 + cos))
    tangent = np.zeros((2, len(vertex), 3))
    for i in range(int(n.max(initial=0))):
        go = i < n
        c = at[go]
        edge_point = points[net.indices[links.next[c]]]
        face_point = points[net.indices[links.next[links.next[c]]]]
        this, after = 2 * np.pi * i / n[go], 2 * np.pi * (i + 1) / n[go]
        for t, wave in enumerate((np.cos, np.sin)):
            if scheme == "loop":
                tangent[t, go] += wave(this)[:, None] * edge_point
            else:
                tangent[t, go] += (a_n[go] * wave(this))[:, None] * edge_point
                tangent[t, go] += (wave(this) + wave(after))[:, None] * face_point
        at[go] = turn[c]
    normal = np.zeros((net.vertex_count, 3))
    normal[vertex] = _unit(cross(tangent[0], tangent[1]))
    normal = normal[net.indices]
    # Not so for the other vertices, and where a ring is folded.
    agrees = np.einsum("ci,ci->c", normal, out)[:, None] > 0.1
    return np.where(agrees, normal, out)


def _unit(v: F64) -> F64:
    length = np.sqrt(np.einsum("...i,...i->...", v, v))[..., None]
    return v / np.where(length > 0, length, 1)
