"""How long a review of a large look takes, and how large its page is.

    python tests/bench/review_size.py [TILES]      200 tiles: 400 edits and 200 strokes

Aim on two cores: two minutes and 40 MB.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1])]

from kit.many_edits import write_many  # noqa: E402

from usdslf.review.page import page_of  # noqa: E402
from usdslf.review.review import review  # noqa: E402


def main() -> None:
    """Prints counts, seconds (of the clock, of the processors) and megabytes."""
    tiles = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    with tempfile.TemporaryDirectory() as folder:
        shot, look = write_many(Path(folder), tiles)
        clock, processors = time.perf_counter(), time.process_time()
        found = review(shot, look)
        page = page_of(found)
        edits, strokes = len(found.look.edits), len(found.strokes)
        print(f"{edits} edits, {strokes} strokes, {len(found.views)} views of {found.views[0].pictures.size}")
        took = time.perf_counter() - clock, time.process_time() - processors
        print(f"{took[0]:.1f} s of the clock, {took[1]:.1f} s of processors")
        print(f"{len(page.encode()) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
