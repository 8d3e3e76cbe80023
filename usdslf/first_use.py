"""Public names of a package that are loaded at first use, so that a help text waits for none of what they need.

    if not TYPE_CHECKING:  # type checkers are to find unknown names
        __getattr__, __dir__ = loaded_at_first_use(__name__, {"usdslf.color": ("Color", "color_of")})

Source: PEP 562.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any


def loaded_at_first_use(
    package: str, names: Mapping[str, Iterable[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Makes what a package's module takes for `__getattr__` and `__dir__`.

    Args:
        package: its name.
        names: module -> those of its names that the package offers.
    """
    home = {name: module for module, offered in names.items() for name in offered}

    def load(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home[name]), name)

    def listed() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home})

    return load, listed
