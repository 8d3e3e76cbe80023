"""What a look layer changes in a shot, and what is wrong with it: for a person who has to accept it.

    review_look(shot, look, ocio) -> dict          JSON-ready: materials, edits, findings
    lines_of_review(found) -> list[str]      the lines that people read
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from pxr import Sdf, Usd

from usdslf.edits.collateral import Collateral, words_of
from usdslf.errors import InputError, StageError
from usdslf.usd.author.collateral import Reading, collateral_between
from usdslf.usd.border import in_words, plain, quiet_usd, reading
from usdslf.usd.edited import open_edited
from usdslf.usd.layer.hand_edits import specs_of
from usdslf.usd.look_data import is_look, our_data, texts
from usdslf.usd.read.read import open_stage
from usdslf.usd.review.validate import Finding, validate

LONG = 4  # values of an array that are shown; of more, their number


def review_look(
    shot: str | os.PathLike[str], look: str | os.PathLike[str], ocio: str | None
) -> dict[str, Any]:
    """Returns what a look layer says of each material and attribute, with the shot's own values, and the findings.

    Args:
        ocio: OpenColorIO config that has to know the colour spaces; None is $OCIO, else the built-in one.

    Raises: StageError for the shot, InputError where the look is no look layer.
    """
    with reading(look, InputError, "solve again"):
        stage, below = _over_its_shot(shot, look)
        layer = Sdf.Layer.FindOrOpen(os.fspath(look))
        if not is_look(layer):
            raise InputError(f"{look} is not a look layer of usdslf; make one with: usdslf solve")
        return _reviewed(stage, below, layer, ocio)


def _over_its_shot(shot: str | os.PathLike[str], look: str | os.PathLike[str]) -> tuple[Usd.Stage, Usd.Stage]:
    """The shot with a look, and what the look changes: the shot without it and what is stronger.

    A look that the shot has already stays where it is: what hides it there hides it.
    """
    plain_shot = open_stage(shot)
    stack = plain_shot.GetLayerStack(includeSessionLayers=False)
    places = [i for i, layer in enumerate(stack) if layer.realPath and _is_same(layer.realPath, look)]
    if not places:
        return open_edited(shot, look), plain_shot
    below = Usd.Stage.Open(plain_shot.GetRootLayer())
    stronger = [layer for layer in stack[: places[0]] if not layer.subLayerPaths]
    below.MuteAndUnmuteLayers([x.identifier for x in (*stronger, stack[places[0]]) if x != stack[0]], [])
    return plain_shot, below


def _is_same(path: str, other: str | os.PathLike[str]) -> bool:
    return os.path.realpath(path) == os.path.realpath(other)


def _reviewed(stage: Usd.Stage, below: Usd.Stage, layer: Sdf.Layer, ocio: str | None) -> dict[str, Any]:
    specs = list(specs_of(layer))
    found = validate(stage, ocio)
    beside: list[Collateral] = []
    try:
        beside = _collateral(stage, below, layer, ocio)
    except InputError as error:  # a colour config that lacks a space of the shot
        say = f"What else the look changes could not be measured: {error}."
        found.append(Finding("Collateral", "/", say, layer.GetDisplayName()))
    found += [_spoilt(c, layer) for c in beside if c.is_finding]
    return {
        "shot": stage.GetRootLayer().realPath,
        "look": layer.realPath,
        "materials": [_material(s) for s in specs if isinstance(s, Sdf.PrimSpec) and our_data(s.customData)],
        "edits": [_edit(below, s) for s in specs if isinstance(s, Sdf.PropertySpec)],
        "collateral": [c.as_values() for c in beside],
        "findings": [vars(f) for f in found],
    }


def _collateral(stage: Usd.Stage, below: Usd.Stage, layer: Sdf.Layer, ocio: str | None) -> list[Collateral]:
    """What the look changes beside what it is meant to, at the frame that it was solved at."""
    frame = our_data(layer.customLayerData).get("frame")
    reading = Reading(float(frame) if isinstance(frame, int | float) else None, ocio=ocio)
    try:
        with quiet_usd():
            return collateral_between(below, stage, layer, reading)
    except StageError:  # nothing is left to see, which is no fault of the look
        return []


def _spoilt(c: Collateral, layer: Sdf.Layer) -> Finding:
    say = f"{c.in_words()}: look at it, or solve with another explanation (--choose) or scope."
    return Finding("Collateral", c.material, say, layer.GetDisplayName())


def lines_of_review(found: Mapping[str, Any]) -> list[str]:
    """Returns a line for each material, edit and finding."""
    lines = [f"{found['look']} over {found['shot']}"]
    for m in found["materials"]:
        known = "residual_after" in m
        residual = f"; residual {m['residual_before']:.3f} -> {m['residual_after']:.3f}" if known else ""
        lines.append(f"{m['prim']}: {m['inferred']}, from {', '.join(m['strokes']) or 'no stroke'}{residual}")
    lines += [
        f"  {e['prim']}.{e['attribute']}: {in_words(e['before'])} -> {in_words(e['after'])}" for e in found["edits"]
    ]
    lines += [f"  {c['material']} beside that: {words_of(c)}" for c in found["collateral"]]
    lines.append(f"findings: {len(found['findings'])}")
    return lines + [f"  {f['name']}: {f['message']}" for f in found["findings"]]


def _material(spec: Sdf.PrimSpec) -> dict[str, Any]:
    data = our_data(spec.customData)
    found: dict[str, Any] = {
        "prim": str(spec.path.StripAllVariantSelections()),
        "inferred": str(data.get("inferred", "none")),
        "strokes": texts(data.get("strokes")),
    }
    before, after = data.get("residualBefore"), data.get("residualAfter")
    if isinstance(before, int | float) and isinstance(after, int | float):
        found |= {"residual_before": float(before), "residual_after": float(after)}
    return found


def _edit(below: Usd.Stage, spec: Sdf.PropertySpec) -> dict[str, Any]:
    path = spec.path.StripAllVariantSelections()
    attribute = below.GetAttributeAtPath(path)
    relationship = below.GetRelationshipAtPath(path)
    before: Any = attribute.Get() if attribute else None
    if relationship:
        before = [str(t) for t in relationship.GetTargets()]
    if isinstance(spec, Sdf.RelationshipSpec):
        after: Any = [str(t) for t in spec.targetPathList.GetAddedOrExplicitItems()]
    elif spec.connectionPathList.GetAddedOrExplicitItems():
        after = [f"<{p}>" for p in spec.connectionPathList.GetAddedOrExplicitItems()]
    else:
        after = spec.default
    return {"prim": str(path.GetPrimPath()), "attribute": path.name, "before": _shown(before), "after": _shown(after)}


def _shown(value: Any) -> Any:
    """A value as JSON holds it; of a long array how many there are."""
    if hasattr(value, "__len__") and len(value) > LONG and not isinstance(value, str):
        return f"{len(value)} values"
    return value if isinstance(value, list) else plain(value)
