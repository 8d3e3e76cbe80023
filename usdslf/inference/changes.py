"""Changes: what was solved or stylized -> the change of each material, with the textures of what varies.

changes_of(answers, scene, strokes, field, mode) -> list[MaterialChange]
restyled(styles, scene) -> list[MaterialChange]
with_varying(changes, answers, scene, folder, color, warnings) -> list[MaterialChange]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from usdslf.color import Color
from usdslf.edits.baked_texture import Baked
from usdslf.edits.collateral import somewhere
from usdslf.edits.edits import InputEdit, MaterialChange, Reflectance, material_change_to_input_edits
from usdslf.edits.moves import NAMES, Move
from usdslf.edits.representations import least_collateral
from usdslf.edits.storage import input_values, storage_of, store
from usdslf.errors import AuthorError
from usdslf.inference.alternatives import alternatives_of
from usdslf.inference.answers import Answer, means_of_similar
from usdslf.inference.candidate import Candidate
from usdslf.inference.varying import Varying, as_even
from usdslf.light_field.light_field import LightField
from usdslf.scene.records import Scene
from usdslf.similarity.similarity import places_at
from usdslf.strokes.anchors import locate_stroke, painted_faces
from usdslf.strokes.stroke import Stroke

SCALED_WELL = 0.02  # of a reflectance, root mean square, that scale and bias of a texture may be off
PLACES = 2000  # that are looked at for it


def changes_of(
    answers: Sequence[Answer], scene: Scene, strokes: Sequence[Stroke], field: LightField, mode: str = ""
) -> list[MaterialChange]:
    """Returns the changes of answers, in their order, then those of what is alike.

    Args:
        strokes: the active ones.
        field: with the reflectance of before.
        mode: `new` is of painted gprims only.
    """
    freed = [a for a in answers if a.chosen.freed]
    changes = [_change(a, scene, strokes, mode) for a in freed]
    if mode == "new":
        return changes
    return changes + [_similar_change(a, m, scene, strokes, field) for a, m, _ in _further(freed)]


def _change(answer: Answer, scene: Scene, strokes: Sequence[Stroke], mode: str) -> MaterialChange:
    pool, table = answer.pool, scene.triangles
    shown = np.unique(table.mesh[table.material == pool.material])
    targets = pool.targets or tuple(scene.meshes[m].path for m in shown)
    faces: dict[str, tuple[int, ...]] = {}
    if pool.scope == "stroke" or (mode == "new" and not pool.targets):
        for i in pool.strokes:
            found = painted_faces(scene, strokes[i], locate_stroke(scene, strokes[i]))
            for gprim, painted in found.items():
                faces[gprim] = tuple(sorted({*faces.get(gprim, ()), *painted}))
    if mode == "new" and not pool.targets:
        targets, faces = tuple(p for p in targets if p in faces), {}
    return MaterialChange(
        material=scene.materials[pool.material],
        scope=pool.scope,
        targets=targets,
        freed=answer.chosen.freed,
        before=Reflectance.of(answer.before),
        after=Reflectance.of(answer.after),
        strokes=tuple(strokes[i].path for i in pool.strokes),
        faces=faces,
        map="multiply" if answer.chosen.is_factor or answer.chosen.roughness_mean else "auto",
        residual_before=answer.residual_before,
        residual_after=answer.residual_after,
        alternatives=tuple(alternatives_of(answer)),
    )


def _similar_change(
    answer: Answer, material: int, scene: Scene, strokes: Sequence[Stroke], field: LightField
) -> MaterialChange:
    """The change of a material that is similar to what an answer's strokes were painted on."""
    before, after = means_of_similar(answer, material, field)
    return MaterialChange(
        material=scene.materials[material],
        scope="material",
        targets=scene.shown_on(material),
        freed=answer.chosen.freed,
        before=Reflectance.of(before),
        after=Reflectance.of(after),
        strokes=tuple(strokes[i].path for i in answer.pool.strokes),
        map="multiply" if answer.chosen.is_factor or answer.chosen.roughness_mean else "auto",
    )


def with_varying(
    changes: list[MaterialChange], answers: Sequence[Answer], scene: Scene, folder: Path, color: Color,
    warnings: list[str],
) -> list[MaterialChange]:  # fmt: skip
    """Gives changes that vary over surfaces their textures, or values at points.

    So too a constant change that scale and bias of a texture cannot say: one that is cut off at black or white.

    Args:
        changes: of `changes_of(answers, ...)`.
        folder: of the textures.
        warnings: takes what is odd about the textures.
    """
    freed = [a for a in answers if a.chosen.freed]
    all_of_them = [*((a, a.pool.material, a.varying) for a in freed), *_further(freed)]
    found = []
    for i, (c, (a, m, v)) in enumerate(zip(changes, all_of_them)):  # of mode `new` there are no further ones
        try:
            if v:
                found.append(_varied(c, m, v, scene, folder, color, warnings))
                continue
            exact = _exact(c, m, a.chosen, scene, folder, color, warnings)
            stem = folder / c.material.path.rsplit("/", 1)[-1]
            found.append(least_collateral(scene, m, exact, stem, color, warnings))
        except AuthorError as error:
            if i < len(freed):
                raise
            warnings.append(str(error))  # what is similar stays as it is
    return found


def _further(answers: list[Answer]) -> list[tuple[Answer, int, Varying | None]]:
    """What is similar: the answer, a material that changes with it, and how, where not by the mean."""
    found: list[tuple[Answer, int, Varying | None]] = []
    for a in answers:
        found += [(a, m, None) for m in a.pool.similar]
        found += [(a, m, a.onto_similar) for m in a.pool.similar_in_part]
    return found


def _varied(
    change: MaterialChange, material: int, varying: Varying, scene: Scene, folder: Path, color: Color,
    warnings: list[str],
) -> MaterialChange:  # fmt: skip
    if not varying.is_even:
        change = replace(change, moves={NAMES[varying.parameter]: _move_of(varying)})
    storage = storage_of(scene, material, change.targets, varying)
    if storage.why_not:  # the light that goes round moved it from where it could be stored
        warnings.append(f"{scene.materials[material].path}: {storage.why_not}; its change is written as its mean")
        return change
    found = store(scene, storage, varying, folder, color, warnings)
    if isinstance(found, Baked):
        return replace(change, baked={storage.input: found})
    return replace(change, by_vertex={storage.input: found})


def _move_of(v: Varying) -> Move:
    """How far a change that varies is meant to go: as far as at its dabs, by terms or by factors."""
    if v.form == "value":  # it takes the place of a texture
        return Move((-1.0,), (1.0,))
    move = Move.within(v.of_dabs())
    if v.form != "factor":
        return move
    low, high = np.minimum(v.q.min(0), 0), np.maximum(v.q.max(0), 0)
    return replace(move, least=tuple((1 + low).tolist()), most=tuple((1 + high).tolist()))


def _exact(
    change: MaterialChange, material: int, chosen: Candidate, scene: Scene, folder: Path, color: Color,
    warnings: list[str],
) -> MaterialChange:  # fmt: skip
    """The change by a bias, else with a texture of its own, where its usual map is too far off what was found."""
    try:
        edits = material_change_to_input_edits(change) if len(chosen.freed) == 1 else []
    except AuthorError:  # there may be another way
        return change
    if len(edits) != 1 or edits[0].representation != "scale":
        return change
    even = as_even(chosen)
    storage = storage_of(scene, material, change.targets, even)
    if storage.why_not or storage.triangles is None or storage.input != edits[0].input:
        return change
    before, after = input_values(
        scene.materials[material], storage.input, even, places_at(scene, *somewhere(scene, storage.triangles, PLACES))
    )

    def off_by(edit: InputEdit) -> float:
        mapped = before * np.array(edit.scale) + np.array(edit.bias)
        return float(np.sqrt(np.mean((mapped - after) ** 2)))

    off = off_by(edits[0])
    if off <= SCALED_WELL:
        return change
    by_bias = replace(change, map="add")
    if off_by(*material_change_to_input_edits(by_bias)) <= SCALED_WELL:
        return by_bias
    warnings.append(
        f"{change.material.path}: {storage.input} gets a texture of its own; a scale and a bias would be {off:.2f} off"
    )
    return _varied(change, material, even, scene, folder, color, warnings)
