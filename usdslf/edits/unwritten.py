"""Unwritten: a scene under solved changes before a look says them, for who looks at it at once.

    materials_under(changes, scene) -> list[Material] | None

What a look would write is put into the materials' records: constants, and scale and bias of textures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from usdslf.edits.edits import InputEdit, MaterialChange, material_change_to_input_edits
from usdslf.errors import AuthorError
from usdslf.scene.records import Material, Scene, Texture, constant

_FIELDS = {"diffuseColor": "diffuse_color", "specularColor": "specular_color"}


def materials_under(changes: Sequence[MaterialChange], scene: Scene) -> list[Material] | None:
    """Returns a scene's materials under changes; those that stay are the same objects.

    Args:
        changes: of its materials.

    Returns: None where records of whole materials cannot say them: a part of what shows one, baked textures, values at
        points, primvars, a material that cannot be edited.
    """
    materials = list(scene.materials)
    for change in changes:
        number = next((i for i, m in enumerate(scene.materials) if m is change.material), None)
        if number is None or not _is_whole(change, scene, number):
            return None
        try:
            edits = material_change_to_input_edits(change)
        except AuthorError:
            return None
        values = dict[str, Any]()
        for edit in edits:
            value = _value_under(edit, getattr(change.material, _FIELDS.get(edit.input, edit.input), None))
            if value is None:
                return None
            values |= value
        materials[number] = replace(materials[number], **values)
    return materials


def _is_whole(change: MaterialChange, scene: Scene, number: int) -> bool:
    """Whether all that shows a material changes, by few numbers."""
    is_even = not (change.baked or change.by_vertex or change.faces)
    return is_even and change.scope != "stroke" and set(scene.shown_on(number)) <= set(change.targets)


def _value_under(edit: InputEdit, value: Any) -> dict[str, Any] | None:
    """The field of a Material that an edit changes, with its new value; None: no record says it."""
    name = _FIELDS.get(edit.input, edit.input)
    if edit.input == "useSpecularWorkflow":
        return {"use_specular_workflow": bool(edit.after)}
    if edit.representation == "constant":
        after = edit.after if isinstance(edit.after, tuple) else (edit.after,)
        return {name: constant(*after)}
    if edit.representation != "scale" or not isinstance(value, Texture):
        return None
    places = range(3) if value.channels == "rgb" else ["rgba".index(value.channels)]
    scale, bias = np.array(value.scale), np.array(value.bias)
    for place, by, more in zip(places, edit.scale, edit.bias, strict=True):
        scale[place], bias[place] = scale[place] * by, bias[place] * by + more
    # as layers hold them, in single precision
    (a, b, c, d), (e, f, g, h) = (x.astype(np.float32).tolist() for x in (scale, bias))
    return {name: replace(value, scale=(a, b, c, d), bias=(e, f, g, h))}
