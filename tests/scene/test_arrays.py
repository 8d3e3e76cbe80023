"""What numpy does too slowly: the same numbers as numpy's, and numpy.ma is not loaded for them."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from usdslf.scene.arrays import cross, distinct


@pytest.mark.parametrize("shape", [(3,), (7, 3), (2, 5, 3), (0, 3)])
def test_cross_products_are_numpys(shape: tuple[int, ...]) -> None:
    a, b = np.random.default_rng(len(shape)).normal(size=(2, *shape))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))


def test_cross_products_of_one_vector_with_many() -> None:
    a, b = np.random.default_rng(5).normal(size=(1, 3)), np.random.default_rng(6).normal(size=(8, 3))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))


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
        code = f"import numpy as np; from usdslf.scene.arrays import distinct; {call}(np.arange(3)); {say}"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == expected
