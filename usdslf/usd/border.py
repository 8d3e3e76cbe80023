"""The border to USD: what pxr prints is kept off stderr, what it raises becomes a sentence.

    quiet_usd()                                    no diagnostics on stderr
    reading(file, error, mend)                     that, and no exception of USD but one sentence of the kind `error`
    text_of(value) -> str                          of an error of USD, whose text need not be UTF-8
    reason_of(error) -> str                        the first reason that an error of USD gives, on one line
    plain(value) -> Any                            a value of USD as JSON can hold it
    in_words(value) -> str                         such a value as people read it

Any call of pxr may raise: Tf.ErrorException with the text of a C++ error, and UnicodeDecodeError where text that it
hands over is not UTF-8 (a name of a binary layer, the line of a text layer that its parser stumbled over).  No single
call is wrapped for that: each way in (a stage, a look, strokes, a review) stands in one `reading`, which names the
file.  Values are another matter: what a file holds in place of a number is checked where it is read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from pxr import Sdf, Tf, UsdUtils

from usdslf.errors import StageError, UsdslfError

_SHOWN = 60  # letters of what a parser stumbled over


@contextmanager
def quiet_usd() -> Iterator[None]:
    """Keeps USD's own diagnostics off stderr; what matters of them is reported by name."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        delegate.TakeUncoalescedDiagnostics()
        del delegate


@contextmanager
def reading(
    file: object, error: type[UsdslfError] = StageError, mend: str = "export it again"
) -> Iterator[None]:
    """Turns what USD raises within the block into one sentence that names a file.

    Args:
        file: its name.
        error: what is raised.
        mend: what to do about it.

    Raises: `error`.
    """
    try:
        with quiet_usd():
            yield
    except (Tf.ErrorException, UnicodeDecodeError) as failed:
        raise error(f"{file} is not a readable USD file, {mend}: {reason_of(failed)}") from None


def text_of(value: object) -> str:
    """Returns the text of an object of USD; bytes that are no UTF-8 are written as \\xNN."""
    try:
        return str(value)
    except UnicodeDecodeError as error:
        return error.object.decode("utf-8", "backslashreplace")


def reason_of(error: Exception) -> str:
    """Returns the first reason of a USD error, as one line."""
    if isinstance(error, UnicodeDecodeError):
        near = error.object[max(0, error.start - 20) : error.end + 20].decode("utf-8", "backslashreplace")
        return f"it has text that is not UTF-8, near '{_one_line(near)}'"
    text = text_of(error)
    quoted = re.findall(r"in file \S+ : '(.*?)'\s*(?:\n|$)", text, re.S)
    return parse_reason(_one_line(quoted[0] if quoted else text))


def parse_reason(text: str) -> str:
    """Returns what USD says of a text that it cannot parse, without the names of its grammar's rules."""
    found = re.search(r"[^\s@]*?:(\d+):\d+: parse error matching .*? at '(.*)' in <", text, re.S)
    if not found:
        return text
    at = found[2] if len(found[2]) <= _SHOWN else found[2][:_SHOWN] + "..."
    where = f"at '{at}'" if at else "it ends there"
    return f"{text[: found.start()]}line {found[1]} cannot be understood, {where}"


def _one_line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split()).rstrip(".")


def plain(value: Any) -> Any:
    """Returns a value of USD as JSON can hold it: numbers and text as they are, in lists; of all else its text."""
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, Sdf.AssetPath):
        return value.path
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    try:
        return [float(x) for x in np.ravel(np.asarray(value, np.float64))]
    except (TypeError, ValueError):
        return [plain(x) for x in value] if hasattr(value, "__getitem__") else text_of(value)


def in_words(value: Any) -> str:
    """Returns a value that `plain` gives as people read it: numbers to three digits, rows in brackets, - for none."""
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {in_words(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        return "(" + ", ".join(in_words(v) for v in value) + ")"
    if value is None:
        return "-"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
