"""Nothing is lost: autosave, recovery, questions, read-only places, shots that change on the disk, errors in a bar."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from kit.moving_stages import roll
from kit.windows import drag, opened, press, sentences, solved, wait_for
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox, QPushButton

from hydra_viewer.model.autosave import autosave_path
from hydra_viewer.model.document import Files
from hydra_viewer.ui import words
from hydra_viewer.ui.window import Window
from usdslf import read_strokes

ON_TABLE = [(0.45, 0.9), (0.5, 0.9), (0.55, 0.9)]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return roll(tmp_path_factory.mktemp("shot"))


def answer(window: Window, text: str) -> None:
    """Presses a button of the bar."""
    shown = lambda: [b for b in window.bar.findChildren(QPushButton) if b.text() == text and b.isVisible()]  # noqa: E731
    wait_for(lambda: bool(shown()))  # Qt shows what is added to a bar that is there a moment later
    button = shown()[-1]
    button.click()


KILLED = """
import os, signal, sys
from kit.windows import ALT, drag, opened, press
from pathlib import Path
with opened(Path(sys.argv[1]), sys.argv[2]) as window:
    drag(window.painting.canvas, [(.45, .9), (.5, .9), (.55, .9)])
    window.filing.autosave.flush()
    press(window.painting.canvas, [(.6, .9), (.65, .9)])
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_strokes_come_back_after_a_kill_in_mid_stroke(stage: Path) -> None:
    layer = stage.with_name("killed.usda")
    tests = Path(__file__).resolve().parents[2]
    path = os.pathsep.join([str(tests.parent), str(tests)])
    run = subprocess.run(
        [sys.executable, "-c", KILLED, str(stage), str(layer)], env=os.environ | {"PYTHONPATH": path}, timeout=200
    )
    assert run.returncode == -signal.SIGKILL and not layer.exists()
    with opened(stage, layer) as window:
        assert "1 stroke was painted" in window.bar.text and not window.document.strokes
        answer(window, words.RECOVER)
        assert len(window.document.strokes) == 1 and window.bar.text == ""
        solved(window)
        window.filing.save()
        wait_for(lambda: window.worker.is_idle and window.document.is_saved)
    assert len(read_strokes(layer)) == 1
    with opened(stage, layer) as window:
        assert window.bar.text == ""  # nothing to recover any more


def test_what_is_not_saved_is_asked_about(stage: Path) -> None:
    with opened(stage, stage.with_name("asked.usda")) as window:
        drag(window.painting.canvas, ON_TABLE)
        window.filing.autosave.flush()
        kept = autosave_path(window.document.files)
        assert kept.is_file()
        asked: list[str] = []

        def press_button(kind: QMessageBox.StandardButton) -> None:
            box = QApplication.activeModalWidget()
            assert isinstance(box, QMessageBox)
            asked.append(box.text())
            box.button(kind).click()

        QTimer.singleShot(50, lambda: press_button(QMessageBox.StandardButton.Cancel))
        assert not window.close() and kept.is_file()
        QTimer.singleShot(50, lambda: press_button(QMessageBox.StandardButton.Discard))
        assert window.close() and not kept.exists()
        assert asked == [words.NOT_SAVED] * 2


def test_a_place_that_cannot_be_written_to_is_an_error_in_the_bar(stage: Path, tmp_path: Path) -> None:
    with opened(stage, tmp_path / "there/is/none/strokes.usda") as window:
        drag(window.painting.canvas, ON_TABLE)
        window.filing.autosave.flush()
        kept = autosave_path(window.document.files)
        assert kept.is_file() and tmp_path not in kept.parents  # it is kept elsewhere
        window.filing.save()
        wait_for(lambda: window.worker.is_idle and bool(window.bar.text))
        assert "cannot be written" in window.bar.text and not window.document.is_saved


def test_the_shot_is_never_written_to(stage: Path) -> None:
    with opened(stage, stage, stage.with_name("never.usda")) as window:
        assert "holds no strokes" in window.bar.text  # a shot is no stroke layer
        assert window.document.shot is None
    before = stage.read_bytes()
    with opened(stage, stage.with_name("strokes_never.usda"), stage) as window:
        drag(window.painting.canvas, ON_TABLE)
        solved(window)
        window.bar.hide()
        window.filing.save()
        wait_for(lambda: window.worker.is_idle and bool(window.bar.text))
        assert "part of the shot" in window.bar.text
    assert stage.read_bytes() == before


def test_a_shot_that_changes_on_the_disk_is_read_again_and_painted_again(tmp_path: Path) -> None:
    stage = roll(tmp_path)
    with opened(stage, stage.with_name("strokes.usda")) as window:
        drag(window.painting.canvas, ON_TABLE)
        solved(window)
        strokes, found = window.document.strokes, window.document.found
        other = stage.read_text().replace("(0.5, 0.4, 0.3)", "(0.1, 0.4, 0.7)")
        stage.write_text("#usda 1.0\nhalf of it(")
        wait_for(lambda: window.bar.text == words.STAGE_CHANGED)
        QTest.keyClick(window, Qt.Key.Key_F5)
        assert window.bar.text == ""  # nothing is asked any more
        wait_for(lambda: bool(window.bar.text))
        assert f"{stage} is not a readable USD file" in window.bar.text
        stage.write_text(other)
        wait_for(lambda: window.bar.text == words.STAGE_CHANGED)
        answer(window, words.RELOAD)
        wait_for(lambda: window.document.found is not found and window.document.is_solved and window.worker.is_idle)
        assert window.document.strokes == strokes
        wood = next(m for m in window.document.shot.scene.materials if m.path.endswith("wood"))
        np.testing.assert_allclose(wood.diffuse_color, (0.1, 0.4, 0.7), atol=1e-6)


@pytest.mark.parametrize("name", ["missing.usda", "broken.usda"])
def test_what_cannot_be_opened_is_an_error_in_the_bar(stage: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "broken.usda").write_text("this is no layer")
    with opened(tmp_path / name) as window:
        assert str(tmp_path / name) in window.bar.text and window.isVisible()
        window.filing.open(Files(str(stage)))
        wait_for(lambda: window.document.shot is not None)  # the window goes on
        assert name not in window.bar.text


def test_a_shot_without_lights_and_with_a_texture_missing_says_so(tmp_path: Path) -> None:
    stage = roll(tmp_path)
    from pxr import Usd, UsdLux

    source = Usd.Stage.Open(str(stage))
    for path in ("/World/lamp", "/World/sky"):
        source.RemovePrim(path)
    dome = UsdLux.DomeLight.Define(source, "/World/sky")
    dome.CreateTextureFileAttr("./nowhere.exr")
    source.Save()
    with opened(stage) as window:
        assert "nowhere.exr" in window.bar.text
        drag(window.painting.canvas, ON_TABLE)
        solved(window)
        assert sentences(window)


def test_cancelled_work_changes_nothing(stage: Path) -> None:
    with opened(stage, stage.with_name("cancelled.usda")) as window:
        drag(window.painting.canvas, ON_TABLE)
        window.worker.cancel()
        assert window.worker.is_idle and len(window.document.strokes) == 1
        press(window.painting.canvas, [(0.6, 0.9)])
        window.painting.solving.solve_again()
        solved(window)
