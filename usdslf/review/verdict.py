"""Verdict: what a person decided about a look, as the review page saves it and `accept --verdict` executes it.

    read_verdict(path, look) -> Verdict        schemas/verdict.schema.json
    Verdict.wish() -> Wish
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from usdslf.contents import file_hash
from usdslf.errors import InputError
from usdslf.replacing import is_file
from usdslf.usd.review.accept import Wish


@dataclass(frozen=True)
class Decided:
    """What was decided about one thing.

    Attributes:
        target: a stroke's name, a material, one of its inputs, or a gprim.
        is_accepted: or rejected.
        note: of the person; "".
    """

    target: str
    is_accepted: bool
    note: str = ""


@dataclass(frozen=True)
class Verdict:
    """What was decided about a look.

    Attributes:
        path: of the file.
        look: name of the look's file.
        look_hash: sha256 of its bytes.
        by: who decided; "".
        decided: each target once.
    """

    path: str
    look: str
    look_hash: str
    by: str
    decided: tuple[Decided, ...]

    def wish(self) -> Wish:
        """Returns what is accepted: what nobody names is."""
        return Wish(said={d.target: d.is_accepted for d in self.decided}, by=self.by, verdict=Path(self.path).name)


def read_verdict(path: str | os.PathLike[str], look: str | os.PathLike[str]) -> Verdict:
    """Reads a verdict file.

    Args:
        look: that it has to be of.

    Raises: InputError where it is no verdict, or one of another look, or of what the look was before.
    """
    name = os.fspath(path)
    if not is_file(name):
        raise InputError(f"there is no verdict {name}; save one from the page of: usdslf review")
    try:
        values = json.loads(Path(name).read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        why = " ".join(str(error).split())
        raise InputError(f"{name} is no verdict, save it again from the review: {why}") from None
    named, digest, by = (_text(values, key, name) for key in ("look", "lookHash", "by"))
    found = Verdict(name, named, digest, by, _decided(values, name))
    if not is_file(look):
        raise InputError(f"there is no look layer {look}; make one with: usdslf solve")
    if found.look_hash != file_hash(look):
        raise InputError(f"{name} is a verdict of another state of {found.look or 'a look'}: review {look} again")
    return found


def _text(values: Any, key: str, name: str) -> str:
    found = values.get(key, "") if isinstance(values, dict) else None
    if not isinstance(found, str):
        raise InputError(f"{name} is no verdict: {key} is no text; save it again from the review")
    return found


def _decided(values: Any, name: str) -> tuple[Decided, ...]:
    rows = values.get("verdicts") if isinstance(values, dict) else None
    if not isinstance(rows, list):
        raise InputError(f"{name} is no verdict: it has no list of verdicts; save it again from the review")
    found = {}
    for row in rows:
        said = row if isinstance(row, dict) else {}
        target, verdict = said.get("target"), said.get("verdict")
        if not isinstance(target, str) or not target or verdict not in ("accept", "reject"):
            raise InputError(f"{name} is no verdict: {json.dumps(row)[:80]} is no target with accept or reject")
        found[target] = Decided(target, verdict == "accept", str(said.get("note", "")))
    return tuple(found.values())
