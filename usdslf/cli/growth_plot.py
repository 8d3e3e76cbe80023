"""Plots of the growth bench, by matplotlib (the extra `plots`)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from usdslf.cli.bench_growth import Point, exponent, total
from usdslf.errors import InputError
from usdslf.replacing import replacing

COLUMNS = 3
NAME = "growth.png"


def require_plots() -> None:
    """Raises InputError where matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise InputError(f"plots need matplotlib ({error}); install it with: pip install 'usdslf[plots]'") from error


def plot_growth(found: Mapping[str, list[Point]], folder: Path) -> Path:
    """Draws time by step, and memory, over the size of each axis, in logarithms; returns the picture's path.

    Raises: InputError where matplotlib is missing.
    """
    require_plots()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = -(-len(found) // COLUMNS)
    figure = Figure(figsize=(4.2 * min(COLUMNS, len(found)), 4.1 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    for number, (axis, points) in enumerate(found.items()):
        _draw(figure.add_subplot(rows, min(COLUMNS, len(found)), number + 1), axis, points)
    path = folder / NAME
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=80)
    return path


def _draw(plot: Any, axis: str, points: list[Point]) -> None:
    sizes, times = [p["size"] for p in points], [total(p) for p in points]
    plot.loglog(sizes, times, "k-o", markersize=3, label=f"all: {exponent(sizes, times):.2f}")
    for step in points[0]["seconds"]:
        values = [p["seconds"][step] for p in points]
        plot.loglog(sizes, values, "-", linewidth=1, label=f"{step}: {exponent(sizes, values):.2f}")
    plot.loglog(sizes, [times[-1] * s / sizes[-1] for s in sizes], ":", color="0.6", label="linear")
    plot.set_xlabel(axis)
    plot.set_ylabel("processor seconds")
    plot.set_ylim(bottom=max(1e-3, min(times) / 100))
    memory = plot.twinx()
    memory.loglog(sizes, [p["memory"] / 2**30 for p in points], "s--", color="tab:red", markersize=3, linewidth=1)
    memory.set_ylabel("GiB (dashed)", color="tab:red")
    memory.set_ylim(0.25, 32)
    plot.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3, frameon=False)
