"""Differences: pairs of numbers."""

from __future__ import annotations

import numpy as np
import pytest

from usdslf.scene.difference import pairs_in


@pytest.mark.parametrize("most", [5, 3000])  # looked up in a table, and sorted
def test_pairs_are_each_found_once_in_their_order(most: int) -> None:
    rng = np.random.default_rng(0)
    some, others = rng.integers(0, most, 300).astype(np.int32), rng.integers(0, 70_000, 300).astype(np.int32)
    others[some < 3] = 7
    assert [tuple(p) for p in pairs_in(some, others)] == sorted(set(zip(some.tolist(), others.tolist())))
    assert pairs_in(some[:0], others[:0]).shape == (0, 2)
