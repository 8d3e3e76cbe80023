"""Sheet: a contact sheet, before and after of each job in one picture, with its name and how many findings it has.

write_sheet(summary) -> None      sheet.png in the output folder, where there are pictures
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf.batch.summary import Row, Summary
from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import InputError
from usdslf.textures.captions import caption
from usdslf.textures.images import read_image, write_image

COLUMNS = 3  # jobs side by side
MOST = 120  # jobs on a sheet
GAP, DARK = 6, 0.1  # pixels between pictures, and their grey
CELL = 256  # pixels, the widest picture
LINE = 20  # pixels, of a name
PLAIN, FOUND, FAILED = (0.75, 0.75, 0.75), (0.91, 0.76, 0.42), (0.94, 0.54, 0.48)  # colours of names


def write_sheet(summary: Summary) -> None:
    """Writes the sheet of the jobs that have pictures, before and after side by side, and of those that failed.

    Without any picture there is none.
    """
    folder = Path(summary.output)
    rows = [r for r in summary.rows if len(r.pictures) == 2 or r.state == "failed"]
    pairs = [(r, _pair(folder, r.pictures)) for r in rows[:MOST]]
    target = folder / "sheet.png"
    if all(pair is None for _, pair in pairs):
        target.unlink(missing_ok=True)
        return
    height, width = (max(pair.shape[k] for _, pair in pairs if pair is not None) for k in (0, 1))
    columns = min(COLUMNS, len(pairs))
    high, wide = height + LINE + GAP, width + GAP
    sheet = np.full((high * -(-len(pairs) // columns) + GAP, wide * columns + GAP, 3), DARK, np.float32)
    for i, (row, pair) in enumerate(pairs):
        y, x = GAP + high * (i // columns), GAP + wide * (i % columns)
        if pair is not None:
            sheet[y : y + pair.shape[0], x : x + pair.shape[1]] = pair
        sheet[y + height : y + height + LINE, x : x + width] = _name(row, width)
    write_image(target, sheet)


def _name(row: Row, width: int) -> NDArray[np.float32]:
    """A job's name, with what is to be looked at."""
    count = len(row.findings)
    if row.state == "failed":
        said, color = f"{row.job}: failed", FAILED
    elif count:
        said, color = f"{row.job}: {count} finding{'s' if count > 1 else ''}", FOUND
    else:
        said, color = row.job, PLAIN
    return caption(said, (width, LINE), color, (DARK,) * 3)


def _pair(folder: Path, names: tuple[str, ...]) -> NDArray[np.float32] | None:
    """Before and after side by side; None where one is gone, or was never made."""
    if len(names) != 2:
        return None
    color = color_of(None, USD_DEFAULT_SPACE)
    try:
        pictures = [read_image(folder / p, "raw", color)[..., :3] for p in names]
    except (InputError, OSError):
        return None
    pictures = [p[:: max(1, p.shape[1] // CELL), :: max(1, p.shape[1] // CELL)] for p in pictures]
    height = max(p.shape[0] for p in pictures)
    padded = [np.pad(p, ((0, height - p.shape[0]), (0, 2), (0, 0)), constant_values=DARK) for p in pictures]
    return np.concatenate(padded, 1).astype(np.float32)
