"""Finds kernel files and puts their text together."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from usdslf.errors import KernelBuildError

_PACKAGE = Path(__file__).resolve().parents[1]
_PLACES = (_PACKAGE / "_kernels", _PACKAGE.parent / "kernels")  # a wheel, a checkout
_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$', re.MULTILINE)


def kernel_folder() -> Path:
    """Returns the folder of the .cl files.

    Raises: KernelBuildError where the installation lacks it.
    """
    for place in _PLACES:
        if (place / "common.cl").is_file():
            return place
    raise KernelBuildError(f"the kernels folder is missing beside {_PACKAGE}; reinstall usdslf")


@cache
def kernel_source(stem: str) -> str:
    """Returns the text of kernels/<stem>.cl with its includes put in place, each once.

    Includes are resolved here and not by the compiler: PoCL 3.0 refuses include paths with spaces.
    """
    return _expand(stem + ".cl", set())


def _expand(name: str, seen: set[str]) -> str:
    seen.add(name)
    text = (kernel_folder() / name).read_text()

    def put(match: re.Match[str]) -> str:
        return "" if match[1] in seen else _expand(match[1], seen)

    return _INCLUDE.sub(put, text)
