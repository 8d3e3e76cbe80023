"""Found: what the work of one job gives, and what all kinds of work share.

Found, Worker                     lines, findings, values and files that were read; who finds them
write_values(job, path, values)   JSON, in which shipped files have their own names
of_needs(job), read_needs(job)    folders and files of the results that a job reads
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from usdslf.batch.inputs import Read
from usdslf.batch.job import Job
from usdslf.batch.records import text_of

if TYPE_CHECKING:
    from usdslf.progress import Say


@dataclass(frozen=True)
class Found:
    """What a kind of work found; its files stand in the folder that it was given.

    Attributes:
        read: all that it read.
        begun: hashes of that, or of some of it, from before it was worked with.
    """

    lines: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    values: dict[str, Any] = field(default_factory=dict)
    read: Read = field(default_factory=Read)
    begun: Mapping[str, str] = field(default_factory=dict)


Worker = Callable[[Job, Path, "Say | None"], Found]


def write_values(job: Job, path: Path, values: Any) -> None:
    """Writes JSON-ready values, in which shipped files have their own names, to `path`."""
    text = text_of(values)
    path.write_text(text.replace(json.dumps(job.root)[1:-1], "") if job.root else text, encoding="utf-8")


def of_needs(job: Job) -> list[Path]:
    """Returns the folders of the results that a job reads."""
    return [replace(job, name=name).folder for name in job.needs]


def read_needs(job: Job) -> Read:
    """Returns the files of the results that a job reads."""
    return Read(tuple(str(p) for folder in of_needs(job) for p in sorted(folder.glob("*")) if p.is_file()))
