"""Manifest: which shots, stroke layers and options a batch has, as a TOML file or the same values in Python.

    read_manifest(path or values) -> Manifest        checked by schemas/batch.schema.json; errors name their line

The schema is JSON Schema (draft 2020-12), so that editors check a manifest while it is written.
"""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from usdslf.errors import InputError
from usdslf.replacing import is_file
from usdslf.usd.schema import PLACES

NAME = "batch.schema.json"
IN_PYTHON = "manifest"  # stands for the name of a file where there is none
Key = tuple[str | int, ...]


@dataclass(frozen=True)
class Manifest:
    """A manifest as it was read.

    Attributes:
        path: absolute, of its file; of values in Python a name in the current folder, where there need not be a file.
        values: as schemas/batch.schema.json has them.
        lines: line of each key, by its place in `values`; none of values in Python.
    """

    path: Path
    values: Mapping[str, Any]
    lines: Mapping[Key, int]

    @property
    def folder(self) -> Path:
        """That its paths are relative to."""
        return self.path.parent

    def error(self, key: Key, sentence: str) -> InputError:
        """Returns an error about a key, which names its line where there is one."""
        line = f", line {line_of(key, self.lines)}" if self.lines else ""
        return InputError(f"{self.path.name}{line}: {sentence}")


def read_manifest(manifest: str | os.PathLike[str] | Mapping[str, Any]) -> Manifest:
    """Reads a manifest and checks it by the schema.

    Args:
        manifest: a file, or what it would hold; paths are relative to its folder, or to the current one.

    Raises: InputError, with the line, for what is no TOML or not as the schema says.
    """
    import jsonschema

    if isinstance(manifest, Mapping):
        found = _of_values(manifest)
    else:
        found = _read_file(manifest)
    errors = sorted(
        jsonschema.Draft202012Validator(schema()).iter_errors(found.values), key=lambda e: list(map(str, e.path))
    )
    for error in errors:
        raise found.error(*_in_words(error))
    return found


def _of_values(values: Mapping[str, Any]) -> Manifest:
    """A manifest of values in Python; tuples and paths serve as lists and texts do."""
    try:
        plain = json.loads(json.dumps(dict(values), default=os.fspath))
    except (TypeError, ValueError) as failed:
        raise InputError(f"{IN_PYTHON}: {failed}; give texts, numbers, lists and tables") from None
    return Manifest(Path(os.path.abspath(IN_PYTHON)), plain, {})


def _read_file(path: str | os.PathLike[str]) -> Manifest:
    file = Path(os.path.abspath(path))
    if not is_file(file):
        raise InputError(f"there is no manifest {path}; write one, README.md shows how")
    try:
        text = file.read_text(encoding="utf-8")
        values = tomllib.loads(text)
    except UnicodeDecodeError as failed:
        raise InputError(f"{file.name} is not UTF-8 at byte {failed.start}; save it as UTF-8") from None
    except OSError as failed:
        raise InputError(f"{path} cannot be read: {str(failed.strerror).lower()}; check its rights") from None
    except tomllib.TOMLDecodeError as failed:
        said = str(failed)
        at = re.search(r" \(at (line \d+), column \d+\)", said)
        line = at[1] if at else f"line {text.count(chr(10)) + 1}"  # at the end of the document
        words = re.sub(r" \(at .*\)$", "", said)
        raise InputError(f"{file.name}, {line}: {words[0].lower()}{words[1:]}; it is no TOML there") from None
    return Manifest(file, values, key_lines(text))


@cache
def schema() -> dict[str, Any]:
    """Returns the schema of manifests.

    Raises: InputError where the installation lacks it.
    """
    for place in PLACES:
        if (place / NAME).is_file():
            read: dict[str, Any] = json.loads((place / NAME).read_text(encoding="utf-8"))
            return read
    raise InputError(f"the schema {NAME} is missing; reinstall usdslf")


def _in_words(error: Any) -> tuple[Key, str]:
    """The place and the sentence of an error of jsonschema."""
    key = tuple(error.absolute_path)
    name = ".".join(f"[{k + 1}]" if isinstance(k, int) else k for k in key).replace(".[", "[") or "the manifest"
    if error.validator == "additionalProperties" and isinstance(error.schema.get("properties"), dict):
        known = error.schema["properties"]
        odd = next(k for k in error.instance if k not in known)
        return (*key, odd), f"there is no key '{odd}' in {name}; choose from {', '.join(known)}"
    if error.validator == "required":
        missing = next(k for k in error.validator_value if k not in error.instance)
        return key, f"{name} has no '{missing}'; add it"
    shown = json.dumps(error.instance)
    shown = shown if len(shown) < 60 else shown[:57] + "..."
    wanted = {
        "type": lambda v: f"is no {v}",
        "enum": lambda v: f"is unknown; choose one of {', '.join(v)}",
        "minimum": lambda v: f"is less than {v}",
        "exclusiveMinimum": lambda v: f"is not above {v}",
        "maximum": lambda v: f"is more than {v}",
        "minLength": lambda v: "is empty",
        "minItems": lambda v: f"has fewer than {v} items",
        "maxItems": lambda v: f"has more than {v} items",
    }
    say = wanted.get(error.validator)
    return key, f"{name} = {shown} {say(error.validator_value)}" if say else f"{name}: {error.message}"


def line_of(key: Sequence[str | int], lines: Mapping[Key, int]) -> int:
    """Returns the line of a key, or of the nearest one that it stands in; 1 where there is none."""
    for end in range(len(key), 0, -1):
        if tuple(key[:end]) in lines:
            return lines[tuple(key[:end])]
    return 1


def key_lines(text: str) -> dict[Key, int]:
    """Returns the line of each table and each key of a TOML text, by its place; keys of inline tables are left out."""
    found: dict[Key, int] = {}
    table: Key = ()
    counts: dict[Key, int] = {}
    for number, line in _logical_lines(text):
        stripped = line.strip()
        if array := re.match(r"\[\[(.+?)\]\]", stripped):
            place = _under(_parts(array[1]), counts)
            counts[place] = counts.get(place, -1) + 1
            table = (*place, counts[place])
            found[table] = number
            found.setdefault(place, number)
        elif plain := re.match(r"\[(.+?)\]", stripped):
            table = _under(_parts(plain[1]), counts)
            found.setdefault(table, number)
        elif pair := re.match(r"((?:\"[^\"]*\"|'[^']*'|[\w\-. ])+?)\s*=", stripped):
            for end in range(1, len(_parts(pair[1])) + 1):
                found.setdefault((*table, *_parts(pair[1])[:end]), number)
    return found


def _under(parts: tuple[str, ...], counts: Mapping[Key, int]) -> Key:
    """The place of a table whose name leads through arrays of tables: into the last of each."""
    place: Key = ()
    for part in parts:
        if place in counts:
            place = (*place, counts[place])
        place = (*place, part)
    return place


def _parts(name: str) -> tuple[str, ...]:
    """The parts of a dotted key."""
    return tuple(
        a or b or c.strip() for a, b, c in re.findall(r"\"([^\"]*)\"|'([^']*)'|([^.\"']+)", name) if a or b or c
    )


def _logical_lines(text: str) -> Iterator[tuple[int, str]]:
    """The lines that begin a table or a key: not those within brackets or in texts of several lines."""
    depth, fence = 0, ""
    for number, line in enumerate(text.splitlines(), 1):
        if not depth and not fence:
            yield number, line
        is_header = not depth and not fence and re.match(r"\s*\[", line) is not None
        at = 0
        while at < len(line) and not is_header:
            three = line[at : at + 3]
            if fence:
                at, fence = (at + 3, "") if three == fence else (at + 1, fence)
            elif three in ('"""', "'''"):
                at, fence = at + 3, three
            elif line[at] == "#":
                break
            elif line[at] in "\"'":
                text_ = re.compile(r'"(?:\\.|[^"\\])*"?' if line[at] == '"' else r"'[^']*'?").match(line, at)
                at = text_.end() if text_ else at + 1
            else:
                depth += {"[": 1, "{": 1, "]": -1, "}": -1}.get(line[at], 0)
                at += 1
