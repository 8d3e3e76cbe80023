"""Representations: of the ways to write one change of a material, the one that changes least beside it.

    least_collateral(scene, material, change, place, color, warnings) -> MaterialChange

The first of these that keeps all that was not freed, else the one that changes least of it:

    as usual      constants, and a scale and bias of maps (edits.py)
    own kind      diffuseColor as a texture of its own: of what is metal where metal was painted, else of what is none
    whole set     diffuseColor and specularColor as textures: the specular workflow, which says any F0 at any texel

What a representation changes is computed at places all over the material, before anything is written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color
from usdslf.edits.collateral import RAMP, TOLERANCE, excess_of, parameters_of, somewhere, summed_up
from usdslf.edits.edits import InputEdit, MaterialChange, inputs_before, material_change_to_input_edits, moves_of
from usdslf.edits.moves import DARK
from usdslf.edits.whole_set import Colors, Make, bake_set, why_no_set
from usdslf.errors import AuthorError
from usdslf.scene.records import F64, Scene, Texture
from usdslf.surfaces.preview_surface import ior_for, normal_reflectance
from usdslf.surfaces.surface_points import MIN_ROUGHNESS, SurfacePoints, evaluate_surface, reflectance_at

MOSTLY = 0.1  # metallic below which what was painted is no metal, and as near to 1 a metal
BETTER = 0.5  # of the collateral as usual, for another way to be worth its textures
WHOLE = TOLERANCE  # of collateral, that a whole set has to save: it leaves F90 white, and two textures for one
GREY = 0.01  # of F0 between channels, that an ior leaves out


@dataclass(frozen=True)
class _Way:
    """One way to write a change: what gets textures, at any colours, and constants beside them."""

    make: Make | None = None  # None: as usual
    values: Mapping[str, float] = field(default_factory=dict)
    price: float = 0.0  # collateral that it has to save


def least_collateral(
    scene: Scene, material: int, change: MaterialChange, place: Path, color: Color, warnings: list[str]
) -> MaterialChange:
    """Returns a change with the textures of the best way to write it.

    Args:
        material: into scene.materials; that of the change.
        change: of one offset, or factor, for all that shows the material.
        place: of textures, without the name of an input.
        warnings: takes a sentence where maps get textures of their own.

    Raises: AuthorError where no way keeps the meaning of the maps, or a texture cannot be written.
    """
    m = change.material
    driven = any(isinstance(v, Texture) for v in (m.diffuse_color, m.metallic, m.ior))
    if m.why_not_editable or {*change.baked, *change.by_vertex} - {"roughness"} or not driven:
        return change  # what constants say, they say at every place
    x, moves = _seen(scene, material, change), moves_of(change)
    before = parameters_of(x, scene.materials)
    found: list[tuple[float, _Way]] = []
    refused: AuthorError | None = None
    for way in _ways(change):
        try:
            after = before | _foreseen(change, way, x)
        except AuthorError as error:
            refused = error
            continue
        found.append((summed_up(m.path, excess_of(before, after, moves)).worst, way))
        if found[-1][0] <= TOLERANCE:
            break
    if not found:
        assert refused is not None
        raise AuthorError(f"{refused}; {why_no_set(m)}" if why_no_set(m) else str(refused)) from None
    worst, best = min(found, key=lambda each: each[0] + each[1].price)
    if found[0][1].make is None and worst > BETTER * found[0][0]:
        best = found[0][1]
    if best.make is None:
        return change
    baked = bake_set(m, best.make, place, color)
    get = "get textures of their own" if len(baked) > 1 else "gets a texture of its own"
    warnings.append(f"{m.path}: {' and '.join(baked)} {get}, so that its maps keep their meaning")
    return replace(change, baked={**change.baked, **baked}, values=best.values)


def _seen(scene: Scene, material: int, change: MaterialChange) -> SurfacePoints:
    """Places all over what is to show the change."""
    table = scene.triangles
    shown = table.material == material
    mine = shown & np.array([mesh.path in change.targets for mesh in scene.meshes], bool)[table.mesh]
    return evaluate_surface(scene, *somewhere(scene, np.flatnonzero(mine if mine.any() else shown)), normal_maps=False)


def _ways(change: MaterialChange) -> Iterator[_Way]:
    """The ways to write a change, the plainest first."""
    yield _Way()
    if not {"diffuse", "specular"} & set(change.freed) or why_no_set(change.material):
        return
    before, opacity = inputs_before(change)
    painted, m = before.metallic, change.material
    is_metal, is_none = painted > 1 - MOSTLY, painted < MOSTLY
    of_diffuse, of_f0 = _Shift.of(change, "diffuse", opacity), _Shift.of(change, "specular")

    def none(c: Colors) -> F64:  # how much of what is no metal a place has, beside what was painted
        return np.minimum((1 - c.metallic) / max(1 - painted, MOSTLY), 1)

    def metal(c: Colors) -> F64:
        return np.minimum(c.metallic / max(painted, MOSTLY), 1)

    share = metal if is_metal else none if is_none else lambda c: np.ones_like(c.metallic)
    if is_metal and "diffuse" not in change.freed:
        yield _Way(lambda c: {"diffuseColor": of_f0.moved(c.base, metal(c) ** 2)})
    coated = not isinstance(m.clearcoat, np.ndarray) or float(m.clearcoat[0]) > 0
    says_f0 = isinstance(m.ior, np.ndarray) and not coated and of_f0.is_grey
    if is_none and "diffuse" in change.freed and ("specular" not in change.freed or says_f0):
        ior = {"ior": of_f0.of_ior(before.ior)} if "specular" in change.freed else {}
        yield _Way(lambda c: {"diffuseColor": of_diffuse.moved(c.base, none(c) ** 2)}, ior)
    yield _Way(
        lambda c: {
            "diffuseColor": of_diffuse.moved(c.diffuse, none(c)), "specularColor": of_f0.moved(c.f0, share(c)),
        },
        price=WHOLE,
    )  # fmt: skip


@dataclass(frozen=True)
class _Shift:
    """The change of one colour (3,): an offset, or a factor."""

    offset: F64
    factor: F64

    @staticmethod
    def of(change: MaterialChange, parameter: str, opacity: float = 1.0) -> _Shift:
        """That of a parameter, none where it was not freed.

        Args:
            opacity: that the means were multiplied with.
        """
        if parameter not in change.freed:
            return _Shift(np.zeros(3), np.ones(3))
        name = {"diffuse": "diffuse", "specular": "f0"}[parameter]
        before, after = getattr(change.before, name), getattr(change.after, name)
        is_factor = (change.map == "multiply") & (before > DARK)
        factor = np.where(is_factor, after / np.maximum(before, DARK), 1.0)
        return _Shift(np.where(is_factor, 0.0, after - before) / opacity, factor)

    def moved(self, color: F64, share: F64) -> F64:
        """Returns colours (n, 3) with a share (n, 1) of the change."""
        return np.clip(color + (color * self.factor + self.offset - color) * share, 0, 1)

    @property
    def is_grey(self) -> bool:
        """Whether all channels change by the same."""
        return bool(np.ptp(self.offset) <= GREY and np.ptp(self.factor) <= GREY)

    def of_ior(self, ior: float) -> float:
        """Returns an ior with the change of the reflectance."""
        r2 = float(np.mean(self.moved(np.full((1, 3), normal_reflectance(ior)), np.ones((1, 1)))))
        return float(ior_for(min(r2, 0.99)))


def _foreseen(change: MaterialChange, way: _Way, x: SurfacePoints) -> dict[str, NDArray]:
    """The parameters at n places, of those that may change, as a way would write them.

    Raises: AuthorError where it cannot.
    """
    m = change.material
    is_specular = m.use_specular_workflow
    inputs: dict[str, NDArray] = {
        "diffuseColor": x.base_color, "metallic": x.metallic[:, None], "ior": x.ior[:, None],
        "specularColor": x.specular_color, "roughness": x.roughness[:, None],
    }  # fmt: skip
    if way.make is None:
        edits = [e for e in material_change_to_input_edits(change) if e.baked is None and e.by_vertex is None]
        is_specular = is_specular or any(e.input == "useSpecularWorkflow" for e in edits)
        inputs = inputs | {e.input: _written(e, inputs[e.input]) for e in edits if e.input in inputs}
    else:
        colors = Colors(*(inputs[name].astype(np.float64) for name in ("diffuseColor", "metallic", "ior")))
        made = way.make(colors)
        is_specular = is_specular or "specularColor" in made
        inputs = inputs | dict(made) | {name: np.full((len(x.ior), 1), v) for name, v in way.values.items()}
    base, specular = np.maximum(inputs["diffuseColor"], 0), np.clip(inputs["specularColor"], 0, 1)
    metallic, ior = np.clip(inputs["metallic"][:, 0], 0, 1), np.maximum(inputs["ior"][:, 0], 1e-3)
    d, f0, f90, r2 = reflectance_at(np.full(len(ior), is_specular), base, specular, metallic, ior)
    coat = x.clearcoat.astype(np.float64)
    found = {
        "diffuse": d, "specular": f0, "grazing": RAMP * f90 * np.ones_like(f0),
        "coat": np.stack([coat * r2, coat * x.clearcoat_roughness], 1),
    }  # fmt: skip
    if way.make is None:
        found["roughness"] = np.clip(inputs["roughness"], MIN_ROUGHNESS, 1)
    return found


def _written(e: InputEdit, value: NDArray) -> NDArray:
    """The values (n, C) of an input with an edit."""
    if e.scale:
        return value * np.array(e.scale) + np.array(e.bias)
    return np.broadcast_to(np.asarray(e.after, np.float64), value.shape)
