"""Records: what is known of each job on disk, beside its results.

read_result(job) -> Result | None          a whole result, or None
write_failure(job, result) / read_failure(job) / forget_failure(job)
write_note(job, values) / read_note(job)   seconds, memory, what changed since the last result
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from usdslf.batch.job import Job, Result
from usdslf.batch.places import RECORDS, why_outside
from usdslf.errors import AuthorError
from usdslf.replacing import replacing

RESULT = "result.json"


def text_of(values: Any) -> str:
    """Returns JSON, the same bytes for the same values."""
    return json.dumps(values, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"


def read_result(job: Job) -> Result | None:
    """Returns the result of a job that is there whole, None where there is none."""
    return _read(job.folder / RESULT)


def write_failure(job: Job, why: str, cause: str) -> Result:
    """Keeps why a job failed, and returns it as a result.  An earlier result stays as it is."""
    found = Result(job.name, job.kind, False, why, cause)
    _write(job, "failed", found.as_values())
    return found


def read_failure(job: Job) -> Result | None:
    """Returns why a job failed when it was run last; None where it did not."""
    return _read(_place(job, "failed"))


def forget_failure(job: Job) -> None:
    """Forgets that a job failed: it is run again, or did its work."""
    _place(job, "failed").unlink(missing_ok=True)


def write_note(job: Job, **values: Any) -> None:
    """Keeps what is no part of the result: it differs from run to run."""
    _write(job, "run", values)


def read_note(job: Job) -> dict[str, Any]:
    """Returns what `write_note` kept."""
    try:
        found = json.loads(_place(job, "run").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def as_known(job: Job) -> Result:
    """Returns what came of a job: its failure, its result, or that there is none."""
    lost = Result(job.name, job.kind, False, "it was not run, or its process was ended", "lost")
    return read_failure(job) or read_result(job) or lost


def _place(job: Job, kind: str) -> Path:
    return Path(job.root + job.output, RECORDS, *job.name.split("/")[:-1], f"{job.name.split('/')[-1]}.{kind}.json")


def _write(job: Job, kind: str, values: Mapping[str, Any]) -> None:
    place = _place(job, kind)
    if why := why_outside(job.root + job.output, f"{RECORDS}/{job.name}"):
        raise AuthorError(why)
    place.parent.mkdir(parents=True, exist_ok=True)
    with replacing(place) as temporary:
        temporary.write_text(text_of(values), encoding="utf-8")


def _read(place: Path) -> Result | None:
    try:
        return Result.of_values(json.loads(place.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def without_root(job: Job, result: Result) -> Result:
    """Returns a result in which files that were shipped have the names of the machine that they came from."""
    if not job.root:
        return result
    found = Result.of_values(json.loads(json.dumps(result.as_values()).replace(json.dumps(job.root)[1:-1], "")))
    return replace(found, job=job.name)
