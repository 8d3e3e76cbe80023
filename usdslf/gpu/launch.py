"""Sizes of launches: work-items come in groups of GROUP, and a kernel leaves alone those beyond its count."""

from __future__ import annotations

GROUP = 64  # work-items of a group


def groups(count: int) -> tuple[int]:
    """Returns the global size of a launch of at least `count` work-items."""
    return (-(-count // GROUP) * GROUP,)
