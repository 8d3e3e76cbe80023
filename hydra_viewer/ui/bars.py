"""Bars: an error, a question or a note over the picture, and the progress of work at the foot of the window."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QToolButton, QWidget

from hydra_viewer.ui import theme, words

MARGIN = 32  # beside a sentence [pixels]
NOTED = 12_000  # milliseconds that a note lies over the picture


class MessageBar(QWidget):
    """A sentence across the head of what it lies over, until it is closed, or answered; nothing moves when it comes.

    Attributes:
        folded: Signal(str): a note was there for long enough to be read, and is to be shown where it hides nothing.
    """

    folded = Signal(str)

    def __init__(self, below: QWidget) -> None:
        super().__init__(below)
        self._below = below
        below.installEventFilter(self)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._label, self._sentence, self._is_brief = QLabel(), "", False
        self._label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._answers: list[QPushButton] = []
        self._close = close = QToolButton(autoRaise=True)
        close.setText("✕")
        close.setToolTip(words.CLOSE_BAR)
        close.clicked.connect(self.hide)
        self._layout = QHBoxLayout(self)
        self._layout.setContentsMargins(12, 6, 6, 6)
        self._layout.addWidget(self._label, 1)
        self._layout.addWidget(close)
        self._until_folded = QTimer(self, singleShot=True, interval=NOTED)
        self._until_folded.timeout.connect(self._fold)
        self.hide()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Stays as wide as what it lies over."""
        if event.type() == QEvent.Type.Resize:
            self._fit()
        return False

    def _fit(self) -> None:
        wide = self._below.width()
        if self._is_brief:
            room = wide - self._close.sizeHint().width() - MARGIN
            self._label.setText(self._label.fontMetrics().elidedText(self._sentence, Qt.TextElideMode.ElideRight, room))
        self.setGeometry(0, 0, wide, max(self.heightForWidth(wide), self.minimumSizeHint().height()))

    def _fold(self) -> None:
        if self.underMouse():  # somebody reads it, or its tooltip
            self._until_folded.start()
        elif not self.isHidden():
            self.hide()
            self.folded.emit(self._sentence)

    def clear(self) -> None:
        """Says nothing any more, here or where a note went."""
        self.hide()
        self.folded.emit("")

    @property
    def text(self) -> str:
        """What it says; "" while it is hidden."""
        return self._sentence if not self.isHidden() else ""

    def say(self, sentence: str, is_error: bool = True, answers: dict[str, Callable[[], None]] | None = None) -> None:
        """Shows a sentence.

        Args:
            is_error: in the colour of errors; False: of notes.
            answers: buttons by their text; each also closes the bar.
        """
        for button in self._answers:
            button.deleteLater()
        self._answers = []
        for text, do in (answers or {}).items():
            button = QPushButton(text)
            button.clicked.connect(self.hide)
            button.clicked.connect(lambda _=False, do=do: do())
            self._layout.insertWidget(self._layout.count() - 1, button)
            self._answers.append(button)
        self._sentence, self._is_brief = sentence, not (is_error or answers)  # a note takes one line of the picture
        self._label.setWordWrap(not self._is_brief)
        self._label.setMinimumWidth(1)
        self._label.setText(sentence)
        self._label.setToolTip(sentence if self._is_brief else "")
        self.setStyleSheet(f"MessageBar {{ background: {theme.ERROR if is_error else theme.NOTE}; }}")
        self._fit()
        self.show()
        self.raise_()
        if self._is_brief:
            self._until_folded.start()
        else:
            self._until_folded.stop()


class FoldedNote(QLabel):
    """A note that was read, in one dim line; all of it in the tooltip."""

    def __init__(self) -> None:
        super().__init__()
        self._sentence = ""
        self.setProperty("isDim", True)
        self.setContentsMargins(MARGIN, 0, 0, 0)
        self.setMinimumWidth(1)

    def show_note(self, sentence: str) -> None:
        """Shows a sentence; "": none."""
        self._sentence = sentence
        self.setToolTip(sentence)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._fit()

    def _fit(self) -> None:
        room = self.width() - MARGIN - 2
        self.setText(self.fontMetrics().elidedText(self._sentence, Qt.TextElideMode.ElideRight, room))


LABEL = 260  # of what is being done [pixels]
WIDE, HIGH = 160, 6  # of the bar [pixels]
TELLING = 50  # milliseconds between what is told of work under way


class _ShareBar(QWidget):
    """How much is done; unlike Qt's own bar it does not make the whole window paint at once when that changes."""

    def __init__(self) -> None:
        super().__init__()
        self.share = 0.0
        self.setFixedSize(WIDE, HIGH)

    def show_share(self, share: float) -> None:
        """Shows a share, 0..1."""
        if share != self.share:
            self.share = share
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        for share, color in ((1.0, theme.FIELD), (self.share, theme.ACCENT)):
            painter.setBrush(QColor(color))
            painter.drawRoundedRect(QRectF(0, 0, share * self.width(), self.height()), 2, 2)
        painter.end()


class ProgressRow(QWidget):
    """What is being done, how much of it, and a button that cancels it.

    Attributes:
        cancelled: Signal(): the button was pressed.
    """

    cancelled = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._label, self._bar = QLabel(words.READY), _ShareBar()
        self._told = "", 0.0
        self._telling = QTimer(self, singleShot=True, interval=TELLING)
        self._telling.timeout.connect(self._show_told)
        self._button = QToolButton()
        self._button.setText(words.CANCEL_BUTTON)
        self._button.setToolTip(words.CANCEL[1])
        self._button.clicked.connect(self.cancelled)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(8, 2, 8, 2)
        for each in (self._bar, self._button, self._label):
            layout.addWidget(each)
            policy = each.sizePolicy()
            policy.setRetainSizeWhenHidden(True)  # the picture keeps its size when work begins and ends
            each.setSizePolicy(policy)
        self._label.setMinimumWidth(LABEL)
        self._label.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.set_idle(True)

    def tell(self, step: str, share: float) -> None:
        """Shows how far a step is."""
        self._told = step, share
        if not self._telling.isActive():
            self._telling.start()

    def _show_told(self) -> None:
        self._label.setText(words.working(*self._told))
        self._bar.show_share(self._told[1])

    def set_idle(self, is_idle: bool) -> None:
        """Shows whether something is done."""
        self._bar.setVisible(not is_idle)
        self._button.setVisible(not is_idle)
        if is_idle:
            self._telling.stop()
            self._label.setText(words.READY)
