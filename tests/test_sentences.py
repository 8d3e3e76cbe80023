"""Error sentences have one voice: lower case, one line, no full stop."""

from __future__ import annotations

import ast
from pathlib import Path

import usdslf

PACKAGE = Path(usdslf.__file__).parent
NAMES = ("OpenCL", "OpenColorIO", "PYOPENCL_CTX", "USD", "AOV", "PNG", "EXR")  # that are written so


def _raised() -> list[tuple[str, str]]:
    """(place, words) of each error that the package raises with a sentence; {} stands for values."""
    found = []
    for file in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args):
                continue
            kind = ast.unparse(node.exc.func)
            parts = node.exc.args[0]
            values = parts.values if isinstance(parts, ast.JoinedStr) else [parts]
            words = "".join(str(v.value) if isinstance(v, ast.Constant) else "{}" for v in values)
            if kind.endswith(("Error", "Error_")) and any(isinstance(v, ast.Constant) for v in values):
                found.append((f"{file.relative_to(PACKAGE)}:{node.lineno}", words))
    return found


def test_error_sentences_have_one_voice() -> None:
    raised = _raised()
    assert len(raised) > 100
    wrong = [
        f"{place}: {words}"
        for place, words in raised
        if "\n" in words or words.endswith(".") or (words[0].isupper() and not words.startswith(NAMES))
    ]
    assert not wrong, "\n".join(wrong)
