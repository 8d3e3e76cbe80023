"""What was found, in words; the place of the panel Understanding."""

from __future__ import annotations

from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.sentences import sentences_of


class SentencePanel(QWidget):
    """A sentence for each thing that was found."""

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document = document
        self.label = QLabel()
        self.label.setWordWrap(True)
        layout = QVBoxLayout(self)
        layout.addWidget(self.label)
        layout.addStretch(1)
        document.found_changed.connect(self._update)

    def _update(self) -> None:
        found, shot = self._document.found, self._document.shot
        self.label.setText("\n\n".join(sentences_of(shot, found.solution)) if found and shot else "")
