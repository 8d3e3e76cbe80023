"""A shot in which everything is cut out shows its background."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import OpenImageIO as oiio
import pytest

STAGE = "nothing_visible/s.usda"


@pytest.mark.parametrize("more", [(), ("--aov", "albedo"), ("--model", "phong")])
def test_the_background_is_left(inputs: Path, tmp_path: Path, run: Callable, more: tuple[str, ...]) -> None:
    picture = tmp_path / "p.exr"
    size = ("--size", "32x18", "--elements", "200", "--samples", "4")
    code, _, err = run("render", inputs / STAGE, "-o", picture, *size, *more)
    assert code == 0, err
    pixels = oiio.ImageInput.open(str(picture)).read_image(0, 0, 0, 3, "float")
    assert pixels == pytest.approx(1.0, abs=1e-3)


def test_other_commands_end_in_a_sentence(inputs: Path, tmp_path: Path, run: Callable) -> None:
    assert run("info", inputs / STAGE)[0] == 0
    strokes = tmp_path / "strokes.usda"
    brush = ("--path", "0.47,0.5 0.53,0.5", "--color", "1,0,0")
    code, _, err = run("stroke", inputs / STAGE, strokes, *brush)
    assert code not in (0, 1) and len(err.strip().splitlines()) == 1 and not strokes.exists(), err
    code, _, err = run("stylize", inputs / STAGE, "-o", tmp_path / "look.usda", "--elements", "200")
    assert code != 1 and "Traceback" not in err and "internal" not in err, err
