"""Runs side by side divide what is alike on all of them: each case is asked by one of the runs.

The gate runs the tests on several Pythons at once.  What depends on a Python (commands, USD, windows, processes, texts,
the public names) each of them asks.  What OpenCL, Embree and numpy compute is alike on all, and so are the sources:
modules of ALIKE, and cases of functions that are marked `divided`, go one by one to the run that comes to them first,
so that all runs end at the same time.  What was taken stands as files in the folder USDSLF_CLAIMS, a new one for each
gate.  Suites whose cases are counted together ask every n-th, or a half of them: USDSLF_SHARE=1/2 is the second.

Without these variables a run asks all.  With a share and no folder it asks its share of what is marked.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

Item = TypeVar("Item")

# Folders and modules of tests/ that ask nothing but what is computed, or what the sources are.
ALIKE = (
    "animation", "batch/test_joint.py", "edits", "elements", "geometry", "hydra_viewer/test_on_a_display.py",
    "inference", "journeys/test_demo.py", "light_field", "lights", "render", "sampling", "similarity", "strokes",
    "stylize", "surfaces", "test_sentences.py", "test_structure.py", "test_threads.py",
    "textures/test_texture_store.py", "truth", "usd/author/test_look_round_trip.py",
)  # fmt: skip
COUNTED = ("inference/test_recovery.py",)  # divided by what they count, below
TESTS = Path(__file__).resolve().parents[1]


def is_alike(module: Path) -> bool:
    """Whether a module of tests/ is alike on all Pythons."""
    path = module.resolve().relative_to(TESTS).as_posix()
    return path not in COUNTED and any(path == name or path.startswith(f"{name}/") for name in ALIKE)


def claims() -> Path | None:
    """Returns the folder of what runs side by side have taken, where there are others."""
    folder = os.environ.get("USDSLF_CLAIMS")
    return Path(folder) if folder else None


def take(name: str, folder: Path) -> bool:
    """Takes a piece of work for this run.

    Returns: False where another run has it.
    """
    try:
        with (folder / hashlib.sha256(name.encode()).hexdigest()).open("x") as file:
            file.write(f"{name}\n{os.getpid()}\n")
    except FileExistsError:
        return False
    return True


def not_taken(items: Sequence[Item], piece: Callable[[Item], str | None], folder: Path) -> Iterator[Item]:
    """Yields those that this run is to ask, and takes each piece of them as it comes to it.

    Args:
        items: In this run's order.
        piece: The piece of work that an item belongs to; None for those that all runs ask.
    """
    mine: dict[str, bool] = {}
    for item in items:
        name = piece(item)
        if name is None:
            yield item
            continue
        if name not in mine:
            mine[name] = take(name, folder)
        if mine[name]:
            yield item


def share_of(items: Sequence[Item]) -> list[Item]:
    """Returns every n-th of some items, from the k-th on, where the variable says k/n (0/1: all)."""
    number, count = _share()
    return list(items[number::count])


def rows_of_share(length: int) -> range:
    """Returns the part of so many rows, one after the other, that is this run's."""
    number, count = _share()
    return range(number * length // count, (number + 1) * length // count)


def first_of_share(length: int) -> int:
    """Returns the row of a list at which this run begins, so that runs side by side do not do the same at once."""
    return rows_of_share(length).start


def _share() -> tuple[int, int]:
    number, count = (int(x) for x in os.environ.get("USDSLF_SHARE", "0/1").split("/"))
    if not 0 <= number < count:
        raise ValueError(f"USDSLF_SHARE={number}/{count}: the first number is 0 to {count - 1}")
    return number, count
