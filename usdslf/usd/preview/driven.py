"""What drives an input of another renderer's shader: a number, an image or a primvar, times and plus numbers.

    Driven, Image                             value = source * scale + bias
    constant(*values) -> Driven
    times(a, b), plus(a, b), mix(a, b, t)     of two driven ones one is a number: NotAffine says which not
    DrivenReader(time, color).value(shader, name, default) -> Driven

Nodes are followed by the table of surface_models.py, through node graphs and interface inputs.  What a number, an
image or a primvar cannot stand for (procedural nodes, products of textures) is named in `notes`, and its default is
used.  Colours come out in USD's default space.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdShade

from usdslf.color import USD_DEFAULT_SPACE, Color
from usdslf.usd.notes import Notes
from usdslf.usd.preview.coordinates import AS_IT_IS, Affine, coordinates_of, producer, scaled, shifted
from usdslf.usd.preview.surface_models import NODES, OUTPUTS, SIZES, SPACES, WRAPS, Node

_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3, "x": 0, "y": 1, "z": 2, "w": 3}
_DEEP = 32  # nodes in a row, which no network has unless it goes round


@dataclass(frozen=True)
class Image:
    """A file that is looked up at transformed texture coordinates."""

    file: str  # resolved; with <UDIM> for a set
    color_space: str  # auto | raw | sRGB | a name that OpenColorIO knows
    wrap: tuple[str, str]
    uv_set: str
    st_from_uv: Affine  # (3, 3) rows
    fallback: tuple[float, ...]  # (4,) of the image, before scale and bias


@dataclass(frozen=True)
class Driven:
    """source * scale + bias, one or three components."""

    scale: tuple[float, ...]  # (k,)
    bias: tuple[float, ...]  # (k,)
    source: Image | str | None = None  # an image, the name of a primvar, or nothing
    channels: str = ""  # of the source, one for each component
    fallback: tuple[float, ...] = ()  # of a primvar (k,)

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.bias)

    @property
    def number(self) -> tuple[float, ...] | None:
        """The value where nothing drives it."""
        return self.bias if self.source is None else None

    @property
    def best_number(self) -> tuple[float, ...]:
        """The value, or what it is without its source: the default of the node."""
        if self.source is None:
            return self.bias
        at = self.fallback
        if isinstance(self.source, Image):
            at = tuple(self.source.fallback["rgba".index(c)] for c in self.channels)
        return tuple(v * s + b for v, s, b in zip(at, self.scale, self.bias))


class NotAffine(Exception):
    """A value that is no source times and plus a number; says why."""


def constant(*values: float) -> Driven:
    """Returns a number, or a colour."""
    return Driven((0.0,) * len(values), tuple(float(v) for v in values))


def as_size(a: Driven, size: int) -> Driven:
    """Returns a value with one component or three: a number becomes a grey, of a colour the first one is taken."""
    if a.size == size:
        return a
    if a.size == 1:
        return replace(
            a, scale=a.scale * size, bias=a.bias * size, channels=a.channels * size, fallback=a.fallback * size
        )
    return replace(
        a, scale=a.scale[:size], bias=a.bias[:size], channels=a.channels[:size], fallback=a.fallback[:size]
    )


def times(a: Driven, b: Driven) -> Driven:
    """Returns a * b."""
    if b.source is not None:
        a, b = b, a
    if b.source is not None:
        raise NotAffine("a product of two textures")
    size = max(a.size, b.size)
    a, b = as_size(a, size), as_size(b, size)
    scale, bias = (tuple(x * y for x, y in zip(values, b.bias)) for values in (a.scale, a.bias))
    if a.source is not None and not any(scale):
        return constant(*bias)
    return replace(a, scale=scale, bias=bias)


def plus(a: Driven, b: Driven) -> Driven:
    """Returns a + b."""
    if b.source is not None:
        a, b = b, a
    size = max(a.size, b.size)
    a, b = as_size(a, size), as_size(b, size)
    bias = tuple(x + y for x, y in zip(a.bias, b.bias))
    if b.source is None:
        return replace(a, bias=bias)
    if (a.source, a.channels) != (b.source, b.channels):
        raise NotAffine("a sum of two textures")
    return replace(a, bias=bias, scale=tuple(x + y for x, y in zip(a.scale, b.scale)))


def mix(a: Driven, b: Driven, t: Driven) -> Driven:
    """Returns a (1 - t) + b t."""
    return plus(times(a, plus(constant(1), times(t, constant(-1)))), times(b, t))


class DrivenReader:
    """Reads the inputs of shaders of other renderers."""

    def __init__(self, time: Usd.TimeCode, color: Color, notes: Notes) -> None:
        self.time, self.color, self.notes = time, color, notes

    def value(self, shader: UsdShade.Shader, name: str, default: Sequence[float], depth: int = 0) -> Driven:
        """Returns what drives an input, with as many components as its default.

        Raises: NotAffine, saying why not.
        """
        size = len(default)
        attribute = producer(shader, name)
        if attribute is None:
            return constant(*default)
        if UsdShade.Output.IsOutput(attribute):
            if depth > _DEEP:
                raise NotAffine(f"a network that goes round at {attribute.GetPrim().GetPath()}")
            return as_size(self._from_node(attribute, depth), size)
        given = attribute.Get(self.time)
        if given is None or isinstance(given, str | Sdf.AssetPath):
            return constant(*default)
        values = tuple(float(x) for x in np.ravel(np.asarray(given, np.float64)))
        if not values or not np.isfinite(values).all():
            return constant(*default)
        if len(values) >= 3 and attribute.GetTypeName().role == "Color":
            space = str(Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, None)) or USD_DEFAULT_SPACE
            if space != USD_DEFAULT_SPACE and self.color.knows(space):
                values = tuple(float(x) for x in self.color.to_working(np.array([values[:3]], np.float32), space)[0])
        return as_size(constant(*values[: 3 if len(values) > 2 else 1]), size)

    def file(
        self, shader: UsdShade.Shader, name: str, channels: str, space: str, scale: Sequence[float],
        shift: Sequence[float],
    ) -> Driven | None:  # fmt: skip
        """Returns a texture that is an input of the surface itself, at st * scale + shift; None where it is no file.

        Raises: NotAffine where a node is connected that gives none.
        """
        attribute = producer(shader, name)
        if attribute is None:
            return None
        if UsdShade.Output.IsOutput(attribute):
            return as_size(self._from_node(attribute, 0), len(channels))
        given = attribute.Get(self.time)
        if not isinstance(given, Sdf.AssetPath) or not given.path:
            return None
        space = str(attribute.GetColorSpace()) if attribute.HasColorSpace() else space
        st = shifted(scaled(AS_IT_IS, scale), shift)
        file = _resolved(attribute, given, self.time)
        image = Image(file, SPACES.get(space.lower(), space), ("repeat", "repeat"), "st", st, (0.0, 0.0, 0.0, 1.0))
        return Driven((1.0,) * len(channels), (0.0,) * len(channels), image, channels)

    def text(self, shader: UsdShade.Shader, name: str, default: str = "") -> str:
        """Returns an input of words."""
        found = producer(shader, name) if name else None
        given = found.Get(self.time) if found is not None and not UsdShade.Output.IsOutput(found) else None
        return default if given is None else str(given)

    def number(self, shader: UsdShade.Shader, name: str, default: Sequence[float]) -> tuple[float, ...]:
        """Returns an input that only makes sense as numbers."""
        found = producer(shader, name) if name else None
        given = found.Get(self.time) if found is not None and not UsdShade.Output.IsOutput(found) else None
        if given is None or isinstance(given, str):
            return tuple(default)
        values = tuple(float(x) for x in np.ravel(np.asarray(given, np.float64)))
        return values if len(values) == len(default) else (values * len(default))[: len(default)]

    # ---- nodes -----------------------------------------------------------------------------
    def _from_node(self, output: Usd.Attribute, depth: int) -> Driven:
        shader = UsdShade.Shader(output.GetPrim())
        node = node_of(shader)
        read: dict[str, Callable[..., Driven]] = {
            "image": self._image, "primvar": self._primvar, "value": self._value,
            "math": self._math, "channel": self._channel,
        }  # fmt: skip
        if node is None or node.kind not in read:
            kind = str(shader.GetIdAttr().Get() or "a node without id")
            raise NotAffine(f"{kind} at {shader.GetPath()}")
        found = read[node.kind](shader, node, output, depth + 1)
        chosen = OUTPUTS.get(output.GetBaseName())
        if chosen and found.size > 1:
            return _component(found, "rgba".index(chosen))
        return found

    def _value(self, shader: UsdShade.Shader, node: Node, output: Usd.Attribute, depth: int) -> Driven:
        return self.value(shader, node.inputs["value"], (0.0,) * _size_of(shader, 0), depth)

    def _channel(self, shader: UsdShade.Shader, node: Node, output: Usd.Attribute, depth: int) -> Driven:
        of = self.value(shader, node.inputs["value"], (0.0,) * 3, depth)
        words = self.text(shader, node.inputs.get("channels", ""), node.text.get("channels", ""))
        if words:
            if not set(words) <= set(_CHANNELS):
                raise NotAffine(f"the channels {words} at {shader.GetPath()}")
            picked = [_component(of, _CHANNELS[c]) for c in words[:3]]
            return picked[0] if len(picked) == 1 else _together(picked)
        if "index" in node.inputs:
            return _component(of, int(self.number(shader, node.inputs["index"], (0,))[0]))
        return of  # the output's name says which

    def _math(self, shader: UsdShade.Shader, node: Node, output: Usd.Attribute, depth: int) -> Driven:
        size = 3 if _size_of(shader, 0) > 1 else 1
        given = [self._operand(shader, name, d, size, depth) for name, d in node.defaults.items()]
        op = node.inputs["op"]
        if op == "multiply":
            return times(*given)
        if op == "add":
            return plus(*given)
        if op == "subtract":
            return plus(given[0], times(given[1], constant(-1)))
        if op == "mix":
            return mix(*given)
        if given[-1].source is not None or any(g.source is not None for g in given[1:]):
            raise NotAffine(f"{op} by a texture at {shader.GetPath()}")
        numbers = [np.array(as_size(g, size).bias) for g in given[1:]]
        if op == "divide":
            return times(given[0], constant(*(1 / numbers[0] if numbers[0].all() else numbers[0])))
        low, high, out_low, out_high = numbers  # remap
        scale = (out_high - out_low) / np.where(high == low, 1, high - low)
        return plus(times(given[0], constant(*scale)), constant(*(out_low - low * scale)))

    def _operand(self, shader: UsdShade.Shader, name: str, default: float, size: int, depth: int) -> Driven:
        """An operand: a colour where the node is of colours, but one number where it has one."""
        port = shader.GetInput(name)
        is_one = bool(port) and port.GetTypeName().type == Sdf.ValueTypeNames.Float.type
        return self.value(shader, name, (default,) * (1 if is_one else size), depth)

    def _primvar(self, shader: UsdShade.Shader, node: Node, output: Usd.Attribute, depth: int) -> Driven:
        name = self.text(shader, node.inputs.get("name", ""), node.text.get("name", ""))
        size = 3 if _size_of(shader, _size_of_type(output)) > 2 else 1
        if not name:
            raise NotAffine(f"{shader.GetPath()}, which names no primvar")
        fallback = self.number(shader, node.inputs["fallback"], (0.0,) * size)
        return Driven((1.0,) * size, (0.0,) * size, name, "rgb"[:size], fallback)

    def _image(self, shader: UsdShade.Shader, node: Node, output: Usd.Attribute, depth: int) -> Driven:
        names = node.inputs
        size = min(_size_of(shader, _size_of_type(output)), 3)
        space, file = self._file(shader, node, size)
        fallback = self.number(shader, names["fallback"], (0.0,) * 3)
        wrap = tuple(
            WRAPS.get(self.text(shader, names.get(f"wrap_{s}", ""), node.text["wrap"]), "repeat") for s in "st"
        )
        if not file:
            reason = f"{{}} names no file: its default {_words(fallback[:size])} is used"
            self.notes.add(reason, shader.GetPath())
            return constant(*fallback[:size])
        if "black" in wrap and any(fallback) and "wrap_s" in names and "uaddressmode" in names.values():
            self.notes.add("{} has a colour outside of its image: black is shown there", shader.GetPath())
        uv_set, st = coordinates_of(self, shader, names["st"])
        uv_set = self.text(shader, names.get("uv_set", ""), "") or uv_set
        st = self._placed(shader, node, st)
        alpha = self.number(shader, names["fallback"], (0.0,) * 4)[3]
        image = Image(file, space, (wrap[0], wrap[1]), uv_set, st, (*fallback, alpha))
        out = OUTPUTS.get(output.GetBaseName(), "")
        channels = out or "rgb"[:size]
        scale, bias = (self.number(shader, names.get(n, ""), (d,) * 4) for n, d in (("scale", 1.0), ("bias", 0.0)))
        at = ["rgba".index(c) for c in channels]
        return Driven(tuple(scale[i] for i in at), tuple(bias[i] for i in at), image, channels)

    def _file(self, shader: UsdShade.Shader, node: Node, size: int) -> tuple[str, str]:
        """Returns colour space and resolved file of an image node."""
        attribute = producer(shader, node.inputs["file"])
        given = attribute.Get(self.time) if attribute is not None else None
        space = self.text(shader, node.inputs.get("space", ""), node.text["space"])
        if attribute is not None and attribute.HasColorSpace():
            space = attribute.GetColorSpace()
        if "linearize" in node.inputs and self.number(shader, node.inputs["linearize"], (0.0,))[0]:
            space = "sRGB"
        if str(shader.GetIdAttr().Get()).startswith(("ND_image_", "ND_tiledimage_")) and not _is_color(shader):
            space = "raw"  # MaterialX converts colours only
        if attribute is None or given is None:
            return "raw", ""
        return SPACES.get(space.lower(), space), _resolved(attribute, given, self.time)

    def _placed(self, shader: UsdShade.Shader, node: Node, st: Affine) -> Affine:
        """The coordinates after what the image node itself does to them."""
        of = lambda key, default: self.number(shader, node.inputs.get(key, ""), default)  # noqa: E731
        if "tiling" in node.inputs:  # NG_tiledimage_color3
            tiling, shift = of("tiling", (1.0, 1.0)), of("shift", (0.0, 0.0))
            factor = np.array(of("tile_size", (1.0, 1.0))) / np.array(of("image_size", (1.0, 1.0)))
            return scaled(shifted(scaled(st, tiling), (-shift[0], -shift[1])), factor)
        if "scale_s" in node.inputs:  # image of Arnold
            st = scaled(st, [of("scale_s", (1.0,))[0], of("scale_t", (1.0,))[0]])
            st = shifted(st, [of("shift_s", (0.0,))[0], of("shift_t", (0.0,))[0]])
            for axis, flips in enumerate((of("flip_s", (0.0,))[0], of("flip_t", (0.0,))[0])):
                if flips:
                    st = shifted(scaled(st, [1 - 2 * (axis == 0), 1 - 2 * (axis == 1)]), [axis == 0, axis == 1])
            return st
        # Images of RenderMan begin at the top, which is what inverting T makes of it: without it they stand on
        # their heads.  Where a manifold is connected, that one does it.
        if "invert_t" in node.inputs and producer(shader, node.inputs["st"]) is None and not of("invert_t", (1.0,))[0]:
            return shifted(scaled(st, (1.0, -1.0)), (0.0, 1.0))
        return st


def node_of(shader: UsdShade.Shader) -> Node | None:
    """Returns what the table says of a node."""
    kind = str(shader.GetIdAttr().Get() or "")
    if kind.startswith("ND_"):
        return NODES.get("mtlx:" + kind.split("_")[1])
    return NODES.get(kind) or NODES.get(kind.split("_")[0])


def _size_of(shader: UsdShade.Shader, otherwise: int) -> int:
    """Components of what a node gives, by its MaterialX type; else as said, or 3."""
    kind = str(shader.GetIdAttr().Get() or "")
    if kind.startswith("ND_"):
        words = kind.replace("color3FA", "color3").replace("vector3FA", "vector3").split("_")[2:]
        sizes = [SIZES[w] for w in words if w in SIZES]
        if sizes:
            return sizes[-1]
    return otherwise or 3


def _size_of_type(output: Usd.Attribute) -> int:
    is_one = output.GetTypeName().type == Sdf.ValueTypeNames.Float.type
    return 1 if is_one or OUTPUTS.get(output.GetBaseName()) else 3


def _is_color(shader: UsdShade.Shader) -> bool:
    return "color" in str(shader.GetIdAttr().Get())


def _component(a: Driven, index: int) -> Driven:
    if a.size == 1:
        return a
    if index > 2:
        if isinstance(a.source, Image):
            return Driven((1.0,), (0.0,), a.source, "a")
        return constant(1.0)
    channels, fallback = a.channels[index : index + 1], a.fallback[index : index + 1]
    return replace(a, scale=(a.scale[index],), bias=(a.bias[index],), channels=channels, fallback=fallback)


def _together(parts: Sequence[Driven]) -> Driven:
    if len({p.source for p in parts}) > 1:
        raise NotAffine("channels of several textures")
    join = lambda name: tuple(x for p in parts for x in getattr(p, name))  # noqa: E731
    channels = "".join(p.channels for p in parts)
    return Driven(join("scale"), join("bias"), parts[0].source, channels, join("fallback"))


def _resolved(attribute: Usd.Attribute, given: Any, time: Usd.TimeCode) -> str:
    """The file that an asset path or a name means, wherever it was said; as it stands where there is none."""
    path = given.path if isinstance(given, Sdf.AssetPath) else str(given)
    if isinstance(given, Sdf.AssetPath) and given.resolvedPath:
        return str(given.resolvedPath)
    stack = attribute.GetPropertyStack(time)
    return Sdf.ComputeAssetPathRelativeToLayer(stack[0].layer, path) if path and stack else path


def _words(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{v:.3g}" for v in values) + ")"

