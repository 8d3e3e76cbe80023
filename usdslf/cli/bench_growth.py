"""Bench of growth: time and memory of shots that grow along one axis, and the exponents that fit them.

    measure_growth(axes, most, folder, device, say) -> Growth by axis; also in folder/growth.json
    lines_of_growth(found)                             the table that people read

Each size runs in a process of its own; seconds are those of all processors together.  The exponent p of time ~ size^p
is the slope through the largest sizes in logarithms, where what does not grow counts least; 1 is linear.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from usdslf.cli.growth_shots import build_growing
from usdslf.errors import UsdslfError
from usdslf.replacing import replacing

if TYPE_CHECKING:
    from usdslf.progress import Say

AXES: dict[str, tuple[int, ...]] = {
    "elements": (1000, 3000, 10_000, 30_000, 100_000, 200_000),
    "triangles": (10_000, 50_000, 250_000, 1_000_000, 5_000_000),
    "lights": (1, 3, 10, 30, 100),
    "strokes": (1, 3, 10, 30, 100, 300, 1000),
    "instances": (100, 1000, 10_000, 100_000),
    "textures": (1, 5, 25, 100, 200),
}
"""Sizes of each axis."""
FITTED = 3  # largest sizes that an exponent is fitted to
RESULTS = "growth.json"

Point = dict[str, Any]
Growth = dict[str, list[Point]]
"""Of each axis its points: size, processors' seconds by step, memory [bytes]."""


def measure_growth(
    axes: Sequence[str], most: int | None, folder: Path, device: str | None, say: Say
) -> Growth:  # fmt: skip
    """Measures some axes; results of others that lie in the folder stay.

    Args:
        axes: names of AXES.
        most: largest size; None: all.
        folder: where the results are kept, after each size.

    Returns: all that the folder holds now.

    Raises: UsdslfError where a size fails, with what its process said last.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / RESULTS
    found: Growth = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    sizes = [(axis, size) for axis in axes for size in AXES[axis] if most is None or size <= most]
    for done, (axis, size) in enumerate(sizes):
        say(f"{axis} {size}", done / len(sizes))
        others = [p for p in found.get(axis, []) if p["size"] != size]
        found[axis] = sorted([*others, {"size": size, **_apart(axis, size, device)}], key=lambda p: p["size"])
        with replacing(file) as temporary:
            Path(temporary).write_text(json.dumps(found, indent=1), encoding="utf-8")
    return found


def _apart(axis: str, size: int, device: str | None) -> Point:
    """One size, measured in a process of its own; its stage is written in this one."""
    with tempfile.TemporaryDirectory(prefix="usdslf_growth_") as name:
        built = build_growing(axis, size, Path(name))
        asked = [str(built.stage), str(built.elements), str(built.strokes), *([device] if device else [])]
        command = [sys.executable, "-m", "usdslf.cli.growth_point", *asked]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise UsdslfError(f"{axis} {size}: {last}; ask for less with --most")
    point: Point = json.loads(done.stdout.splitlines()[-1])
    return point


def total(point: Point) -> float:
    """Returns the time of all steps of a size [s]."""
    return float(sum(point["seconds"].values()))


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Returns p of value ~ size^p, fitted to the FITTED largest sizes; nan where there are fewer than two."""
    x, y = np.log(np.asarray(sizes[-FITTED:], float)), np.log(np.maximum(values[-FITTED:], 1e-9))
    if len(x) < 2:
        return float("nan")
    return float(np.polyfit(x, y, 1)[0])


def lines_of_growth(found: Mapping[str, list[Point]]) -> Iterator[str]:
    """Yields the table: a line a size, and the exponents of time, of memory and of each step."""
    for axis, points in found.items():
        steps = list(points[0]["seconds"])
        yield f"{axis:>10}{'seconds':>10}{'GiB':>7}  " + "".join(f"{s.split(',')[0]:>13}" for s in steps)
        for point in points:
            each = "".join(f"{point['seconds'][s]:>13.2f}" for s in steps)
            yield f"{point['size']:>10}{total(point):>10.2f}{point['memory'] / 2**30:>7.2f}  {each}"
        sizes = [p["size"] for p in points]
        fitted = lambda values, sizes=sizes: exponent(sizes, values)  # noqa: E731
        each = "".join(f"{fitted([p['seconds'][s] for p in points]):>13.2f}" for s in steps)
        time, memory = fitted([total(p) for p in points]), fitted([p["memory"] for p in points])
        yield f"{'exponent':>10}{time:>10.2f}{memory:>7.2f}  {each}"
