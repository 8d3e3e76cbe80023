"""What tests of the viewer share: a display.  What needs Hydra is collected where Hydra can be had."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from kit import displays

collect_ignore = [] if displays.has_hydra() else ["test_hydra.py"]


@pytest.fixture(scope="session")
def display() -> Iterator[dict[str, str]]:
    """The environment of processes that show windows."""
    with displays.display() as environment:
        if environment is None:
            pytest.skip(displays.NO_DISPLAY)
        yield environment
