"""A look is sent to review, and every control of the window is reached, by keys alone."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import pytest
from kit.painted_table import ON_RED, OPTIONS, write_table
from kit.windows import ALT, CTRL, drag, solved, wait_for
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QTabBar, QWidget

from hydra_viewer.model import reviewing
from hydra_viewer.model.document import Files
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.window import Window
from usdslf.review import ReviewSettings
from usdslf.review.verdict import read_verdict

PANELS = tuple(words.PANEL_KEYS)
Key = Qt.Key


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Window]:
    """With a blue stroke on the red ball, saved, and reviewed with small pictures."""
    folder = tmp_path_factory.mktemp("review")
    make_application()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reviewing, "SETTINGS", ReviewSettings(size=(96, 54), frames=2, painted=1, held_out=1))
        window = Window(OPTIONS)
        window.resize(1600, 1000)
        window.show()
        window.filing.open(Files(str(write_table(folder)), str(folder / "strokes.usda"), str(folder / "look.usda")))
        wait_for(lambda: window.document.shot is not None)
        window.easel.set_brush(color=(0.05, 0.08, 0.5), space="reflectance", radius=0.02)
        drag(window.painting.canvas, list(ON_RED))
        solved(window)
        QTest.keyClick(window, Key.Key_S, CTRL)
        wait_for(lambda: window.worker.is_idle and window.document.is_saved)
        review(window)
        yield window
    window.close()
    window.deleteLater()


def review(window: Window) -> None:
    """Reviews by keys, and waits for the pictures."""
    panel = window.review_panel
    go_to(window, words.REVIEW_PANEL)
    wait_for(lambda: QApplication.focusWidget() is panel.review_button)
    QTest.keyClick(panel.review_button, Key.Key_Space)
    reviewed(window)


def reviewed(window: Window) -> None:
    wait_for(lambda: window.worker.is_idle and window.review_panel.review is not None)


def go_to(window: Window, title: str) -> None:
    window.activateWindow()
    wait_for(window.isActiveWindow)
    QTest.keyClick(window, getattr(Key, f"Key_{words.PANEL_KEYS[title]}"))


def walk(first: QWidget) -> list[QWidget]:
    """The controls that Tab comes to, from one on until it comes back, each once."""
    seen: list[QWidget] = []
    control: QWidget | None = first
    while control is not None and control not in seen:
        seen.append(control)
        QTest.keyClick(control, Key.Key_Tab)
        control = QApplication.focusWidget()
    return seen


def said(window: Window) -> str:
    return "\n".join(label.text() for label in window.review_panel.details.findChildren(QLabel))


def test_a_review_shows_pictures_numbers_and_what_was_weighed(window: Window) -> None:
    panel = window.review_panel
    kinds = [panel.views.itemText(n) for n in range(panel.views.count())]
    assert any(words.PAINTED_FROM in k for k in kinds) and any(words.OTHER_LIGHT in k for k in kinds)
    images = panel.picture.images
    assert {*images, "wipe", "blink"} == set(words.REVIEW_MODES)
    at = round(0.33 * images["before"].width()), round(0.51 * images["before"].height())
    before, after = images["before"].pixelColor(*at), images["after"].pixelColor(*at)
    assert before.red() > 1.5 * before.blue() and after.blue() > 1.5 * after.red()  # the red ball became blue
    assert images["difference"].pixelColor(*at).lightness() > images["difference"].pixelColor(1, 1).lightness() + 20
    text = said(window)
    assert "stroke 1" in text and words.WEIGHED in text and "other_red_ball" in text and "painted" in text
    assert window.review_panel.tree.selected.material.endswith("/red")


def test_modes_and_the_wipe_are_worked_by_keys(window: Window) -> None:
    panel = window.review_panel
    for mode, button in panel.modes.items():
        button.setFocus()
        QTest.keyClick(button, Key.Key_Space)
        assert panel.picture.mode == mode
    QTest.keyClick(panel.modes["wipe"], Key.Key_Space)
    panel.picture.setFocus()
    QTest.keyClick(panel.picture, Key.Key_Left)
    assert panel.picture.split == pytest.approx(0.48)


def test_before_and_after_blink(window: Window, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = window.review_panel.picture
    picture._blinking.setInterval(20)
    QTest.keyClick(window.review_panel.modes["blink"], Key.Key_Space)
    at = round(0.33 * picture.width()), round(0.51 * picture.height())
    seen = dict[bool, bool]()
    wait_for(lambda: len(seen) == 2 or seen.update({picture.shows_after: is_red(picture, at)}))
    assert seen == {False: True, True: False}  # the red ball is blue after the look
    QTest.keyClick(window.review_panel.modes["after"], Key.Key_Space)
    assert not picture._blinking.isActive()


def is_red(widget: QWidget, at: tuple[int, int]) -> bool:
    color = widget.grab().toImage().pixelColor(*at)
    return color.red() > color.blue()


def test_differences_are_magnified_by_the_gain(window: Window) -> None:
    panel = window.review_panel
    at = round(0.33 * 96), round(0.51 * 54)
    levels = []
    for mode in ("wipe", "difference"):
        QTest.keyClick(panel.modes[mode], Key.Key_Space)
        assert panel.gain.isEnabled() == (mode == "difference")
    for gain in ("1", "8"):
        panel.gain.setFocus()
        panel.gain.selectAll()
        QTest.keyClicks(panel.gain, gain)
        QTest.keyClick(panel.gain, Key.Key_Return)
        images = panel.picture.images
        levels.append([images[m].pixelColor(*at).lightness() for m in ("difference", "before")])
    (little, before), (much, as_before) = levels
    assert little > 0 and much > 1.5 * little and before == as_before


def test_a_change_is_rejected_with_a_note_that_accept_reads(window: Window, tmp_path: Path) -> None:
    panel, row = window.review_panel, window.review_panel.tree.selected
    panel.tree.setFocus()
    QTest.keyClick(panel.tree, Key.Key_Space)
    panel.note.setFocus()
    QTest.keyClicks(panel.note, "too blue")
    panel.save_verdict(str(tmp_path / "verdict.json"))
    read = read_verdict(tmp_path / "verdict.json", window.document.files.look)
    assert {d.target: (d.is_accepted, d.note) for d in read.decided}[row.target] == (False, "too blue")
    panel.save_page(str(tmp_path / "review.html"))
    assert row.material in (tmp_path / "review.html").read_text()


def test_a_change_is_switched_off_and_on_and_what_was_decided_stays(window: Window) -> None:
    panel, row = window.review_panel, window.review_panel.tree.selected
    for is_off in (True, False):
        panel.switch.setFocus()
        QTest.keyClick(panel.switch, Key.Key_Space)
        wait_for(lambda is_off=is_off: panel.tree.selected is not None and panel.tree.selected.is_off == is_off)
        reviewed(window)
        at = round(0.33 * 96), round(0.51 * 54)
        blue = panel.picture.images["after"].pixelColor(*at)
        assert (blue.red() > blue.blue()) == is_off  # red again while it is off
        assert row.target in panel.verdict.rejected and panel.verdict.notes[row.target] == "too blue"
        if is_off:
            save_again(window)
            assert panel.tree.selected.is_off


def save_again(window: Window) -> None:
    """Saves strokes and look once more, and reviews it."""
    go_to(window, words.REVIEW_PANEL)
    QTest.keyClick(window, Key.Key_S, CTRL)
    wait_for(lambda: window.worker.is_idle)
    before = window.review_panel.verdict
    review(window)
    wait_for(lambda: window.review_panel.verdict is not before)


@pytest.mark.parametrize("title", PANELS)
def test_a_panel_is_as_wide_as_its_dock(window: Window, title: str) -> None:
    go_to(window, title)
    area = next(d for d in window.docks if d.windowTitle() == title).widget()
    assert area.widget().minimumSizeHint().width() <= area.viewport().width()  # nothing is cut off at the right


@pytest.mark.parametrize("title", PANELS)
def test_a_key_goes_to_each_panel_and_tab_to_all_its_controls(window: Window, title: str) -> None:
    go_to(window, title)
    if title == words.STROKES_PANEL:
        window.strokes_panel.select(("stroke_0001",))
    dock = next(d for d in window.docks if d.windowTitle() == title)
    panel = dock.widget().widget()
    wait_for(lambda: panel.isAncestorOf(QApplication.focusWidget() or window), 10)
    reached = walk(QApplication.focusWidget())
    controls = [w for w in panel.findChildren(QWidget) if can_have_keys(w)]
    assert len(controls) >= 2
    assert [w for w in controls if w not in reached] == []
    own = [w for w in reached if panel.isAncestorOf(w)]
    tops = [w.mapTo(panel, w.rect().center()).y() for w in own]
    assert all(b >= a - w.height() / 2 - 6 for a, b, w in zip(tops, tops[1:], own)), list(zip(tops, own))


def test_underlined_letters_go_to_fields(window: Window) -> None:
    panel = window.brush_panel
    for key, field in ((Key.Key_M, panel.choices["mode"]), (Key.Key_Z, panel.radius.box)):
        window.painting.canvas.setFocus()
        QTest.keyClick(window, key, ALT)
        assert QApplication.focusWidget() is field


@pytest.mark.parametrize("title", PANELS)
def test_who_has_the_keys_is_seen(window: Window, title: str) -> None:
    go_to(window, title)
    dock = next(d for d in window.docks if d.windowTitle() == title)
    panel = dock.widget().widget()
    for control in [w for w in panel.findChildren(QWidget) if can_have_keys(w)]:
        window.painting.canvas.setFocus()
        QApplication.processEvents()
        without = control.grab().toImage()
        control.setFocus(Qt.FocusReason.TabFocusReason)
        QApplication.processEvents()
        assert control.grab().toImage() != without, control


def can_have_keys(widget: QWidget) -> bool:
    is_asked = bool(widget.focusPolicy() & Qt.FocusPolicy.TabFocus) and widget.focusProxy() is None
    return is_asked and widget.isVisible() and widget.isEnabled() and not isinstance(widget, QTabBar)
