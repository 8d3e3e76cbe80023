"""Reads: the files that a job will read, before it is run, for farms and workers that have to be given them.

reads_of(job) -> Read      by composing its shot; of one that cannot be composed, what can be named
"""

from __future__ import annotations

import os
from functools import lru_cache

from usdslf.batch.inputs import Read
from usdslf.batch.job import Job
from usdslf.errors import UsdslfError
from usdslf.usd.files_read import FilesRead, files_read
from usdslf.usd.read.read import open_stage


def reads_of(job: Job) -> Read:
    """Returns the files of a job's row and all that their stages stand on; those of other jobs' results are not."""
    own = [p for p in (job.shot, job.strokes, job.look, *job.elsewhere) if p]
    parts = [_of_stage(p) for p in own if os.path.splitext(p)[1].lower() in (".usd", ".usda", ".usdc", ".usdz")]
    files = {*own, *(f for part in parts for f in part.found)}
    return Read(tuple(sorted(files)), tuple(sorted({p for part in parts for p in part.patterns})))


@lru_cache(256)
def _of_stage(path: str) -> FilesRead:
    try:
        return files_read(open_stage(path))
    except UsdslfError:
        return FilesRead(())
