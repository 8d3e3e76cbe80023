"""Open Job Description: a batch as a job template for render farms.

    write_template(plan, path) -> sentence

Each job is a task, each layer of what needs what a step, and a last step collects.  All files that the jobs read are
listed as the job's inputs.  A task whose job fails, or whose process is killed, ends well, so that others go on
(task.py); the last step fails then.
Source: https://github.com/OpenJobDescription/openjd-specifications, 2023-09; lists of paths are its extension EXPR.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from usdslf.batch.inputs import read_together
from usdslf.batch.job import Job
from usdslf.batch.planning import Plan
from usdslf.batch.reads import reads_of
from usdslf.batch.run import phases
from usdslf.errors import InputError
from usdslf.replacing import check_place, replacing

MOST_TASKS = 1024  # of a step, as the specification says
SPARE = 60  # seconds for a task beside those of its job
MOST_NAME = 128
TASK = ("-m", "usdslf.batch.task", "{{Param.Manifest}}", "{{Param.Output}}")  # of a job, whose name follows
COLLECT = ("-m", "usdslf", "batch", "{{Param.Manifest}}", "-o", "{{Param.Output}}", "--collect")


def write_template(found: Plan, path: str | os.PathLike[str]) -> str:
    """Writes a template of all jobs of a plan, finished ones too, which their tasks skip.

    Args:
        found: of `plan`.
        path: ends in .yaml, .yml or .json.

    Returns: a line about it.

    Raises: InputError where it cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".yaml", ".yml", ".json"):
        raise InputError(f"{target} is no template; end its name in .yaml or .json")
    if not found.is_file:
        raise InputError("tasks on other machines read a manifest, and this plan has no file of one; write one as TOML")
    check_place(target)
    files = read_together(reads_of(job) for job in found.jobs).files
    inputs = sorted({found.manifest, *(f for f in files if os.path.isfile(f))})
    template = {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["EXPR"],
        "name": f"usdslf batch {Path(found.manifest).stem}"[:MOST_NAME],
        "parameterDefinitions": _parameters(found, inputs, Path(os.path.abspath(target)).parent),
        "steps": list(_steps(found)),
    }
    with replacing(target) as temporary:
        temporary.write_text(json.dumps(template, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    steps = len(template["steps"])
    return f"{target}: {len(found.jobs)} tasks in {steps} steps, {len(inputs)} files; run it with: openjd run {target}"


def _parameters(found: Plan, inputs: Sequence[str], beside: Path) -> list[dict[str, Any]]:
    """The parameters of the job; what lies below the template's folder `beside` travels with it."""
    folder = {"objectType": "DIRECTORY", "dataFlow": "OUT"}
    return [
        {"name": "Python", "type": "STRING", "default": sys.executable, "description": "That has usdslf."},
        {"name": "Manifest", **_path(found.manifest, beside, {"objectType": "FILE", "dataFlow": "IN"})},
        {"name": "Output", **_path(found.output, beside, folder)},
        {
            "name": "Inputs",
            "type": "LIST[PATH]",
            "objectType": "FILE",
            "dataFlow": "IN",
            "default": list(inputs),
            "description": "All files that the jobs read: layers, textures, tiles, value clips, strokes.",
        },
    ]


def _path(path: str, beside: Path, kind: dict[str, str]) -> dict[str, str]:
    """A parameter of a file or folder: defaults of paths have to lie below the template; others are texts."""
    relative = os.path.relpath(path, beside)
    if relative.startswith(".."):
        return {"type": "STRING", "default": path}
    return {"type": "PATH", **kind, "default": Path(relative).as_posix()}


def _steps(found: Plan) -> Iterator[dict[str, Any]]:
    """A step for each layer of jobs, more where they are many, and one that collects."""
    before: list[str] = []
    for number, jobs in enumerate(phases(found.jobs)):
        names = []
        for part, first in enumerate(range(0, len(jobs), MOST_TASKS)):
            names.append(f"Jobs{number + 1}" + (f"_{part + 1}" if len(jobs) > MOST_TASKS else ""))
            yield _step(names[-1], before, [*TASK, "{{Task.Param.Job}}"], found, jobs[first : first + MOST_TASKS])
        before = names
    yield _step("Collect", before, COLLECT, found, [])


def _step(
    name: str, after: Sequence[str], arguments: Sequence[str], found: Plan, jobs: Sequence[Job]
) -> dict[str, Any]:
    run: dict[str, Any] = {"command": "{{Param.Python}}", "args": list(arguments)}
    step: dict[str, Any] = {"name": name}
    if after:
        step["dependencies"] = [{"dependsOn": other} for other in after]
    if jobs:
        run["timeout"] = int(found.limits.seconds) + SPARE
        tasks = {"name": "Job", "type": "STRING", "range": [job.name for job in jobs]}
        step["parameterSpace"] = {"taskParameterDefinitions": [tasks]}
        step["hostRequirements"] = {"amounts": [{"name": "amount.worker.memory", "min": _mebibytes(found)}]}
    return {**step, "script": {"actions": {"onRun": run}}}


def _mebibytes(found: Plan) -> int:
    return max(1, found.limits.memory >> 20)
