"""Report: what was inferred and authored, as JSON-ready values (the report of `solve` and `stylize`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from usdslf.edits.collateral import words_of
from usdslf.edits.edits import inferred
from usdslf.inference.alternatives import alternatives_of, as_plain
from usdslf.inference.answers import Answer, Pool, means_of_similar
from usdslf.inference.uncertainty import interval
from usdslf.inference.weights import Options
from usdslf.look import Look
from usdslf.scene.records import Scene
from usdslf.shot import Shot
from usdslf.solution import Solution
from usdslf.strokes.stroke import Stroke
from usdslf.stylize.unsharp_mask import Stylized
from usdslf.usd.author.rebase import words_of_edit
from usdslf.usd.border import in_words
from usdslf.usd.layer.wins import AuthoredEdit


def report_of(shot: Shot, solution: Solution, look: Look | None = None) -> dict[str, Any]:
    """Returns what was inferred, and authored as a look, as JSON-ready values (DESIGN: the report of solve).

    Of a stylized shot, `stylize` says how, and `materials` what became of each.

    Args:
        shot: that was worked on.
        solution: what was inferred.
        look: what was written of it; None: nothing.
    """
    edits = look.edits if look else ()
    as_written = look.as_written if look else {}
    of_stroke: dict[int, list[Answer]] = {}
    for a in solution.answers:
        for i in a.pool.strokes:
            of_stroke.setdefault(i, []).append(a)
    parts = (shot, solution, *((look,) if look else ()))
    return {
        "stage": shot.scene.stage,
        "frame": None if np.isnan(shot.scene.frame) else shot.scene.frame,
        "device": shot.device.name,
        "elements": len(shot.elements),
        "directions": 1024,
        "model": shot.model,
        "missing": [vars(m) | {"materials": list(m.materials)} for m in shot.scene.missing],
        **({} if solution.stylized is None else _of_style(shot.scene, solution.stylized, edits)),
        "strokes": [
            _of_stroke(shot, solution, as_written, stroke, *of_stroke[i])
            for i, stroke in enumerate(solution.strokes)
            if i in of_stroke
        ],
        "edits": [
            {
                "prim": e.prim,
                "attribute": e.attribute,
                "before": e.before,
                "after": e.after,
                "representation": e.representation,
                "wins": e.wins,
                "hidden_by": e.hidden_by,
                "mend": e.mend,
                "affects": list(e.affects),
            }
            for e in edits
        ],
        **({"rebase": look.rebase.as_values()} if look and look.rebase else {}),
        "collateral": [c.as_values() for c in (look.collateral if look else ())],
        "light_left_out": [round(x, 6) for x in solution.left_out],
        "warnings": list(dict.fromkeys(w for part in parts for w in part.warnings)),
        "seconds": {k: round(v, 4) for part in parts for k, v in part.seconds.items()},
    }


def _of_style(scene: Scene, s: Stylized, edits: Sequence[AuthoredEdit]) -> dict[str, Any]:
    paths = {m: scene.materials[m].path for m in (style.material for style in s.styles)}
    written = [e for e in edits if e.wins]
    return {
        "stylize": {"amount": s.amount, "radius": s.radius, "rounds": list(s.rounds)},
        "materials": [
            {
                "material": paths[style.material],
                "inferred": inferred(style.freed),
                "before": as_plain(style.before),
                "after": as_plain(style.after),
                "residual_before": style.residual_before,
                "residual_after": style.residual_after,
                **({} if np.isnan(style.residual_as_written) else {"residual_as_written": style.residual_as_written}),
                "representation": sorted({e.representation for e in written if _is_of(e, style.material, scene)}),
            }
            for style in s.styles
        ],
    }


def _surface_of(scene: Scene, stroke: Stroke, material: int) -> str:
    """The gprim of a stroke that shows the material; the first where none does, as of an indirect stroke."""
    shows = {m.path for m in scene.meshes if material in m.material_of_triangle}
    return next((s for s in stroke.surfaces if s in shows), stroke.surfaces[0] if stroke.surfaces else "")


def _is_of(edit: AuthoredEdit, material: int, scene: Scene) -> bool:
    """Whether an edit is one of a material's nodes, or of values at the points of what shows it."""
    path = scene.materials[material].path
    return edit.prim.startswith(f"{path}/") or edit.prim in scene.shown_on(material)


def _of_stroke(
    shot: Shot, solution: Solution, written: Mapping[Pool, float], stroke: Stroke, answer: Answer, *more: Answer
) -> dict[str, Any]:
    """The first answer is the stroke's own; an indirect one may change further materials."""
    materials = shot.scene.materials
    as_preview = solution.as_preview.get(answer.pool)
    as_written = written.get(answer.pool)
    found = {
        "path": stroke.path,
        "surface": _surface_of(shot.scene, stroke, answer.pool.material),
        "material": materials[answer.pool.material].path,
        "inferred": answer.chosen.id,
        "before": as_plain(answer.before),
        "after": as_plain(answer.after),
        "residual_before": answer.residual_before,
        "residual_after": answer.residual_after,
        "rounds": list(answer.rounds),
        **({} if as_preview is None else {"residual_as_preview_surface": as_preview}),
        **({} if as_written is None else {"residual_as_written": as_written}),
        "ambiguous": answer.is_ambiguous,
        "varies": answer.varying is not None,
        "range": _ranges(answer),
        "alternatives": [a.as_values() for a in alternatives_of(answer)],
    }
    if stands_on := _stands_on(shot.scene, answer.pool.material):
        found["stands_on"] = stands_on
    alike = (*answer.pool.similar, *answer.pool.similar_in_part)
    also = [(m, answer, *means_of_similar(answer, m, shot.light_field)) for m in alike]
    if answer.note:
        found["note"] = answer.note
    if answer.others:
        found["alternatives"] = [
            {"id": o.id, "cost": o.cost, "materials": list(o.materials), "after": as_plain(o.after)}
            for o in sorted(answer.others, key=lambda o: (not o.is_chosen, o.cost is None, o.cost or 0.0))
        ]
        also += [(a.pool.material, a, a.before, a.after) for a in more]
    if also or answer.others:
        found["also"] = [
            {
                "material": materials[m].path,
                "inferred": a.chosen.id,
                "before": as_plain(before),
                "after": as_plain(after),
            }
            for m, a, before, after in also
        ]
    return found


def _stands_on(scene: Scene, material: int) -> list[str]:
    """The textures that an answer stands on and that cannot be read: of its material, and of all lights."""
    path = scene.materials[material].path
    return [f"{m.file} of {m.prim}" for m in scene.missing if not m.materials or path in m.materials]


def _ranges(answer: Answer) -> dict[str, Any]:
    """Least and greatest value of each parameter that changed, which hold 90 % of what the paint may mean.

    Empty for answers that vary, and for indirect ones.
    """
    c = answer.chosen
    if answer.varying or answer.others:
        return {}
    found = interval(answer.tables, Options(), c)
    names = {"diffuse": "diffuse", "specular": "specular", "glossiness": "roughness"}
    ends = {names[f]: getattr(found, names[f]) for f in c.freed}
    return {name: [as_plain({"": end})[""] for end in each] for name, each in ends.items()}


def lines_of_report(report: Mapping[str, Any]) -> Iterator[str]:
    """Yields a line a missing texture, two a stylized material or what strokes ask together, and up to two an edit.

    Args:
        report: of `report_of`.
    """
    for m in report.get("missing", ()):
        yield f"missing texture {m['file']} of {m['prim']} cannot be read ({m['why']}): {m['stands_for_it']}"
    for style in report.get("materials", ()):
        yield f"{style['material']}: {style['inferred']}"
        residual = f"{style['residual_before']:.3f} -> {style['residual_after']:.3f}"
        written = f", as written {style['residual_as_written']:.3f}" if "residual_as_written" in style else ""
        yield f"  {_changes(style)}; residual of its elements {residual}{written}"
    for strokes in _answered_alike(report["strokes"]):
        stroke = strokes[0]
        named, on = (", ".join(dict.fromkeys(s[key] for s in strokes)) for key in ("path", "surface"))
        tie = "  (ambiguous)" if stroke.get("ambiguous") else ""
        tie += "  (varies over the surface; means follow)" if stroke.get("varies") else ""
        yield f"{named} on {on}: {stroke['inferred']} of {stroke['material']}{tie}"
        residual = f"{stroke['residual_before']:.3f} -> {stroke['residual_after']:.3f}"
        yield f"  {_changes(stroke)}; residual {residual}"
        for file in stroke.get("stands_on", ()):
            yield f"  it stands on a texture that cannot be read: {file}"
        for name, (low, high) in stroke.get("range", {}).items():
            yield f"  the paint allows {name} {in_words(low)} to {in_words(high)} (90 %)"
        for also in stroke.get("also", ()):
            yield f"  and {also['inferred']} of {also['material']}: {_changes(also)}"
    for edit in report["edits"]:
        loses = "" if edit["wins"] else f"  (hidden by {edit['hidden_by']}: {edit['mend']})"
        change = f"{in_words(edit['before'])} -> {in_words(edit['after'])}"
        yield f"{edit['prim']}.{edit['attribute']}: {change}{loses}"
        if edit["affects"]:
            yield f"  shown by {len(edit['affects'])}: {_some(edit['affects'])}"
    rebase = report.get("rebase", {"edits": (), "stale_strokes": {}})
    for edit in rebase["edits"]:
        yield f"since the last look: {words_of_edit(edit)}"
    for stroke, why in rebase["stale_strokes"].items():
        yield f"stale stroke {stroke}: {why}"
    for beside in report.get("collateral", ()):
        too_much = "  (a finding)" if beside["finding"] else ""
        yield f"{beside['material']} beside that: {words_of(beside)}{too_much}"


def _answered_alike(strokes: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    """The strokes of a report, those together that were asked together and have one answer."""
    found: list[list[Mapping[str, Any]]] = []
    for stroke in strokes:
        same = {k: v for k, v in stroke.items() if k not in ("path", "surface")}
        for others in found:
            if same == {k: v for k, v in others[0].items() if k not in ("path", "surface")}:
                others.append(stroke)
                break
        else:
            found.append([stroke])
    return found


def _some(prims: Sequence[str], most: int = 3) -> str:
    more = len(prims) - most
    return ", ".join(prims[:most]) + (f" and {more} more" if more > 0 else "")


def _changes(of: Mapping[str, Any]) -> str:
    before, after = of["before"], of["after"]
    changed = [f"{k} {in_words(before[k])} -> {in_words(after[k])}" for k in after if before[k] != after[k]]
    return ", ".join(changed) or "nothing changed"
