"""What a review says of a look layer without pictures: typed records, each as JSON holds it.

    LookReview        materials, edits, gprims, what will not survive, findings, where it comes from
    of each           as_values() -> dict      by schemas/review.schema.json
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from usdslf.edits.collateral import Collateral
from usdslf.edits.explanation import Explanation


@dataclass(frozen=True)
class ReviewedMaterial:
    """A Material that the look changes.

    Attributes:
        prim: path in the look, without variants; a class for what lies in an instance.
        shown_at: composed path.
        inferred: parameters that changed, joined by "+".
        strokes: paths of those that asked for it.
        before, after: means of `diffuse`, `specular` (three numbers) and `roughness` over what was painted.
        residual_before, residual_after: relative error of what was painted; None: not measured.
        alternatives: the explanations that were weighed, the cheapest first.
        gprims: that show it.
    """

    prim: str
    shown_at: str
    inferred: str
    strokes: tuple[str, ...]
    before: Mapping[str, Any] = field(default_factory=dict)
    after: Mapping[str, Any] = field(default_factory=dict)
    residual_before: float | None = None
    residual_after: float | None = None
    alternatives: tuple[Explanation, ...] = ()
    gprims: tuple[str, ...] = ()

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        found: dict[str, Any] = {
            "prim": self.prim, "shown_at": self.shown_at, "inferred": self.inferred, "strokes": list(self.strokes),
            "before": dict(self.before), "after": dict(self.after), "gprims": list(self.gprims),
            "alternatives": [a.as_values() for a in self.alternatives],
        }  # fmt: skip
        if self.residual_before is not None and self.residual_after is not None:
            found |= {"residual_before": self.residual_before, "residual_after": self.residual_after}
        return found


@dataclass(frozen=True)
class ReviewedEdit:
    """An opinion of the look.

    Attributes:
        prim, attribute: where it stands in the look, without variants.
        shown_at: composed path of the prim.
        targets: what it is for, "/World/mtl/ball.inputs:roughness"; what a verdict names.
        before: composed value of the shot, below the look.
        after: of the look.
        base: what the shot said when it was solved; None: not known.
        drifted: the shot says something else now, or the texture that it is relative to is another one.
        representation: constant | scale | primvar | texture | connection | binding | faces | node.
        hidden_by, mend: what is stronger, and what would make it show; "" where it does.
        gprims: that show it.
        is_off: it is kept, and silent (usdslf toggle).
    """

    prim: str
    attribute: str
    shown_at: str
    targets: tuple[str, ...]
    before: Any
    after: Any
    base: Any = None
    drifted: str = ""
    representation: str = "constant"
    hidden_by: str = ""
    mend: str = ""
    gprims: tuple[str, ...] = ()
    is_off: bool = False

    @property
    def wins(self) -> bool:
        """Whether nothing stronger hides it."""
        return not self.hidden_by and not self.is_off

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "prim": self.prim, "attribute": self.attribute, "shown_at": self.shown_at, "targets": list(self.targets),
            "before": self.before, "after": self.after, "base": self.base, "drifted": self.drifted,
            "representation": self.representation, "wins": self.wins, "hidden_by": self.hidden_by, "mend": self.mend,
            "gprims": list(self.gprims),
            "off": self.is_off,
        }  # fmt: skip


@dataclass(frozen=True)
class ReviewedGprim:
    """A gprim or GeomSubset that shows something else under the look.

    Attributes:
        path: composed; of an instance's, as it is seen below the instance.
        is_painted: a stroke of the look lies on it.
        instance: root of the instance that it is in; "" for none.
        materials: paths of those of the look that it shows.
    """

    path: str
    is_painted: bool
    instance: str
    materials: tuple[str, ...]

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "path": self.path, "painted": self.is_painted, "instance": self.instance, "materials": list(self.materials)
        }  # fmt: skip


@dataclass(frozen=True)
class Risk:
    """A place where another program will not show an edit as it is shown here.

    Attributes:
        rule: its name in survival.py.
        prim: composed path.
        message: what, where, and how to mend it.
        source: of the rule: who says so, in public.
    """

    rule: str
    prim: str
    message: str
    source: str

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return dict(vars(self))


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or not as it was."""

    name: str
    prim: str  # composed path; that of the layer where it is in no prim
    message: str  # what, where, and how to mend it
    layer: str  # file


@dataclass(frozen=True)
class LookReview:
    """What a look layer changes in a shot, and what is wrong with it.

    Attributes:
        shot, look: files.
        look_hash: sha256 of the look's bytes: a verdict is of these.
        materials, edits, gprims: what changes.
        risks: where it will not survive.
        collateral: what changes beside what was asked.
        findings: what is wrong with it.
        provenance: what the look says of where it comes from.
        is_stale: the shot or the strokes changed since.
        validator_errors: of USD's own validators, that the shot does not have without the look.
    """

    shot: str
    look: str
    look_hash: str
    materials: tuple[ReviewedMaterial, ...]
    edits: tuple[ReviewedEdit, ...]
    gprims: tuple[ReviewedGprim, ...]
    risks: tuple[Risk, ...]
    collateral: tuple[Collateral, ...]
    findings: tuple[Finding, ...]
    provenance: Mapping[str, Any]
    is_stale: bool
    validator_errors: tuple[str, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        """The inputs of Materials that change, each once."""
        return tuple(dict.fromkeys(t for e in self.edits if not e.is_off for t in e.targets if "." in t))

    def as_values(self) -> dict[str, Any]:
        """Returns it as JSON holds it."""
        on = [e for e in self.edits if not e.is_off]
        return {
            "format": "usdslf-review-1",
            "shot": self.shot,
            "look": self.look,
            "look_hash": self.look_hash,
            "summary": {
                "materials": len(self.materials),
                "inputs": len(self.inputs),
                "gprims": len(self.gprims),
                "not_painted": sum(not g.is_painted for g in self.gprims),
                "validator_errors": len(self.validator_errors),
                "wins": all(e.wins for e in on),
                "stale": self.is_stale,
                "off": len(self.edits) - len(on),
                "findings": len(self.findings),
                "risks": len(self.risks),
            },
            "materials": [m.as_values() for m in self.materials],
            "edits": [e.as_values() for e in self.edits],
            "gprims": [g.as_values() for g in self.gprims],
            "risks": [r.as_values() for r in self.risks],
            "collateral": [c.as_values() for c in self.collateral],
            "findings": [dict(vars(f)) for f in self.findings],
            "validator_errors": list(self.validator_errors),
            "provenance": dict(self.provenance),
        }
