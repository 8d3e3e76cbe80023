"""Propagate: an accepted look laid over another shot, with pictures before and after, and what is wrong there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from usdslf.batch.found import Found, write_values
from usdslf.batch.job import Job
from usdslf.batch.reads import stages_read
from usdslf.errors import InputError
from usdslf.replacing import is_file
from usdslf.scene.difference import look_alike
from usdslf.scene.records import Scene
from usdslf.usd.author.author import author_review_root
from usdslf.usd.edited import open_edited
from usdslf.usd.read.read import open_stage, read_scene
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
    shot, edited, (scene, scene_edited) = _opened(job, look)
    review = review_look(job.file(job.shot), look, job.options.get("ocio"))
    review = replace(review, findings=tuple(f for f in review.findings if f.name not in EXPECTED))
    read, begun = stages_read(job, shot, edited)
    findings = [*_sentences(review, scene), *other_variants(shot, look)]
    if look_alike(scene.materials, scene_edited.materials):
        findings.insert(0, f"the look changes nothing in {Path(job.shot).name}")
    author_review_root(folder / "review.usda", look, None, job.file(job.shot))
    write_values(job, folder / "report.json", review.as_values())
    if job.pictures:
        from usdslf.batch.solving import open_shot, write_pictures

        write_pictures(job, open_shot(job, say), folder, look)
    lines = [line.replace(f"{job.root}/", "/") if job.root else line for line in lines_of_review(review)]
    return Found(tuple(lines), tuple(findings), {"edits": len(review.edits)}, read, begun)


def _opened(job: Job, look: str) -> tuple[Any, Any, tuple[Scene, Scene]]:
    """The stages of the shot without and with the look, and what they show; light is needed for pictures alone."""
    if job.options.get("make_preview"):
        from usdslf.batch.solving import open_shot

        session = open_shot(job, None)
        under = session.edited(look)
        return session.shot.source, under.shot.source, (session.scene, under.scene)
    stages = open_stage(job.file(job.shot)), open_edited(job.file(job.shot), look)
    o = job.options
    scenes = [read_scene(s, o.get("frame"), refine=o.get("refine", 1), ocio=o.get("ocio")) for s in stages]
    return *stages, (scenes[0], scenes[1])


def _sentences(review: LookReview, scene: Scene) -> Iterator[str]:
    """The findings in words; of a material that is not there, which one may be it under another name."""
    for finding in review.findings:
        say = finding.message
        if finding.name in GONE:
            gone = {n for e in review.edits if e.prim.startswith(finding.prim) for n in e.prim.split("/")}
            named = [m.path for m in scene.materials if m.path.rsplit("/", 1)[-1] in gone]
            say += f" It may be {', '.join(named)} now." if named else ""
        yield say
