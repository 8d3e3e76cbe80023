"""Rows of the bench about painting: what is waited for between a stroke and its answer, light field in hand."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from usdslf.cli.bench_timing import Timed
from usdslf.session import Session
from usdslf.shot import Shot
from usdslf.solution import Settings, find_solution
from usdslf.strokes.stroke import Stroke

REPEATS = 2
MANY_DABS = 480  # on one material
OF_STROKE = 120  # dabs
APART = 0.4  # brushes that repeated dabs lie apart
UNEVEN = 0.1  # relative, of their colours


def stroke_steps(session: Session, strokes: Sequence[Stroke]) -> Iterator[Timed]:
    """Times what comes after a stroke; the session has solved `strokes`."""
    shot, known = session.shot, list(strokes)
    last = known[-1]
    find_solution(shot, known[:-1])
    fresh = (replace(last, colors=last.colors * np.float32(1 + 0.01 * k)) for k in range(1, 3 * REPEATS + 1))
    yield _timed("new stroke to answer, first one", shot, ([next(fresh)] for _ in range(REPEATS)))
    yield _timed("new stroke to answer, third one", shot, ([*known[:-1], next(fresh)] for _ in range(REPEATS)))
    anew = Settings(bounces=shot.bounces + 1)  # which only rounds depend on
    yield _timed("three known strokes, all rounds", shot, [known], anew)
    yield _timed("undo of the third", shot, (known[:-1] for _ in range(REPEATS)))
    (answer,) = (a for a in find_solution(shot, known).answers if len(known) - 1 in a.pool.strokes)
    ways = [c.id for c in answer.candidates if c.is_admitted and c.id != answer.chosen.id]
    other = Settings(choose={last.name: "specular" if "specular" in ways else ways[0]})
    yield _timed("another choice", shot, [known], other)
    yield _timed(f"{MANY_DABS} dabs on one material", shot, [many_dabs(known[0], MANY_DABS)])


def many_dabs(stroke: Stroke, count: int) -> list[Stroke]:
    """Returns strokes of `count` dabs in all: those of one stroke again and again, near by and of uneven colours."""
    rng = np.random.default_rng(0)
    own = len(stroke.counts)
    found = []
    for first in range(0, count, OF_STROKE):
        again = -(-min(OF_STROKE, count - first) // own)
        points = np.cumsum([0, *stroke.counts])
        rows = np.concatenate([np.arange(a, b) for a, b in pairwise(points)] * again)
        dab = np.repeat(np.arange(own * again), list(stroke.counts) * again)
        off = rng.normal(0, APART, (own * again, 3))[dab] * stroke.widths[rows, None]
        color = stroke.colors[rows] * rng.uniform(1 - UNEVEN, 1 + UNEVEN, (own * again, 3))[dab]
        found.append(
            replace(
                stroke, name=f"{stroke.name}_{first}", points=(stroke.points[rows] + off).astype(np.float32),
                colors=color.astype(np.float32), widths=stroke.widths[rows], eye=stroke.eye[rows],
                curve_counts=tuple(stroke.counts) * again, normals=np.zeros((0, 3), np.float32),
                surface_index=np.zeros(0, np.int32),
            )
        )  # fmt: skip
    return found


def _timed(step: str, shot: Shot, asked: Iterable[list[Stroke]], how: Settings | None = None) -> Timed:
    """The least time of some solves, and what the last one moved."""
    least, moved = np.inf, 0
    for strokes in asked:
        before, began = shot.device.moved, time.perf_counter()
        find_solution(shot, strokes, how)
        least, moved = min(least, time.perf_counter() - began), shot.device.moved - before
    return Timed(step, least, moved=moved)
