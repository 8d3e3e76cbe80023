"""A picture of the unchanged shot that is painted back over itself asks for nothing, on real assets."""

from __future__ import annotations

import pytest
from kit.asset_shots import SHOTS
from truth.identity import Setting, measure

SMALL = Setting(samples=16, elements=1500, dabs=12, size=(120, 90), radius=0.025)
# of pictures of few samples, and few elements; without mixtures and followed rays .16 and .22 are left
MOST = {"fancy_teapot": 0.04, "cornell_box": 0.055}


@pytest.mark.parametrize("name", MOST)
def test_a_picture_painted_back_leaves_little(name: str) -> None:
    found = list(measure(SHOTS[name], SMALL))
    assert found
    for identity in found:
        assert identity.inferred == "none", str(identity)
        assert identity.residual < max(MOST[name], 2 * identity.noise), str(identity)
