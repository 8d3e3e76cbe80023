"""Diff: two looks over one shot, by what they say and by pictures.

    diff_looks(stage, look_a, look_b, ocio) -> LookDiff          what they say otherwise
    compare(stage, look_a, look_b, settings) -> Comparison       the same with pictures: a page of a review, A before B
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from usdslf.review.review import Review, ReviewSettings, pictured
from usdslf.shot import Shot
from usdslf.usd.border import in_words
from usdslf.usd.review.records import LookReview, ReviewedEdit, ReviewedGprim, ReviewedMaterial
from usdslf.usd.review.review import over_its_shot, review_look

PathLike = str | os.PathLike[str]
SAME = 1e-4  # of a value, that is no difference


@dataclass(frozen=True)
class DiffRow:
    """An opinion that is not the same in both looks.

    Attributes:
        prim, attribute: where it is composed.
        targets: what it is for.
        shot, a, b: what each says; None: nothing.
    """

    prim: str
    attribute: str
    targets: tuple[str, ...]
    shot: Any
    a: Any
    b: Any

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return dict(vars(self)) | {"targets": list(self.targets)}


@dataclass(frozen=True)
class LookDiff:
    """What two looks say otherwise.

    Attributes:
        shot, look_a, look_b: files.
        rows: opinions that differ.
        same: number of opinions that are the same in both.
        gprims_a, gprims_b: that only one of them changes.
    """

    shot: str
    look_a: str
    look_b: str
    rows: tuple[DiffRow, ...]
    same: int
    gprims_a: tuple[str, ...]
    gprims_b: tuple[str, ...]

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it: schemas/diff.schema.json."""
        values = {k: list(v) if isinstance(v, tuple) else v for k, v in vars(self).items()}
        return {"format": "usdslf-diff-1", **values, "rows": [r.as_values() for r in self.rows]}

    def lines(self) -> list[str]:
        """The lines that people read."""
        found = [f"{self.look_a} and {self.look_b} over {self.shot}"]
        found += [
            f"  {r.prim}.{r.attribute}: {in_words(r.a)} | {in_words(r.b)}  (shot {in_words(r.shot)})" for r in self.rows
        ]
        found += [f"  only the first changes {g}" for g in self.gprims_a]
        found += [f"  only the second changes {g}" for g in self.gprims_b]
        return [*found, f"{len(self.rows)} opinions differ, {self.same} are the same"]


def diff_looks(stage: PathLike, look_a: PathLike, look_b: PathLike, ocio: str | None) -> LookDiff:
    """Compares what two looks say.

    Args:
        stage: the shot of both.
        ocio: OpenColorIO config.

    Raises: StageError for the shot, InputError for a look.
    """
    return _diff(*(review_look(stage, look, ocio) for look in (look_a, look_b)))


def _diff(a: LookReview, b: LookReview) -> LookDiff:
    one, two = (_by_place(r.edits) for r in (a, b))
    rows, same = [], 0
    for key in dict.fromkeys([*one, *two]):
        x, y = one.get(key), two.get(key)
        if x is not None and y is not None and _is_near(x.after, y.after):
            same += 1
            continue
        known = x or y
        assert known is not None
        values = (e.after if e else None for e in (x, y))
        rows.append(DiffRow(*key, known.targets, known.before, *values))
    gprims = [[g.path for g in r.gprims] for r in (a, b)]
    only = [tuple(g for g in mine if g not in other) for mine, other in (gprims, gprims[::-1])]
    return LookDiff(a.shot, a.look, b.look, tuple(rows), same, *only)


def compare(
    stage: PathLike, look_a: PathLike, look_b: PathLike, settings: ReviewSettings | None = None
) -> tuple[LookDiff, Review]:
    """Compares two looks by what they say and by pictures.

    Returns: what they say otherwise, and a Review whose before is the first and whose after is the second.

    Raises: as `review`.
    """
    s = settings or ReviewSettings()
    a, b = (review_look(stage, look, s.ocio) for look in (look_a, look_b))
    found = _diff(a, b)
    frame = b.provenance.get("frame") if s.frame is None else s.frame
    one, below = over_its_shot(stage, look_a)
    two, _ = over_its_shot(stage, look_b)
    shot = Shot.open(below, frame, s.device, s.ocio, **s.quality)
    as_one = replace(
        b, materials=tuple(_materials(a, b)), edits=tuple(_edits(found)), gprims=tuple(_gprims(a, b)), risks=(),
        collateral=(), findings=(), validator_errors=(),
    )  # fmt: skip
    return found, pictured(as_one, shot.reopened(one), shot.reopened(two), s)


def _materials(a: LookReview, b: LookReview) -> Iterable[ReviewedMaterial]:
    """The Materials of both, before as the first look says and after as the second."""
    one, two = ({m.shown_at: m for m in r.materials} for r in (a, b))
    for path in dict.fromkeys([*one, *two]):
        x, y = one.get(path), two.get(path)
        known = y or x
        assert known is not None
        before = x.after if x else y.before if y else {}
        after = y.after if y else x.before if x else {}
        strokes = tuple(dict.fromkeys([*(x.strokes if x else ()), *(y.strokes if y else ())]))
        gprims = tuple(dict.fromkeys([*(x.gprims if x else ()), *(y.gprims if y else ())]))
        words = f"{x.inferred if x else 'none'} | {y.inferred if y else 'none'}"
        yield ReviewedMaterial(known.prim, path, words, strokes, before, after, gprims=gprims)


def _edits(found: LookDiff) -> Iterable[ReviewedEdit]:
    for r in found.rows:
        a, b = (r.shot if v is None else v for v in (r.a, r.b))
        yield ReviewedEdit(r.prim, r.attribute, r.prim, r.targets, a, b)


def _gprims(a: LookReview, b: LookReview) -> Iterable[ReviewedGprim]:
    known = {g.path: g for r in (a, b) for g in r.gprims}
    return [known[path] for path in sorted(known)]


def _by_place(edits: Iterable[ReviewedEdit]) -> dict[tuple[str, str], ReviewedEdit]:
    return {(e.shown_at, e.attribute): e for e in edits if not e.is_off}


def _is_near(a: Any, b: Any) -> bool:
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return all(_is_near(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, int | float) and isinstance(b, int | float):
        return abs(a - b) <= SAME * max(1.0, abs(a), abs(b))
    return bool(a == b)
