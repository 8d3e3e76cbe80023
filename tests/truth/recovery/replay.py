"""Replays values and intervals of a run that was kept, in seconds: how would other constants do?

    python tests/truth/recovery/replay.py DIR [--half even|odd] [--set uncertainty.BELOW=.04 paint_errors.SURE=.02 ...]

DIR was filled by run_recovery.py --keep.  Each answer is fitted again as painted, from the tables that its last round
had, and its interval taken; which explanation wins, and the light that goes round, stay as they were.  Constants were
found on the even half of the cases in their sets; the odd one shows what they are worth.
"""

from __future__ import annotations

import argparse
import importlib
import pickle
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from truth.recovery.cases import SETS
from truth.recovery.ideal import half_widths
from truth.recovery.run_recovery import REPORT_KEY, TOLERANCE, Outcome, intervals, read_truth, totals, with_interval

from usdslf.inference.answers import means_of
from usdslf.inference.paint_errors import refit_as_painted
from usdslf.inference.uncertainty import interval
from usdslf.inference.weights import Options

HALVES = {"even": (0,), "odd": (1,), "": (0, 1)}


def replayed(path: Path) -> Outcome:
    """Returns a kept outcome with the value and the interval of now."""
    kept = pickle.loads(path.read_bytes())
    o: Outcome = kept["outcome"]
    if not o.is_right or o.expected == "none" or kept["varies"]:
        return o
    key, t = REPORT_KEY[o.expected], kept["tables"]
    c = refit_as_painted(t, Options(), kept["chosen"])
    value = np.atleast_1d(means_of(t, c)[1][key])
    error = float(np.abs(value - o.true).max())
    case = next(c for group in SETS.values() for c in group if c.name == o.case)
    ideal = half_widths(read_truth(case), o.way, SimpleNamespace(tables=t, chosen=c), key)  # type: ignore[arg-type]
    o = replace(o, found=tuple(value.tolist()), error=error, is_close=error <= TOLERANCE[o.expected])
    return with_interval(o, getattr(interval(t, Options(), c), key), ideal)


def is_of_half(name: str, half: str) -> bool:
    """Whether a case is at an even or odd place of its set, the twins after the others."""
    for group in (SETS["all"], SETS["textured"]):
        place = [c.name for c in group].index(name) if name in {c.name for c in group} else None
        if place is not None:
            return place % 2 in HALVES[half]
    return False


def main() -> None:
    """Prints values and intervals by painter."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--half", default="", choices=list(HALVES))
    parser.add_argument("--set", nargs="*", default=[], metavar="MODULE.NAME=NUMBER")
    a = parser.parse_args()
    for each in a.set:
        place, number = each.split("=")
        module, name = place.split(".")
        setattr(importlib.import_module(f"usdslf.inference.{module}"), name, float(number))
    files = sorted(a.folder.glob("*.pkl"))
    found = [replayed(f) for f in files if is_of_half(f.name.split(".")[0], a.half)]
    for total in totals(found):
        print(total)
    print(intervals(found))


if __name__ == "__main__":
    main()
