"""IfChosen: what each candidate of an answer would give, found when somebody asks for it.

An answer is waited for; what its alternatives would be is looked at afterwards, if at all.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from numpy.typing import NDArray

from usdslf.inference.answers import Answer, Painted, means_of
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Evidence
from usdslf.inference.fit import Problem
from usdslf.inference.paint_errors import refit_as_painted
from usdslf.inference.refits import is_painted, refit_answer
from usdslf.inference.solve import refit, refit_problem
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.threads import one_blas_thread

UNLIKELY = 12.0  # cost above the chosen candidate's from which glossiness stays on its coarse level

Means = dict[str, NDArray]


@dataclass(frozen=True, eq=False)
class IfChosen(Mapping[str, Means]):
    """Means as in Answer.after, by the id of a candidate; those of one id are found once.  Safe between threads.

    They are in the light as it is, before a change goes round.  Glossiness is fitted on finer levels where its
    candidate costs little more than the chosen one.
    """

    answer: Answer  # whose pool counts `evidence` and `painted`
    evidence: tuple[Evidence, ...]
    painted: tuple[Painted, ...]
    light: LightField  # as it is, which nobody changes
    options: Options
    _found: dict[str, Means] = field(default_factory=dict, init=False, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False)

    @staticmethod
    def of(
        answer: Answer, evidence: list[Evidence], painted: list[Painted], light: LightField, options: Options
    ) -> IfChosen:
        """Keeps what the strokes of the answer's pool need, out of those of all strokes."""
        rows = answer.pool.strokes
        answer = replace(answer, pool=replace(answer.pool, strokes=tuple(range(len(rows)))))
        return IfChosen(
            answer, tuple(evidence[i] for i in rows), tuple(painted[i] for i in rows), light, options
        )  # fmt: skip

    def __getitem__(self, id_: str) -> Means:
        """Returns means after a candidate.  Raises KeyError where there is none of that id."""
        c = self._candidates[id_]
        with self._lock, one_blas_thread():
            if id_ not in self._found:
                self._found[id_] = self._means(c)
            return self._found[id_]

    def __iter__(self) -> Iterator[str]:
        return iter(self._candidates)

    def __len__(self) -> int:
        return len(self._candidates)

    @cached_property
    def _candidates(self) -> dict[str, Candidate]:
        return {c.id: c for c in self.answer.candidates}

    @cached_property
    def _tables(self) -> Tables:
        return pool_tables(list(self.evidence), self.answer.pool.material, self.light.model)

    @cached_property
    def _problem(self) -> Problem:
        return refit_problem(self._tables, self.options)

    def _means(self, c: Candidate) -> Means:
        answer, tables = self.answer, self._tables
        if "glossiness" in c.freed and c.cost - answer.chosen.cost < UNLIKELY:
            as_chosen = replace(answer, chosen=c, varying=None)
            return refit_answer(as_chosen, list(self.evidence), list(self.painted), self.light, self.options).after
        if c.freed:
            level = c.level if "glossiness" in c.freed else tables.own
            c = refit(self._problem, replace(c, level=level))
        if "glossiness" not in c.freed and is_painted(list(self.evidence)):
            c = refit_as_painted(tables, self.options, c)
        return means_of(tables, c)[1]
