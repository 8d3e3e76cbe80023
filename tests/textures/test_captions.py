"""Names below pictures."""

from __future__ import annotations

import numpy as np

from usdslf.textures.captions import caption

WHITE, GREY = (1.0, 1.0, 1.0), (0.2, 0.2, 0.2)


def test_letters_stand_on_the_ground_within_the_line() -> None:
    line = caption("shots/010", (120, 20), WHITE, GREY)
    assert line.shape == (20, 120, 3)
    np.testing.assert_allclose(line.max((0, 1)), WHITE, atol=0.02)
    np.testing.assert_allclose(line[:, -20:], 0.2, atol=1e-6)  # nothing more is said
    np.testing.assert_allclose(caption("", (120, 20), WHITE, GREY), 0.2, atol=1e-6)


def test_of_what_is_too_long_the_end_is_shown() -> None:
    one, other = (caption(f"{'a/' * count}shots/010", (120, 20), WHITE, GREY) for count in (100, 200))
    np.testing.assert_array_equal(one, other)
    assert (one != caption("a/" * 100, (120, 20), WHITE, GREY)).any()
    np.testing.assert_allclose(one[:, -1], 0.2, atol=1e-6)
