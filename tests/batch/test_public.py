"""The public names of batches are documented and listed, as those of the program are."""

from __future__ import annotations

from public_api.docstrings import gaps

import usdslf.batch


def test_every_public_docstring_says_what_it_should() -> None:
    assert gaps(usdslf.batch) == []
    assert {"plan", "run_job", "run_batch", "collect"} <= set(usdslf.batch.__all__)
