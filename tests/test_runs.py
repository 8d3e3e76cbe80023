"""Runs and equal numbers are what numpy's own functions say."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from usdslf import runs
from usdslf.runs import distinct, first_places, numbered, owners

COUNTS = st.lists(st.integers(0, 9) | st.integers(0, 400), max_size=60)
KINDS = st.sampled_from([np.int8, np.int32, np.int64, np.uint32, np.uint64])


@given(COUNTS, st.integers(1, 100))
@settings(deadline=None)
def test_owners_are_what_repeating_gives(counts: list[int], block: int) -> None:
    given_counts = np.array(counts, np.int32)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "BLOCK", block)
        found = owners(given_counts)
    np.testing.assert_array_equal(found, np.repeat(np.arange(len(counts)), given_counts))
    assert found.dtype == np.int64


@given(st.data(), KINDS, st.booleans())
@settings(deadline=None)
def test_equal_keys_are_numbered_as_numpy_does(data: st.DataObject, kind: type, is_near: bool) -> None:
    limits = np.iinfo(kind)
    low = data.draw(st.integers(limits.min, limits.max - 20)) if is_near else limits.min
    each = st.integers(int(low), int(low) + 20 if is_near else limits.max)
    keys = np.array(data.draw(st.lists(each, max_size=80)), kind)
    names, first, number = np.unique(keys, return_index=True, return_inverse=True)
    found_names, found_number = numbered(keys)
    np.testing.assert_array_equal(found_names, names)
    np.testing.assert_array_equal(found_number, number)
    assert found_names.dtype == kind
    np.testing.assert_array_equal(first_places(found_number, len(names)), first)


@pytest.mark.parametrize(
    "values", [np.array([3, 1, 3, 2, 1]), np.zeros(0, np.int32), np.array([[2, 2], [1, 2]], np.uint8), np.array([5])]
)
def test_distinct_numbers_are_numpys(values: np.ndarray) -> None:
    found = distinct(values)
    np.testing.assert_array_equal(found, np.unique(values))
    assert found.dtype == values.dtype


def test_numpys_masked_arrays_are_not_loaded() -> None:
    """Else there would be no reason for `distinct`."""
    say = "import sys; print('numpy.ma' in sys.modules)"
    for call, expected in (("distinct", "False"), ("np.unique", "True")):
        code = f"import numpy as np; from usdslf.runs import distinct; {call}(np.arange(3)); {say}"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == expected
