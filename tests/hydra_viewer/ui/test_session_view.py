"""session.view() from a Python prompt: what is painted in the window is the session's when it is closed."""

from __future__ import annotations

from pathlib import Path

from kit.moving_stages import roll
from kit.windows import SMALL, drag
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

import usdslf
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.window import Window


def test_what_is_painted_is_the_sessions(tmp_path: Path) -> None:
    make_application()
    session = usdslf.open(str(roll(tmp_path)), **SMALL)
    timer = QTimer()

    def work() -> None:
        windows = [w for w in QApplication.topLevelWidgets() if isinstance(w, Window) and w.isVisible()]
        for window in windows:
            document = window.document
            if document.shot is session.shot and not document.strokes:
                drag(window.painting.canvas, [(0.45, 0.9), (0.5, 0.9), (0.55, 0.9)])
            elif document.strokes and document.is_solved and window.worker.is_idle:
                timer.stop()
                window.close()

    timer.timeout.connect(work)
    timer.start(50)
    session.view()
    timer.timeout.disconnect(work)
    (stroke,) = session.strokes
    assert stroke.surfaces == ("/World/table",)
    assert [a.pool.strokes for a in session.answers] == [(0,)]
