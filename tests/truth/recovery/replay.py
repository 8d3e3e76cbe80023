"""Replays values and intervals of a run that was kept, in seconds: how would other constants do?

    python tests/truth/recovery/replay.py DIR [--kind clean|textured] [--half even|odd]
                                              [--set uncertainty.OUTSIDE=.04 field_errors.SURE=.02 ...]

DIR was filled by run_recovery.py --keep.  Each answer is fitted again as painted, from the tables that its last round
had, and its interval taken; which explanation wins, and the light that goes round, stay as they were.  Constants were
found on the even half of the cases in their sets; the odd one shows what they are worth.  What is wrong, off in value
or has its truth outside is named.
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
from truth.recovery.run_recovery import (
    REPORT_KEY,
    TOLERANCE,
    Outcome,
    aims,
    intervals,
    read_truth,
    reliability,
    totals,
    true_value,
    with_interval,
)

from usdslf.inference.answers import means_of
from usdslf.inference.paint_errors import refit_as_painted
from usdslf.inference.uncertainty import interval
from usdslf.inference.weights import Options

HALVES = {"even": (0,), "odd": (1,), "": (0, 1)}
KINDS = {"clean": ("all",), "textured": ("textured",), "": ("all", "textured")}


def replayed(path: Path) -> Outcome:
    """Returns a kept outcome with the value and the interval of now."""
    kept = pickle.loads(path.read_bytes())
    o: Outcome = kept["outcome"]
    if not o.is_right or o.expected == "none" or kept["varies"]:
        return o
    key, t = REPORT_KEY[o.expected], kept["tables"]
    c = refit_as_painted(t, Options(), kept["chosen"])
    before, value = (np.atleast_1d(m[key]) for m in means_of(t, c))
    case = next(c for group in SETS.values() for c in group if c.name == o.case)
    truth = kept.get("truth") or read_truth(case)
    true = true_value(case, truth, "after", before)
    error = float(np.abs(value - true).max())
    ideal = half_widths(truth, o.way, SimpleNamespace(tables=t, chosen=c), key)  # type: ignore[arg-type]
    is_close = error <= TOLERANCE[o.expected]
    o = replace(o, true=tuple(true.tolist()), found=tuple(value.tolist()), error=error, is_close=is_close)
    return with_interval(o, getattr(interval(t, Options(), c), key), ideal)


def is_asked(name: str, kind: str, half: str) -> bool:
    """Whether a case is of a kind, at an even or odd place of its set; the twins come after the others."""
    for set_name in KINDS[kind]:
        names = [c.name for c in SETS[set_name]]
        if name in names:
            return names.index(name) % 2 in HALVES[half]
    return False


def named(found: list[Outcome]) -> str:
    """What is not as it should be, by name: strokes of each case."""
    rows = []
    for why, is_so in (
        ("wrong", lambda o: not o.is_right),
        ("off in value", lambda o: o.is_right and not o.is_close and o.way == "exact"),
        ("truth outside", lambda o: o.is_right and o.inside < 1),
    ):
        ways: dict[str, list[str]] = {}
        for o in found:
            if is_so(o):
                ways.setdefault(o.case, []).append(f"{o.way} {o.inferred}" if why == "wrong" else o.way)
        rows += [f"{why}: {case} ({', '.join(of)})" for case, of in ways.items()]
    return "\n".join(rows)


def main() -> None:
    """Prints values and intervals by painter."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kind", default="", choices=list(KINDS))
    parser.add_argument("--half", default="", choices=list(HALVES))
    parser.add_argument("--set", nargs="*", default=[], metavar="MODULE.NAME=NUMBER")
    a = parser.parse_args()
    for each in a.set:
        place, number = each.split("=")
        module, name = place.split(".")
        setattr(importlib.import_module(f"usdslf.inference.{module}"), name, float(number))
    files = sorted(a.folder.glob("*.pkl"))
    found = [replayed(f) for f in files if is_asked(f.name.split(".")[0], a.kind, a.half)]
    for total in totals(found):
        print(total)
    print(aims(totals(found), a.kind or "clean"))
    print(intervals(found))
    print(reliability(found))
    print(named(found))


if __name__ == "__main__":
    main()
