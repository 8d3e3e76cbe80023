"""What an answer says of the explanations that were not taken."""

from typing import cast

import pytest

from usdslf.inference.answers import Answer, Pool
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate

_COSTS = {"diffuse": 9.5, "glossiness": 12.0, "specular": 36.3}  # 4 is a near tie


def _answer(chosen: str) -> Answer:
    candidates = {name: Candidate((name,), cost=cost) for name, cost in _COSTS.items()}
    refused = Candidate(("none",), cost=_COSTS[chosen], is_admitted=False)
    tables = cast("Tables", None)  # not looked at
    pool = Pool(0, "material", (), (0,))
    return Answer(pool, candidates[chosen], (*candidates.values(), refused), tables, {}, {}, 1.0, 0.0, ())


@pytest.mark.parametrize(
    ("chosen", "ties"), [("diffuse", ("glossiness",)), ("glossiness", ("diffuse",)), ("specular", ())]
)
def test_a_tie_costs_about_the_same_also_where_a_person_chose(chosen: str, ties: tuple[str, ...]) -> None:
    """A dear explanation that was chosen by hand is no near tie with those that are much cheaper."""
    answer = _answer(chosen)
    assert answer.ties == ties
    assert answer.is_ambiguous == bool(ties)
