"""Texture coordinates of other renderers' images: a primvar and an affine transform.

    producer(shader, name)                                        the attribute that holds the value of an input
    coordinates_of(reader, shader, name) -> (primvar, Affine)     what is connected to an input of an image
    scaled(st, by), shifted(st, by)                               the transform with one more step after it
    as_transform_2d(st) -> (scale, rotation, translation)         of a UsdTransform2d, or None

Sources: NG_place2d_vector2 and rotate2d of MaterialX 1.39 (which turns clockwise), UsdTransform2d of the
UsdPreviewSurface specification (scale, then rotation, then translation), PxrManifold2D of RenderMan.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pxr import Usd, UsdShade

from usdslf.usd.notes import Notes


class InputReader(Protocol):
    """Reads inputs that only make sense as numbers or as words."""

    notes: Notes

    def number(self, shader: UsdShade.Shader, name: str, default: Sequence[float]) -> tuple[float, ...]: ...
    def text(self, shader: UsdShade.Shader, name: str, default: str = "") -> str: ...


Affine = tuple[tuple[float, ...], ...]  # (3, 3) rows, acts on columns (s, t, 1)
AS_IT_IS: Affine = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_DEEP = 16
# category of a node -> inputs that hold the coordinates, and the operand
_STEPS = {"multiply": ("in1", "in2"), "divide": ("in1", "in2"), "add": ("in1", "in2"), "subtract": ("in1", "in2")}


def producer(shader: UsdShade.Shader, name: str) -> Usd.Attribute | None:
    """Returns the attribute that holds the value of an input, through node graphs; None where it has none."""
    port = shader.GetInput(name)
    if not port:
        return None
    found = port.GetValueProducingAttributes()
    if found:
        return found[0]
    return port.GetAttr() if port.GetAttr().HasValue() else None


def scaled(st: Affine, by: ArrayLike) -> Affine:
    """Returns coordinates scaled by (s, t)."""
    s, t = (float(x) for x in np.asarray(by, float))
    return _after(st, np.diag([s, t, 1.0]))


def shifted(st: Affine, by: ArrayLike) -> Affine:
    """Returns coordinates moved by (s, t)."""
    s, t = (float(x) for x in np.asarray(by, float))
    return _after(st, np.array([[1, 0, s], [0, 1, t], [0, 0, 1.0]]))


def turned(st: Affine, degrees: float) -> Affine:
    """Returns coordinates turned counter-clockwise."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return _after(st, np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]))


def _after(st: Affine, step: NDArray) -> Affine:
    return tuple(tuple(float(x) for x in row) for row in step @ np.array(st))


def as_transform_2d(st: Affine) -> tuple[tuple[float, float], float, tuple[float, float]] | None:
    """Returns scale, rotation [degrees] and translation of a transform; None for one that shears."""
    m = np.array(st)
    first, second = m[:2, 0], m[:2, 1]
    sx = float(np.hypot(*first))
    turn = np.arctan2(first[1], first[0]) if sx else np.arctan2(-second[0], second[1])
    c, s = np.cos(turn), np.sin(turn)
    sy = float(second @ (-s, c))
    if not np.allclose(second, (-s * sy, c * sy), atol=1e-6 * (1 + abs(sy))):
        return None
    if abs(turn) > np.pi / 2 + 1e-9:  # a mirror, not a half turn
        turn, sx, sy = turn - np.copysign(np.pi, turn), -sx, -sy
    return (sx, sy), float(np.degrees(turn)), (float(m[0, 2]), float(m[1, 2]))


def coordinates_of(reader: InputReader, shader: UsdShade.Shader, name: str, depth: int = 0) -> tuple[str, Affine]:
    """Returns the primvar and the transform of the coordinates that an image is given; st where it is given none."""
    output = producer(shader, name)
    if output is None:
        return "st", AS_IT_IS
    if not UsdShade.Output.IsOutput(output):
        at = reader.number(shader, name, (0.0, 0.0))
        return "st", ((0.0, 0.0, at[0]), (0.0, 0.0, at[1]), (0.0, 0.0, 1.0))
    node = UsdShade.Shader(output.GetPrim())
    kind = str(node.GetIdAttr().Get() or "")
    category = kind.split("_")[1] if kind.startswith("ND_") else kind.split("_")[0]
    inside = lambda port: coordinates_of(reader, node, port, depth + 1)  # noqa: E731
    if depth > _DEEP:
        return "st", AS_IT_IS
    if category in ("texcoord", "geompropvalue", "UsdPrimvarReader"):
        return _primvar(reader, node, category), AS_IT_IS
    if category in ("UsdTransform2d", "place2d", "rotate2d", "PxrManifold2D"):
        return _placed(reader, node, category, inside)
    if category in _STEPS:
        found = _stepped(reader, node, category, inside)
        if found is not None:
            return found
    reader.notes.add(f"{{}} ({kind or 'no id'}) cannot give texture coordinates: st is used", node.GetPath())
    return "st", AS_IT_IS


def _primvar(reader: InputReader, node: UsdShade.Shader, category: str) -> str:
    if category == "texcoord":
        index = int(reader.number(node, "index", (0,))[0])
        return f"st{index}" if index else "st"
    return reader.text(node, "geomprop" if category == "geompropvalue" else "varname") or "st"


def _placed(reader: InputReader, node: UsdShade.Shader, category: str, inside: object) -> tuple[str, Affine]:
    of = lambda name, default: reader.number(node, name, default)  # noqa: E731
    one, nothing = (1.0, 1.0), (0.0, 0.0)
    if category == "UsdTransform2d":
        name, st = inside("in")  # type: ignore[operator]
        st = turned(scaled(st, of("scale", one)), of("rotation", (0.0,))[0])
        return name, shifted(st, of("translation", nothing))
    if category == "rotate2d":
        name, st = inside("in")  # type: ignore[operator]
        return name, turned(st, -of("amount", (0.0,))[0])
    if category == "PxrManifold2D":
        name = reader.text(node, "primvarS") or "st"
        st = turned(AS_IT_IS, of("angle", (0.0,))[0])
        st = scaled(st, [of("scaleS", (1.0,))[0], of("scaleT", (1.0,))[0]])
        st = shifted(st, [of("offsetS", (0.0,))[0], of("offsetT", (0.0,))[0]])
        if of("invertS", (0.0,))[0]:
            st = shifted(scaled(st, (-1.0, 1.0)), (1.0, 0.0))
        return name, st if of("invertT", (1.0,))[0] else shifted(scaled(st, (1.0, -1.0)), (0.0, 1.0))
    name, st = inside("texcoord")  # type: ignore[operator]
    pivot, scale, offset = np.array(of("pivot", nothing)), np.array(of("scale", one)), np.array(of("offset", nothing))
    turn, shrink = -of("rotate", (0.0,))[0], 1 / np.where(scale == 0, 1, scale)
    st = shifted(st, -pivot)
    if of("operationorder", (0.0,))[0]:
        st = scaled(turned(shifted(st, -offset), turn), shrink)
    else:
        st = shifted(turned(scaled(st, shrink), turn), -offset)
    return name, shifted(st, pivot)


def _stepped(
    reader: InputReader, node: UsdShade.Shader, category: str, inside: object
) -> tuple[str, Affine] | None:
    """Coordinates times or plus numbers; None where both operands are driven."""
    driven = [_is_driven(producer(node, port)) for port in _STEPS[category]]
    if all(driven) or (driven[1] and category in ("divide", "subtract")):
        return None
    first, second = _STEPS[category] if not driven[1] else _STEPS[category][::-1]
    name, st = inside(first)  # type: ignore[operator]
    default = (1.0, 1.0) if category in ("multiply", "divide") else (0.0, 0.0)
    by: Sequence[float] = reader.number(node, second, default)
    if category == "multiply":
        return name, scaled(st, by)
    if category == "divide":
        return name, scaled(st, [1 / x if x else 1.0 for x in by])
    return name, shifted(st, by if category == "add" else [-x for x in by])


def _is_driven(attribute: Usd.Attribute | None) -> bool:
    return attribute is not None and UsdShade.Output.IsOutput(attribute)
