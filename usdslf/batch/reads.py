"""Reads: the files that a job reads.

reads_of(job) -> Read                      before it is run, for farms and workers that have to be given them
stages_read(job, stages) -> Read, hashes   those that its stages stand on, and what they are before they are worked with
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from usdslf.batch.inputs import Read, inputs_of, read_together
from usdslf.batch.job import Job
from usdslf.errors import UsdslfError
from usdslf.usd.files_read import FilesRead, files_read
from usdslf.usd.read.read import open_stage


def reads_of(job: Job) -> Read:
    """Returns the files of a job's row and all that they stand on, by composing them; not those of other jobs' results.

    Of a stage that cannot be composed they are those that can be named.
    """
    own = [p for p in (job.shot, job.strokes, job.look, *job.elsewhere) if p]
    parts = [_of_stage(p) for p in own if os.path.splitext(p)[1].lower() in (".usd", ".usda", ".usdc", ".usdz")]
    files = {*own, *(f for part in parts for f in part.found)}
    return Read(tuple(sorted(files)), tuple(sorted({p for part in parts for p in part.patterns})))


def stages_read(job: Job, *stages: Any) -> tuple[Read, Mapping[str, str]]:
    """Returns the files that stages stand on, and their hashes as they are before they are worked with."""
    read = read_together(Read((*p.found, *p.missing), p.patterns) for p in map(files_read, stages))
    return read, inputs_of(job, read)


@lru_cache(256)
def _of_stage(path: str) -> FilesRead:
    try:
        return files_read(open_stage(path))
    except UsdslfError:
        return FilesRead(())
