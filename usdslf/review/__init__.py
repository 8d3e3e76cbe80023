"""Review of a look layer: pixels, strokes and opinions in one place, and what a person decides about them.

Public names:

    review_shot      a look over a Shot that is open -> Review: what changes, by numbers and by pictures
    page_of          a Review as one HTML file
    toggle           edits of a look that are kept and silent, and that come back
    Review, ReviewSettings      records
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from usdslf.review.page import page_of
    from usdslf.review.review import Review, ReviewSettings, review_shot
    from usdslf.usd.review.toggle import toggle

__all__ = ["Review", "ReviewSettings", "page_of", "review_shot", "toggle"]

_HOME = {
    **dict.fromkeys(("Review", "ReviewSettings", "review_shot"), "usdslf.review.review"),
    "page_of": "usdslf.review.page",
    "toggle": "usdslf.usd.review.toggle",
}


if not TYPE_CHECKING:  # type checkers are to find unknown names

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'usdslf.review' has no attribute {name!r}")
        return getattr(import_module(_HOME[name]), name)
