"""Runs the recovery suite: does a stroke give back the change that was made?

    python tests/truth/recovery/run_recovery.py [NAME ...] [--set tuning|twin|all|textured] [--ways all|exact,few,...]
                                          [--elements N] [--json OUT] [--markdown] [--keep DIR]

The truth (truth/NAME.json, see make_truth) was rendered by a path tracer.  For each case and way the dabs are
painted on the unchanged stage as one replace stroke, solved, and compared: the freed parameters must be
exactly the one that was changed, of the right material, and for exact strokes its value must come back.
Painters: see painters.py.  The gate (WANTED) holds exact, uneven and flat; AIMED_AT is where all are to come to.
"""

from __future__ import annotations

import argparse
import json
import math
import pickle
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from truth.recovery.cases import SETS, UNDECIDABLE
from truth.recovery.ideal import half_widths
from truth.recovery.painters import PAINTERS, painted
from truth.recovery.stages import CAMERA, SIZE, Case, build_stage
from truth.recovery.textured_cases import TexturedCase

import usdslf
from usdslf.scene.cameras import camera_rays

TRUTH = Path(__file__).parent / "truth"
WAYS = ("exact", "uneven", "flat")  # of the gate; all are in painters.py
BEFORE = "before"  # the true colours of the unchanged stage, to which the answer is: none
WANTED = {"exact": 0.95, "uneven": 0.90, "flat": 0.70}  # the gate's
AIMED_AT = {  # shares of the right parameter that the program is to come to, by set and painter
    "clean": {"exact": 0.95, "uneven": 0.95, "few": 0.90, "swatch": 0.90, "dark": 0.85, "flat": 0.80, "display": 0.95},
    "textured": {"exact": 0.90, "swatch": 0.80},
}
TOLERANCE = {"diffuse": 0.05, "specular": 0.05, "glossiness": 0.07}
REPORT_KEY = {"diffuse": "diffuse", "specular": "specular", "glossiness": "roughness"}
ELEMENTS = 4000
ROUNDED = 5e-4  # the true values of an outcome are
BINS = (0.0, 0.6, 0.8, 0.95, 0.99, 1.0)  # of probabilities, in the table of how often they are right


@dataclass(frozen=True)
class Outcome:
    """What became of one stroke."""

    case: str
    way: str
    expected: str
    inferred: str
    is_right: bool  # parameter and material
    error: float  # of the changed parameter's value, largest channel; nan where it was not freed
    is_close: bool  # value within tolerance
    true: tuple[float, ...]
    found: tuple[float, ...]
    ranking: str  # the best alternatives with their costs
    residual: float
    seconds: float
    note: str = ""
    inside: float = float("nan")  # share of the channels whose true value the stated 90 % interval holds
    width: float = float("nan")  # median over the channels of its width, in an ideal observer's; see ideal.py
    probability: float = float("nan")  # that the report gives to what was inferred


def read_truth(case: Case | TexturedCase) -> dict[str, Any]:
    """Returns the saved truth of a case."""
    return json.loads((TRUTH / f"{case.name}.json").read_text())


def run_case(
    case: Case | TexturedCase, ways: Iterable[str] = WAYS, elements: int = ELEMENTS, keep: Path | None = None,
    **options: Any,
) -> list[Outcome]:  # fmt: skip
    """Paints and solves one case in each way.  `keep`: folder of answers, see replay.py.  `options`: of usdslf.open."""
    truth = read_truth(case)
    start = time.perf_counter()
    found = []
    with tempfile.TemporaryDirectory() as folder:
        stage = case.build(Path(folder)) if isinstance(case, TexturedCase) else build_stage(case, Path(folder))
        session = usdslf.open(stage, elements=elements, **options)
        truth = on_one_copy(session, case, truth)
        for way in ways:
            stroke = paint(session, truth, way)
            session.add_stroke(stroke)
            session.solve()
            report = session.report()["strokes"][0]
            outcome = judge(case, truth, way, report, time.perf_counter() - start)
            if outcome.is_right and way != BEFORE:
                ideal = half_widths(truth, way, session.answers[0], REPORT_KEY[case.parameter])
                outcome = with_interval(outcome, report["range"].get(REPORT_KEY[case.parameter]), ideal)
            if keep is not None:
                keep_answer(keep, outcome, session.answers[0], truth)
            session.remove_stroke(stroke.name)
            found.append(outcome)
            start = time.perf_counter()
    return found


def on_one_copy(session: Any, case: Case | TexturedCase, truth: dict[str, Any]) -> dict[str, Any]:
    """Returns the truth with the dabs on the copy that has most of them alone: a stroke changes the copy it is on.

    Where a shot has one copy it is the truth as it is.
    """
    if not (isinstance(case, TexturedCase) and case.shot.copies):
        return truth
    camera = next(c for c in session.scene.cameras if c.path == truth["camera"])
    rays = camera_rays(camera, np.array(truth["xy"]), SIZE[0] / SIZE[1])
    material = session.scene.triangles.material[session.tracer.intersect(rays.origin, rays.direction).triangle]
    mine = np.flatnonzero(material == np.bincount(material).argmax())
    of = lambda rows: [rows[i] for i in mine]  # noqa: E731
    colors = {"exact": of(truth["colors"]["exact"])}  # what the others paint follows from these
    return truth | {"xy": of(truth["xy"]), "colors": colors, "colors_before": of(truth["colors_before"])}


def keep_answer(folder: Path, outcome: Outcome, answer: Any, truth: dict[str, Any]) -> None:
    """Keeps an answer's tables with its outcome, so that what is fitted last can be repeated without the stage."""
    folder.mkdir(parents=True, exist_ok=True)
    kept = {"outcome": outcome, "tables": answer.tables, "chosen": answer.chosen, "truth": truth}
    kept["varies"] = answer.varying is not None
    (folder / f"{outcome.case}.{outcome.way}.pkl").write_bytes(pickle.dumps(kept))


def paint(session: Any, truth: dict[str, Any], way: str) -> usdslf.Stroke:
    """Returns the dabs of a truth as one stroke with a colour for each dab."""
    camera = next(c for c in session.scene.cameras if c.path == truth.get("camera", CAMERA))
    if way == BEFORE:
        chosen, painted_colors = np.arange(len(truth["xy"])), np.array(truth["colors_before"])
    else:
        chosen, painted_colors = painted(truth, way)
    paths = [np.array([truth["xy"][i]]) for i in chosen]
    stroke = usdslf.paint_stroke(
        session.scene, session.tracer, camera, paths, truth["radius"], aspect=SIZE[0] / SIZE[1]
    )
    assert len(stroke.counts) == len(paths), "a dab missed its surface"
    colors = np.repeat(painted_colors.astype(np.float32), stroke.counts, axis=0)
    return replace(stroke, colors=colors)


def judge(
    case: Case | TexturedCase, truth: dict[str, Any], way: str, report: dict[str, Any], seconds: float
) -> Outcome:
    """Compares a stroke's report with the truth."""
    key, expected = REPORT_KEY[case.parameter], "none" if way == BEFORE else case.parameter
    true = true_value(case, truth, "before" if way == BEFORE else "after", np.atleast_1d(report["before"][key]))
    found = np.atleast_1d(report["after"][key]).astype(float)
    is_material = is_same_material(case, truth["material"], report["material"])
    is_right = report["inferred"] == expected and is_material
    error = float(np.abs(found - true).max()) if expected in report["inferred"] else float("nan")
    others = sorted(report.get("alternatives", ()), key=lambda a: a["cost"])[:3]
    return Outcome(
        case.name,
        way,
        expected,
        report["inferred"],
        is_right,
        error,
        bool(is_right and error <= TOLERANCE[case.parameter]),
        tuple(np.round(true, 3).tolist()),
        tuple(np.round(found, 3).tolist()),
        " ".join(f"{a['id']}:{a['cost']:.3g}" for a in others),
        float(report["residual_after"]),
        seconds,
        "" if is_material else f"material {report['material']}",
        probability=next((a["probability"] for a in report["alternatives"] if a["id"] == report["inferred"]), 0.0),
    )


def true_value(
    case: Case | TexturedCase, truth: dict[str, Any], when: str, before: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Returns the true value of the changed parameter at the dabs that an answer reads.

    What is saved is the mean over all dabs of the truth.  Six of them, or those on one of several copies, lie on other
    texels; where a texture was changed by a factor that is known, the truth there is what was there times it.

    Args:
        before: mean over the answer's own dabs.
    """
    key = REPORT_KEY[case.parameter]
    was, true = (np.atleast_1d(truth[k][key]).astype(float) for k in ("before", when))
    is_factor = isinstance(case, TexturedCase) and all(c.is_factor for c in case.changes)
    is_factor |= isinstance(case, Case) and bool(case.texture) and case.parameter == "diffuse"
    return true * np.asarray(before, float) / np.maximum(was, 1e-9) if is_factor else true


def with_interval(o: Outcome, ends: Any, ideal: np.ndarray) -> Outcome:
    """Returns the outcome with what its interval is worth; as it is where the answer varies.

    Args:
        ends: least and greatest value, of each channel or of roughness.
        ideal: half the width of an ideal observer's interval.
    """
    if ends is None:
        return o
    low, high = (np.atleast_1d(x).astype(float) for x in ends)
    true = np.array(o.true)
    inside = float(np.mean((true >= low - ROUNDED) & (true <= high + ROUNDED)))
    return replace(o, inside=inside, width=float(np.median(0.5 * (high - low) / ideal)))


def is_same_material(case: Case | TexturedCase, true: str, found: str) -> bool:
    """Whether a material is the one that changed, or that one in an instance."""
    if isinstance(case, TexturedCase) and case.shot.copies:
        return found.endswith(true.removeprefix(case.shot.root))
    return found == true


def run(cases: Iterable[Case | TexturedCase], ways: Iterable[str] = WAYS, **options: Any) -> Iterator[Outcome]:
    """Yields the outcomes of all cases; one that fails to run is an outcome too."""
    for case in cases:
        try:
            yield from run_case(case, ways, **options)
        except Exception as error:
            traceback.print_exc()
            note = f"{type(error).__name__}: {error}"
            for way in ways:
                nan = float("nan")
                yield Outcome(
                    case.name, way, case.parameter, "failed", False, nan, False, (), (), "", nan, 0.0, note
                )


def select(set_name: str = "tuning", names: Iterable[str] = ()) -> list[Case | TexturedCase]:
    """Returns the cases of a set that have a truth and can be decided; names are parts of names."""
    names = list(names)
    return [
        c
        for c in SETS[set_name]
        if (not names or any(n in c.name for n in names))
        and (names or c.name not in UNDECIDABLE)
        and (TRUTH / f"{c.name}.json").exists()
    ]


def line(o: Outcome) -> str:
    """One row of the table."""
    mark = "ok   " if o.is_right and o.is_close else "value" if o.is_right else "WRONG"
    values = f"{_numbers(o.true):>17s} {_numbers(o.found):>17s}"
    what = f"{mark} {o.case:46s} {o.way:7s} {o.expected:10s} {o.inferred:22s}"
    return f"{what} {values} {o.error:6.3f} {o.seconds:5.1f}  {o.ranking} {o.note}"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{v:.3f}" for v in values)


@dataclass(frozen=True)
class Totals:
    """Counts of one way."""

    way: str
    strokes: int
    right: int
    close: int  # of the right ones

    @property
    def share(self) -> float:
        """Of right parameters."""
        return self.right / max(self.strokes, 1)

    def __str__(self) -> str:
        wanted = f", wanted {100 * WANTED[self.way]:.0f} %" if self.way in WANTED else ""
        return (
            f"{self.way:7s} {self.right} of {self.strokes} right ({100 * self.share:.1f} %{wanted}), "
            f"{self.close} of them within tolerance"
        )


def totals(outcomes: list[Outcome]) -> list[Totals]:
    """Counts by way."""
    found = []
    for way in (*PAINTERS, BEFORE):
        of_way = [o for o in outcomes if o.way == way]
        if of_way:
            right = [o for o in of_way if o.is_right]
            found.append(Totals(way, len(of_way), len(right), sum(o.is_close for o in right)))
    return found


def aims(found: list[Totals], kind: str) -> str:
    """The second table: what each painter is to come to, in the sets that are "clean" or "textured"."""
    rows = ["painter   right  aimed at"]
    for t in found:
        aim = AIMED_AT[kind].get(t.way)
        if aim is not None:
            mark = "reached" if t.share >= aim else f"{math.ceil(aim * t.strokes - 1e-9) - t.right} cases short"
            rows.append(f"{t.way:8s} {100 * t.share:5.1f} %    {100 * aim:3.0f} %  {mark}")
    return "\n".join(rows)


def intervals(outcomes: list[Outcome]) -> str:
    """The third table: how often the stated 90 % intervals hold the truth, and how wide they are."""
    rows = ["painter   strokes  truth inside  width in an ideal observer's (median, 90 % below)"]
    for way in PAINTERS:
        of_way = [o for o in outcomes if o.way == way and not math.isnan(o.inside)]
        if of_way:
            inside = 100 * np.mean([o.inside for o in of_way])
            middle, most = np.percentile([o.width for o in of_way], [50, 90])
            rows.append(f"{way:8s} {len(of_way):8d} {inside:10.1f} %  {middle:.1f}, {most:.1f}")
    return "\n".join(rows)


def reliability(outcomes: list[Outcome]) -> str:
    """The fourth table: how often what the report gives a probability is right."""
    rows = ["probability   strokes  mean  right"]
    known = [o for o in outcomes if o.way != BEFORE and not math.isnan(o.probability)]
    for low, high in pairwise(BINS):
        mine = [o for o in known if low < o.probability <= high]
        if mine:
            mean, right = np.mean([o.probability for o in mine]), np.mean([o.is_right for o in mine])
            rows.append(f"{low:.2f} - {high:.2f} {len(mine):8d}  {mean:.3f}  {right:.3f}")
    return "\n".join(rows)


def markdown_of_failures(outcomes: list[Outcome]) -> str:
    """The table of failures for the README."""
    rows = ["| case | stroke | changed | inferred | true | found |", "|---|---|---|---|---|---|"]
    for o in outcomes:
        if not o.is_right or (o.way == "exact" and not o.is_close):
            cells = (o.case, o.way, o.expected, o.inferred, _numbers(o.true), _numbers(o.found))
            rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of names; none: all of the set")
    parser.add_argument("--set", default="tuning", choices=list(SETS))
    parser.add_argument("--ways", default=",".join(WAYS), help=f"of {','.join([*PAINTERS, BEFORE])}, or all")
    parser.add_argument("--elements", type=int, default=ELEMENTS)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--keep", type=Path, help="folder of answers, for replay.py")
    parser.add_argument("--markdown", action="store_true", help="end with a table of failures")
    a = parser.parse_args()
    outcomes = []
    ways = PAINTERS if a.ways == "all" else a.ways.split(",")
    sets = ("all", "textured") if a.names and a.set == "tuning" else (a.set,)
    chosen = [case for name in sets for case in select(name, a.names)]
    for outcome in run(chosen, ways, elements=a.elements, keep=a.keep):
        outcomes.append(outcome)
        print(line(outcome), flush=True)
    for total in totals(outcomes):
        print(total)
    print(aims(totals(outcomes), "textured" if a.set == "textured" else "clean"))
    print(intervals(outcomes))
    print(reliability(outcomes))
    if a.markdown:
        print(markdown_of_failures(outcomes))
    if a.json:
        a.json.write_text(json.dumps([asdict(o) for o in outcomes], indent=1))


if __name__ == "__main__":
    main()
