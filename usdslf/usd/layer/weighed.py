"""The explanations that were weighed for a Material's change, as its customData.usdslf.alternatives holds them.

weighed_data(explanations) -> dict      ids, costs (inf: not admitted), probabilities, seven numbers of each after
weighed_in(data) -> tuple               of such a dictionary, whoever wrote it
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pxr import Vt

from usdslf.edits.explanation import Explanation
from usdslf.usd.look_data import texts

WEIGHED = "alternatives"
_SIZE = 7  # diffuse, specular, roughness


def weighed_data(explanations: Sequence[Explanation]) -> dict[str, Any]:
    """Returns explanations as USD holds them in a dictionary."""
    after = [[*e.after["diffuse"], *e.after["specular"], e.after["roughness"]] for e in explanations]
    return {
        "ids": Vt.StringArray([e.id for e in explanations]),
        "costs": Vt.FloatArray([float("inf") if e.cost is None else e.cost for e in explanations]),
        "probabilities": Vt.FloatArray([e.probability for e in explanations]),
        "after": Vt.FloatArray(np.ravel(after).tolist()),
    }


def weighed_in(data: Any) -> tuple[Explanation, ...]:
    """Returns the explanations that a dictionary holds, the cheapest first; nothing of one that is none."""
    if not isinstance(data, Mapping):
        return ()
    ids = texts(data.get("ids"))
    try:
        costs, chances, after = (
            np.asarray(data.get(name, ()), np.float64).ravel() for name in ("costs", "probabilities", "after")
        )
    except (TypeError, ValueError):
        return ()
    if not (len(ids) == len(costs) == len(chances) and len(after) == _SIZE * len(ids)):
        return ()
    rows = zip(ids, costs.tolist(), chances.tolist(), after.reshape(-1, _SIZE).tolist(), strict=True)
    return tuple(
        Explanation(
            name, cost if np.isfinite(cost) else None, chance,
            {"diffuse": row[:3], "specular": row[3:6], "roughness": row[6]},
        )
        for name, cost, chance, row in rows
    )  # fmt: skip
