"""Writes a look as a UsdPreviewSurface with its textures and primvar readers, into a look layer.

    write_preview(look_layer, path, look, folder) -> None     what the layer says there already stays
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf

from usdslf.usd.files import relative_path
from usdslf.usd.layer.look_layer import LookLayer
from usdslf.usd.preview.coordinates import AS_IT_IS, as_transform_2d
from usdslf.usd.preview.driven import Driven, Image
from usdslf.usd.preview.preview_look import MODES, Look

Names = Sdf.ValueTypeNames
_KINDS = {
    "diffuseColor": Names.Color3f, "specularColor": Names.Color3f, "emissiveColor": Names.Color3f,
    "normal": Names.Normal3f,
    "useSpecularWorkflow": Names.Int, "opacityMode": Names.Token,
}  # fmt: skip
_OWN_SPACES = ("auto", "raw", "sRGB")  # of sourceColorSpace


def write_preview(look: LookLayer, path: Sdf.Path, shows: Look, folder: Path | None) -> None:
    """Defines a Material that shows a look.

    Args:
        look: the layer.
        path: of the new Material.
        shows: what drives the inputs of its UsdPreviewSurface.
        folder: that files are named from; None names them from the root.
    """
    if not look.stage.GetPrimAtPath(path.GetParentPath()):
        look.define(path.GetParentPath(), "Scope")
    material = look.define(path, "Material")
    shader = _node(look, path.AppendChild("surface"), "UsdPreviewSurface")
    _connect(material, "outputs:surface", Names.Token, _output(look, shader, "surface", Names.Token))
    for name, value in shows.items():
        kind = _KINDS.get(name, Names.Float)
        if value.source is None:
            _put_new(look, shader, f"inputs:{name}", kind, _value(name, value))
            continue
        write = _write_image if isinstance(value.source, Image) else _write_primvar
        _connect(shader, f"inputs:{name}", kind, write(look, path, name, value, folder))


def _value(name: str, value: Driven) -> Any:
    if name == "opacityMode":
        return MODES[int(value.bias[0])]
    if name == "useSpecularWorkflow":
        return int(value.bias[0])
    return Gf.Vec3f(*value.bias) if value.size == 3 else float(np.float32(value.bias[0]))


def _write_primvar(look: LookLayer, path: Sdf.Path, name: str, value: Driven, folder: Path | None) -> Sdf.Path:
    is_color = value.size == 3
    reader = _node(look, path.AppendChild(f"{name}_primvar"), f"UsdPrimvarReader_float{'3' if is_color else ''}")
    kind = Names.Float3 if is_color else Names.Float
    _put_new(look, reader, "inputs:varname", Names.String, value.source)
    _put_new(look, reader, "inputs:fallback", kind, Gf.Vec3f(*value.fallback) if is_color else value.fallback[0])
    return _output(look, reader, "result", kind)


def _write_image(look: LookLayer, path: Sdf.Path, name: str, value: Driven, folder: Path | None) -> Sdf.Path:
    image = value.source
    assert isinstance(image, Image)
    node = _node(look, path.AppendChild(f"{name}_texture"), "UsdUVTexture")
    is_new = "inputs:file" not in node.attributes
    file = relative_path(image.file, folder) if folder and os.path.isabs(image.file) else image.file
    _put_new(look, node, "inputs:file", Names.Asset, Sdf.AssetPath(file))
    if image.color_space in _OWN_SPACES:
        _put_new(look, node, "inputs:sourceColorSpace", Names.Token, image.color_space)
    elif is_new:
        node.attributes["inputs:file"].colorSpace = image.color_space
    for axis, wrap in zip("ST", image.wrap):
        _put_new(look, node, f"inputs:wrap{axis}", Names.Token, wrap)
    scale, bias, fallback = [1.0] * 4, [0.0] * 4, list(image.fallback)
    for channel, s, b, best in zip(value.channels, value.scale, value.bias, value.best_number):
        at = "rgba".index(channel)
        scale[at], bias[at], fallback[at] = s, b, best
    if scale != [1.0] * 4:
        _put_new(look, node, "inputs:scale", Names.Float4, Gf.Vec4f(*scale))
    if bias != [0.0] * 4:
        _put_new(look, node, "inputs:bias", Names.Float4, Gf.Vec4f(*bias))
    _put_new(look, node, "inputs:fallback", Names.Float4, Gf.Vec4f(*fallback))
    _connect(node, "inputs:st", Names.Float2, _write_coordinates(look, path, name, image))
    if value.size == 3:
        return _output(look, node, "rgb", Names.Float3)
    return _output(look, node, value.channels, Names.Float)


def _write_coordinates(look: LookLayer, path: Sdf.Path, name: str, image: Image) -> Sdf.Path:
    reader = _node(look, path.AppendChild(f"{name}_st"), "UsdPrimvarReader_float2")
    _put_new(look, reader, "inputs:varname", Names.String, image.uv_set)
    output = _output(look, reader, "result", Names.Float2)
    found = as_transform_2d(image.st_from_uv)
    if image.st_from_uv == AS_IT_IS or found is None:
        return output
    scale, rotation, translation = found
    transform = _node(look, path.AppendChild(f"{name}_transform"), "UsdTransform2d")
    _connect(transform, "inputs:in", Names.Float2, output)
    if not np.allclose(scale, 1):
        _put_new(look, transform, "inputs:scale", Names.Float2, Gf.Vec2f(*scale))
    if abs(rotation) > 1e-6:
        _put_new(look, transform, "inputs:rotation", Names.Float, rotation)
    if np.any(translation):
        _put_new(look, transform, "inputs:translation", Names.Float2, Gf.Vec2f(*translation))
    return _output(look, transform, "result", Names.Float2)


def _node(look: LookLayer, path: Sdf.Path, name: str) -> Sdf.PrimSpec:
    spec = look.define(path, "Shader")
    if "info:id" not in spec.attributes:
        attribute = Sdf.AttributeSpec(
            spec, "info:id", Names.Token, Sdf.VariabilityUniform, declaresCustom=False
        )
        attribute.default = name
    return spec


def _output(look: LookLayer, spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName) -> Sdf.Path:
    if f"outputs:{name}" not in spec.attributes:
        Sdf.AttributeSpec(spec, f"outputs:{name}", kind, declaresCustom=False)
    return spec.path.AppendProperty(f"outputs:{name}")


def _put_new(look: LookLayer, spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, value: Any) -> None:
    if name not in spec.attributes:
        look.put(spec, name, kind, value)


def _connect(spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, source: Sdf.Path) -> None:
    if name in spec.attributes:
        return
    attribute = Sdf.AttributeSpec(spec, name, kind, declaresCustom=False)
    attribute.connectionPathList.ClearEditsAndMakeExplicit()
    attribute.connectionPathList.explicitItems = [source]
