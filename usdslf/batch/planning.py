"""Planning: the jobs of a manifest, by name, and which of them are finished.

    plan(manifest, output) -> Plan

Shots x stroke layers x variants, globs and templates expanded, names checked.  No stage is opened: what a finished job
read is known by content from its result.
"""

from __future__ import annotations

import glob
import os
import string
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from usdslf.batch.inputs import Hashes, why_stale
from usdslf.batch.job import Job, Limits
from usdslf.batch.manifest import Key, Manifest, read_manifest
from usdslf.batch.places import check_name, why_outside
from usdslf.batch.records import read_failure, read_result
from usdslf.errors import InputError
from usdslf.threads import thread_count

SHARE = 0.8  # of the machine's memory that all jobs together may take


@dataclass(frozen=True)
class Plan:
    """What a manifest asks for.

    Attributes:
        manifest: absolute path of its file; of values in Python a name in the folder that their paths are relative to.
        output: absolute path of the folder of all results.
        jobs: in the order of the manifest, what a job needs before it.
        why: name of each job -> why it has to be run, in words; "" where its result stands.
        limits: of each job.
        workers: jobs at a time.
        is_file: whether the manifest is one.
    """

    manifest: str
    output: str
    jobs: tuple[Job, ...]
    why: Mapping[str, str]
    limits: Limits
    workers: int
    is_file: bool = True

    @property
    def to_run(self) -> tuple[Job, ...]:
        """The jobs that have to be run."""
        return tuple(j for j in self.jobs if self.why[j.name])

    def job(self, name: str) -> Job:
        """Returns the job of a name.  Raises: InputError where there is none."""
        for each in self.jobs:
            if each.name == name:
                return each
        some = ", ".join(j.name for j in self.jobs[:5])
        raise InputError(f"there is no job '{name}' in {self.manifest}; it has {some} and so on")


def plan(
    manifest: str | os.PathLike[str] | Mapping[str, Any], output: str | os.PathLike[str] | None = None,
    workers: int = 0, prefer_robust: bool = False,
) -> Plan:  # fmt: skip
    """Reads a manifest and says what has to be run.

    Args:
        manifest: a file, or what it would hold, with paths relative to the current folder.
        output: folder of all results; None: as the manifest says.
        workers: jobs at a time; 0: as the manifest says, else one a processor, as memory allows.
        prefer_robust: at near ties what holds elsewhere is taken, whatever the manifest says.

    Raises: InputError, with the line, for a manifest that cannot be meant.
    """
    found = read_manifest(manifest)
    folder = _output(found, output)
    jobs = list(_jobs(found, folder))
    if prefer_robust:
        jobs = [replace(j, prefer_robust=True) if j.kind == "solve" else j for j in jobs]
    _check_names(jobs, found)
    hashes = Hashes.of(folder)
    why = {job.name: why_to_run(job, hashes) for job in jobs}
    hashes.keep()
    limits, count = _limits(found, workers, len(jobs))
    return Plan(str(found.path), folder, tuple(jobs), why, limits, count, not isinstance(manifest, Mapping))


def why_to_run(job: Job, hashes: Callable[[str], str]) -> str:
    """Returns why a job has to be run, in words; "" where its result stands."""
    if failure := read_failure(job):
        return f"failed: {failure.why}"
    return why_stale(job, read_result(job), hashes)


def _output(m: Manifest, output: str | os.PathLike[str] | None) -> str:
    if output is not None:
        return os.path.abspath(output)
    name = m.values.get("output", "batch")
    parts = Path(name).parts
    if os.path.isabs(name) or ".." in parts or "\\" in name:
        raise m.error(("output",), f"output = '{name}' leads out of the folder of the manifest; name a folder below it")
    if why := why_outside(m.folder, Path(name).as_posix()):
        raise m.error(("output",), why)
    return str(m.folder / name)


def _limits(m: Manifest, workers: int, jobs: int) -> tuple[Limits, int]:
    """The limits of a job, and how many run at a time: workers x threads and x memory are what the machine has."""
    given = m.values.get("limits", {})
    count = workers or given.get("workers", 0) or thread_count()
    count = max(1, min(count, jobs))
    threads = max(1, thread_count() // count)
    there = _machine_memory()
    memory = int(given["memory"] * 2**30) if "memory" in given else int(SHARE * there / count)
    if "memory" in given and there:
        count = max(1, min(count, int(SHARE * there / memory)))
    return Limits(float(given.get("seconds", 3600.0)), memory, threads), count


def _machine_memory() -> int:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return 0


def _jobs(m: Manifest, output: str) -> Iterator[Job]:
    """The jobs of all tables, those of joint ones after what they need."""
    numbers = iter(range(1, 1 << 62))
    for i, table in enumerate(m.values["jobs"]):
        key: Key = ("jobs", i)
        if ("strokes" in table) == ("look" in table):
            raise m.error(key, "a table of jobs has either strokes to solve or a look to lay over its shots")
        if table.get("joint") and "look" in table:
            raise m.error((*key, "joint"), "a look is one already; joint jobs have strokes")
        rows = list(_rows(m, table, key, output, numbers))
        yield from _joint(m, table, key, rows) if table.get("joint") else rows


def _rows(m: Manifest, table: Mapping[str, Any], key: Key, output: str, numbers: Iterator[int]) -> Iterator[Job]:
    """Shots x stroke layers x variants of one table."""
    values = m.values
    shared = {**values.get("options", {}), **table.get("options", {})}
    elsewhere = [p for each in values.get("elsewhere", ()) for p in _files(m, each, ("elsewhere",))]
    look = str(m.folder / table["look"]) if "look" in table else ""
    own = {} if table.get("joint") else table  # the name of joint jobs is their look's
    template = own.get("name", values.get("name", "{stem}"))
    where: Key = (*key, "name") if "name" in own else ("name",)
    for shot in (p for each in table["shots"] for p in _files(m, each, (*key, "shots"))):
        of_shot = {
            "dir": glob.escape(os.path.dirname(shot)),
            "folder": os.path.basename(os.path.dirname(shot)),
            "stem": _stem(shot),
        }
        layers = [p for s in table.get("strokes", ()) for p in _files(m, _filled(m, s, of_shot, (*key, "strokes")),
                                                                      (*key, "strokes"))]  # fmt: skip
        for strokes in layers or [""]:
            for variant in table.get("variants", [{"name": ""}]):
                number = next(numbers)
                names = {
                    **of_shot, "strokes": _stem(strokes or look), "variant": variant["name"], "number": f"{number:04d}"
                }  # fmt: skip
                del names["dir"]
                yield Job(
                    _filled(m, template, names, where), "propagate" if look else "solve", shot, strokes, look,
                    options={**shared, **variant.get("options", {})}, elsewhere=tuple(dict.fromkeys(elsewhere)),
                    prefer_robust=values.get("prefer_robust", False), pictures=values.get("pictures", True),
                    output=output,
                )  # fmt: skip


def _joint(m: Manifest, table: Mapping[str, Any], key: Key, rows: list[Job]) -> Iterator[Job]:
    """The steps of one joint solve: all shots are measured, one change is chosen, refined in all, and written."""
    if "name" not in table:
        raise m.error(key, "joint jobs need a name, that of their look")
    group = table["name"]
    if len({_text_of(r.options) for r in rows}) > 1:
        raise m.error((*key, "variants"), "joint jobs have one set of options")
    plain = [replace(r, elsewhere=(), prefer_robust=False) for r in rows]
    measured = [replace(r, name=f"{group}/measure/{r.name}", kind="measure") for r in plain]
    yield from measured
    names = tuple(r.name for r in measured)
    of_all = replace(plain[0], shot="", strokes="", needs=names)
    choice = replace(of_all, name=f"{group}/choose", kind="choose")
    yield choice
    refined = [replace(r, name=f"{group}/refine/{r.name}", kind="refine", needs=(choice.name,)) for r in plain]
    yield from refined
    look = replace(of_all, name=f"{group}/look", kind="settle", needs=(choice.name, *(r.name for r in refined)))
    yield look
    yield from (replace(r, name=f"{group}/shots/{r.name}", kind="show", needs=(look.name,)) for r in plain)


def _text_of(options: Mapping[str, Any]) -> str:
    """Options as text, equal where they are."""
    return repr(sorted(options.items(), key=lambda pair: pair[0]))


def _files(m: Manifest, pattern: str, key: Key) -> list[str]:
    """The files of a path or glob, absolute; a path without wildcards is taken as it is, there or not."""
    if not glob.has_magic(pattern):
        return [os.path.normpath(os.path.join(m.folder, pattern))]
    path = os.path.normpath(os.path.join(glob.escape(str(m.folder)), pattern))
    found = sorted(p for p in glob.glob(path, recursive=True) if not os.path.isdir(p))
    if not found:
        raise m.error(key, f"'{pattern}' matches no file")
    return found


def _filled(m: Manifest, template: str, names: Mapping[str, str], key: Key) -> str:
    """A template with its names filled in."""
    try:
        parts = list(string.Formatter().parse(template))
    except ValueError as bad:
        raise m.error(key, f"'{template}' is no template: {bad}") from None
    filled = []
    for text, name, form, conversion in parts:
        filled.append(text)
        if name is None:
            continue
        if name not in names or form or conversion:
            raise m.error(key, f"'{template}' names {{{name}}}; choose from {', '.join(f'{{{n}}}' for n in names)}")
        filled.append(names[name])
    return "".join(filled)


def _stem(path: str) -> str:
    return os.path.splitext(os.path.basename(path))[0]


def _check_names(jobs: list[Job], m: Manifest) -> None:
    """Raises InputError for names that are no folders below the output, or that two jobs share."""
    seen: dict[str, Job] = {}
    for job in jobs:
        if why := check_name(job.name):
            raise m.error(("name",), f"the job of {job.shot} would have the name '{job.name}', which {why}")
        if job.name in seen:
            other = seen[job.name]
            raise m.error(
                ("name",), f"{other.shot} and {job.shot} would both have the name '{job.name}'; let `name` tell them "
                "apart, e.g. \"{folder}_{stem}_{strokes}_{variant}\""
            )  # fmt: skip
        seen[job.name] = job
    for name in seen:
        parts = name.split("/")
        inside = next((p for i in range(1, len(parts)) if (p := "/".join(parts[:i])) in seen), "")
        if inside:
            raise m.error(("name",), f"the job '{name}' would lie in the results of the job '{inside}'")
    links = {os.path.dirname(name) for name in seen} | set(seen)
    for name in sorted(links):
        if why := why_outside(jobs[0].output, name) if name else "":
            raise m.error(("output",), why)
