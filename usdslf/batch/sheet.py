"""Sheet: a contact sheet, before and after of each job in one picture.

write_sheet(summary) -> None      sheet.png in the output folder, where there are pictures
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf.batch.summary import Summary
from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import InputError
from usdslf.textures.images import read_image, write_image

COLUMNS = 3  # jobs side by side
MOST = 120  # jobs on a sheet
GAP, DARK = 6, 0.1  # pixels between pictures, and their grey
CELL = 256  # pixels, the widest picture


def write_sheet(summary: Summary) -> None:
    """Writes the sheet of the jobs that have pictures, before and after side by side, row by row."""
    pairs = [r.pictures for r in summary.rows if len(r.pictures) == 2][:MOST]
    cells = [c for pair in pairs if (c := _cell(Path(summary.output), pair)) is not None]
    target = Path(summary.output) / "sheet.png"
    if not cells:
        target.unlink(missing_ok=True)
        return
    height, width = (max(c.shape[k] for c in cells) + GAP for k in (0, 1))
    columns = min(COLUMNS, len(cells))
    sheet = np.full((height * -(-len(cells) // columns) + GAP, width * columns + GAP, 3), DARK, np.float32)
    for i, cell in enumerate(cells):
        y, x = GAP + height * (i // columns), GAP + width * (i % columns)
        sheet[y : y + cell.shape[0], x : x + cell.shape[1]] = cell
    write_image(target, sheet)


def _cell(folder: Path, pair: tuple[str, ...]) -> NDArray[np.float32] | None:
    """Before and after side by side; None where one is gone."""
    color = color_of(None, USD_DEFAULT_SPACE)
    try:
        pictures = [read_image(folder / p, "raw", color)[..., :3] for p in pair]
    except (InputError, OSError):
        return None
    pictures = [p[:: max(1, p.shape[1] // CELL), :: max(1, p.shape[1] // CELL)] for p in pictures]
    height = max(p.shape[0] for p in pictures)
    padded = [np.pad(p, ((0, height - p.shape[0]), (0, 2), (0, 0)), constant_values=DARK) for p in pictures]
    return np.concatenate(padded, 1).astype(np.float32)
