"""What numpy does too slowly: the same numbers as numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from usdslf.scene.arrays import cross


@pytest.mark.parametrize("shape", [(3,), (7, 3), (2, 5, 3), (0, 3)])
def test_cross_products_are_numpys(shape: tuple[int, ...]) -> None:
    a, b = np.random.default_rng(len(shape)).normal(size=(2, *shape))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))


def test_cross_products_of_one_vector_with_many() -> None:
    a, b = np.random.default_rng(5).normal(size=(1, 3)), np.random.default_rng(6).normal(size=(8, 3))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
