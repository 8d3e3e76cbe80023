"""What an input of a UsdPreviewSurface is driven by, and the opinions that change it there.

input_place(shader, name) -> (attribute or None, path, other inputs that it drives)
path_of_copy(stage, shader, edit) -> path                     of a node of its own, where others show its texture too
map_texture(shader, edit, copied, time) -> opinions on scale and bias
map_fallback(shader, edit, copied, time) -> opinion on the fallback, where no file is to be read
map_primvar(shader, edit, time) -> (reader's varname, its fallback)
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdShade

from usdslf.edits.edits import InputEdit
from usdslf.errors import AuthorError
from usdslf.usd.read.input_values import floats, holds

if TYPE_CHECKING:
    from usdslf.color import Color

NEW_TYPES = {
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "specularColor": Sdf.ValueTypeNames.Color3f,
    "useSpecularWorkflow": Sdf.ValueTypeNames.Int,
    "metallic": Sdf.ValueTypeNames.Float,
    "roughness": Sdf.ValueTypeNames.Float,
    "ior": Sdf.ValueTypeNames.Float,
}
_CHANNELS = "rgba"
Opinion = tuple[Sdf.Path, Any, Any]  # attribute, value before, value after


def input_place(shader: UsdShade.Shader, name: str) -> tuple[Usd.Attribute | None, Sdf.Path, list[str]]:
    """Finds where a value for an input has to be written.

    That is the interface input at the end of its connections, else the input itself.  Returns the attribute
    (None if it is not there yet; an output if a node computes the value), its path, and the other inputs of
    the material's shaders that take their value from it.
    """
    path = shader.GetPath().AppendProperty(f"inputs:{name}")
    port = shader.GetInput(name)
    if not port:
        return None, path, []
    found = port.GetValueProducingAttributes()
    attribute = found[0] if found else _end_of_chain(port)
    if UsdShade.Output.IsOutput(attribute):
        return attribute, path, []
    others = []
    if attribute.GetPath() != path:
        for other in _inputs_of(shader.GetPrim().GetStage(), shader.GetPrim()):
            values = other.GetValueProducingAttributes() or [_end_of_chain(other)]
            if attribute in values and other.GetAttr().GetPath() != path and not _is_interface(other):
                others.append(str(other.GetAttr().GetPath()))
    return attribute, attribute.GetPath(), others


def _end_of_chain(port: UsdShade.Input) -> Usd.Attribute:
    """Where an input without any value leads: interface inputs may be declared without one."""
    seen = set()
    while port.GetPrim().GetPath() not in seen:
        seen.add(port.GetPrim().GetPath())
        sources = port.GetConnectedSources()[0]
        if not sources or sources[0].sourceType != UsdShade.AttributeType.Input:
            break
        port = UsdShade.ConnectableAPI(sources[0].source.GetPrim()).GetInput(sources[0].sourceName)
    return port.GetAttr()


def _is_interface(port: UsdShade.Input) -> bool:
    return UsdShade.ConnectableAPI(port.GetPrim()).IsContainer()


def _inputs_of(stage: Usd.Stage, shader: Usd.Prim) -> Iterator[UsdShade.Input]:
    """The inputs of all shaders of the material that a shader is in."""
    material = shader
    while material and not material.IsA(UsdShade.Material):
        material = material.GetParent()
    for prim in Usd.PrimRange(material or shader, Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdShade.Shader):
            yield from UsdShade.Shader(prim).GetInputs()


def driving_prim(shader: UsdShade.Shader, name: str) -> Usd.Prim:
    """Returns the texture or primvar reader that drives an input."""
    port = shader.GetInput(name)
    found = port.GetValueProducingAttributes() if port else []
    if not found or not UsdShade.Output.IsOutput(found[0]):
        raise AuthorError(f"no texture drives {name} of {shader.GetPath()}: open the stage that was painted")
    return found[0].GetPrim()


def map_texture(shader: UsdShade.Shader, edit: InputEdit, copied: Sdf.Path, time: Usd.TimeCode) -> list[Opinion]:
    """Composes an affine map of an input with the scale and bias of the UsdUVTexture that drives it.

    Returns the opinions on both.

    Args:
        copied: where the node has a copy that they are for, else empty.
        time: at which the values of before are taken.
    """
    texture = UsdShade.Shader(driving_prim(shader, edit.input))
    channels = [_CHANNELS.index(c) for c in edit.channels]
    values = {}
    for name, fallback in (("scale", (1.0,) * 4), ("bias", (0.0,) * 4)):
        attribute, path, _ = input_place(texture, name)
        if not copied.isEmpty:
            path = copied.AppendProperty(f"inputs:{name}")
        values[name] = (path, _four(attribute, time, fallback))
    # (texel * scale + bias) * s + b
    scale, bias = Gf.Vec4f(values["scale"][1]), Gf.Vec4f(values["bias"][1])
    for channel, s, b in zip(channels, edit.scale, edit.bias):
        scale[channel], bias[channel] = scale[channel] * s, bias[channel] * s + b
    return [(*values["scale"], scale), (*values["bias"], bias)]


def map_fallback(shader: UsdShade.Shader, edit: InputEdit, copied: Sdf.Path, time: Usd.TimeCode) -> Opinion:
    """Returns the opinion on the fallback of the UsdUVTexture that drives an input, or of its copy."""
    texture = UsdShade.Shader(driving_prim(shader, edit.input))
    attribute, path, _ = input_place(texture, "fallback")
    before = _four(attribute, time, (0.0, 0.0, 0.0, 1.0))
    after = Gf.Vec4f(before)
    for channel, wanted in zip(edit.channels, np.ravel(edit.after)):
        after[_CHANNELS.index(channel)] = float(wanted)
    return (path if copied.isEmpty else copied.AppendProperty("inputs:fallback")), before, after


def _four(attribute: Usd.Attribute | None, time: Usd.TimeCode, fallback: tuple[float, ...]) -> Gf.Vec4f:
    """The four numbers of an attribute, or the fallback."""
    is_value = attribute is not None and not UsdShade.Output.IsOutput(attribute)
    value = floats(attribute.Get(time)) if is_value and attribute is not None else None
    return Gf.Vec4f(*(value if value and len(value) == 4 else fallback))


def path_of_copy(stage: Usd.Stage, shader: UsdShade.Shader, edit: InputEdit, is_foreign: bool = False) -> Sdf.Path:
    """Returns where a texture node of its own for an input goes; empty where it needs none.

    It needs one where another input reads the same channels of the node, or where that is foreign: another
    material shows it too, or it stands in none.
    """
    texture = driving_prim(shader, edit.input)
    if not is_foreign and not _is_shared(stage, shader, edit, texture.GetPath()):
        return Sdf.Path.emptyPath
    return new_node_path(shader, f"slf_{texture.GetName()}_{edit.input}")


def new_node_path(shader: UsdShade.Shader, name: str) -> Sdf.Path:
    """Returns the path of a new node beside a shader: in its material or node graph, not in a plain scope."""
    home = shader.GetPrim().GetParent()
    while not (UsdShade.ConnectableAPI(home) and UsdShade.ConnectableAPI(home).IsContainer()):
        home = home.GetParent()
    return home.GetPath().AppendChild(name)


def _is_shared(stage: Usd.Stage, shader: UsdShade.Shader, edit: InputEdit, texture: Sdf.Path) -> bool:
    """Whether another input takes one of the edit's channels from the same texture node."""
    channels = set(edit.channels)
    mine = shader.GetPath().AppendProperty(f"inputs:{edit.input}")
    for port in _inputs_of(stage, shader.GetPrim()):
        if port.GetAttr().GetPath() == mine:
            continue
        for source in port.GetValueProducingAttributes():
            taken = set(source.GetBaseName()) if UsdShade.Output.IsOutput(source) else set()
            if source.GetPrim().GetPath() == texture and taken & channels:
                return True
    return False


def map_primvar(
    shader: UsdShade.Shader, edit: InputEdit, time: Usd.TimeCode
) -> tuple[tuple[Sdf.Path, Sdf.ValueTypeName, Any], tuple[Sdf.Path, Sdf.ValueTypeName, Any, Any]]:
    """Finds the UsdPrimvarReader of an input.

    Returns path, type and value of its varname, and path, type, value before and after of its fallback.
    """
    reader = UsdShade.Shader(driving_prim(shader, edit.input))
    attribute, path, _ = input_place(reader, "varname")
    kind = attribute.GetTypeName() if attribute is not None else Sdf.ValueTypeNames.String
    varname = (path, kind, attribute.Get(time) if attribute is not None else None)
    attribute, path, _ = input_place(reader, "fallback")
    size = len(edit.scale)
    default = Sdf.ValueTypeNames.Float3 if size == 3 else Sdf.ValueTypeNames.Float
    kind = attribute.GetTypeName() if attribute is not None else default
    kind = kind if holds(kind, size) else default
    given = floats(attribute.Get(time)) if attribute is not None else None
    given = (given if len(given) >= size else given[:1] * size)[:size] if given else (0.0,) * size
    before = as_attribute(given if size > 1 else given[0], kind)
    mapped = np.asarray(given) * edit.scale + edit.bias
    after = as_attribute(tuple(mapped) if size > 1 else float(mapped[0]), kind)
    return varname, (path, kind, before, after)


def as_attribute(
    value: Any, kind: Sdf.ValueTypeName, attribute: Usd.Attribute | None = None, color: Color | None = None
) -> Any:
    """Returns a value of the edits as the attribute's type and colour space want it."""
    if isinstance(value, tuple):
        if color is not None and attribute is not None:
            space = str(Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, None))
            if space and color.knows(space):
                value = tuple(float(x) for x in color.from_working([value], space)[0])
        python = kind.type.pythonClass or Gf.Vec3f
        rest = () if python.dimension == len(value) else (1.0,) * (python.dimension - len(value))
        return python(*(float(x) for x in (*value, *rest)))
    if kind in (Sdf.ValueTypeNames.Int, Sdf.ValueTypeNames.Bool):
        return bool(value) if kind == Sdf.ValueTypeNames.Bool else int(value)
    return float(np.float32(value))


def same_value(a: Any, b: Any) -> bool:
    """Whether two values are the same in float32."""
    if a is None or b is None or isinstance(a, str) or isinstance(b, str):
        return a == b
    if isinstance(a, Sdf.AssetPath) and isinstance(b, Sdf.AssetPath):  # one of them may not be resolved
        return a.path == b.path
    try:
        x, y = np.asarray(a, np.float64), np.asarray(b, np.float64)
    except (TypeError, ValueError):  # arrays of strings
        return bool(a == b)
    return x.shape == y.shape and bool(np.allclose(x, y, rtol=1e-6, atol=1e-7, equal_nan=True))
