"""What tests of the viewer share: a display.  What needs Qt or Hydra is collected where it can be had."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest
from kit import displays

NEED_QT = ["ui", "test_display_menu.py", "test_hydra.py", "test_no_hydra.py", "test_on_a_display.py", "test_usdview.py"]
collect_ignore = NEED_QT if displays.why_no_qt() else [] if displays.has_hydra() else ["test_hydra.py"]


@pytest.fixture(scope="module", autouse=True)
def _what_windows_left_is_freed() -> Iterator[None]:
    """On the main thread, before other tests let Python collect on any; a window that is left would hold its shot."""
    yield
    if "hydra_viewer.ui.collector" in sys.modules:
        sys.modules["hydra_viewer.ui.collector"].collect_anywhere()
        shown = sys.modules["PySide6.QtWidgets"].QApplication.topLevelWidgets()
        assert not [w for w in shown if type(w).__name__ == "Window"]


@pytest.fixture(autouse=True)
def _nothing_fails_in_an_event(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What is raised while Qt paints or calls back ends no test by itself."""
    failed: list[BaseException] = []
    monkeypatch.setattr(sys, "excepthook", lambda kind, error, trace: failed.append(error))
    yield
    assert failed == []


@pytest.fixture(scope="session")
def display() -> Iterator[dict[str, str]]:
    """The environment of processes that show windows."""
    with displays.display() as environment:
        if environment is None:
            pytest.skip(displays.NO_DISPLAY)
        yield environment
