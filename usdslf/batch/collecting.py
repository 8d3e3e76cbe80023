"""Collecting: what came of all jobs of a plan, from what they wrote.

collect(plan) -> Summary      also written: summary.json, summary.csv, junit.xml, index.html, sheet.png
"""

from __future__ import annotations

import os
from pathlib import Path

from usdslf.batch.job import Job, Result
from usdslf.batch.places import RECORDS, why_outside
from usdslf.batch.planning import Plan
from usdslf.batch.records import as_known, read_note
from usdslf.batch.summary import Row, Summary, write_summary
from usdslf.errors import AuthorError

PICTURES = ("before.png", "after.png")


def collect(found: Plan) -> Summary:
    """Reads what came of all jobs, and writes the summary beside their results.

    Args:
        found: of `plan`; which results stand is read again.

    Raises: AuthorError or InputError where the summary cannot be written.
    """
    folder = Path(found.output)
    if why := why_outside(folder, RECORDS):
        raise AuthorError(why)
    (folder / RECORDS).mkdir(parents=True, exist_ok=True)
    rows = tuple(_row(job, as_known(job), os.path.dirname(found.manifest)) for job in found.jobs)
    summary = Summary(os.path.basename(found.manifest), found.output, rows)
    if any(row.pictures for row in rows) or (folder / "sheet.png").exists():
        from usdslf.batch.sheet import write_sheet

        write_sheet(summary)
    write_summary(summary, folder)
    return summary


def _row(job: Job, result: Result, base: str) -> Row:
    state = "done" if result.is_done else "new" if result.cause == "lost" else "failed"
    values = result.values
    return Row(
        job=job.name,
        kind=job.kind,
        state=state,
        shot=os.path.relpath(job.shot, base) if job.shot else "",
        strokes=os.path.relpath(job.strokes, base) if job.strokes else "",
        why="" if state == "new" else result.why,
        cause="" if state == "new" else result.cause,
        lines=result.lines,
        findings=result.findings,
        answers=tuple(values.get("strokes", ())),
        edits=int(values.get("edits", 0)),
        elsewhere=tuple(values.get("elsewhere", ())),
        changed=read_note(job).get("changed") if state == "done" else None,
        pictures=tuple(f"{job.name}/{p}" for p in PICTURES if p in result.files),
        residuals=tuple(values.get("residuals", ())),
    )
