"""Similarity, propagation and joint bilateral upsampling, one pair of places after the other, in float64."""

from __future__ import annotations

import math

import numpy as np


def similarity(px, nx, rx, py, ny, ry, reach, w, step=0.08):
    """Nguyen et al. 2013, 4.3, each term bounded by its weight; w: position, normal, reflectance."""
    apart = sum((float(a) - float(b)) ** 2 for a, b in zip(px, py))
    turned = max(sum(float(a) * float(b) for a, b in zip(nx, ny)), 0.0)
    other = sum((float(a) - float(b)) ** 2 for a, b in zip(rx, ry))
    s = w[0] / (1 + apart / reach**2) + w[1] * turned**4 + w[2] / (1 + other / step**2)
    return s / sum(w)


def propagated(x, painted, values, reach, w, gate=(0.45, 0.7), power=4):
    """The mean over the painted places of each place; places are tuples of position, normal, reflectance."""
    out = []
    for place in x:
        s = [similarity(*place, *y, reach, w) for y in painted]
        mean = sum(np.asarray(v, float) * k**power for v, k in zip(values, s)) / sum(k**power for k in s)
        t = min(max((max(s) - gate[0]) / (gate[1] - gate[0]), 0), 1)
        out.append(mean * t * t * (3 - 2 * t))
    return np.array(out)


def upsampled(x, known, values, spacing, step=0.06):
    """The joint bilateral mean over all known places."""
    out = []
    for p, n, r in x:
        total, weight = 0.0, 0.0
        for (q, m, u), v in zip(known, values):
            d2 = sum((float(a) - float(b)) ** 2 for a, b in zip(p, q))
            turned = max(sum(float(a) * float(b) for a, b in zip(n, m)), 0.0)
            r2 = sum((float(a) - float(b)) ** 2 for a, b in zip(r, u))
            k = math.exp(-0.5 * d2 / spacing**2) * turned**2 * math.exp(-0.5 * r2 / step**2)
            total, weight = total + k * np.asarray(v, float), weight + k
        out.append(total / weight)
    return np.array(out)
