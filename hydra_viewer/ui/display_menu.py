"""Display menu: by which display, view and look of the OpenColorIO config, and what of the picture, is shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QEvent, QObject, QRect, QSize, Qt, Signal
from PySide6.QtGui import QAction, QActionGroup, QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QMenu, QWidget

from hydra_viewer.model.brush_color import shot_color
from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.ui import words
from usdslf import CHANNELS, FALSE_COLORS, Color, DisplaySettings, UsdslfError


class DisplayMenu(QMenu):
    """What brings the picture to the screen.

    Attributes:
        named: Signal(str): what is shown, and how, in a few words.
    """

    named = Signal(str)

    def __init__(self, document: Document, easel: Easel, parent: QWidget | None = None) -> None:
        """Lists what the config of the open shot has.

        Args:
            document: of the shot.
            easel: whose display is changed.
            parent: as QMenu; shortcuts work in its window.
        """
        super().__init__(words.DISPLAY, parent)
        self.setToolTipsVisible(True)
        self._document, self._easel = document, easel
        self._color: Color | None = None
        self.displays, self.views, self.looks = (QMenu(name, self) for name in words.DISPLAY_PARTS)
        self.channels = {channel: self._channel_action(channel) for channel in CHANNELS}
        for menu in (self.displays, self.views, self.looks):
            self.addMenu(menu)
        self.addSeparator()
        self.addActions(list(self.channels.values()))
        self.addSeparator()
        self.reset = self._action(words.RESET_DISPLAY, lambda: easel.set_display(exposure=0.0, gamma=1.0))
        self.addAction(self.reset)
        document.shot_changed.connect(self._fill)
        easel.display_changed.connect(self._update)
        self._update()

    def _action(self, words_of: tuple[str, str, str], do: Callable[[], object]) -> QAction:
        name, more, key = words_of
        action = QAction(name, self)
        action.setShortcut(key)
        action.setToolTip(words.tooltip(name, more, key))
        action.triggered.connect(lambda _=False: do())
        return action

    def _channel_action(self, channel: str) -> QAction:
        action = self._action(words.CHANNELS[channel], lambda: self._show_channel(channel))
        action.setCheckable(True)
        return action

    def _show_channel(self, channel: str) -> None:
        """Shows a channel; the one that is shown: the colours again."""
        is_shown = self._easel.display.channel == channel
        self._easel.set_display(channel=CHANNELS[0] if is_shown else channel)
        self._update()

    # ── what the config has ────────────────────────────────────────────────────────────────────

    def _fill(self) -> None:
        """Lists what the config of the shot has; what it lacks is shown by its first ones."""
        shot = self._document.shot
        if shot is None:
            return
        try:
            self._color = shot_color(shot)
        except UsdslfError:  # said where the picture is made
            return
        displays, s = self._color.displays(), self._easel.display
        if s.display and (s.display not in displays or (s.view and s.view not in displays[s.display])):
            self._easel.set_display(display="", view="", look="")
        elif s.look and s.look not in self._color.looks():
            self._easel.set_display(look="")
        self._update()

    def _update(self) -> None:
        s = self._easel.display
        for channel, action in self.channels.items():
            action.setChecked(channel == s.channel)
        if self._color is not None:
            displays = self._color.displays()
            display = s.display or next(iter(displays))
            view = s.view or self._color.default_view(display)
            looks = ["", *self._color.looks()]
            self._list(self.displays, list(displays), display, self._take_display)
            self._list(self.views, displays[display], view, lambda view: self._easel.set_display(view=view))
            self._list(self.looks, looks, s.look, lambda look: self._easel.set_display(look=look))
        self.named.emit(self.name_of(s))

    def name_of(self, settings: DisplaySettings) -> str:
        """Returns in a few words what is shown, and how."""
        channel = words.CHANNELS[settings.channel][0].replace("&", "")
        if settings.channel == "false_color" or self._color is None:
            return channel
        display = settings.display or self._color.display_name
        view = settings.view or self._color.default_view(display)
        return view if settings.channel == CHANNELS[0] else f"{channel}, {view}"

    def _take_display(self, display: str) -> None:
        """Takes a display; the view stays where it has that too."""
        view = self._easel.display.view
        assert self._color is not None
        is_there = view in self._color.displays()[display]
        self._easel.set_display(display=display, view=view if is_there else "")

    def _list(self, menu: QMenu, names: Sequence[str], now: str, take: Callable[[str], object]) -> None:
        if [a.data() for a in menu.actions()] != list(names):
            menu.clear()
            group = QActionGroup(menu)
            for name in names:
                action = menu.addAction(name.replace("&", "&&") or words.NO_LOOK)
                action.setData(name)
                action.setCheckable(True)
                action.triggered.connect(lambda _=False, name=name: take(name))
                group.addAction(action)
        for action in menu.actions():
            action.setChecked(action.data() == now)


class FalseColorLegend(QWidget):
    """What the false colours mean, over the picture, as long as they are shown."""

    ROW, SWATCH, MARGIN = 18, 26, 10

    def __init__(self, easel: Easel, canvas: QWidget) -> None:
        """Lies over a canvas.

        Args:
            easel: whose display says whether it is seen.
            canvas: in whose lower left corner it is.
        """
        super().__init__(canvas)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._easel, self._canvas = easel, canvas
        self.resize(self.sizeHint())
        canvas.installEventFilter(self)
        easel.display_changed.connect(self._update)
        self._update()

    def sizeHint(self) -> QSize:
        """Returns the size that all rows need."""
        width = max(self.fontMetrics().horizontalAdvance(text) for _, _, text in FALSE_COLORS)
        return QSize(width + self.SWATCH + 3 * self.MARGIN, len(FALSE_COLORS) * self.ROW + 2 * self.MARGIN)

    def _update(self) -> None:
        self.setVisible(self._easel.display.channel == "false_color")
        self.move(self.MARGIN, self._canvas.height() - self.height() - self.MARGIN)
        self.raise_()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Follows the corner of the canvas."""
        if event.type() == QEvent.Type.Resize:
            self._update()
        return super().eventFilter(watched, event)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paints the rows, the brightest first."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(20, 20, 20, 200))
        for number, (_, codes, text) in enumerate(reversed(FALSE_COLORS)):
            top = self.MARGIN + number * self.ROW
            painter.fillRect(QRect(self.MARGIN, top + 2, self.SWATCH, self.ROW - 4), QColor(*codes))
            rows = QRect(2 * self.MARGIN + self.SWATCH, top, self.width(), self.ROW)
            painter.setPen(QColor(230, 230, 230))
            painter.drawText(rows, Qt.AlignmentFlag.AlignVCenter, text)
