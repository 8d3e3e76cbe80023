"""Rebase: what became of a look when it was solved anew over a shot that changed.

    earlier_look(path) -> Sdf.Layer | None                          as it is on disk
    silence_again(path, earlier) -> sentences                       what was switched off stays off
    rebased(earlier, stage, edits, painted) -> Rebase               edit by edit, and which strokes are stale

Each opinion of a look keeps what the shot said when it was solved (opinions.py).  So it can be told whether the shot
drifted under it, whether what the strokes ask for now is another value, or needs no opinion any more.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from pxr import Sdf, Tf, Usd

from usdslf.replacing import is_file
from usdslf.usd.border import in_words, plain, quiet_usd
from usdslf.usd.files import write_layer
from usdslf.usd.layer.hand_edits import specs_of
from usdslf.usd.layer.opinions import base_of, targets_of
from usdslf.usd.layer.shown_paths import ShownPaths, is_chosen, shot_attribute
from usdslf.usd.layer.silent import restore_all, silence
from usdslf.usd.layer.wins import AuthoredEdit
from usdslf.usd.look_data import is_look, our_data, texts

SAME = 1e-3  # of a value, that solving anew may differ by


class Became(Enum):
    """What became of an edit of a look."""

    DRIFTED = "the shot drifted under it"
    CHANGED = "the strokes ask for another value"
    UNNECESSARY = "the strokes need it no more"
    NEW = "the strokes need it now"


@dataclass(frozen=True)
class RebasedEdit:
    """An edit that is not as it was.

    Attributes:
        prim, attribute: where it is composed.
        became: why.
        base: what the shot said when it was solved before; None: not known.
        now: what the shot says.
        was: what the look said before; None: nothing.
        asks: what it says now; None: nothing.
    """

    prim: str
    attribute: str
    became: Became
    base: Any
    now: Any
    was: Any
    asks: Any

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {k: v.name.lower() if isinstance(v, Became) else v for k, v in vars(self).items()}


@dataclass(frozen=True)
class Rebase:
    """What became of an earlier look.

    Attributes:
        edits: those that are not as they were.
        stale_strokes: by path why a stroke is not what it was: gone, or painted on what moved.
    """

    edits: tuple[RebasedEdit, ...] = ()
    stale_strokes: Mapping[str, str] = field(default_factory=dict)

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"edits": [e.as_values() for e in self.edits], "stale_strokes": dict(self.stale_strokes)}


def words_of_edit(values: Mapping[str, Any]) -> str:
    """Returns what `RebasedEdit.as_values` says of an edit, as a line."""
    became = Became[values["became"].upper()]
    drift = f" over {in_words(values['base'])}, now {in_words(values['now'])}" if became is Became.DRIFTED else ""
    change = f"{in_words(values['was'])} -> {in_words(values['asks'])}"
    return f"{values['prim']}.{values['attribute']}: {became.value}{drift}: {change}"


def earlier_look(path: str | os.PathLike[str]) -> Sdf.Layer | None:
    """Returns the look that stands at a path, in memory alone; None where there is none."""
    name = os.fspath(path)
    if not is_file(name) or not os.path.getsize(name):
        return None
    try:
        with quiet_usd():
            layer = Sdf.Layer.OpenAsAnonymous(name)
            return layer if layer and is_look(layer) else None
    except (Tf.ErrorException, UnicodeDecodeError):  # which writing the new one says
        return None


def silence_again(path: str | os.PathLike[str], earlier: Sdf.Layer) -> tuple[str, ...]:
    """Silences in a look what was silent in the one that stood there before; returns what that is, in words.

    Args:
        path: of the look, which was written anew.
        earlier: the one before; nothing of it is silent afterwards, so that both can be compared.

    Raises: AuthorError where the file cannot be written.
    """
    with quiet_usd():
        silent = restore_all(earlier)
        layer = Sdf.Layer.OpenAsAnonymous(os.fspath(path)) if silent else None
        there = [p for p in silent if layer.GetPropertyAtPath(p)] if layer else []
        if there:
            silence(layer, there)
            write_layer(layer, path)
    return tuple(f"{p} stays switched off; bring it back with: usdslf toggle --on" for p in there)


def rebased(
    earlier: Sdf.Layer, stage: Usd.Stage, edits: Sequence[AuthoredEdit], moved: Iterable[str], there: Iterable[str]
) -> Rebase:
    """Compares an earlier look with what was solved now.

    Args:
        stage: the shot as it is now, without a look.
        edits: of the new look.
        moved: paths of strokes whose surface is not where it was.
        there: paths of the strokes that were solved now.
    """
    with quiet_usd():
        shown, found = ShownPaths(stage, earlier), list[RebasedEdit]()
        new = {str(Sdf.Path(e.shown_at or f"{e.prim}.{e.attribute}")): e for e in edits}
        before: dict[str, Sdf.AttributeSpec] = {}
        for spec in specs_of(earlier):
            is_ours = isinstance(spec, Sdf.AttributeSpec) and targets_of(spec) and base_of(spec) is not None
            if is_ours and is_chosen(earlier, spec.path):
                before[str(shown(spec.path))] = spec
        for at, spec in before.items():
            says = shot_attribute(stage, earlier, shown, spec.path)
            if each := _compared(plain(says.Get()) if says else None, at, spec, new.get(at)):
                found.append(each)
        for at, edit in new.items():
            if at not in before and edit.representation in ("constant", "scale") and before:
                path = Sdf.Path(at)
                now = _value(stage, at)
                found.append(
                    RebasedEdit(str(path.GetPrimPath()), path.name, Became.NEW, None, now, None, edit.after)
                )
    stale = {path: "its surface is not where it was painted" for path in moved}
    named = [s for spec in specs_of(earlier) if isinstance(spec, Sdf.PrimSpec) for s in _strokes(spec)]
    gone = [s for s in dict.fromkeys(named) if s not in set(there)]
    return Rebase(tuple(found), stale | dict.fromkeys(gone, "it is gone, or switched off"))


def _compared(now: Any, at: str, spec: Sdf.AttributeSpec, new: AuthoredEdit | None) -> RebasedEdit | None:
    """What became of an opinion, where the shot says `now`; None where it is as it was."""
    base, was = base_of(spec), plain(spec.default)
    asks = new.after if new else None
    became = None
    if now is not None and not _is_near(base, now):
        became = Became.DRIFTED
    elif new is None:
        became = Became.UNNECESSARY
    elif not _is_near(was, asks):
        became = Became.CHANGED
    path = Sdf.Path(at)
    return RebasedEdit(str(path.GetPrimPath()), path.name, became, base, now, was, asks) if became else None


def _value(stage: Usd.Stage, at: str) -> Any:
    attribute = stage.GetAttributeAtPath(at)
    return plain(attribute.Get()) if attribute else None


def _strokes(spec: Sdf.PrimSpec) -> list[str]:
    return texts(our_data(spec.customData).get("strokes"))


def _is_near(a: Any, b: Any) -> bool:
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(_is_near(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, int | float) and isinstance(b, int | float):
        return abs(a - b) <= SAME * max(1.0, abs(a), abs(b))
    return bool(a == b)
