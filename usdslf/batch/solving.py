"""Solving: one shot and its strokes to a look, a report and small pictures, as a job of a batch."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import usdslf.session
from usdslf.batch.elsewhere import Scored, prefer_what_holds, score_elsewhere
from usdslf.batch.found import Found, write_values
from usdslf.batch.identity import identity_of
from usdslf.batch.job import Job
from usdslf.batch.reads import stages_read
from usdslf.inference.weights import Options
from usdslf.outputs import write_picture
from usdslf.report import lines_of_report
from usdslf.session import Session
from usdslf.similarity.similarity import Weights
from usdslf.strokes.stroke import Stroke, frame_of
from usdslf.usd.stroke_layer import read_strokes

if TYPE_CHECKING:
    from usdslf.progress import Say

SIZE, SAMPLES = (256, 144), 8  # of the small pictures
READING = ("device", "ocio", "make_preview", "elements", "bounces", "refine", "model", "missing_dome", "memory")
SHOWN = ("path", "material", "inferred", "before", "after", "residual_before", "residual_after", "ambiguous", "range")


def solve_shot(job: Job, folder: Path, say: Say | None) -> Found:
    """Solves the strokes of a shot and writes look.usda, report.json, before.png and after.png into `folder`."""
    strokes, said, session = opened(job, say)
    read, begun = stages_read(job, session.shot.source)
    for stroke in strokes:
        session.add_stroke(stroke)
    options = job.options
    choose = dict(options.get("choose", {}))
    weights = Options.of(options["weights"]) if "weights" in options else None
    similar = Weights(*options["similarity"]) if "similarity" in options else None
    session.solve(options.get("norm"), choose, weights, similar)
    scored: list[Scored] = []
    if job.elsewhere:
        places = [job.file(e) for e in job.elsewhere]
        scored = score_elsewhere(session.shot, session.solution, places)
        if job.prefer_robust and (better := prefer_what_holds(session.solution, scored, choose)):
            session.solve(options.get("norm"), choose | better, weights, similar)
            said += [
                f"{stroke}: {taken} is taken, as it holds in the other lights too" for stroke, taken in better.items()
            ]
            scored = score_elsewhere(session.shot, session.solution, places)
    session.author(folder / "look.usda", strokes_path=job.file(job.strokes), mode=options.get("mode", ""))
    report = session.report()
    del report["seconds"]  # differ from run to run
    report["warnings"] = [*said, *report["warnings"]]
    write_values(job, folder / "report.json", report)
    if job.pictures:
        write_pictures(job, session, folder)
    values = {
        "identity": identity_of(session.shot, strokes, options),
        "strokes": [{k: s[k] for k in SHOWN if k in s} for s in report["strokes"]],
        "elsewhere": [s.as_values() for s in scored],
        "edits": len(report["edits"]),
    }
    return Found(tuple(lines_of_report(report)), tuple(_findings(session, report)), values, read, begun)


def opened(job: Job, say: Say | None) -> tuple[list[Stroke], list[str], Session]:
    """Reads the strokes of a job and opens its shot at their frame; returns also what was said of them."""
    said: list[str] = []
    strokes = read_strokes(job.file(job.strokes), said)
    frame = frame_of([s for s in strokes if s.active], job.options.get("frame"), said)
    return strokes, said, open_shot(job, say, frame)


def open_shot(job: Job, say: Say | None, frame: float | None = None) -> Session:
    """Opens the shot of a job as its options say."""
    given = {k: job.options[k] for k in READING if k in job.options}
    frame = job.options.get("frame") if frame is None else frame
    return usdslf.session.open(job.file(job.shot), frame=frame, say=say, **given)


def write_pictures(job: Job, session: Session, folder: Path, look: str | Path | None = None) -> None:
    """Writes before.png and after.png: the shot as it is, and under a look, look.usda of the folder by default."""
    size = tuple(job.options.get("size", SIZE))
    camera, samples = job.options.get("camera"), job.options.get("samples", SAMPLES)
    write_picture(folder / "before.png", session.render(camera, size, samples=samples), session.scene)
    after = session.edited(look or folder / "look.usda")
    write_picture(folder / "after.png", after.render(camera, size, samples=samples), after.scene)


def _findings(session: Session, report: Mapping[str, Any]) -> list[str]:
    """What a person should look at, in sentences, each once."""
    look = session.look
    found = [
        *(look.not_shown if look else ()),
        *(c.in_words() for c in (look.collateral if look else ()) if c.is_finding),
    ]
    found += [m.sentence for m in session.scene.missing]
    found += [f"{s['path']} is ambiguous: {s['inferred']} is taken" for s in report["strokes"] if s.get("ambiguous")]
    if not report["edits"]:
        found.append("nothing is changed: no explanation was worth while")
    return list(dict.fromkeys(found))
