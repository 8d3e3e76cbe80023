"""A device that has memory of its own, as a GPU, computes the same; what is moved there and back is counted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.painted_table import CAMERA, ON_RED, write_table

import usdslf
from usdslf.gpu.device import Device, open_device
from usdslf.gpu.shared import Shared
from usdslf.scene.records import constant
from usdslf.solution import find_solution

SIZE = (60, 45)


def found(stage: Path) -> dict[str, Any]:
    """What a shot that is opened anew shows and answers."""
    shot = usdslf.open(str(stage), elements=150, bounces=2).shot
    brush = shot.scene, shot.tracer, shot.camera(CAMERA)
    stroke = usdslf.paint_stroke(*brush, [[p] for p in ON_RED], 0.03, (0.05, 0.1, 0.5), aspect=4 / 3)
    (answer,) = find_solution(shot, [stroke]).answers
    live = usdslf.live_picture(shot, CAMERA, size=SIZE)
    *_, frame = live.frames(3)
    before = shot.device.moved
    shot.light_field.bounce()
    bounce = shot.device.moved - before
    materials = list(shot.scene.materials)
    materials[0] = replace(materials[0], roughness=constant(0.6))
    edited = live.with_materials(materials, shot.light_field)
    *_, after = edited.frames(2, (5, 5, 50, 40))
    return {
        "links": shot.visibility.hit, "light": shot.light_field.radiance(), "live": frame.picture,
        "error": np.array(frame.error), "edited": after.picture, "answer": np.concatenate([*answer.after.values()]),
        "picture": usdslf.render_shot(shot, CAMERA, size=SIZE, samples=4, aovs=("indirect", "albedo"))["color"],
        "bounce": np.array(bounce),
    }  # fmt: skip


def test_results_are_those_of_a_device_that_shares_the_hosts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit: nothing is read that was not brought over.  A bounce moves what it does where all is one."""
    stage = write_table(tmp_path)
    assert open_device().has_host_memory
    shared = found(stage)
    monkeypatch.setattr(Device, "has_host_memory", False)
    for name, value in found(stage).items():
        np.testing.assert_array_equal(value, shared[name], name)


def test_what_is_copied_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    for is_one, each in ((True, 0), (False, 400)):
        monkeypatch.setattr(Device, "has_host_memory", is_one)
        device = open_device()
        array = Shared(device, (100,), np.float32)
        array.push()
        array.pull()
        assert device.moved == 2 * each
