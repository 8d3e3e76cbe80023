"""The display menu: what the config has is listed, a choice acts on the easel, a channel toggles; the legend."""

from __future__ import annotations

import os
from collections.abc import Iterator
from types import SimpleNamespace

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import pytest
from PySide6.QtCore import QPoint
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.display_menu import DisplayMenu, FalseColorLegend
from usdslf import FALSE_COLORS, color_of

COLOR = color_of(None, "lin_rec709_scene")


@pytest.fixture
def opened() -> Iterator[tuple[DisplayMenu, Easel, list[str]]]:
    """A menu on a document whose shot uses the built-in config, and what it names."""
    make_application()
    document, easel, named = Document(), Easel(), []
    menu = DisplayMenu(document, easel)
    menu.named.connect(named.append)
    document.shot = SimpleNamespace(scene=SimpleNamespace(ocio="", working_space="lin_rec709_scene"))
    document.shot_changed()
    yield menu, easel, named
    menu.deleteLater()


def texts(menu: QWidget) -> list[str]:
    return [a.text() for a in menu.actions()]


def test_displays_views_and_looks_of_the_config_are_listed_and_chosen(opened) -> None:  # type: ignore[no-untyped-def]
    menu, easel, named = opened
    assert texts(menu.displays) == list(COLOR.displays())
    assert texts(menu.views) == COLOR.displays()[COLOR.display_name]
    assert texts(menu.looks) == ["the view's own", *COLOR.looks()]
    assert [a.text() for a in menu.views.actions() if a.isChecked()] == [COLOR.view_name] == named[-1:]
    menu.views.actions()[1].trigger()
    assert easel.display.view == texts(menu.views)[1] == named[-1]
    menu.looks.actions()[1].trigger()
    assert easel.display.look == COLOR.looks()[0]
    menu.displays.actions()[2].trigger()
    display = list(COLOR.displays())[2]
    assert easel.display.display == display and texts(menu.views) == COLOR.displays()[display]
    assert easel.display.view in ("", *COLOR.displays()[display])


def test_a_channel_is_shown_and_the_same_again_shows_the_colours(opened) -> None:  # type: ignore[no-untyped-def]
    menu, easel, named = opened
    menu.channels["red"].trigger()
    assert easel.display.channel == "red" and named[-1].startswith("Red, ")
    menu.channels["luminance"].trigger()
    assert [c for c, action in menu.channels.items() if action.isChecked()] == ["luminance"]
    menu.channels["luminance"].trigger()
    assert easel.display.channel == "color" and menu.channels["color"].isChecked()
    easel.set_display(exposure=2.0, gamma=1.4)
    menu.reset.trigger()
    assert (easel.display.exposure, easel.display.gamma) == (0.0, 1.0)


def test_the_legend_shows_each_false_colour_while_they_are_shown(opened) -> None:  # type: ignore[no-untyped-def]
    _, easel, _ = opened
    canvas = QWidget()
    canvas.resize(640, 400)
    legend = FalseColorLegend(easel, canvas)
    canvas.show()
    assert not legend.isVisible()
    easel.set_display(channel="false_color")
    assert legend.isVisible() and legend.geometry().bottomLeft() == QPoint(10, 400 - 11)
    image = legend.grab().toImage()
    rows = [image.pixelColor(20, 10 + 18 * n + 9).getRgb()[:3] for n in range(len(FALSE_COLORS))]
    assert rows == [codes for _, codes, _ in reversed(FALSE_COLORS)]
    canvas.resize(640, 500)
    assert legend.geometry().bottom() == 500 - 11
    canvas.close()
