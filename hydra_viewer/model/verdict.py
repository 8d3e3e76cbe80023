"""Verdict: what a person decides about each change of a look, as `usdslf accept --verdict` executes it.

    rows_of(review) -> tuple[Row, ...]           what there is to decide, each with what it changes
    Verdict                                      what was decided so far; written by `write`
"""

from __future__ import annotations

import getpass
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from usdslf import LookReview

MEANS = {"diffuseColor": "diffuse", "specularColor": "specular", "roughness": "roughness"}
"""Inputs, and the means over what was painted that belong to them."""


@dataclass(frozen=True)
class Row:
    """A change to decide about.

    Attributes:
        target: what a verdict names: an input of a material, or a prim.
        material: path of what it belongs to.
        name: of the input, or of the attribute.
        before, after: values as text.
        state: why it does not show; "" where it does.
        strokes: names of those that asked for it.
        colors: before and after, scene-linear, where it is a colour; else ().
        is_off: it is kept, and silent.
    """

    target: str
    material: str
    name: str
    before: str
    after: str
    state: str = ""
    strokes: tuple[str, ...] = ()
    colors: tuple[tuple[float, ...], ...] = ()
    is_off: bool = False


@dataclass
class Verdict:
    """What was decided.

    Attributes:
        review: what of.
        rejected: targets that are not accepted.
        notes: by target.
    """

    review: LookReview
    rejected: set[str] = field(default_factory=set)
    notes: dict[str, str] = field(default_factory=dict)

    def decide(self, target: str, is_accepted: bool) -> None:
        """Accepts or rejects a change."""
        (self.rejected.discard if is_accepted else self.rejected.add)(target)

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it: schemas/verdict.schema.json."""
        targets = dict.fromkeys(row.target for row in rows_of(self.review))
        return {
            "look": Path(self.review.look).name,
            "lookHash": self.review.look_hash,
            "by": _person(),
            "verdicts": [
                {
                    "target": t,
                    "verdict": "reject" if t in self.rejected else "accept",
                    "note": self.notes.get(t, ""),
                }
                for t in targets
            ],
        }

    def write(self, path: str) -> None:
        """Writes it.

        Raises: OSError where the file cannot be written.
        """
        Path(path).write_text(json.dumps(self.as_values(), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def rows_of(review: LookReview) -> tuple[Row, ...]:
    """Returns what there is to decide, one row for each thing that a verdict can name, by material."""
    strokes = {m.prim: tuple(s.rsplit("/", 1)[-1] for s in m.strokes) for m in review.materials}
    means = {m.prim: m for m in review.materials}
    found: dict[str, Row] = {}
    for edit in review.edits:
        for target in edit.targets:
            material, _, name = target.partition(".")
            state = "off" if edit.is_off else f"hidden by {edit.hidden_by}" if edit.hidden_by else edit.drifted
            named = (name or edit.attribute).removeprefix("inputs:")
            before, after = edit.before, edit.after
            mean, of = means.get(material), MEANS.get(named, "")
            if edit.representation != "constant" and mean is not None and of in mean.before and of in mean.after:
                before, after = mean.before[of], mean.after[of]  # of what was painted, instead of a texture's scale
            row = Row(
                target, material, named, in_words(before), in_words(after), state, strokes.get(material, ()),
                _colors(before, after), edit.is_off,
            )  # fmt: skip
            found.setdefault(target, row)
    return tuple(sorted(found.values(), key=lambda r: r.material))


def _colors(*values: Any) -> tuple[tuple[float, ...], ...]:
    """Values that are colours; () unless all are."""
    are = all(isinstance(v, (list, tuple)) and len(v) == 3 and all(isinstance(c, float) for c in v) for v in values)
    return tuple(tuple(v) for v in values) if are else ()


def _person() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # an account without a name
        return ""


def in_words(value: Any) -> str:
    """Returns a value of USD as a person reads it."""
    if value is None:
        return "—"
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, (list, tuple)) and value and all(isinstance(v, float) for v in value):
        return " ".join(f"{v:.2f}" for v in value)
    return str(value)
