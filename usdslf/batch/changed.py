"""Changed: what is another one between two results of a job, and why.

    what_changed(before, after) -> Changed

What an answer stands on is known by its parts, as `identity.py` names them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from usdslf.batch.job import Result

CAUSES = ("light", "surface", "asset", "strokes")
SAME = 2e-3  # difference of a value that is none
MOST = 3  # paths that a sentence names


@dataclass(frozen=True)
class Changed:
    """What became another one between two results of a job.

    Attributes:
        why: sentences: which lights, surfaces, shapes, strokes or options changed.
        answers: sentences: which answers are others, and how.
    """

    why: tuple[str, ...]
    answers: tuple[str, ...]

    def as_values(self) -> dict[str, list[str]]:
        """Returns it as JSON-ready values."""
        return {"why": list(self.why), "answers": list(self.answers)}


def what_changed(before: Result, after: Result) -> Changed:
    """Returns what changed in the answers of a job, and why.

    Args:
        before, after: results of the job, an earlier and a later one.
    """
    was, now = before.values.get("identity", {}), after.values.get("identity", {})
    why = []
    for cause in CAUSES:
        a, b = was.get(cause, {}), now.get(cause, {})
        for words, paths in (
            ("changed", [p for p in b if p in a and a[p] != b[p]]),
            ("is new", [p for p in b if p not in a]),
            ("is gone", [p for p in a if p not in b]),
        ):
            if paths:
                more = f" and {len(paths) - MOST} more" if len(paths) > MOST else ""
                why.append(f"{cause}: {', '.join(paths[:MOST])}{more} {words}")
    why += [f"{k} changed" for k in ("options", "version") if was.get(k) != now.get(k)]
    earlier = {s["path"]: s for s in before.values.get("strokes", ())}
    answers = []
    for stroke in after.values.get("strokes", ()):
        answers += _of_stroke(earlier.get(stroke["path"]), stroke)
    return Changed(tuple(why), tuple(answers))


def _of_stroke(before: Mapping[str, Any] | None, after: Mapping[str, Any]) -> list[str]:
    """What changed in the answer of a stroke, in sentences."""
    path = after["path"]
    if before is None:
        return [f"{path}: {after['inferred']}, was not asked before"]
    found = []
    if before["inferred"] != after["inferred"] or before["material"] != after["material"]:
        of = f" of {after['material']}" if before["material"] != after["material"] else ""
        found.append(f"{path}: {before['inferred']} became {after['inferred']}{of}")
    for key in after["after"]:
        a, b = (_numbers(s["after"].get(key)) for s in (before, after))
        if len(a) != len(b) or any(abs(x - y) > SAME for x, y in zip(a, b, strict=True)):
            found.append(f"{path}: {key} {_in_words(before['after'].get(key))} became {_in_words(after['after'][key])}")
    was, now = float(before["residual_after"]), float(after["residual_after"])
    if abs(was - now) > max(0.02, 0.25 * was):
        found.append(f"{path}: residual {was:.3f} became {now:.3f}")
    return found


def _numbers(value: Any) -> list[float]:
    """A value of a report as numbers: one, a colour, or none."""
    return [float(x) for x in value] if isinstance(value, list | tuple) else [] if value is None else [float(value)]


def _in_words(value: Any) -> str:
    """A value of a report as people read it."""
    numbers = ", ".join(f"{x:.3g}" for x in _numbers(value))
    return f"({numbers})" if isinstance(value, list | tuple) else numbers or "-"
