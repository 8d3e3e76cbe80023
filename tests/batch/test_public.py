"""The public names of batches are documented and listed, as those of the program are."""

from __future__ import annotations

from pathlib import Path

from public_api.docstrings import gaps

import usdslf.batch


def test_every_public_docstring_says_what_it_should() -> None:
    assert gaps(usdslf.batch) == []
    assert {"plan", "run_job", "run_batch", "collect"} <= set(usdslf.batch.__all__)


def test_names_are_functions_whatever_was_imported_before() -> None:
    """A module of the same name would take their place."""
    for file in Path(usdslf.batch.__file__).parent.glob("*.py"):
        assert file.stem not in usdslf.batch.__all__, file
