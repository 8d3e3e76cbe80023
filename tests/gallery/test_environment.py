"""--hdri: whether it can be read is asked before any scene is made, and where it lights none that is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from usdslf.errors import InputError
from usdslf.gallery.demo import run_demos
from usdslf.textures.images import write_image


def first_line(folder: Path, hdri: Path, name: str) -> str:
    lines = run_demos([name], False, folder, str(hdri), None, None, lambda p: None)
    found = next(lines)
    lines.close()
    return found


@pytest.mark.parametrize("name", ["still_life", "window_light"])
def test_a_missing_environment_is_said_at_once(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="is not there"):
        first_line(tmp_path, tmp_path / "none.exr", name)


def test_an_environment_that_lights_nothing_is_said(tmp_path: Path) -> None:
    hdri = write_image(tmp_path / "sky.exr", np.ones((4, 8, 3)))
    assert "is not used: of all scenes it lights window_light" in first_line(tmp_path, hdri, "still_life")
    assert first_line(tmp_path, hdri, "window_light").startswith("window_light: ")
