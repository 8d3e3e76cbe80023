"""How large a painter's errors are: chances of sizes, against the restricted likelihood by its definition."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space

from usdslf.inference import error_sizes
from usdslf.inference.error_sizes import SIZES_ALIKE, Left, mostly_grey
from usdslf.scene.records import F64

OWN = np.array([0.02, 0.5, 3.0])


def by_definition(left: Left, grey: float) -> F64:
    """Logarithms (g, h) of the density of all that no column explains, and of the measure of those (Harville 1974)."""
    m, k = left.residual.shape
    columns, residual = left.explained.reshape(m * k, -1), left.residual.reshape(-1)
    alike = np.kron(left.drift, np.ones((k, k))) + np.kron(left.tint, np.eye(k))
    alike *= np.outer(left.share, left.share)
    rest = null_space(columns.T)
    found = []
    for a in SIZES_ALIKE:
        for b in OWN:
            whole = a * alike + b * np.kron(np.eye(m), mostly_grey(k, grey))
            seen = rest.T @ whole @ rest
            size = np.linalg.slogdet(seen)[1] + (rest.T @ residual) @ np.linalg.solve(seen, rest.T @ residual)
            found.append(-0.5 * (size + np.linalg.slogdet(columns.T @ columns)[1]))
    return np.reshape(found, (len(SIZES_ALIKE), len(OWN)))


@pytest.mark.parametrize("is_even", [True, False])
@pytest.mark.parametrize("channels", [1, 2, 3])
@pytest.mark.parametrize("grey", [0.0, 0.5])
def test_chances_are_the_restricted_likelihood(channels: int, is_even: bool, grey: float) -> None:
    rng, m = np.random.default_rng(channels), 9
    place = rng.uniform(0, 1, (m, 3))
    same = np.kron(np.eye(3), np.ones((3, 3)))
    drift = same * np.exp(-np.linalg.norm(place[:, None] - place, axis=2))
    share = rng.uniform(0.3, 1, (m, 1 if is_even else channels)) * np.ones((1, channels))
    left = Left(rng.normal(0, 1, (m, channels)), rng.normal(0, 1, (m, channels, 4)), share, drift, 0.3 * same)
    found = error_sizes._chances(left, OWN, grey if channels > 1 else 0.0)
    np.testing.assert_allclose(found, by_definition(left, grey if channels > 1 else 0.0), rtol=1e-9)
