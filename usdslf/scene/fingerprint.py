"""Fingerprint: a name of records by all that they hold, so that what is computed from equal ones is found again.

    digest(values, of_file) -> str        the same for equal values, on any machine
    geometry_of(scene), appearance_of(scene) -> what elements and rays depend on, what light and reflectance do beside

Files stand for their contents, wherever they lie and whenever they were written.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from usdslf.runs import distinct
from usdslf.scene.records import LightTexture, Scene, Texture

OfFile = Callable[[str], bytes]
"""Path of a file, also within a package -> a name of its contents."""

_NAMES = {Texture: ("prim",), LightTexture: ()}  # fields that do not change what is computed


def digest(value: Any, of_file: OfFile) -> str:
    """Names a value: records, mappings, sequences, arrays, texts and numbers of any depth.

    Args:
        value: arrays are told apart by dtype and shape too; files of textures count by their contents.
        of_file: names the contents of a file.

    Returns: 40 hexadecimal digits.

    Raises: TypeError for an object of another kind, which has no value of its own.
    """
    code = hashlib.blake2b(digest_size=20)
    _add(code, value, of_file)
    return code.hexdigest()


def geometry_of(scene: Scene) -> tuple[Any, ...]:
    """Returns what rays and what they meet depend on: triangles, and how far materials are seen through."""
    t = scene.triangles
    clear = [i for i, m in enumerate(scene.materials) if not m.is_opaque]
    seen_through = distinct(t.mesh[np.isin(t.material, clear)])
    return (
        (t.positions, t.normals, t.mesh, t.material, t.first_of_mesh, scene.origin),
        [(m.opacity, m.opacity_threshold, m.opacity_mode) for m in scene.materials],
        [(scene.meshes[i].uvs, scene.meshes[i].primvars) for i in seen_through],
    )


def appearance_of(scene: Scene) -> tuple[Any, ...]:
    """Returns all of a scene that light depends on beside its geometry: lights, materials and what they read."""
    meshes = [(m.uvs, m.primvars, m.double_sided) for m in scene.meshes]
    materials = [
        {f.name: getattr(m, f.name) for f in fields(m) if f.name not in ("path", "shader", "why_not_editable")}
        for m in scene.materials
    ]
    lights = [{f.name: getattr(x, f.name) for f in fields(x) if f.name != "path"} for x in scene.lights]
    return meshes, materials, lights, scene.up_axis, scene.meters_per_unit, scene.working_space


def _add(code: Any, value: Any, of_file: OfFile) -> None:
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        code.update(f"a{array.dtype.str}{array.shape}".encode())
        code.update(array.data.cast("B") if array.size else b"")
    elif isinstance(value, Texture):
        tiles = [(number, of_file(file)) for number, file in value.tiles]
        read = {"path": b"" if tiles else of_file(value.path), "tiles": tiles}
        _add(code, _named(value, read), of_file)
    elif isinstance(value, LightTexture):
        _add(code, _named(value, {"path": of_file(value.path)}), of_file)
    elif is_dataclass(value) and not isinstance(value, type):
        _add(code, _named(value, {}), of_file)
    elif isinstance(value, Mapping):
        code.update(f"m{len(value)}".encode())
        for key in sorted(value):
            _add(code, key, of_file)
            _add(code, value[key], of_file)
    elif isinstance(value, (tuple, list)):
        code.update(f"s{len(value)}".encode())
        for item in value:
            _add(code, item, of_file)
    elif isinstance(value, bytes):
        code.update(f"b{len(value)} ".encode() + value)
    elif value is None or isinstance(value, (str, int, float, bool, np.generic, Enum)):
        text = repr(value.item() if isinstance(value, np.generic) else value).encode()
        code.update(f"v{len(text)} ".encode() + text)
    else:
        raise TypeError(f"{type(value).__name__} has no fingerprint")


def _named(record: Any, read: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a record that count, some of them as they were read, and its kind."""
    left = _NAMES.get(type(record), ())
    values = {f.name: getattr(record, f.name) for f in fields(record) if f.name not in left}
    return {**values, **read, "": type(record).__name__}
