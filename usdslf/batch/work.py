"""Work: one job, in this process, from its row to the folder of its results.

    run_job(job, say) -> Result      the same files, byte for byte, wherever it runs

The folder holds result.json, which names all else in it by content, and by kind: look.usda, report.json, before.png
and after.png of solve and propagate; tables of a joint solve.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from usdslf.batch.found import Worker
from usdslf.batch.inputs import inputs_of, row_of
from usdslf.batch.job import Job, Result
from usdslf.batch.places import staged
from usdslf.batch.records import RESULT, forget_failure, text_of, without_root
from usdslf.contents import file_hash
from usdslf.errors import InputError
from usdslf.progress import hearing

if TYPE_CHECKING:
    from usdslf.progress import Say


def run_job(job: Job, say: Say | None = None) -> Result:
    """Does a job in this process and writes its results, whole or not at all.

    Args:
        job: of a `Plan`.
        say: told the name of a step and how much of it is done, 0..1; what it raises ends the job.

    Returns: what is in result.json.

    Raises: UsdslfError, InputError where a file changed meanwhile, and what libraries raise; nothing is written then.
    """
    work = _worker(job.kind)
    tell = lambda p: say(p.step, p.share) if say else None  # noqa: E731
    with staged(job.root + job.output, job.name) as folder, hearing(tell):
        found = work(job, folder, say)
        names = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
        values, inputs = {**found.values, "row": row_of(job)}, inputs_of(job, found.read)
        if changed := [name for name, code in found.begun.items() if inputs.get(name) != code]:
            raise InputError(f"{changed[0]} changed while the job {job.name} read it; run it again")
        result = Result(
            job.name, job.kind, lines=found.lines, findings=found.findings, values=values, inputs=inputs
        )  # fmt: skip
        result = without_root(job, result)
        result = replace(result, files={name: file_hash(folder / name) for name in names})
        (folder / RESULT).write_text(text_of(result.as_values()), encoding="utf-8")
    forget_failure(job)
    return result


def _worker(kind: str) -> Worker:
    """Imports what a kind of work needs, and no more."""
    if kind == "solve":
        from usdslf.batch.solving import solve_shot

        return solve_shot
    if kind == "propagate":
        from usdslf.batch.propagate import propagate_look

        return propagate_look
    from usdslf.batch import joint

    steps: dict[str, Worker] = {
        "measure": joint.measure,
        "choose": joint.choose,
        "refine": joint.refine,
        "settle": joint.settle,
        "show": joint.show,
    }
    return steps[kind]
