"""Subdivision surfaces: cages -> refined nets, by sparse stencils.

Catmull-Clark with semi-sharp creases and corners, Loop, and bilinear, uniformly, level by level.  A level
is a matrix: refined values = stencil @ cage values, the same one for points and vertex primvars.  Children
are numbered: old vertices, then edges, then (quads only) faces.

Source: Catmull and Clark 1978; Loop 1987; DeRose, Kass, Truong 1998 (creases, their Section 3 and
Appendix B); Halstead, Kass, DeRose 1993 (normals of the limit surface); boundary and face-varying rules as
OpenSubdiv documents them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from usdslf.runs import distinct, numbered, owners
from usdslf.scene.records import F64

I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]
Matrix: TypeAlias = Any  # scipy.sparse.csr_array, which has no types


@dataclass(frozen=True)
class Net:
    """Polygons with what is sharp.  V vertices, F faces, C corners, E edges."""

    counts: I64  # (F,) corners of each face
    indices: I64  # (C,) vertex of each corner
    vertex_count: int
    edge_sharpness: F64  # (E,) 0 smooth; inf: sharp for ever
    vertex_sharpness: F64  # (V,)

    @cached_property
    def links(self) -> Links:
        """Who lies beside whom."""
        return Links(self.counts, self.indices, self.vertex_count)


class Links:
    """Neighbours within polygons; edges are numbered by their (lower, higher) vertex."""

    def __init__(self, counts: I64, indices: I64, vertex_count: int) -> None:
        corner = np.arange(len(indices))
        self.first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
        self.face = owners(counts)  # (C,)
        last = self.first + counts - 1
        self.next = corner + 1
        self.next[last] = self.first
        self.previous = corner - 1
        self.previous[self.first] = last
        a, b = indices, indices[self.next]
        key, self.edge = numbered(np.minimum(a, b) * vertex_count + np.maximum(a, b))
        self.ends = np.stack([key // vertex_count, key % vertex_count], axis=1)  # (E, 2)
        self.faces_of_edge = np.bincount(self.edge, minlength=len(key))  # (E,) how many


def make_net(
    counts: I64,
    indices: I64,
    vertex_count: int,
    creases: tuple[I64, F64] | None = None,
    corners: tuple[I64, F64] | None = None,
    boundary: str = "edgeAndCorner",
) -> Net:
    """Makes a net of a cage.

    Args:
        creases: edges as vertex pairs (K, 2) and their sharpness (K,); pairs without an edge are left out.
        corners: vertices (K,) and their sharpness (K,).
        boundary: edgeAndCorner | edgeOnly | none; whether vertices of a single face are sharp.
    """
    net = Net(counts, indices, vertex_count, np.zeros(0), np.zeros(vertex_count))
    links = net.links
    sharp = np.zeros(len(links.ends))
    if creases is not None and len(creases[0]) and len(links.ends):
        pair = np.sort(creases[0], axis=1)
        key = links.ends[:, 0] * vertex_count + links.ends[:, 1]
        want = pair[:, 0] * vertex_count + pair[:, 1]
        at = np.minimum(np.searchsorted(key, want), len(key) - 1)
        found = key[at] == want
        np.maximum.at(sharp, at[found], creases[1][found])
    if corners is not None:
        np.maximum.at(net.vertex_sharpness, corners[0], corners[1])
    # Boundaries, and edges of three and more faces, have no smooth rule.
    sharp[links.faces_of_edge != 2] = np.inf
    if boundary == "edgeAndCorner":
        net.vertex_sharpness[np.bincount(indices, minlength=vertex_count) == 1] = np.inf
    return _with_sharpness(net, sharp)


def face_varying_net(net: Net, indices: I64, count: int, rule: str) -> Net:
    """Makes the net on which face-varying values are smooth; seams are its boundaries.

    Args:
        indices: value of each corner (C,), into `count` values.
        rule: faceVaryingLinearInterpolation, other than `all`: none | cornersOnly | cornersPlus1 |
            cornersPlus2 | boundaries.  cornersPlus2 is taken as cornersPlus1.
    """
    links = net.links
    out = Net(net.counts, indices, count, np.zeros(0), np.zeros(count))
    edges = out.links
    sharp = np.zeros(len(edges.ends))
    sharp[edges.edge] = net.edge_sharpness[links.edge]
    # A value is beside a seam wherever an edge of it has one face only.
    sharp[edges.faces_of_edge != 2] = np.inf
    out.vertex_sharpness[indices] = net.vertex_sharpness[net.indices]
    uses = np.bincount(indices, minlength=count)
    if rule != "none":
        out.vertex_sharpness[uses == 1] = np.inf
    if rule in ("cornersPlus1", "cornersPlus2"):
        # Junctions: vertices where three and more values meet.
        pairs = distinct(net.indices * np.int64(count) + indices) // count
        junction = np.bincount(pairs, minlength=net.vertex_count) >= 3
        out.vertex_sharpness[indices[junction[net.indices]]] = np.inf
    if rule == "boundaries":
        out.vertex_sharpness[edges.ends[edges.faces_of_edge != 2].ravel()] = np.inf
    return _with_sharpness(out, sharp)


def _with_sharpness(net: Net, edge_sharpness: F64) -> Net:
    out = Net(net.counts, net.indices, net.vertex_count, edge_sharpness, net.vertex_sharpness)
    out.__dict__["links"] = net.links
    return out


def refine_net(net: Net, scheme: str, smooth_triangles: bool = False) -> tuple[Net, Matrix]:
    """Refines a net by one level.

    Args:
        scheme: catmullClark | loop | bilinear.  loop wants triangles only.
        smooth_triangles: the `smooth` triangleSubdivisionRule of Catmull-Clark.
    Returns:
        the refined net, and the stencil (V', V) of its vertices.  Face i of the cage becomes consecutive
        faces: one a corner (quads), or four (loop).
    """
    return _children(net, scheme), vertex_stencil(net, scheme, smooth_triangles)


def refined_faces(net: Net, scheme: str) -> I64:
    """Returns the cage face of each refined face."""
    return np.repeat(np.arange(len(net.counts)), 4 if scheme == "loop" else net.counts)


def vertex_stencil(net: Net, scheme: str, smooth_triangles: bool = False) -> Matrix:
    """Returns the stencil (V', V) of a level, `bilinear` for varying values on any net of quads' scheme."""
    links, n = net.links, net.vertex_count
    count_e = len(links.ends)
    edge_rows = np.repeat(np.arange(count_e), 2)
    middle = _matrix(edge_rows, links.ends.ravel(), 0.5, (count_e, n))
    centre = _matrix(links.face, net.indices, 1 / net.counts[links.face], (len(net.counts), n))
    if scheme == "bilinear":
        return _sparse().vstack([_sparse().eye_array(n), middle, centre], format="csr")

    soft = 1 - np.minimum(net.edge_sharpness, 1)  # how much of the smooth edge rule
    if scheme == "loop":
        # Edge: 3/8 of its ends, 1/8 of the two opposite vertices.
        opposite = _matrix(links.edge, net.indices[links.previous], 1.0, (count_e, n))
        edge = _scaled(1 - 0.25 * soft, middle) + _scaled(0.125 * soft, opposite)
        return _sparse().vstack([_vertex_rows(net, None), edge], format="csr")
    # Edge: the mean of its ends and the two faces beside; triangles may weigh more (OpenSubdiv's 0.470).
    of_face = np.where(net.counts == 3, 0.47, 0.25) if smooth_triangles else np.full(len(net.counts), 0.25)
    share = np.bincount(links.edge, of_face[links.face], count_e) / np.maximum(links.faces_of_edge, 1) * soft
    beside = _matrix(links.edge, links.face, 1.0, (count_e, len(net.counts)))
    edge = _scaled(1 - 2 * share, middle) + _scaled(share, beside @ centre)
    return _sparse().vstack([_vertex_rows(net, centre), edge, centre], format="csr")


def linear_stencil(net: Net, scheme: str) -> Matrix:
    """Returns the stencil (V', V) that interpolates linearly: varying values."""
    rows = vertex_stencil(net, "bilinear")
    return rows[: net.vertex_count + len(net.links.ends)] if scheme == "loop" else rows


def refine_corner_values(net: Net, scheme: str, values: F64) -> F64:
    """Interpolates values of corners (C, k) linearly within each face -> (C', k)."""
    links = net.links
    middle = (values + values[links.next]) / 2
    if scheme == "loop":
        t, m = values.reshape(-1, 3, values.shape[1]), middle.reshape(-1, 3, values.shape[1])
        tips = np.stack([t, m, np.roll(m, 1, axis=1)], axis=2)
        return np.concatenate([tips, m[:, None]], axis=1).reshape(-1, values.shape[1])
    centre = np.add.reduceat(values, links.first, axis=0) / net.counts[:, None]
    quads = np.stack([values, middle, centre[links.face], middle[links.previous]], axis=1)
    return quads.reshape(-1, values.shape[1])


def _children(net: Net, scheme: str) -> Net:
    links, n = net.links, net.vertex_count
    edge = n + links.edge
    count = n + len(links.ends)
    if scheme == "loop":
        v, e = net.indices.reshape(-1, 3), edge.reshape(-1, 3)
        tips = np.stack([v, e, np.roll(e, 1, axis=1)], axis=2)
        indices = np.concatenate([tips, e[:, None]], axis=1).ravel()
        counts = np.full(4 * len(net.counts), 3)
    else:
        indices = np.stack([net.indices, edge, count + links.face, edge[links.previous]], axis=1).ravel()
        counts = np.full(len(net.indices), 4)
        count += len(net.counts)
    vertex_sharpness = np.zeros(count)
    vertex_sharpness[:n] = np.maximum(net.vertex_sharpness - 1, 0)
    child = Net(counts, indices, count, np.zeros(0), vertex_sharpness)
    # Halves of an edge inherit its sharpness less one; edges across faces are smooth.
    ends = child.links.ends  # lower end first: a half edge runs from an old vertex to an edge's
    half = (ends[:, 0] < n) & (ends[:, 1] < n + len(links.ends))
    sharp = np.zeros(len(ends))
    sharp[half] = np.maximum(net.edge_sharpness[ends[half, 1] - n] - 1, 0)
    if scheme == "bilinear":
        sharp[child.links.faces_of_edge != 2] = np.inf
    return _with_sharpness(child, sharp)


def _vertex_rows(net: Net, centre: Matrix | None) -> Matrix:
    """The stencil (V, V) of the old vertices; `centre` (F, V) for Catmull-Clark, none for Loop.

    Two masks, for the sharpness now and that of the next level, are blended where sharpness runs out
    between them [DeRose et al. 1998, Appendix B; OpenSubdiv's fractional weight].
    """
    links, n = net.links, net.vertex_count
    now, later = net.edge_sharpness, np.maximum(net.edge_sharpness - 1, 0)
    v_now, v_later = net.vertex_sharpness, np.maximum(net.vertex_sharpness - 1, 0)
    running_out = (now > 0) & (later == 0)
    ends = links.ends.ravel()
    fading = np.repeat(running_out, 2)
    v_fading = (v_now > 0) & (v_later == 0)
    total = np.bincount(ends[fading], np.repeat(now, 2)[fading], n) + np.where(v_fading, v_now, 0)
    number = np.bincount(ends[fading], minlength=n) + v_fading
    weight = np.where(number > 0, total / np.maximum(number, 1), 1.0)
    rows = _scaled(weight, _masked_rows(net, centre, now > 0, v_now > 0))
    if (weight < 1).any():
        rows = rows + _scaled(1 - weight, _masked_rows(net, centre, later > 0, v_later > 0))
    return rows


def _masked_rows(net: Net, centre: Matrix | None, sharp_edge: Bool, sharp_vertex: Bool) -> Matrix:
    """Rows (V, V): smooth with at most one sharp edge, crease with two, corner with more."""
    links, n = net.links, net.vertex_count
    a, b = links.ends[:, 0], links.ends[:, 1]
    valence = np.bincount(links.ends.ravel(), minlength=n)
    number = np.bincount(links.ends[sharp_edge].ravel(), minlength=n)
    corner = sharp_vertex | (number > 2) | (valence < 2)
    crease = ~corner & (number == 2)
    smooth = ~corner & ~crease
    k = np.maximum(valence, 1)

    neighbour = _matrix(np.concatenate([a, b]), np.concatenate([b, a]), 1.0, (n, n))
    a, b = a[sharp_edge], b[sharp_edge]
    along = _matrix(np.concatenate([a, b]), np.concatenate([b, a]), 1.0, (n, n))
    if centre is not None:
        # (n - 2)/n of the vertex, 1/n^2 of each neighbour and of each face point.
        own, each = (k - 2) / k, 1 / k**2
    else:
        each = (0.625 - (0.375 + 0.25 * np.cos(2 * np.pi / k)) ** 2) / k
        own = 1 - k * each
    rows = _sparse().diags_array(np.where(smooth, own, np.where(crease, 0.75, 1.0))).tocsr()
    rows = rows + _scaled(np.where(smooth, each, 0), neighbour) + _scaled(np.where(crease, 0.125, 0), along)
    if centre is not None:
        around = _matrix(net.indices, links.face, 1.0, (n, len(net.counts)))
        rows = rows + _scaled(np.where(smooth, each, 0), around @ centre)
    return rows


def _sparse() -> Any:
    """scipy.sparse, imported where it is needed: it would take a third of the start of `usdslf info`."""
    from scipy import sparse

    return sparse


def _matrix(rows: I64, columns: I64, values: F64 | float, shape: tuple[int, int]) -> Matrix:
    return _sparse().csr_array((np.broadcast_to(values, rows.shape).astype(float), (rows, columns)), shape)


def _scaled(weights: F64, matrix: Matrix) -> Matrix:
    """Multiplies each row; rows of weight zero become empty."""
    out = matrix.copy()
    out.data = out.data * np.repeat(weights, np.diff(out.indptr))
    out.eliminate_zeros()
    return out
