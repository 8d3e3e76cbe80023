"""Propagate: an accepted look laid over another shot, with pictures before and after, and what is wrong there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from usdslf.batch.found import Found, write_values
from usdslf.batch.job import Job
from usdslf.batch.solving import open_shot, read_of, write_pictures
from usdslf.errors import InputError
from usdslf.replacing import is_file
from usdslf.scene.difference import look_alike
from usdslf.scene.records import Scene
from usdslf.usd.author.author import author_review_root
from usdslf.usd.review.other_variants import other_variants
from usdslf.usd.review.records import LookReview
from usdslf.usd.review.review import lines_of_review, review_look

if TYPE_CHECKING:
    from usdslf.progress import Say

EXPECTED = ("StaleLook",)  # findings of a look that is laid over another shot than its own
GONE = ("DanglingOver", "MissingTarget")


def propagate_look(job: Job, folder: Path, say: Say | None) -> Found:
    """Lays a look over a shot: writes review.usda, report.json, before.png and after.png into `folder`.

    Raises: InputError where there is no look, StageError for the shot.
    """
    look = job.file(job.look)
    if not is_file(look):
        raise InputError(f"there is no look {job.look}; solve it first, or mend `look` of the manifest")
    session = open_shot(job, say)
    review = review_look(job.file(job.shot), look, job.options.get("ocio"))
    review = replace(review, findings=tuple(f for f in review.findings if f.name not in EXPECTED))
    edited = session.edited(look)
    read, begun = read_of(job, session, edited)
    findings = [*_sentences(review, session.scene), *other_variants(session.shot.source, look)]
    if look_alike(session.scene.materials, edited.scene.materials):
        findings.insert(0, f"the look changes nothing in {Path(job.shot).name}")
    author_review_root(folder / "review.usda", look, None, job.file(job.shot))
    write_values(job, folder / "report.json", review.as_values())
    if job.pictures:
        write_pictures(job, session, folder, look)
    lines = [line.replace(f"{job.root}/", "/") if job.root else line for line in lines_of_review(review)]
    return Found(tuple(lines), tuple(findings), {"edits": len(review.edits)}, read, begun)


def _sentences(review: LookReview, scene: Scene) -> Iterator[str]:
    """The findings in words; of a material that is not there, which one may be it under another name."""
    for finding in review.findings:
        say = finding.message
        if finding.name in GONE:
            gone = {n for e in review.edits if e.prim.startswith(finding.prim) for n in e.prim.split("/")}
            named = [m.path for m in scene.materials if m.path.rsplit("/", 1)[-1] in gone]
            say += f" It may be {', '.join(named)} now." if named else ""
        yield say
