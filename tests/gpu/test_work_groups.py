"""Answers and styles do not depend on the size of work-groups; pictures and bounces are asked where they are tested."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.painted_table import CAMERA, ON_RED, write_table

import usdslf
from usdslf.gpu.device import Kernel
from usdslf.gpu.launch import GROUP
from usdslf.solution import find_solution, find_style

OTHER = 16


def found(stage: Path) -> dict[str, np.ndarray]:
    """What strokes and a style ask for on a shot that is opened anew."""
    shot = usdslf.open(str(stage), elements=150, bounces=3).shot
    brush = shot.scene, shot.tracer, shot.camera(CAMERA)
    direct = usdslf.paint_stroke(*brush, [[p] for p in ON_RED], 0.03, (0.05, 0.1, 0.5), aspect=4 / 3)
    indirect = usdslf.paint_stroke(*brush, [[(0.5, 0.85)]], 0.03, (0.3, 0.2, 0.2), aspect=4 / 3, name="below")
    solution = find_solution(shot, [direct, replace(indirect, mode="indirect")])
    values = [np.ravel(x) for a in solution.answers for x in (*a.after.values(), a.residual_before, a.residual_after)]
    style = find_style(shot, radius=0.1).stylized
    assert style is not None
    return {
        "answers": np.concatenate(values), "left out": np.array(solution.left_out), "rounds": np.array(style.rounds),
        "style": np.concatenate([np.ravel(x) for x in style.change_at(np.arange(len(shot.elements)))]),
    }  # fmt: skip


def test_answers_and_styles_do_not_depend_on_the_size_of_work_groups(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, call, resized = write_table(tmp_path), Kernel.__call__, list[int]()
    usual = found(stage)

    def in_small_groups(kernel: Kernel, size: tuple, local: tuple | None, *args: Any) -> None:
        resized.append(local == (GROUP,))
        call(kernel, size, (OTHER,) if local == (GROUP,) else local, *args)

    monkeypatch.setattr(Kernel, "__call__", in_small_groups)
    for name, value in found(stage).items():
        np.testing.assert_array_equal(value, usual[name], name)
    assert sum(resized) > 100
