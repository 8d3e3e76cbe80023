"""Pictures agree with a path tracer's, of which pictures/make_pictures.py made the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kit.lit_stages import CAMERA, SCENES, SIZE
from kit.picture_errors import relative_error

import usdslf

PICTURES = Path(__file__).parents[1] / "truth/pictures"
ELEMENTS, SAMPLES = 4000, 16
FRAMES = 64  # of the live picture that is near the path tracer's
CONVERGED = 256  # frames, and samples of the final picture, that are alike within LIKE
LIKE = 0.01
LIVE = {"room_glossy_area": 0.016, "metals_textured_dome": 0.012, "textured_sky_z_up": 0.018, "emissive_panel": 0.024}
"""Glossy, metal, textured and emissive stages, whose live pictures are looked at too."""


@pytest.mark.divided
@pytest.mark.parametrize("name", SCENES)
def test_picture_agrees_with_the_path_tracer(name: str, tmp_path: Path) -> None:
    """Mean relative error after 5 x 5 averaging, light units and orientation included."""
    scene = SCENES[name]
    session = usdslf.open(str(scene.write(tmp_path)), elements=ELEMENTS)
    picture = session.render(CAMERA, SIZE, samples=SAMPLES)["color"]
    truth = np.load(PICTURES / f"{name}.npz")["picture"].astype(np.float64)
    assert relative_error(picture, truth) < scene.tolerance, name
    if name in LIVE:
        live = usdslf.live_picture(session.shot, CAMERA, size=SIZE)
        *_, frame = live.frames(FRAMES)
        shown = frame.picture
        assert relative_error(shown, truth) < LIVE[name]
        assert np.abs(shown.mean((0, 1)) / truth.mean((0, 1)) - 1).max() < 0.01
        assert relative_error(shown, picture) < 0.025
        final = session.render(CAMERA, SIZE, samples=CONVERGED)["color"]
        off = relative_error(shown, final)
        *_, frame = live.frames(CONVERGED)
        assert relative_error(frame.picture, final) < min(LIKE, off)
        assert 0.25 * frame.error < relative_error(frame.picture, final, 1) < frame.error  # which knows no filter
    assert not session.warnings
