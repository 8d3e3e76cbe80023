"""How far the kernels of each roughness level are from the exact matrices, and how far plain MIP look-ups are.

    python tests/bench/preconvolution_errors.py [preview_surface | phong]

prints a table in Markdown.  Errors are relative L2 norms over the outgoing bins of the light that the lobe A + B
reflects, means over lights of a kind: smooth (three broad lobes over a constant), edged (two bright rectangles),
single (one bright bin).  MIP: the best of the six levels of the box-filtered, mirrored light, scaled to the exact
albedo, with bilinear look-ups (Nguyen et al. 2013, 6.2); it is chosen after the fact.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).resolve().parents[n]) for n in (1, 2)]

import numpy as np
from kit.level_matrices import dense
from reference.preconvolution import centres, mip_lookups
from reference.reflectance import frame_about

from usdslf.gpu.device import Device, open_device
from usdslf.light_field.preconvolution import build_level, integrate_rows
from usdslf.sampling.hemisphere import D
from usdslf.surfaces.reflectance import directional_albedo, lobe_parameter, roughness_levels

KINDS = ("smooth", "edged", "single")
SIDE = 32


@dataclass(frozen=True)
class Row:
    """Errors at one level; `taps` weights of a row, None where bins are averaged two by two."""

    roughness: float
    taps: float | None
    ours: dict[str, float]
    mip: dict[str, float]


def lights(kind: str, count: int, rng: np.random.Generator) -> np.ndarray:
    """Radiance (D, count) of random lights."""
    towards = centres()
    out = np.full((D, count), {"smooth": 0.2, "edged": 0.1, "single": 0.0}[kind])
    for i in range(count):
        if kind == "single":
            out[rng.choice(np.flatnonzero(towards[:, 2] > 0.1)), i] = 1
            continue
        for _ in range(3 if kind == "smooth" else 2):
            axis = rng.normal(size=3)
            axis[2] = abs(axis[2])
            x, y, z = frame_about(axis / np.linalg.norm(axis)) @ towards.T
            if kind == "smooth":
                out[:, i] += rng.uniform(0.3, 1) * np.exp(rng.uniform(2, 8) * (z - 1))
            else:
                inside = (np.abs(x) < rng.uniform(0.15, 0.6)) & (np.abs(y) < rng.uniform(0.15, 0.6)) & (z > 0)
                out[inside, i] = rng.uniform(0.5, 2)
    return out


def symmetries() -> np.ndarray:
    """The eight symmetries (8, D) of the square of bins: where each moves each bin."""
    grid = np.arange(D).reshape(SIDE, SIDE)
    turned = [np.rot90(grid, k) for k in range(4)]
    return np.stack([t.ravel() for t in (*turned, *(t.T for t in turned))])


def exact_lobe(device: Device, model: str, roughness: float) -> np.ndarray:
    """The exact matrix (D, D) of A + B, each row scaled to its exact albedo; a frame can be turned and mirrored."""
    moves = symmetries()
    rows = np.unique(moves.min(0))
    a, b, _ = integrate_rows(device, model, roughness, rows=rows)
    albedo = directional_albedo(model, float(lobe_parameter(model, roughness)), centres()[rows, 2])
    a *= (albedo[:, 2] / a.sum(1))[:, None]
    b *= (albedo[:, 3] / np.maximum(b.sum(1), 1e-30))[:, None]
    out = np.empty((D, D))
    for move in moves:
        out[np.ix_(move[rows], move)] = a + b
    return out


def measure(device: Device, model: str = "preview_surface", count: int = 12, seed: int = 0) -> Iterator[Row]:
    """Yields the errors of all levels."""
    rng = np.random.default_rng(seed)
    light = {kind: lights(kind, count, rng) for kind in KINDS}
    for roughness in roughness_levels():
        exact = exact_lobe(device, model, float(roughness))
        level = build_level(device, model, float(roughness))
        lobe = sum(dense(level))
        ours, mip = {}, {}
        for kind in KINDS:
            truth = exact @ light[kind]
            size = np.linalg.norm(truth, axis=0)
            ours[kind] = float((np.linalg.norm(lobe @ light[kind] - truth, axis=0) / size).mean())
            albedo = exact.sum(1)
            looked_up = np.array([mip_lookups(one, albedo) for one in light[kind].T])  # (count, 6, D)
            apart = np.linalg.norm(looked_up - truth.T[:, None], axis=2) / size[:, None]
            mip[kind] = float(apart.mean(0).min())
        taps = None if level.coarse else len(level.tap) / D
        yield Row(float(roughness), taps, ours, mip)


def means(rows: list[Row]) -> Row:
    """The means over all levels."""
    return Row(
        float("nan"),
        None,
        *({k: float(np.mean([getattr(r, name)[k] for r in rows])) for k in KINDS} for name in ("ours", "mip")),
    )


def markdown(rows: list[Row]) -> str:
    """The table, with the means at its foot."""
    lines = [
        "| roughness | taps a row | smooth | edged | single bin | MIP: smooth | edged | single bin |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in [*rows, means(rows)]:
        name = "mean" if np.isnan(r.roughness) else f"{r.roughness:.2f}"
        taps = "" if np.isnan(r.roughness) else "2 x 2" if r.taps is None else f"{r.taps:.0f}"
        values = [f"{100 * v[k]:.1f} %" for v in (r.ours, r.mip) for k in KINDS]
        lines.append(f"| {name} | {taps} | {' | '.join(values)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(markdown(list(measure(open_device(), *sys.argv[1:2]))))
