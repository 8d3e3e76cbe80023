"""Gathered: what was found for strokes on one shot, kept as long as it is likely to be asked again.

Samples depend on the stroke and on the shot as it is, on nothing else, evidence and first answers on no other pool's
strokes: another stroke beside it, an undo or another choice ask for the same ones.  All answers together stay for an
undo or redo.  The least recently asked go when all of them are larger than the limit.
"""

from __future__ import annotations

import functools
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from usdslf.inference.answers import Painted
from usdslf.scene.fingerprint import digest
from usdslf.strokes.stroke import Stroke

LIMIT = 1 << 30  # bytes; a stroke of 24 dabs has some 10 MB

Found = TypeVar("Found")


class Gathered:
    """What was found on one shot, by names; safe between threads."""

    def __init__(self, limit: int = LIMIT) -> None:
        """Has nothing yet.

        Args:
            limit: bytes of all that is kept.
        """
        self._limit = limit
        self._kept: OrderedDict[str, tuple[Any, tuple[str, ...], int]] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, stroke: Stroke, gather: Callable[[list[str]], Painted], said: list[str]) -> Painted:
        """Returns a stroke with its samples, by the stroke's values.

        Args:
            stroke: as it is asked.
            gather: finds it, and adds what is to be said of it to a list.
            said: takes that, also where it was kept.
        """
        name = name_of(stroke)
        return self.once(name, lambda own: replace(gather(own), name=name), said)

    def once(self, name: str, make: Callable[[list[str]], Found], said: list[str]) -> Found:
        """Returns what is found once for a name.

        Args:
            name: of all that it depends on, beside the shot as it is: `name_of`.
            make: finds it, and adds what is to be said of it to a list.
            said: takes that, also where it was kept.
        """
        with self._lock:
            found = self._kept.get(name)
            if found is not None:
                self._kept.move_to_end(name)
        if found is None:
            own: list[str] = []
            value = make(own)
            found = (value, tuple(own), size_of(value))
            with self._lock:
                self._kept[name] = found
                while sum(size for _, _, size in self._kept.values()) > self._limit:
                    self._kept.popitem(last=False)
        said.extend(found[1])
        known: Found = found[0]
        return known


def name_of(*values: Any) -> str:
    """Names values: records, sequences, arrays, texts and numbers."""
    return digest(values, str.encode)


def size_of(value: Any) -> int:
    """Returns the bytes of all arrays of a record or a sequence."""
    if isinstance(value, (tuple, list)):
        return sum(map(size_of, value))
    names = _fields_of(type(value))  # type: ignore[arg-type]  # types can be hashed
    if names is None:
        return int(getattr(value, "nbytes", 0))
    return sum(size_of(getattr(value, name)) for name in names)


@functools.cache
def _fields_of(kind: type) -> tuple[str, ...] | None:
    """Names of a record's fields; None: it is no record."""
    return tuple(f.name for f in fields(kind)) if is_dataclass(kind) else None
