"""Review of a look layer: pixels, strokes and opinions in one place, and what a person decides about them.

Public names:

    review_shot      a look over a Shot that is open -> Review: what changes, by numbers and by pictures
    page_of          a Review as one HTML file
    toggle           edits of a look that are kept and silent, and that come back
    Review, ReviewSettings      records
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from usdslf.first_use import loaded_at_first_use

if TYPE_CHECKING:
    from usdslf.review.page import page_of
    from usdslf.review.review import Review, ReviewSettings, review_shot
    from usdslf.usd.review.toggle import toggle

__all__ = ["Review", "ReviewSettings", "page_of", "review_shot", "toggle"]

if not TYPE_CHECKING:  # type checkers are to find unknown names
    __getattr__, __dir__ = loaded_at_first_use(__name__, {
        "usdslf.review.review": ("Review", "ReviewSettings", "review_shot"),
        "usdslf.review.page": ("page_of",),
        "usdslf.usd.review.toggle": ("toggle",),
    })  # fmt: skip
