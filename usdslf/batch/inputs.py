"""Inputs: what a job read, by content, and whether any of it changed since.

inputs_of(job, found) -> {path: hash}              of files that were read, globs, and files that were not there
row_of(job) -> str                                  names the row itself
why_stale(job, result, hashes) -> str               "" for a result that stands, else why it does not
Hashes(output)                                      hashes of files that stay, kept between runs
"""

from __future__ import annotations

import glob
import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import usdslf
from usdslf.batch.job import Job, Result
from usdslf.batch.places import RECORDS
from usdslf.contents import file_hash
from usdslf.replacing import replacing

GLOB = "glob:"  # before a pattern, whose hash is that of the names that match it
SETTLED = 2.0  # seconds after its last change for which a file's time does not say that it is the same
STAMPS = "stamps.json"


@dataclass(frozen=True)
class Read:
    """Files that a job read: absolute paths on the machine that ran it.

    Attributes:
        files: that were there, or were asked for.
        patterns: globs that gave some of them.
    """

    files: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ()


def inputs_of(job: Job, read: Read) -> dict[str, str]:
    """Returns the hash of each file of a job, by its path relative to the output folder."""
    own = [*read.files, *(job.file(p) for p in (job.shot, job.strokes, job.look, *job.elsewhere) if p)]
    found = {_relative(job, path): file_hash(path) for path in sorted({os.path.abspath(p) for p in own})}
    found |= {GLOB + _relative(job, p): _names(p) for p in read.patterns}
    return dict(sorted(found.items()))


def row_of(job: Job) -> str:
    """Returns a name of what a job is told; of files their places beside the output, as contents are in `inputs_of`."""
    shot, strokes, look, *elsewhere = (
        os.path.relpath(p, job.output) if p else "" for p in (job.shot, job.strokes, job.look, *job.elsewhere)
    )
    told = replace(job, shot=shot, strokes=strokes, look=look, elsewhere=tuple(elsewhere), output="", root="")
    return hashlib.sha256((told.as_json() + usdslf.__version__).encode()).hexdigest()


def why_stale(job: Job, result: Result | None, hashes: Callable[[str], str]) -> str:
    """Returns why a job has to be run, in words; "" where its result stands.

    Args:
        result: that is there; None: none.
        hashes: of a file by its path.
    """
    if result is None:
        return "new"
    if result.values.get("row") != row_of(job):
        return "its row changed"
    for name, wanted in result.inputs.items():
        path = os.path.normpath(os.path.join(job.output, name.removeprefix(GLOB)))
        if wanted != (_names(path) if name.startswith(GLOB) else hashes(path)):
            return f"{name.removeprefix(GLOB)} changed"
    return next((f"{name} of its result changed" for name, wanted in result.files.items()
                 if hashes(str(job.folder / name)) != wanted), "")  # fmt: skip


@dataclass
class Hashes:
    """Hashes of files by their paths; those of files that stay are kept between runs, by time and size."""

    output: str
    known: dict[str, list] = field(default_factory=dict)
    is_changed: bool = False

    @staticmethod
    def of(output: str) -> Hashes:
        """Returns what an earlier run kept."""
        try:
            known = json.loads((Path(output) / RECORDS / STAMPS).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            known = {}
        return Hashes(output, known if isinstance(known, dict) else {})

    def __call__(self, path: str) -> str:
        """Returns the hash of a file, "" where there is none."""
        try:
            status = os.stat(path)
        except OSError:
            return ""
        stamp = [status.st_mtime_ns, status.st_size]
        if self.known.get(path, [])[:2] == stamp:
            return str(self.known[path][2])
        found = file_hash(path)
        if found and time.time() - status.st_mtime > SETTLED:
            self.known[path] = [*stamp, found]
            self.is_changed = True
        return found

    def keep(self) -> None:
        """Writes them for the next run."""
        folder = Path(self.output) / RECORDS
        if self.is_changed and folder.is_dir():
            with replacing(folder / STAMPS) as temporary:
                temporary.write_text(json.dumps(self.known), encoding="utf-8")
            self.is_changed = False


def _relative(job: Job, path: str) -> str:
    return os.path.relpath(path, job.root + job.output)


def _names(pattern: str) -> str:
    return hashlib.sha256(
        "\n".join(sorted(glob.glob(pattern))).replace(os.path.dirname(pattern), "").encode()
    ).hexdigest()


def read_together(parts: Iterable[Read]) -> Read:
    """Returns the files of all parts."""
    parts = list(parts)
    return Read(
        tuple(sorted({f for p in parts for f in p.files})), tuple(sorted({f for p in parts for f in p.patterns}))
    )


def shown(values: Mapping[str, str]) -> list[str]:
    """Returns the paths of inputs that are files which are there."""
    return [name for name, code in values.items() if code and not name.startswith(GLOB)]
