"""Joint: one asset in several shots, one change of it.

    measure    each shot: the tables of its painted materials, in its light as it is      tables_N.npz, measured.json
    choose     all: the change that explains all tables with the fewest freedoms          choice.json
    refine     each shot: the tables again, in the light that the change sends round      tables_N.npz, measured.json
    settle     all: the change's value; one look over the asset                           look.usda, asset.usda
    show       each shot: the same change as a look over it, its residual, pictures       look.usda, before.png, ...

Shots are told apart by their lights, materials known by the file and path that define them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from usdslf.batch.found import Found, of_needs, read_needs, write_values
from usdslf.batch.inputs import Read
from usdslf.batch.job import Job
from usdslf.batch.reads import stages_read
from usdslf.batch.solving import READING, opened, write_pictures
from usdslf.edits.whole_set import colored_specular
from usdslf.errors import InputError, SolveError
from usdslf.inference.answers import Answer, Painted, Pool, means_of, scope_rows
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.direct import gather_stroke
from usdslf.inference.evidence import Evidence
from usdslf.inference.pooled import Joint, arrays_of, choose_jointly, fit_jointly, tables_of
from usdslf.inference.pools import sort_into_pools
from usdslf.inference.refits import finer, is_painted
from usdslf.inference.solve import relative_error
from usdslf.inference.tools import expected_error
from usdslf.inference.weights import Options
from usdslf.look import author
from usdslf.session import Session
from usdslf.shot import Shot
from usdslf.solution import Solution
from usdslf.surfaces.reflectance import Parameters
from usdslf.usd.asset_of import asset_of
from usdslf.usd.author.author import author_review_root

if TYPE_CHECKING:
    from usdslf.light_field.light_field import LightField
    from usdslf.progress import Say

MEASURED, CHOICE = "measured.json", "choice.json"


@dataclass(frozen=True)
class Measured:
    """What one shot says of one material.

    Attributes:
        asset: file that defines the material, and `path`, its path there.
        material: its path in the shot.
        strokes: paths of the strokes.
        norm: l2 | l0 | mixed.
        dab_error: how far off [relative] what the strokes ask for may be.
        painted: they are colours that a painter chose.
        tables: file name, beside this.
        residual: relative error of what was painted, before any change.
    """

    asset: str
    path: str
    material: str
    strokes: tuple[str, ...]
    norm: str
    dab_error: float
    painted: bool
    tables: str
    residual: float

    @property
    def key(self) -> str:
        """Names the material in all shots."""
        return f"{self.asset}<{self.path}>"


# ── each shot ──────────────────────────────────────────────────────────────────────────────────


def measure(job: Job, folder: Path, say: Say | None) -> Found:
    """Writes the tables of what was painted in a shot, in its light as it is."""
    view = _View.of(job, say)
    found = [_written(m, t, folder) for m, t in view.measured(view.field)]
    if not found:
        raise SolveError(f"{job.shot}: no direct stroke asks for a change of a whole material; joint jobs need one")
    write_values(job, folder / MEASURED, [asdict(m) for m in found])
    return Found(tuple(f"{m.material}: {len(m.strokes)} strokes" for m in found), read=view.read, begun=view.begun)


def refine(job: Job, folder: Path, say: Say | None) -> Found:
    """Writes the tables again, in the light that the chosen change sends round."""
    choice = _choice_of(job)
    view = _View.of(job, say)
    field = view.changed(choice)
    found = [_written(m, t, folder) for m, t in view.measured(field, choice)]
    write_values(job, folder / MEASURED, [asdict(m) for m in found])
    return Found(read=_with_needs(job, view.read), begun=view.begun)


def show(job: Job, folder: Path, say: Say | None) -> Found:
    """Writes the settled change as a look over one shot, its residual there, and pictures before and after."""
    choice = _choice_of(job)
    view = _View.of(job, say)
    field = view.changed(choice)
    before = {m.key: m for m, _ in view.measured(view.field)}
    answers, residuals = [], []
    for (m, tables), pool in zip(view.measured(field, choice), view.pools, strict=True):
        c = choice[m.key]
        after = relative_error(tables, c)
        was, now = means_of(tables, c)
        residuals.append({"shot": Path(job.shot).name, "before": before[m.key].residual, "after": after})
        answers.append(Answer(pool, c, (c,), tables, was, now, before[m.key].residual, after, (after,)))
    strokes = tuple(p.stroke for p in view.painted)
    shot = view.session.shot
    look = author(shot, Solution(strokes, tuple(answers), painted=tuple(view.painted)), folder / "look.usda",
                  job.file(job.strokes))  # fmt: skip
    if job.pictures:
        write_pictures(job, view.session, folder)
    lines = [f"residual {r['before']:.3f} -> {r['after']:.3f}" for r in residuals]
    findings = (*look.not_shown, *(c.in_words() for c in look.collateral if c.is_finding))
    values = {"residuals": residuals, "edits": len(look.edits)}
    return Found(tuple(lines), findings, values, _with_needs(job, view.read), view.begun)


@dataclass(frozen=True)
class _View:
    """A shot with its strokes, as the steps look at it."""

    session: Session
    painted: list[Painted]
    pools: list[Pool]
    field: LightField  # as it is
    read: Read
    begun: Mapping[str, str]  # hashes of that, from before

    @staticmethod
    def of(job: Job, say: Say | None) -> _View:
        strokes, said, session = opened(job, say)
        read, begun = stages_read(job, session.shot.source)
        with session.hearing():
            shot = session.shot
            active = [s for s in strokes if s.active]
            painted = [gather_stroke(s, shot.scene, shot.pictured, said) for s in active]
            field = shot.light_field
            evidence = [p.evidence(field) for p in painted]
            pools = [p for p in sort_into_pools(evidence, shot.scene) if p.scope == "material" and not p.is_held]
        return _View(session, painted, pools, field, read, begun)

    def measured(
        self, field: LightField, choice: Mapping[str, Candidate] | None = None
    ) -> Iterator[tuple[Measured, Tables]]:
        """What the shot says of each painted material in a light, on levels about a choice."""
        shot = self.session.shot
        evidence = [p.evidence(field) for p in self.painted]
        for number, pool in enumerate(self.pools):
            material = shot.scene.materials[pool.material]
            mine = [evidence[i] for i in pool.strokes]
            asset, path = asset_of(shot.source, material.path)
            m = Measured(
                asset, path, material.path, tuple(e.stroke.path for e in mine), _norm(mine),
                expected_error([e.stroke for e in mine]), is_painted(mine), f"tables_{number}.npz", 0.0,
            )  # fmt: skip
            chosen = choice.get(m.key) if choice else None
            if chosen is not None and "glossiness" in chosen.freed:
                mine = [
                    finer(e, self.painted[i].samples, field, chosen) for e, i in zip(mine, pool.strokes, strict=True)
                ]
            tables = pool_tables(mine, pool.material, field.model)
            none = relative_error(tables, Candidate((), level=tables.own))
            yield replace(m, residual=none), replace(tables, colored=colored_specular(material))

    def changed(self, choice: Mapping[str, Candidate]) -> LightField:
        """The light field of the shot with the chosen changes."""
        shot, surface = self.session.shot, self.field.surface
        with self.session.hearing():
            for (m, tables), pool in zip(self.measured(self.field), self.pools, strict=True):
                c = choice.get(m.key)
                if c is None:
                    raise InputError(f"{shot.path}: {m.path} of {m.asset} was not measured; run the whole batch again")
                rows = scope_rows(pool, self.field, shot.scene, self.painted)
                values = c.apply(Parameters.of(self.field.surface, rows), tables.is_metal)
                surface = surface.with_rows(rows, **vars(values))
            field = self.field.with_surface(surface)
            field.settle(shot.bounces)
        return field


def _norm(evidence: list[Evidence]) -> str:
    norms = {e.stroke.norm for e in evidence} - {"mixed"}
    return norms.pop() if len(norms) == 1 else "mixed"


def _written(m: Measured, tables: Tables, folder: Path) -> Measured:
    with (folder / m.tables).open("wb") as file:
        np.savez(file, **arrays_of(tables))  # type: ignore[arg-type]
    return m


# ── all shots together ─────────────────────────────────────────────────────────────────────────


def choose(job: Job, folder: Path, say: Say | None) -> Found:
    """Chooses one change of each material for all shots that painted it."""
    found, lines, findings = {}, [], []
    for key, parts in _by_material(job).items():
        joint = choose_jointly([t for _, t in parts], _options(job, [m for m, _ in parts]), _wanted(job, parts))
        found[key] = _plain(joint.chosen)
        lines.append(f"{parts[0][0].path}: {joint.chosen.id}, by {len(parts)} shots")
        findings += [
            f"{parts[0][0].path}: {joint.chosen.id} and {t} explain all shots about equally" for t in joint.ties
        ]
    write_values(job, folder / CHOICE, found)
    return Found(tuple(lines), tuple(findings), read=read_needs(job))


def settle(job: Job, folder: Path, say: Say | None) -> Found:
    """Fits the chosen changes to all shots, and writes them as one look over the asset."""
    choice = _choice_of(job)
    found: dict[str, Any] = {}
    answers: dict[str, list[tuple[str, Joint]]] = {}
    report, residuals, lines = [], [], list[str]()
    for key, parts in _by_material(job).items():
        options, ms = _options(job, [m for m, _ in parts]), [m for m, _ in parts]
        c, tables = fit_jointly([t for _, t in parts], choice[key], options, all(m.painted for m in ms))
        found[key] = _plain(c)
        answers.setdefault(ms[0].asset, []).append((ms[0].path, Joint(c, (c,), tables)))
        before, after = means_of(tables, c)
        each = [
            {"shot": name, "before": m.residual, "after": relative_error(t, c)}
            for (m, t), name in zip(parts, _names(job), strict=True)
        ]
        residuals += each
        lines += _lines(ms[0], c, before, after, each)
        values = {k: {n: v.tolist() for n, v in x.items()} for k, x in (("before", before), ("after", after))}
        report.append({"asset": ms[0].asset, "material": ms[0].path, "inferred": c.id, **values, "shots": each})
    if len(answers) > 1:
        raise InputError(f"the strokes are on materials of {' and of '.join(answers)}: joint jobs are of one asset")
    look_lines, findings = _write_look(job, folder, *answers.popitem())
    write_values(job, folder / CHOICE, found)
    write_values(job, folder / "report.json", report)
    return Found(
        (*lines, *look_lines), tuple(findings), {"residuals": residuals, "edits": len(look_lines)}, read_needs(job)
    )


def _write_look(
    job: Job, folder: Path, asset: str, answers: list[tuple[str, Joint]]
) -> tuple[list[str], list[str]]:  # fmt: skip
    """Writes the look over an asset, and the asset under it; returns lines and findings."""
    shot = Shot.open(asset, **{k: job.options[k] for k in READING if k in job.options})
    paths = [m.path for m in shot.scene.materials]
    made = []
    for path, joint in answers:
        before, after = means_of(joint.tables, joint.chosen)
        none = relative_error(joint.tables, Candidate((), level=joint.tables.own))
        left = relative_error(joint.tables, joint.chosen)
        pool = Pool(paths.index(path), "material", (), ())
        made.append(Answer(pool, joint.chosen, (joint.chosen,), joint.tables, before, after, none, left, (left,)))
    look = author(shot, Solution((), tuple(made)), folder / "look.usda")
    author_review_root(folder / "asset.usda", folder / "look.usda", None, asset)
    lines = [f"{e.prim}.{e.attribute}: {e.before} -> {e.after}" for e in look.edits]
    return lines, [*look.not_shown, *(c.in_words() for c in look.collateral if c.is_finding)]


def _by_material(job: Job) -> dict[str, list[tuple[Measured, Tables]]]:
    """What the shots that a step needs measured, by material."""
    found: dict[str, list[tuple[Measured, Tables]]] = {}
    for folder in of_needs(job):
        if not (folder / MEASURED).is_file():
            continue
        for values in json.loads((folder / MEASURED).read_text(encoding="utf-8")):
            m = Measured(**{**values, "strokes": tuple(values["strokes"]), "asset": job.root + values["asset"]})
            with np.load(folder / m.tables) as arrays:
                found.setdefault(m.key, []).append((m, tables_of(arrays)))
    return found


def _names(job: Job) -> list[str]:
    """Names of the shots that a step needs."""
    return [f.name for f in of_needs(job) if (f / MEASURED).is_file()]


def _options(job: Job, measured: list[Measured]) -> Options:
    """The weights of a choice."""
    o = Options.of(job.options["weights"]) if "weights" in job.options else Options()
    norms = {job.options["norm"]} if "norm" in job.options else {m.norm for m in measured} - {"mixed"}
    o = replace(o, norm=norms.pop()) if len(norms) == 1 else o
    return replace(o, dab_error=max(o.dab_error, *(m.dab_error for m in measured)))


def _wanted(job: Job, parts: list[tuple[Measured, Tables]]) -> str:
    """The explanation that `choose` of the options names for a stroke of these."""
    asked: Mapping[str, str] = job.options.get("choose", {})
    names = {s.rsplit("/", 1)[-1] for m, _ in parts for s in m.strokes}
    return next((asked[n] for n in sorted(names) if n in asked), "")


def _choice_of(job: Job) -> dict[str, Candidate]:
    """The changes that an earlier step chose, by material."""
    place = next(f / CHOICE for f in of_needs(job) if (f / CHOICE).is_file())
    return {job.root + k: _candidate(v) for k, v in json.loads(place.read_text(encoding="utf-8")).items()}


def _plain(c: Candidate) -> dict[str, Any]:
    values = asdict(c)
    return {k: v.tolist() if isinstance(v, np.ndarray) else list(v) if isinstance(v, tuple) else v
            for k, v in values.items()}  # fmt: skip


def _candidate(values: Mapping[str, Any]) -> Candidate:
    deltas = {k: np.asarray(values[k], np.float64) for k in ("delta_diffuse", "delta_f0")}
    return Candidate(**{**values, **deltas, "freed": tuple(values["freed"])})


def _with_needs(job: Job, read: Read) -> Read:
    return Read((*read.files, *read_needs(job).files), read.patterns)


def _lines(
    m: Measured, c: Candidate, before: Mapping[str, Any], after: Mapping[str, Any], shots: list[dict[str, Any]]
) -> list[str]:  # fmt: skip
    """What was settled, in words."""
    words = [f"{k} {np.round(before[k], 3).tolist()} -> {np.round(after[k], 3).tolist()}"
             for k in after if not np.array_equal(before[k], after[k])]  # fmt: skip
    lines = [f"{m.path} of {os.path.basename(m.asset)}: {c.id}", f"  {', '.join(words) or 'nothing changed'}"]
    return lines + [f"  in {s['shot']}: residual {s['before']:.3f} -> {s['after']:.3f}" for s in shots]
