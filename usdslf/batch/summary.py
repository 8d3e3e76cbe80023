"""Summary: what came of all jobs, as JSON, CSV, JUnit XML and a page with small pictures.

write_summary(summary, folder)      summary.json, summary.csv, junit.xml, index.html, each whole or not at all
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jinja2

from usdslf.batch.records import text_of
from usdslf.replacing import replacing

CSV_FIELDS = (
    "job", "kind", "state", "shot", "strokes", "inferred", "residual_before", "residual_after", "edits", "findings",
    "why",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What came of one job.

    Attributes:
        job: its name.
        kind: as of the job.
        state: done | failed | new: one that was not run.
        shot, strokes: files, relative to the manifest.
        why: of a failure.
        cause: error | crash | time | memory | lost, of a failure.
        lines: what was found, in words.
        findings: what a person should look at.
        answers: of each stroke what was inferred, before, after and the residuals.
        edits: how many were written.
        elsewhere: scores in other light.
        changed: what changed since the result before, and why; empty where there was none.
        pictures: names of pictures, relative to the output folder.
        residuals: of a joint solve, by shot: before and after.
    """

    job: str
    kind: str
    state: str
    shot: str = ""
    strokes: str = ""
    why: str = ""
    cause: str = ""
    lines: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    answers: tuple[Mapping[str, Any], ...] = ()
    edits: int = 0
    elsewhere: tuple[Mapping[str, Any], ...] = ()
    changed: Mapping[str, Any] | None = None
    pictures: tuple[str, ...] = ()
    residuals: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True)
class Summary:
    """What came of a batch.

    Attributes:
        manifest: name of its file.
        output: folder of all results.
        rows: of each job, in the order of the manifest.
    """

    manifest: str
    output: str
    rows: tuple[Row, ...]

    def count(self, state: str) -> int:
        """Returns how many jobs are in a state: done | failed | new."""
        return sum(r.state == state for r in self.rows)

    @property
    def failed(self) -> tuple[Row, ...]:
        """The jobs that failed."""
        return tuple(r for r in self.rows if r.state == "failed")

    def as_values(self) -> dict[str, Any]:
        """Returns it as JSON-ready values."""
        counts = {state: self.count(state) for state in ("done", "failed", "new")}
        return {"manifest": self.manifest, "counts": counts, "jobs": [asdict(r) for r in self.rows]}


def write_summary(summary: Summary, folder: str | Path) -> None:
    """Writes summary.json, summary.csv, junit.xml and index.html into a folder.

    Raises: InputError where they cannot be written.
    """
    texts = {
        "summary.json": text_of(summary.as_values()),
        "summary.csv": _csv(summary),
        "junit.xml": _junit(summary),
        "index.html": _page(summary),
    }
    for name, text in texts.items():
        with replacing(Path(folder) / name) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="")


def _csv(summary: Summary) -> str:
    """One row a stroke, or a job without any."""
    out = io.StringIO()
    writer = csv.DictWriter(out, CSV_FIELDS, lineterminator="\n")
    writer.writeheader()
    for r in summary.rows:
        shared = {
            "job": r.job, "kind": r.kind, "state": r.state, "shot": r.shot, "strokes": r.strokes, "edits": r.edits,
            "findings": len(r.findings), "why": r.why,
        }  # fmt: skip
        for answer in r.answers or ({},):
            writer.writerow({**shared, **{k: answer.get(k, "") for k in CSV_FIELDS[5:8]}})
    return out.getvalue()


def _junit(summary: Summary) -> str:
    """A test case a job, as continuous integration reads it."""
    counts = {"tests": len(summary.rows), "failures": 0, "errors": len(summary.failed), "skipped": summary.count("new")}
    suite = ElementTree.Element(
        "testsuite", {"name": summary.manifest, **{k: str(v) for k, v in counts.items()}}
    )  # fmt: skip
    for r in summary.rows:
        case = ElementTree.SubElement(suite, "testcase", {"classname": summary.manifest, "name": r.job})
        if r.state == "failed":
            ElementTree.SubElement(case, "error", {"message": _printable(r.why), "type": r.cause})
        elif r.state == "new":
            ElementTree.SubElement(case, "skipped", {"message": "it was not run"})
        if r.lines or r.findings:
            said = "\n".join([*r.lines, *(f"finding: {f}" for f in r.findings)])
            ElementTree.SubElement(case, "system-out").text = _printable(said)
    ElementTree.indent(suite)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suite, encoding="unicode") + "\n"


def _printable(text: str) -> str:
    """A text as XML can hold it."""
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def _page(summary: Summary) -> str:
    text = (Path(__file__).parent / "page.html.jinja").read_text(encoding="utf-8")
    return jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(text).render(s=summary)
