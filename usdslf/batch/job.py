"""Job: one row of a batch, what became of it, and what is told meanwhile, as records that JSON can hold."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Limits:
    """How much a job may take.

    Attributes:
        seconds: after which it is ended, above 0.
        memory: bytes of resident memory beyond which it is ended; 0: as much as there is.
        threads: processors that it may use.
    """

    seconds: float = 3600.0
    memory: int = 0
    threads: int = 1


@dataclass(frozen=True)
class Job:
    """A row of a batch: all that its result depends on beside the files that it names.

    Attributes:
        name: of its folder below `output`, with / between folders.
        kind: solve | propagate, or a step of a joint solve: measure | choose | refine | settle | show.
        shot: file of the stage; "" for steps that look at none.
        strokes: file of the stroke layer; "" where there is none.
        look: file of the look that is laid over the shot; "" for none.
        needs: names of jobs whose results it reads.
        options: as `options` of a manifest.
        elsewhere: files of surroundings in whose light its edits are scored too.
        prefer_robust: at a near tie the explanation that holds there is taken.
        pictures: whether small pictures are made.
        output: folder of all results.
        root: folder that stands for / where files were shipped to this machine; "" where they lie as named.
    """

    name: str
    kind: str
    shot: str = ""
    strokes: str = ""
    look: str = ""
    needs: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    elsewhere: tuple[str, ...] = ()
    prefer_robust: bool = False
    pictures: bool = True
    output: str = ""
    root: str = ""

    @property
    def folder(self) -> Path:
        """Of its results."""
        return Path(self.root + self.output, *self.name.split("/"))

    def file(self, path: str) -> str:
        """Returns where a file that the row names, `path`, lies on this machine."""
        return self.root + path if path else ""

    def as_json(self) -> str:
        """Returns the row as one line of JSON."""
        return json.dumps(asdict(self), sort_keys=True)

    @staticmethod
    def of_json(text: str) -> Job:
        """Returns the row that `as_json` wrote as `text`."""
        return Job(**_with_tuples(json.loads(text)))


@dataclass(frozen=True)
class Result:
    """What became of a job.

    Attributes:
        job: its name.
        kind: as of the job.
        is_done: whether it came to its end.
        why: the sentence of its failure; "" where it is done.
        cause: error | crash | time | memory | lost, of a failure.
        lines: what was found, as `solve` prints it.
        findings: sentences: what a person should look at.
        values: more, by kind: answers, residuals, scores elsewhere, what changed since the last run.
        files: name of each file of the result -> its hash.
        inputs: path of each file that was read -> its hash; "" for one that was asked for and not there.
        seconds, memory: that it took, of wall clock and most resident bytes; 0 in result.json, as they are no result.
    """

    job: str
    kind: str = "solve"
    is_done: bool = True
    why: str = ""
    cause: str = ""
    lines: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    memory: int = 0

    def as_values(self) -> dict[str, Any]:
        """Returns it as JSON-ready values."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}

    @staticmethod
    def of_values(values: Mapping[str, Any]) -> Result:
        """Returns the result that `as_values` gave as `values`.  Raises: TypeError for what it is not."""
        return Result(**_with_tuples(values))


@dataclass(frozen=True)
class Event:
    """What is told while a batch runs.

    Attributes:
        job: its name.
        state: started | running | done | failed.
        step: what it does now.
        share: of that step that is done, 0..1.
        pid: of its process; 0 where that is on another machine.
        why: of a failure.
    """

    job: str
    state: str
    step: str = ""
    share: float = 0.0
    pid: int = 0
    why: str = ""


def _with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """JSON has lists where records have tuples."""
    return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
