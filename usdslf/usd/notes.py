"""Notes: what could not be read, each reason said once with the prims that it concerns."""

from __future__ import annotations

_NAMED = 3  # prims named in one note


class Notes:
    """Collects trouble that is not fatal, by reason."""

    def __init__(self) -> None:
        self._prims: dict[str, dict[str, None]] = {}
        self.missing: dict[str, tuple[str, str]] = {}  # prim -> file of its texture, and why that cannot be read

    def add(self, reason: str, prim: object) -> None:
        """Notes that `reason` holds for a prim; {} in the reason is where the prims are named."""
        self._prims.setdefault(reason, {})[str(prim)] = None

    def sentences(self) -> list[str]:
        """Returns one sentence for each reason."""
        return [reason.replace("{}", name_some(list(prims))) for reason, prims in self._prims.items()]


def name_some(prims: list[str]) -> str:
    """Returns the first names of a list and how many more there are."""
    more = len(prims) - _NAMED
    return ", ".join(prims[:_NAMED]) + (f" and {more} more" if more > 0 else "")
