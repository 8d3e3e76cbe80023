"""Programs built ahead are those that answers run, each built once; light is lent in what is idle or made ahead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.lit_plane import write_plane
from kit.painted_table import CAMERA, ON_RED, OPTIONS, write_table

import usdslf
from usdslf.gpu.ahead import built_ahead
from usdslf.gpu.device import Device, Programs, open_device
from usdslf.inference.ahead import programs_of_answers
from usdslf.scene.difference import look_alike
from usdslf.solution import find_solution
from usdslf.strokes.paint import paint_stroke


def key(stem: str, constants: dict[str, Any]) -> tuple[Any, ...]:
    return (stem, *sorted(constants.items()))


def test_answers_run_what_is_built_ahead_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device, built, asked = Device(open_device().context, Programs()), [], set()
    build, kernel = Device._build, Device.kernel

    def noted(self: Device, stem: str, constants: dict[str, Any]) -> Any:
        built.append(key(stem, constants))
        return build(self, stem, constants)

    def noted_too(self: Device, stem: str, function: str, **constants: Any) -> Any:
        asked.add(key(stem, constants))
        return kernel(self, stem, function, **constants)

    monkeypatch.setattr(Device, "_build", noted)
    monkeypatch.setattr(Device, "kernel", noted_too)
    shot = usdslf.open(str(write_table(tmp_path)), **OPTIONS, device=device).shot
    path, blue = [np.array(ON_RED)], (0.05, 0.08, 0.4)
    stroke = paint_stroke(shot.scene, shot.tracer, shot.camera(CAMERA), path, 0.02, blue, aspect=4 / 3, name="a")
    find_solution(shot, [stroke])
    ahead = {key(stem, dict(constants)) for stem, constants in programs_of_answers(shot.model)}
    assert ahead <= asked, ahead - asked
    assert ahead <= set(built) and len(built) == len(set(built))
    before = len(built)
    with built_ahead(device, programs_of_answers(shot.model)):
        pass
    assert len(built) == before


def test_light_that_is_lent_in_what_bounces_left_is_as_any_other(tmp_path: Path) -> None:
    field = usdslf.open(str(write_plane(tmp_path)), elements=100).shot.light_field
    left = field._idle[0]
    with field.lent() as first, field.lent() as second:
        assert first.next_d is left.next_d and second.next_d is not left.next_d and not field._idle
        surface = field.surface.with_rows(np.arange(50), diffuse=np.float32([0.1, 0.2, 0.3]))
        for other in (first, second):
            other.set_surface(surface)
            other.bounce()
        np.testing.assert_array_equal(first.radiance(), second.radiance())
        assert not look_alike(first.radiance(), field.radiance())


def test_light_is_lent_in_room_that_was_made_meanwhile(tmp_path: Path) -> None:
    field = usdslf.open(str(write_plane(tmp_path)), elements=100).shot.light_field
    field.lend_soon()
    field.lend_soon()
    room_d = field._rooms[0]()
    with field.lent() as first, field.lent() as second:
        assert first.outgoing_d is room_d and second.outgoing_d is not room_d and not field._rooms
        for other in (first, second):
            np.testing.assert_array_equal(other.radiance(), field.radiance())
    field.lend_soon()
    assert not field._rooms  # one that was lent is there
