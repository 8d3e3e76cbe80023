"""Alternatives: the explanations of what was painted that were weighed, with what choosing each would write."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from usdslf.edits.explanation import Explanation
from usdslf.inference.answers import Answer, means_of
from usdslf.inference.uncertainty import probabilities

MOST = 16  # of an indirect answer, which has some for each material in sight


def alternatives_of(answer: Answer) -> list[Explanation]:
    """Returns all explanations of an answer, the cheapest first, each in the light as it is.

    Of an indirect answer, the chosen one first, they are the MOST cheapest changes of all materials in sight: `after`
    is that of the first material that changes, and what is there where none does.
    """
    if answer.others:
        return _of_indirect(answer)
    t, chosen = answer.tables, answer.chosen.id
    constant = [(c.id, c, answer.if_chosen.get(c.id) or means_of(t, c)[1]) for c in answer.candidates]
    if not answer.varying:
        constant = [(name, c, answer.after if name == chosen else after) for name, c, after in constant]
    explained = [*constant, *((a.id, a.mean, means_of(t, a.mean)[1]) for a in answer.varied)]
    chances = probabilities([c.cost if c.is_admitted else None for _, c, _ in explained]).tolist()
    return [
        Explanation(name, c.cost if c.is_admitted else None, chance, as_plain(after))
        for (name, c, after), chance in zip(explained, chances, strict=True)
    ]


def _of_indirect(answer: Answer) -> list[Explanation]:
    others = sorted(answer.others, key=lambda o: (not o.is_chosen, o.cost is None, o.cost or 0.0))[:MOST]
    chances = probabilities([o.cost for o in others]).tolist()
    return [
        Explanation(o.id, o.cost, chance, as_plain(o.after or answer.before))
        for o, chance in zip(others, chances, strict=True)
    ]


def as_plain(values: Mapping[str, NDArray]) -> dict[str, Any]:
    """Returns means as JSON holds them: three numbers of a colour, one of a roughness."""
    return {k: v.tolist() if len(v) > 1 else float(v[0]) for k, v in values.items()}
