"""Subdivision as the textbooks write it: one vertex at a time, float64.

Source: Catmull and Clark 1978; Loop 1987; DeRose, Kass, Truong 1998, Section 3 and Appendix B (a vertex
whose creases run out is blended by the mean of their sharpness).
"""

from __future__ import annotations

import math

import numpy as np


def _edges(faces):
    """(lower, higher) -> faces beside it, in the order of the pairs."""
    beside: dict[tuple[int, int], list[int]] = {}
    for f, face in enumerate(faces):
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            beside.setdefault((min(a, b), max(a, b)), []).append(f)
    return dict(sorted(beside.items()))


def subdivide(points, faces, sharpness, corner_sharpness, scheme):
    """One level.  sharpness: (lower, higher) -> s; boundary edges are sharp for ever.

    Returns points, faces, sharpness, corner sharpness of the next level; old vertices first, then edges
    by their pair, then faces.
    """
    points = np.asarray(points, float)
    edges = _edges(faces)
    sharp = {e: math.inf if len(beside) != 2 else sharpness.get(e, 0.0) for e, beside in edges.items()}
    middle = {e: (points[e[0]] + points[e[1]]) / 2 for e in edges}
    centre = [points[face].mean(0) for face in faces]

    edge_points = {}
    for e, beside in edges.items():
        if len(beside) != 2:
            edge_points[e] = middle[e]
            continue
        if scheme == "loop":
            opposite = [next(v for v in faces[f] if v not in e) for f in beside]
            smooth = 3 / 8 * (points[e[0]] + points[e[1]]) + 1 / 8 * (
                points[opposite[0]] + points[opposite[1]]
            )
        else:
            smooth = (points[e[0]] + points[e[1]] + centre[beside[0]] + centre[beside[1]]) / 4
        s = min(sharp[e], 1.0)
        edge_points[e] = s * middle[e] + (1 - s) * smooth

    vertex_points = []
    for v in range(len(points)):
        around = [e for e in edges if v in e]
        corner = corner_sharpness.get(v, 0.0)
        uses = sum(face.count(v) for face in faces)

        def mask(is_sharp, is_corner, v=v, around=around, uses=uses):
            creases = [e for e in around if is_sharp(e)]
            if is_corner or len(creases) > 2 or len(around) < 2:
                return points[v]
            if len(creases) == 2:
                return 0.75 * points[v] + sum(points[e[0]] + points[e[1]] - points[v] for e in creases) / 8
            n = len(around)
            if scheme == "loop":
                beta = (5 / 8 - (3 / 8 + math.cos(2 * math.pi / n) / 4) ** 2) / n
                ring = sum(points[e[0]] + points[e[1]] - points[v] for e in around)
                return (1 - n * beta) * points[v] + beta * ring
            q = sum(centre[f] for f, face in enumerate(faces) if v in face) / uses
            r = sum(middle[e] for e in around) / n
            return q / n + 2 * r / n + (n - 3) / n * points[v]

        now = mask(lambda e: sharp[e] > 0, corner > 0)
        fading = [sharp[e] for e in around if 0 < sharp[e] <= 1] + ([corner] if 0 < corner <= 1 else [])
        if fading:
            t = sum(fading) / len(fading)
            now = t * now + (1 - t) * mask(lambda e: sharp[e] > 1, corner > 1)
        vertex_points.append(now)

    number = {e: len(points) + i for i, e in enumerate(edges)}
    new_faces = []
    for f, face in enumerate(faces):
        n = len(face)
        e = [number[tuple(sorted((face[i], face[(i + 1) % n])))] for i in range(n)]
        if scheme == "loop":
            new_faces += [[face[i], e[i], e[i - 1]] for i in range(n)] + [e]
        else:
            new_faces += [[face[i], e[i], len(points) + len(edges) + f, e[i - 1]] for i in range(n)]
    new_points = [*vertex_points, *edge_points.values(), *([] if scheme == "loop" else centre)]
    new_sharpness = {}
    for e, s in sharp.items():
        for v in e:
            new_sharpness[(v, number[e])] = max(s - 1, 0.0)
    new_corner = {v: max(s - 1, 0.0) for v, s in corner_sharpness.items()}
    return np.array(new_points), new_faces, new_sharpness, new_corner
