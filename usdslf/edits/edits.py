"""Edits: before and after of each material input that a solved change needs, without USD.

    Reflectance(diffuse (3,), f0 (3,), roughness)                     float64 means over the painted area
    MaterialChange(material, scope, targets, freed, before, after, strokes, ...)
    InputEdit(material, input, before, after, representation, ...)
    material_change_to_input_edits(change) -> list[InputEdit]         sparse, by the workflow rule
    inferred(freed) -> str                                            "diffuse+glossiness", "none"

The workflow rule: useSpecularWorkflow stays 0 while diffuseColor, metallic, roughness and ior can say the
change; else the whole equivalent set of the specular workflow is written (preview_surface.py), as constants where F0
is one, else as textures (whole_set.py).  An input that a texture or primvar drives keeps its detail: the change is an
affine map value * scale + bias that takes the mean to what was solved and 0..1 into 0..1.  A metallic that is driven
keeps its meaning: what is metal stays metal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.edits.explanation import Explanation
from usdslf.edits.moves import DARK, NAMES, Move
from usdslf.errors import AuthorError
from usdslf.scene.records import F64, Input, Material, PrimvarInput, Texture
from usdslf.surfaces.preview_surface import SurfaceInputs, error_of, inputs_for, reflectance_of
from usdslf.surfaces.reflectance import NO_DIFFUSE
from usdslf.surfaces.surface_points import MIN_ROUGHNESS

if TYPE_CHECKING:
    from usdslf.edits.baked_texture import Baked

FREED = ("diffuse", "specular", "glossiness")
# Of the reflectance: constants are met exactly or not at all; through a textured metallic only means are.
TOLERANCE, TOLERANCE_TEXTURED = 0.005, 0.03
_OF_REFLECTANCE = {"diffuse": "diffuse", "specular": "f0", "glossiness": "roughness"}  # freed -> its field
SAME = 1e-5  # a change below this is none
Value = tuple[float, ...] | float | int


@dataclass(frozen=True)
class Reflectance:
    """Mean reflectance over a painted area."""

    diffuse: F64  # (3,) d
    f0: F64  # (3,) at normal incidence
    roughness: float  # the input, not alpha

    @classmethod
    def of(cls, values: Mapping[str, NDArray]) -> Reflectance:
        """The record of means `diffuse`, `specular` (3,) and `roughness` (1,)."""
        return cls(values["diffuse"], values["specular"], float(values["roughness"][0]))


@dataclass(frozen=True)
class ByVertex:
    """Values of an input that vary over gprims without texture coordinates: one at each of their points."""

    before: tuple[float, ...]  # the constant that they replace
    after: tuple[float, ...]  # mean
    at: Callable[[str, F64], F64]  # gprim, its points (V, 3) in the world -> values (V, channels)
    frame: float = float("nan")  # at which the points are in that place; nan: default time


@dataclass(frozen=True)
class MaterialChange:
    """A solved change of one material."""

    material: Material
    scope: str  # material | prim | stroke
    targets: tuple[str, ...]  # gprims or GeomSubsets that show the change
    freed: tuple[str, ...]  # of FREED: what else in `after` is not looked at
    before: Reflectance
    after: Reflectance
    strokes: tuple[str, ...] = ()  # paths in the stroke layer
    faces: Mapping[str, tuple[int, ...]] = field(default_factory=dict)  # gprim -> painted faces
    # What is not needed, but makes the edit of a textured input more exact.  By input name:
    means: Mapping[str, ArrayLike] = field(default_factory=dict)  # mean over the painted area
    highest: Mapping[str, float] = field(default_factory=dict)  # highest value of any channel
    baked: Mapping[str, Baked] = field(default_factory=dict)  # by input name: instead of one value for all points
    by_vertex: Mapping[str, ByVertex] = field(default_factory=dict)  # by input name, where there are no coordinates
    values: Mapping[str, float] = field(default_factory=dict)  # constants that go with a whole set of textures
    moves: Mapping[str, Move] = field(default_factory=dict)  # what is meant by parameter, where means do not say it
    map: str = "auto"  # of textured inputs: auto | add (a bias) | multiply (a scale)
    residual_before: float = float("nan")
    residual_after: float = float("nan")
    alternatives: tuple[Explanation, ...] = ()  # the explanations that were weighed, this one too


@dataclass(frozen=True)
class InputEdit:
    """An opinion on one input: `after`, or value * scale + bias of what drives it now."""

    material: str  # path
    input: str  # without "inputs:"
    before: Value  # its value; the mean over the painted area where it is textured
    after: Value
    representation: str  # constant | scale | primvar | texture
    source: str = ""  # scale, texture: prim of the UsdUVTexture; primvar: name of the primvar
    channels: str = ""  # scale, texture: rgb | r | g | b | a
    scale: tuple[float, ...] = ()  # per channel of the input
    bias: tuple[float, ...] = ()
    baked: Baked | None = None  # texture
    by_vertex: ByVertex | None = None  # primvar without a source


def inferred(freed: tuple[str, ...]) -> str:
    """Returns what a change is made of, as reports name it."""
    return "+".join(name for name in FREED if name in freed) or "none"


def moves_of(change: MaterialChange) -> dict[str, Move]:
    """Returns what a change means to move, by parameter: what it says itself, else as its means do."""
    found = {}
    for name in change.freed:
        before, after = (np.atleast_1d(getattr(r, _OF_REFLECTANCE[name])) for r in (change.before, change.after))
        through = inputs_before(change)[1] if name == "diffuse" else 1.0
        found[NAMES[name]] = Move.of(before / through, np.clip(after / through, 0, 1), change.map == "multiply")
    return found | dict(change.moves)


def material_change_to_input_edits(change: MaterialChange) -> list[InputEdit]:
    """Says a solved change in the inputs of its UsdPreviewSurface; nothing for an input that stays as it is.

    Raises:
        AuthorError: the material cannot be edited, or the change is not finite.
    """
    m = change.material
    if m.why_not_editable:
        more = len(change.targets) - 3
        named = ", ".join(change.targets[:3]) + (f" and {more} more" if more > 0 else "")
        raise AuthorError(f"the material of {named} stays: {m.why_not_editable}")
    wanted = change.after
    if not np.isfinite([*wanted.diffuse, *wanted.f0, wanted.roughness]).all():
        raise AuthorError(f"the change of {m.path} is not finite: solve again with fewer strokes")
    before, opacity = inputs_before(change)
    d, f0 = reflectance_of(before)
    textured = any(_is_driven(v) for v in (m.diffuse_color, m.metallic, m.ior, m.specular_color))
    if "diffuse" in change.freed:
        # The solver's unknown is one change for all points: through textures that is what carries over.
        d = _carried_over(change, d, opacity) if textured else wanted.diffuse / opacity
    if "specular" in change.freed:
        f0 = f0 + (wanted.f0 - change.before.f0) if textured else wanted.f0
    d, f0 = np.clip(d, 0, 1), np.clip(f0, 0, 1)
    after = before
    if {"diffuse", "specular"} & set(change.freed):
        coated = not isinstance(m.clearcoat, np.ndarray) or float(m.clearcoat[0]) > 0
        tolerance = TOLERANCE_TEXTURED if _is_driven(m.metallic) else TOLERANCE
        becomes_metal = "diffuse" in change.freed and d.max() < NO_DIFFUSE  # all of it
        is_free = becomes_metal or not _is_driven(m.metallic)
        after = inputs_for(before, d, f0, tolerance, ior_is_free=not coated, metallic_is_free=is_free)
        if after.use_specular_workflow != before.use_specular_workflow and not _says_specular(change):
            _require_no_map_of_f0(change)

    edits = []
    if after.use_specular_workflow != before.use_specular_workflow:
        edits.append(InputEdit(m.path, "useSpecularWorkflow", 0, 1, "constant"))
        specular = _mean(change, "specularColor", m.specular_color)
        edits += _edit(change, "specularColor", m.specular_color, specular, after.specular_color)
    elif after.use_specular_workflow:
        edits += _edit(change, "specularColor", m.specular_color, before.specular_color, after.specular_color)
    edits += _edit(change, "diffuseColor", m.diffuse_color, before.diffuse_color, after.diffuse_color)
    if not after.use_specular_workflow:
        edits += _edit(change, "metallic", m.metallic, before.metallic, after.metallic)
        edits += _edit(change, "ior", m.ior, before.ior, after.ior)
    if "glossiness" in change.freed:
        rough = _mean(change, "roughness", m.roughness)
        rough = np.array([change.before.roughness]) if rough is None else rough
        if _is_driven(m.roughness):  # texels below the least roughness show as it: most of them are zero
            rough = np.where(rough <= MIN_ROUGHNESS * 1.0001, 0.0, rough)
        edits += _edit(change, "roughness", m.roughness, rough, np.clip(wanted.roughness, 0, 1))
    return _beside_varying(change, edits) + _baked_edits(change) + _vertex_edits(change)


def _says_specular(change: MaterialChange) -> bool:
    return bool({"specularColor", "diffuseColor"} & {*change.baked, *change.by_vertex})


def _require_no_map_of_f0(change: MaterialChange) -> None:
    """Raises AuthorError where one specularColor would take the place of what maps say of F0."""
    m = change.material
    if _is_driven(m.metallic) or _is_driven(m.ior):
        raise AuthorError(
            f"{m.path} stays: its specular colour would have to be one constant, and the maps that say what is metal "
            "would lose their meaning: choose another explanation (solve --choose)"
        )


def _carried_over(change: MaterialChange, d: F64, opacity: float) -> F64:
    """The diffuse reflectance of the mean inputs after a change: a scale of the texture is the same factor on both."""
    before, after = change.before.diffuse, change.after.diffuse
    ratio = after / np.maximum(before, DARK)
    by_scale = is_scale(before, ratio, change.highest.get("diffuseColor", 1.0), change.map)
    return np.where(by_scale, d * ratio, d + (after - before) / opacity)


def _beside_varying(change: MaterialChange, edits: list[InputEdit]) -> list[InputEdit]:
    """The edits of inputs that do not vary, without what says the mean of a specular change that does."""
    varies = {*change.baked, *change.by_vertex}
    kept = [e for e in edits if e.input not in varies]
    m = change.material
    if any(b.like for b in change.baked.values()):  # they say all of the colours
        return [*(e for e in kept if e.input == "roughness"), *_beside_whole_set(change)]
    if not {"ior", "specularColor"} & varies or m.use_specular_workflow:
        return kept
    says_mean = {"ior", "metallic", "useSpecularWorkflow", "specularColor"}
    says_mean |= set() if "diffuse" in change.freed else {"diffuseColor"}
    kept = [e for e in kept if e.input not in says_mean]
    if "specularColor" in varies:
        kept.append(InputEdit(m.path, "useSpecularWorkflow", 0, 1, "constant"))
    return kept


def _beside_whole_set(change: MaterialChange) -> list[InputEdit]:
    """The constants that go with textures which say the colours of a material as one."""
    m = change.material
    edits = []
    if "specularColor" in change.baked and not m.use_specular_workflow:
        edits.append(InputEdit(m.path, "useSpecularWorkflow", 0, 1, "constant"))
    for name, value in change.values.items():
        edits += _edit(change, name, getattr(m, name), getattr(m, name), np.array([value]))
    return edits


def _vertex_edits(change: MaterialChange) -> list[InputEdit]:
    """The inputs whose change varies over gprims that have nothing but their points to carry it."""
    return [
        InputEdit(
            change.material.path, name, _plain(np.array(v.before)), _plain(np.array(v.after)), "primvar", by_vertex=v
        )
        for name, v in sorted(change.by_vertex.items())
    ]


def _baked_edits(change: MaterialChange) -> list[InputEdit]:
    """The inputs whose change varies over the surface, and takes a texture of its own."""
    fields = {"diffuseColor": "diffuse_color", "specularColor": "specular_color"}
    edits = []
    for name, baked in sorted(change.baked.items()):
        drives = getattr(change.material, fields.get(name, name))
        source = drives.prim if isinstance(drives, Texture) and not baked.like else ""
        before, after = _plain(np.array(baked.before)), _plain(np.array(baked.after))
        path = change.material.path
        edits.append(InputEdit(path, name, before, after, "texture", source, baked.channels, baked=baked))
    return edits


def affine_map(mean: float, target: float, high: float, kind: str = "auto") -> tuple[float, float]:
    """Returns scale and bias that take `mean` to `target`, and values of 0 to `high` to none outside 0..1.

    Darker is a scale, which keeps black and relative contrast; so is brighter where there is room; else a
    bias where there is room; else the map that keeps white.
    """
    if abs(target - mean) <= SAME:
        return 1.0, 0.0
    ratio = target / mean if mean > DARK else np.inf
    if kind == "add":
        return 1.0, target - mean
    if is_scale(mean, ratio, high, kind):
        return float(ratio), 0.0
    if kind == "multiply" or high + target - mean <= 1 or mean >= 1:
        return 1.0, target - mean
    scale = (1 - target) / (1 - mean)
    return scale, 1 - scale


def is_scale(mean: ArrayLike, ratio: ArrayLike, high: float, kind: str = "auto") -> NDArray[np.bool_]:
    """Whether the affine map of a mean to `ratio` times it is a scale: see `affine_map`."""
    is_dark = np.asarray(mean) <= DARK
    ratio = np.where(is_dark, 0.0, ratio)
    return ~is_dark & ((kind == "multiply") | (ratio <= 1) | (high * ratio <= 1)) & (kind != "add")


def _is_driven(value: Input) -> bool:
    return isinstance(value, (Texture, PrimvarInput))


def _mean(change: MaterialChange, name: str, value: Input) -> F64 | None:
    """The input's value or its mean over the painted area; None where nobody knows."""
    if isinstance(value, np.ndarray):
        return np.asarray(value, np.float64)
    if name in change.means:
        return np.atleast_1d(np.asarray(change.means[name], np.float64))
    return None


def inputs_before(change: MaterialChange) -> tuple[SurfaceInputs, float]:
    """The inputs as they are, and the opacity that the diffuse reflectance was multiplied with.

    What is textured and has no mean is taken from the mean reflectance.
    """
    m, seen = change.material, change.before
    opacity = 1.0
    if m.opacity_threshold == 0 and m.opacity_mode == "transparent":
        mean = _mean(change, "opacity", m.opacity)
        opacity = float(mean[0]) if mean is not None and mean[0] > 0 else _opacity_of(m, seen.diffuse)
    d = np.clip(seen.diffuse / opacity, 0, 1)
    color = _mean(change, "diffuseColor", m.diffuse_color)
    if m.use_specular_workflow:
        specular = _mean(change, "specularColor", m.specular_color)
        color, specular = d if color is None else color, seen.f0 if specular is None else specular
        return SurfaceInputs(color, specular_color=specular, use_specular_workflow=True), opacity
    metallic, ior = _mean(change, "metallic", m.metallic), _mean(change, "ior", m.ior)
    ior_ = 1.5 if ior is None else float(ior[0])

    def inputs(m_: float) -> SurfaceInputs:
        of_metal = np.clip(seen.f0, 0, 1)
        c = color if color is not None else np.clip(d / (1 - m_), 0, 1) if m_ < 1 else of_metal
        return SurfaceInputs(c, m_, ior_)

    if metallic is None:
        candidates = [inputs(m_) for m_ in np.linspace(0, 1, 1001)]
        return min(candidates, key=lambda c: error_of(c, d, seen.f0)), opacity
    return inputs(float(metallic[0])), opacity


def _opacity_of(m: Material, seen: F64) -> float:
    """The opacity that a constant colour was seen through, where a map says it; 1 where the colour is not known."""
    if not isinstance(m.diffuse_color, np.ndarray) or not isinstance(m.metallic, np.ndarray):
        return 1.0
    own = np.asarray(m.diffuse_color, np.float64) * (1.0 if m.use_specular_workflow else 1 - float(m.metallic[0]))
    return float(np.clip(own @ seen / max(float(own @ own), 1e-12), 0.01, 1)) if own.any() else 1.0


def _edit(
    change: MaterialChange, name: str, value: Input, before: ArrayLike | None, after: ArrayLike | None
) -> list[InputEdit]:
    """The opinion that takes an input from `before` to `after`; none where they are the same."""
    assert after is not None, name
    new = np.atleast_1d(np.asarray(after, np.float64))
    old = np.full_like(new, np.nan) if before is None else np.atleast_1d(np.asarray(before, np.float64))
    if (np.abs(new - old) <= SAME * np.maximum(1, np.abs(old))).all():
        return []
    path = change.material.path
    if isinstance(value, np.ndarray):
        return [InputEdit(path, name, _plain(old), _plain(new), "constant")]
    if np.isnan(old).any():  # what drives it is not known: replaced by the constant, through the same node
        maps = [(0.0, float(x)) for x in new]
    else:
        high = change.highest.get(name, 1.0)
        kind = "add" if name == "ior" else change.map
        maps = [affine_map(float(o), float(n), high, kind) for o, n in zip(old, new)]
    scale, bias = (tuple(x) for x in zip(*maps))
    if isinstance(value, Texture):
        source, channels, representation = value.prim, value.channels, "scale"
    else:
        source, channels, representation = value.name, "", "primvar"
    return [InputEdit(path, name, _plain(old), _plain(new), representation, source, channels, scale, bias)]


def _plain(value: F64) -> Value:
    """A float, or a tuple of three, as float32 holds it."""
    rounded = tuple(float(x) for x in value.astype(np.float32))
    return rounded if len(rounded) > 1 else rounded[0]
