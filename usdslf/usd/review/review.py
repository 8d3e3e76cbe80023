"""What a look layer changes in a shot, and what is wrong with it: for a person who has to accept it.

    review_look(shot, look, ocio) -> LookReview       materials, edits, gprims, risks, findings
    strokes_of_look(look) -> list[Stroke]              of the layer that it names
    over_its_shot(shot, look) -> (with it, below)     how it is composed
    lines_of_review(review) -> list[str]              the lines that people read
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from pxr import Sdf, Usd, UsdValidation

from usdslf.contents import file_hash
from usdslf.edits.collateral import Collateral, words_of
from usdslf.errors import InputError, StageError, StrokeError
from usdslf.strokes.stroke import Stroke
from usdslf.usd.author.collateral import Reading, collateral_between
from usdslf.usd.binding import BINDING, bound_relationship
from usdslf.usd.border import in_words, plain, quiet_usd, reading
from usdslf.usd.edited import open_edited
from usdslf.usd.layer.affected import gprims_reached
from usdslf.usd.layer.hand_edits import specs_of
from usdslf.usd.layer.layer_names import layer_name
from usdslf.usd.layer.opinions import base_of, file_digest, texture_of
from usdslf.usd.layer.parts import Parts
from usdslf.usd.layer.provenance import of_another_shot, stale
from usdslf.usd.layer.shown_paths import ShownPaths, shot_attribute
from usdslf.usd.layer.silent import silent_specs
from usdslf.usd.layer.weighed import WEIGHED, weighed_in
from usdslf.usd.layer.wins import why_hidden
from usdslf.usd.look_data import is_look, our_data, texts
from usdslf.usd.read.read import open_stage
from usdslf.usd.review.records import Finding, LookReview, ReviewedEdit, ReviewedGprim, ReviewedMaterial
from usdslf.usd.review.survival import risks_of
from usdslf.usd.review.validate import validate
from usdslf.usd.stroke_layer import read_strokes

LONG = 4  # values of an array that are shown; of more, their number
_SAME = 1e-4  # share by which a number may differ from its base
_KEPT = ("version", "workingSpace", "ocioConfig", "device", "solve", "settings", "frame", "shot", "shotHash", "strokes",
         "strokesHash", "accepted")  # fmt: skip


def review_look(shot: str | os.PathLike[str], look: str | os.PathLike[str], ocio: str | None) -> LookReview:
    """Returns what a look layer says of each material and attribute, with the shot's own values, and the findings.

    Args:
        shot, look: files of the shot, and of the look layer.
        ocio: OpenColorIO config that has to know the colour spaces; None is $OCIO, else the built-in one.

    Raises: StageError for the shot, InputError where the look is no look layer.
    """
    with reading(look, InputError, "solve again"):
        stage, below = over_its_shot(shot, look)
        layer = Sdf.Layer.FindOrOpen(os.fspath(look))
        if not is_look(layer):
            raise InputError(f"{look} is not a look layer of usdslf; make one with: usdslf solve")
        return _Reviewing(stage, below, layer, ocio).review()


def over_its_shot(
    shot: str | os.PathLike[str], look: str | os.PathLike[str]
) -> tuple[Usd.Stage, Usd.Stage]:
    """Returns the shot with a look, and what the look changes: the shot without it and what is stronger.

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


@dataclass(frozen=True)
class _Reviewing:
    """A look over its shot while it is reviewed."""

    stage: Usd.Stage
    below: Usd.Stage
    layer: Sdf.Layer
    ocio: str | None

    @cached_property
    def shown(self) -> ShownPaths:
        """Where the opinions of the look are composed."""
        return ShownPaths(self.stage, self.layer)

    def review(self) -> LookReview:
        stage, layer = self.stage, self.layer
        findings = validate(stage, self.ocio)
        beside: list[Collateral] = []
        try:
            beside = self._collateral()
        except InputError as error:  # a colour config that lacks a space of the shot
            say = f"What else the look changes could not be measured: {error}."
            findings.append(Finding("Collateral", "/", say, layer.GetDisplayName()))
        findings += [_spoilt(c, layer) for c in beside if c.is_finding]
        shown = self.shown
        reached = gprims_reached(stage, layer)
        specs = [s for s in specs_of(layer) if shown.is_selected(s.path)]
        gprims_of = lambda spec: tuple(reached.get(spec.path, ()))  # noqa: E731
        of = {p.path: p.targets for p in Parts.of(layer).parts}
        edits = [
            self._edit(s, shown(s.path), of[s.path], gprims_of(s.owner))
            for s in specs
            if isinstance(s, Sdf.PropertySpec)
        ]
        edits += [self._silent(at, s, of[at]) for at, s in silent_specs(layer) if isinstance(s, Sdf.PropertySpec)]
        findings = self._of_this_look(findings, edits)
        materials = [
            _material(s, str(shown(s.path)), gprims_of(s))
            for s in specs
            if isinstance(s, Sdf.PrimSpec) and our_data(s.customData)
        ]
        data = our_data(layer.customLayerData)
        return LookReview(
            shot=stage.GetRootLayer().realPath,
            look=layer.realPath,
            look_hash=file_hash(layer.realPath),
            materials=tuple(materials),
            edits=tuple(edits),
            gprims=tuple(self._gprims(materials, edits)),
            risks=tuple(risks_of(stage, layer, edits)),
            collateral=tuple(beside),
            findings=tuple(findings),
            provenance={name: plain(data[name]) for name in _KEPT if name in data},
            is_stale=bool([*stale(layer), *of_another_shot(layer, stage)]),
            validator_errors=tuple(_new_errors(stage, self.below, layer)),
        )

    def _of_this_look(self, findings: list[Finding], edits: list[ReviewedEdit]) -> list[Finding]:
        """Leaves out what a look that is laid over the shot hides, and what other looks of the shot hide of each other.

        Two looks that are in the shot both, and clash there, are found as such.
        """
        if self.layer in self.stage.GetLayerStack(includeSessionLayers=False):
            return findings
        replaced, name = self._replaced(edits), layer_name(self.stage, self.layer)
        return [f for f in findings if f.name != "HiddenEdit" or (f.layer == name and f.prim not in replaced)]

    def _replaced(self, edits: list[ReviewedEdit]) -> set[str]:
        """Where a look that is laid over the shot shows: what an earlier one of the shot says there is replaced."""
        found: set[str] = set()
        for e in (e for e in edits if e.wins):
            prim = self.stage.GetPrimAtPath(e.shown_at)
            if not e.attribute.startswith(BINDING):
                found.add(f"{e.shown_at}.{e.attribute}")
            elif prim and str(bound_relationship(prim)[0]) in (e.after or ()):
                found.add(e.shown_at)
        return found

    def _collateral(self) -> list[Collateral]:
        """What the look changes beside what it is meant to, at the frame that it was solved at."""
        frame = our_data(self.layer.customLayerData).get("frame")
        how = Reading(float(frame) if isinstance(frame, int | float) else None, ocio=self.ocio)
        try:
            with quiet_usd():
                return collateral_between(self.below, self.stage, self.layer, how)
        except StageError:  # nothing is left to see, which is no fault of the look
            return []

    def _edit(
        self, spec: Sdf.PropertySpec, at: Sdf.Path, targets: tuple[str, ...], gprims: tuple[str, ...]
    ) -> ReviewedEdit:
        path = spec.path.StripAllVariantSelections()
        before, after = _values(self.below, at, spec)
        hidden, mend = "", ""
        if isinstance(spec, Sdf.AttributeSpec) and spec.HasDefaultValue():
            hidden, mend = why_hidden(self.stage, self.layer, spec.path, at)
        return ReviewedEdit(
            prim=str(path.GetPrimPath()), attribute=path.name, shown_at=str(at.GetPrimPath()), targets=targets,
            before=before, after=after, base=_shown(base_of(spec)), drifted=self._drift(spec),
            representation=_representation(spec), hidden_by=hidden, mend=mend, gprims=() if hidden else gprims,
        )  # fmt: skip

    def _silent(self, at: Sdf.Path, spec: Sdf.PropertySpec, targets: tuple[str, ...]) -> ReviewedEdit:
        before, after = _values(self.below, at.StripAllVariantSelections(), spec)
        prim = str(at.GetPrimPath().StripAllVariantSelections())
        return ReviewedEdit(
            prim, at.name, prim, targets, before, after, _shown(base_of(spec)),
            representation=_representation(spec), is_off=True,
        )  # fmt: skip

    def _drift(self, spec: Sdf.PropertySpec) -> str:
        """What of the shot is not as it was when an opinion was solved, in words."""
        _, digest = texture_of(spec)
        file = spec.path.GetPrimPath().AppendProperty("inputs:file")
        texture = shot_attribute(self.below, self.layer, self.shown, file)
        now = texture.Get() if texture else None
        if digest and isinstance(now, Sdf.AssetPath) and file_digest(now.resolvedPath) not in ("", digest):
            return f"acts on {now.path}, which is not the texture that it was solved over"
        base, attribute = base_of(spec), shot_attribute(self.below, self.layer, self.shown, spec.path)
        current = plain(attribute.Get()) if attribute else None
        if base is None or current is None or _is_near(base, current):
            return ""
        return f"was solved over {in_words(_shown(base))}, and the shot says {in_words(_shown(current))} now"

    def _gprims(
        self, materials: list[ReviewedMaterial], edits: list[ReviewedEdit]
    ) -> Iterator[ReviewedGprim]:
        """What shows something else, and whether it was painted."""
        try:
            painted = {s.split("[")[0] for x in strokes_of_look(self.layer.realPath) for s in x.surfaces}
        except StrokeError:  # which is a finding
            painted = set()
        of: dict[str, list[str]] = {}
        for edit in edits:
            for gprim in edit.gprims if edit.wins else ():
                of.setdefault(gprim, [])
        for m in materials:
            for gprim in m.gprims:
                of.setdefault(gprim, []).append(m.shown_at)
        for path, shows in sorted(of.items()):
            prim, instance = self.stage.GetPrimAtPath(path), ""
            while prim and prim.IsInstanceProxy():
                prim = prim.GetParent()
                instance = str(prim.GetPath())
            is_painted = path in painted or str(Sdf.Path(path).GetParentPath()) in painted
            yield ReviewedGprim(path, is_painted, instance, tuple(dict.fromkeys(shows)))


def strokes_of_look(look: str | os.PathLike[str]) -> list[Stroke]:
    """Returns the strokes of the layer that a look names; none where there is none.

    Raises: StrokeError where they cannot be read.
    """
    with reading(look, InputError, "solve again"):
        layer = Sdf.Layer.FindOrOpen(os.fspath(look))
        named = str(our_data(layer.customLayerData).get("strokes", "")) if layer else ""
        file = layer.ComputeAbsolutePath(named) if named else ""
    return read_strokes(file) if os.path.isfile(file) else []


def _is_near(a: Any, b: Any) -> bool:
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return all(_is_near(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, int | float) and isinstance(b, int | float):
        return abs(a - b) <= _SAME * max(1.0, abs(a), abs(b))
    return bool(a == b)


def _new_errors(stage: Usd.Stage, below: Usd.Stage, layer: Sdf.Layer) -> list[str]:
    """What USD's own validators say of the shot with the look, and do not say of it without.

    What is wrong with a Material of the shot is wrong with those that the look makes of it too, and not new.
    """
    made = {
        str(s.path): str(arcs.GetAddedOrExplicitItems()[0])
        for s in specs_of(layer)
        if isinstance(s, Sdf.PrimSpec) and s.specifier == Sdf.SpecifierDef
        for arcs in (s.inheritPathList, s.specializesList)
        if arcs.GetAddedOrExplicitItems()
    }

    def as_in_the_shot(message: str) -> str:
        for path in sorted(made, key=len, reverse=True):
            message = message.replace(path, made[path])
        return message

    known = set(_errors(below))
    return [e for e in dict.fromkeys(_errors(stage)) if as_in_the_shot(e) not in known]


def _errors(stage: Usd.Stage) -> list[str]:
    registry = UsdValidation.ValidationRegistry()
    own = [m.name for m in registry.GetAllValidatorMetadata() if not m.name.startswith("usdslf")]
    context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(own))
    with quiet_usd():
        return [f"{e.GetName()}: {e.GetMessage()}" for e in context.Validate(stage)]


def _spoilt(c: Collateral, layer: Sdf.Layer) -> Finding:
    say = f"{c.in_words()}: look at it, or solve with another explanation (--choose) or scope."
    return Finding("Collateral", c.material, say, layer.GetDisplayName())


def lines_of_review(r: LookReview) -> list[str]:
    """Returns a line for each material, edit, risk and finding."""
    lines = [f"{r.look} over {r.shot}"]
    for m in r.materials:
        known = m.residual_before is not None and m.residual_after is not None
        residual = f"; residual {m.residual_before:.3f} -> {m.residual_after:.3f}" if known else ""
        lines.append(f"{m.prim}: {m.inferred}, from {', '.join(m.strokes) or 'no stroke'}{residual}")
    for e in r.edits:
        off = "  (off)" if e.is_off else ""
        lines.append(f"  {e.prim}.{e.attribute}: {in_words(e.before)} -> {in_words(e.after)}{off}")
    also = [g for g in r.gprims if not g.is_painted]
    lines.append(f"changes {len(r.gprims)} gprims, {len(also)} of them not painted")
    lines += [f"  {c.material} beside that: {words_of(c.as_values())}" for c in r.collateral]
    lines += [f"may not survive: {len(r.risks)}", *(f"  {x.rule}: {x.message} ({x.source})" for x in r.risks)]
    lines.append(f"findings: {len(r.findings)}")
    return lines + [f"  {f.name}: {f.message}" for f in r.findings]


def _material(spec: Sdf.PrimSpec, shown_at: str, gprims: tuple[str, ...]) -> ReviewedMaterial:
    data = our_data(spec.customData)
    found = ReviewedMaterial(
        str(spec.path.StripAllVariantSelections()), shown_at, str(data.get("inferred", "none")),
        tuple(texts(data.get("strokes"))), _means(data.get("before")), _means(data.get("after")),
        alternatives=weighed_in(data.get(WEIGHED)), gprims=gprims,
    )  # fmt: skip
    before, after = data.get("residualBefore"), data.get("residualAfter")
    if isinstance(before, int | float) and isinstance(after, int | float):
        return replace(found, residual_before=float(before), residual_after=float(after))
    return found


def _means(data: Any) -> dict[str, Any]:
    """Means of parameters as JSON holds them; what is no number is left out."""
    values = plain(data) if isinstance(data, dict) else {}
    fits = lambda v: isinstance(v, int | float) or (isinstance(v, list) and len(v) == 3)  # noqa: E731
    return {k: v for k, v in values.items() if k in ("diffuse", "specular", "roughness") and fits(v)}


def _representation(spec: Sdf.PropertySpec) -> str:
    if isinstance(spec, Sdf.RelationshipSpec):
        return "binding" if spec.name.startswith("material:binding") else "node"
    if spec.name.startswith("primvars:"):
        return "primvar"
    if spec.name in ("indices", "elementType", "familyName") or spec.name.startswith("subsetFamily:"):
        return "faces"
    if spec.connectionPathList.GetAddedOrExplicitItems():
        return "connection"
    if spec.name in ("info:id", "inputs:varname") or spec.name.startswith("outputs:"):
        return "node"
    if texture_of(spec)[0] or spec.name in ("inputs:scale", "inputs:bias"):
        return "scale"
    return "texture" if spec.name in _OF_TEXTURES else "constant"


_OF_TEXTURES = tuple(f"inputs:{n}" for n in ("file", "sourceColorSpace", "wrapS", "wrapT", "fallback"))


def _values(below: Usd.Stage, at: Sdf.Path, spec: Sdf.PropertySpec) -> tuple[Any, Any]:
    """What the shot says, and what the look says there, as JSON holds it."""
    attribute, relationship = below.GetAttributeAtPath(at), below.GetRelationshipAtPath(at)
    before: Any = attribute.Get() if attribute else None
    if relationship:
        before = [str(t) for t in relationship.GetTargets()]
    elif before is None and isinstance(spec, Sdf.AttributeSpec):
        before = base_of(spec)
    if isinstance(spec, Sdf.RelationshipSpec):
        after: Any = [str(t) for t in spec.targetPathList.GetAddedOrExplicitItems()]
    elif spec.connectionPathList.GetAddedOrExplicitItems():
        after = [f"<{p}>" for p in spec.connectionPathList.GetAddedOrExplicitItems()]
    else:
        after = spec.default
    return _shown(before), _shown(after)


def _shown(value: Any) -> Any:
    """A value as JSON holds it; of a long array how many there are."""
    if hasattr(value, "__len__") and len(value) > LONG and not isinstance(value, str):
        return f"{len(value)} values"
    return value if isinstance(value, list) else plain(value)


