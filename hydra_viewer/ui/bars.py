"""Bars: an error, a question or a note over the picture, and the progress of work at the foot of the window."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton, QToolButton, QWidget

from hydra_viewer.ui import theme, words


class MessageBar(QWidget):
    """A sentence across the window until it is closed, or answered."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._label = QLabel()
        self._label.setWordWrap(True)
        self._label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._answers: list[QPushButton] = []
        close = QToolButton(autoRaise=True)
        close.setText("✕")
        close.setToolTip(words.CLOSE_BAR)
        close.clicked.connect(self.hide)
        self._layout = QHBoxLayout(self)
        self._layout.setContentsMargins(12, 6, 6, 6)
        self._layout.addWidget(self._label, 1)
        self._layout.addWidget(close)
        self.hide()

    @property
    def text(self) -> str:
        """What it says; "" while it is hidden."""
        return self._label.text() if not self.isHidden() else ""

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
        self._label.setText(sentence)
        self.setStyleSheet(f"MessageBar {{ background: {theme.ERROR if is_error else theme.NOTE}; }}")
        self.show()


LABEL = 260  # of what is being done [pixels]


class ProgressRow(QWidget):
    """What is being done, how much of it, and a button that cancels it.

    Attributes:
        cancelled: Signal(): the button was pressed.
    """

    cancelled = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._label, self._bar = QLabel(words.READY), QProgressBar(textVisible=False, maximum=1000)
        self._bar.setFixedWidth(160)
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
        self._label.setText(words.working(step, share))
        self._bar.setValue(round(1000 * share))

    def set_idle(self, is_idle: bool) -> None:
        """Shows whether something is done."""
        self._bar.setVisible(not is_idle)
        self._button.setVisible(not is_idle)
        if is_idle:
            self._label.setText(words.READY)
