"""Faults of a layer's text: bytes, tokens, lines, ends, numbers, values, types, names.

    fault(text, random) -> bytes          one to three faults
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

_TOKEN = re.compile(r'"[^"\n]*"|@[^@\n]*@|<[^>\n]*>|[-+.\w:]+|[^\s\w]')
_NUMBERS = (
    *("nan", "inf", "-inf", "1e39", "-1e308", "-1", "0", "2147483647", "99999", "1e-30", "[]", "None", '"x"', "()"),
    *("nan", "inf", "-1", "0", "3", "1e30", "-7", "1000"),
)
_TYPES = (
    *("float", "double", "int", "bool", "token", "string", "asset", "color3f", "float2", "float3", "float4", "half3"),
    *("point3f[]", "int[]", "float[]", "token[]", "string[]", "texCoord2f[]", "texCoord3f[]", "matrix4d", "quatf"),
    *("timecode", "int64[]", "uchar[]", "color4f", "vector3d[]", "opaque", "group", "dictionary", "pathExpression"),
)
_BYTES = (0, 9, 10, 34, 40, 41, 60, 62, 64, 91, 93, 123, 125, 0x80, 0xC3, 0xE9, 0xFE, 0xFF)
Random = np.random.Generator
NAMES = frozenset(t.removesuffix("[]") for t in _TYPES)


def fault(text: str, random: Random) -> bytes:
    """Returns the text of a layer with one to three faults: of how it is written, or in what it says."""
    written: list[Callable[[bytes, Random], bytes]] = [_bytes, _stray, _tokens, _lines, _end]
    said: list[Callable[[bytes, Random], bytes]] = [_numbers, _values, _values, _types, _names, _lines]
    kinds = written if random.random() < 0.3 else said
    data = text.encode()
    for _ in range(random.integers(1, 4)):
        data = kinds[random.integers(len(kinds))](data, random)
    return data


def _bytes(data: bytes, random: Random) -> bytes:
    """Some bytes are others, missing, or too many."""
    for _ in range(random.integers(1, 4)):
        at, new = int(random.integers(len(data) + 1)), random.integers(256, size=random.integers(3), dtype=np.uint8)
        data = data[:at] + new.tobytes() + data[at + int(random.integers(3)) :]
    return data


def _stray(data: bytes, random: Random) -> bytes:
    """A byte that means something to the reader of text, inside of a name, a string or a path."""
    places = [m.start() + 1 for m in re.finditer(rb'["@<\w][\w./]', data)] or [0]
    at = places[random.integers(len(places))]
    return data[:at] + bytes([_BYTES[random.integers(len(_BYTES))]]) + data[at:]


def _tokens(data: bytes, random: Random) -> bytes:
    """A token is missing, twice there, or in the place of another."""
    text = data.decode("latin-1")
    found = list(_TOKEN.finditer(text))
    if not found:
        return data
    one, other = (found[random.integers(len(found))] for _ in range(2))
    new = ("", one[0] * 2, other[0])[random.integers(3)]
    return (text[: one.start()] + new + text[one.end() :]).encode("latin-1")


def _numbers(data: bytes, random: Random) -> bytes:
    """A number is one that nobody expects."""
    return _swapped(data, r"(?<![\w.])-?[\d.]+", _NUMBERS, random)


def _types(data: bytes, random: Random) -> bytes:
    """A value has another type."""
    return _swapped(data, rf"\b({'|'.join(sorted(NAMES))})(\[\])?(?= [\w:]+)", _TYPES, random)


def _values(data: bytes, random: Random) -> bytes:
    """A value is none, empty, short, long, or that of another attribute; the layer can still be parsed."""
    lines = data.split(b"\n")
    stands = re.compile(rb"\s+(uniform )?[\w\[\]]+ [\w:]+(\.connect)? = .*[^({]$")
    at = [i for i, line in enumerate(lines) if stands.match(line)]
    if not at:
        return data
    i, other = at[random.integers(len(at))], at[random.integers(len(at))]
    name, _, value = lines[i].partition(b" = ")
    kind = name.split()[-2]
    if value.startswith(b"["):
        items = re.findall(rb"\([^()]*\)|[^,\[\]]+", value[1:-1])
        items = [x for x in items if x.strip()]
        new = [b"None", b"[]", b"[" + b", ".join(items[:-1]) + b"]", b"[" + b", ".join(items * 2) + b"]"]
        new.append(b"[" + b", ".join(re.sub(rb"[-.\d]+", b"nan", x) for x in items) + b"]")
        new.append(b"[" + b", ".join(re.sub(rb"[-.\d]+", b"-3", x) for x in items) + b"]")
    else:
        extremes = (b"nan", b"inf", b"-1", b"0", b"1e30", b"1e-30", b"100000")
        number = extremes[random.integers(len(extremes))]
        new = [b"None", re.sub(rb"(?<![\w.])-?[.\d]+", number, value), re.sub(rb"[.\d]+", b"0", value, count=1)]
    if lines[other].split()[-1:] and kind == lines[other].partition(b" = ")[0].split()[-2]:
        new.append(lines[other].partition(b" = ")[2])
    lines[i] = name + b" = " + new[random.integers(len(new))]
    return b"\n".join(lines)


def _names(data: bytes, random: Random) -> bytes:
    """A name in a path, a string or a declaration is that of something else."""
    found = list(re.finditer(rb"(?<=[/\" ])[A-Za-z_]\w+(?=[\"/.>]| = )", data))
    if not found:
        return data
    one, other = (found[random.integers(len(found))] for _ in range(2))
    return data[: one.start()] + other[0] + data[one.end() :]


def _swapped(data: bytes, pattern: str, choices: tuple[str, ...], random: Random) -> bytes:
    text = data.decode("latin-1")
    found = list(re.finditer(pattern, text))
    if not found:
        return data
    one = found[random.integers(len(found))]
    return (text[: one.start()] + choices[random.integers(len(choices))] + text[one.end() :]).encode("latin-1")


def _lines(data: bytes, random: Random) -> bytes:
    """A line is missing, twice there, or elsewhere."""
    lines = data.split(b"\n")
    at = int(random.integers(len(lines)))
    line = lines[at]
    what = random.integers(3)
    if what != 1:
        del lines[at]
    if what:
        lines.insert(at if what == 1 else int(random.integers(len(lines) + 1)), line)
    return b"\n".join(lines)


def _end(data: bytes, random: Random) -> bytes:
    """The rest is missing."""
    return data[: int(random.integers(len(data) + 1))]
