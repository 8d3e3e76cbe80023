"""Collateral: what an edit changes beyond what it was meant to change, parameter by parameter, without any light.

    excess_of(before, after, moves) -> {parameter: (n,)}       beyond that, at n places
    collateral_of(shot, shown, moves) -> list[Collateral]      of a shot with its look, at all that it changed

A parameter that was freed may be, at each place, anywhere between what it was, that plus the change, and that times
the change's factor: a constant, a scale and a bias of a texture, and what is between them, are all as intended.  What
was not freed has to stay.  Places are spread by area over every surface whose material is not as it was; a number for
all of them that small parts are not lost in is the mean over the hundredth of the surface where it is worst.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.moves import Move
from usdslf.scene.difference import pairs_in
from usdslf.scene.records import F64, Material, Scene
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface

PLACES = 4000  # of each material that is not as it was
WORST = 0.01  # share of the surface that `worst` is the mean of
TOLERANCE = 0.03  # of a reflectance or roughness, of `worst`: a step that is seen beside what stayed
GRAZING = 0.05  # the same of a metal that gets the white F90 of the specular workflow
NOTED = 1e-3  # what is less is not said
RAMP = 1 / 21  # of F90, in reflectance: the mean of (1 - cos)^5 over the hemisphere
_NOT_SEEN = ("path", "shader", "why_not_editable", "normal")  # fields of a material that say no reflectance


@dataclass(frozen=True)
class Spoilt:
    """What happened to one parameter beyond what was meant, in its own units."""

    mean: float  # over the surface
    worst: float  # over the hundredth of it where it is largest


@dataclass(frozen=True)
class Collateral:
    """What a look changes on one material beyond what it was meant to."""

    material: str  # that shows, with the look
    spoilt: Mapping[str, Spoilt]  # by parameter, of those where it is worth a word

    @property
    def worst(self) -> float:
        """The largest of all parameters."""
        return max((s.worst for s in self.spoilt.values()), default=0.0)

    @property
    def is_finding(self) -> bool:
        """Whether somebody has to look at it."""
        return any(s.worst > (GRAZING if name == "grazing" else TOLERANCE) for name, s in self.spoilt.items())

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        spoilt = {name: {"mean": s.mean, "worst": s.worst} for name, s in self.spoilt.items()}
        return {"material": self.material, "finding": self.is_finding, "parameters": spoilt}

    def in_words(self) -> str:
        """A sentence."""
        return f"{self.material} changes where nothing was asked of it: {words_of(self.as_values())}"


def words_of(values: Mapping[str, Any]) -> str:
    """Returns what `Collateral.as_values` says of the parameters, the worst first."""
    most = sorted(values["parameters"].items(), key=lambda item: -item[1]["worst"])
    said = ", ".join(f"{name} by {s['worst']:.3f} (mean {s['mean']:.4f})" for name, s in most)
    return f"{said} on the worst hundredth of its surface"


def parameters_of(s: SurfacePoints, materials: Sequence[Material]) -> dict[str, F64]:
    """Returns what n places look like, by name, (n, C): reflectances, and what else may change.

    The diffuse reflectance is that of what is there: what is seen through is in the opacity.

    Args:
        materials: those of the scene.
    """
    is_specular = np.array([m.use_specular_workflow for m in materials], bool)[s.material][:, None]
    base = s.base_color.astype(np.float64)
    coat = s.clearcoat.astype(np.float64)
    emission = s.emission.astype(np.float64)
    return {
        "diffuse": np.where(is_specular, base, base * (1 - s.metallic[:, None])),
        "specular": s.f0.astype(np.float64),
        "roughness": s.roughness.astype(np.float64)[:, None],
        "grazing": RAMP * s.f90.astype(np.float64),
        "coat": np.stack([coat * s.coat_f0, coat * s.clearcoat_roughness], 1),
        "emission": emission / np.maximum(1.0, emission.max(1, keepdims=True, initial=0.0)),
        "opacity": np.stack([s.opacity, s.presence], 1).astype(np.float64),
    }


def excess_of(before: Mapping[str, F64], after: Mapping[str, F64], moves: Mapping[str, Move]) -> dict[str, F64]:
    """Returns by parameter how far beyond what is meant each of n places goes (n,), the largest of its channels."""
    found = {}
    for name, new in after.items():
        low = high = before[name]
        if name in moves:
            low, high = moves[name].between(before[name])
        if name == "grazing" and "specular" in moves:  # of a metal it goes with the specular colour
            low, high = (RAMP * x for x in moves["specular"].between(before[name] / RAMP))
        found[name] = np.maximum(np.maximum(low - new, new - high), 0).max(1)
    return found


def summed_up(material: str, excess: Mapping[str, F64]) -> Collateral:
    """Returns the numbers that stand for all places."""
    spoilt = {}
    for name, e in excess.items():
        count = max(1, round(WORST * len(e)))
        worst = float(np.sort(e)[-count:].mean()) if len(e) else 0.0
        if worst > NOTED:
            spoilt[name] = Spoilt(float(e.mean()), worst)
    return Collateral(material, spoilt)


def collateral_of(shot: Scene, shown: Scene, moves: Mapping[str, Mapping[str, Move]]) -> list[Collateral]:
    """Returns what a look changes beyond what it was meant to, for each material that shows something else.

    Args:
        shot: without the look.
        shown: with it; nothing is compared where it has other triangles.
        moves: what is meant, by path of the material that shows and by parameter.
    """
    if len(shot.triangles.mesh) != len(shown.triangles.mesh):
        return []
    found = []
    for path, triangles in _changed(shot, shown):
        at = somewhere(shot, triangles)
        seen = ((evaluate_surface(s, *at, normal_maps=False), s.materials) for s in (shot, shown))
        before, after = (parameters_of(*each) for each in seen)
        one = summed_up(path, excess_of(before, after, moves.get(path, {})))
        if one.spoilt:
            found.append(one)
    return sorted(found, key=lambda c: -c.worst)


def somewhere(scene: Scene, triangles: NDArray, count: int = PLACES) -> tuple[NDArray, NDArray]:
    """Returns random places on triangles, by area: triangles (count,), barycentrics (count, 2); always the same."""
    count = count if len(triangles) else 0
    rng = np.random.default_rng(0)
    area = scene.triangles.areas[triangles]
    share = area / area.sum() if area.sum() > 0 else None
    which = rng.choice(triangles, count, p=share).astype(np.int32) if count else np.zeros(0, np.int32)
    root, along = np.sqrt(rng.random(count)), rng.random(count)
    return which, np.stack([root * (1 - along), root * along], 1).astype(np.float32)


def _changed(shot: Scene, shown: Scene) -> Iterator[tuple[str, NDArray]]:
    """The materials that are shown on triangles that had another one, or one with other values, and which these are."""
    old, new = shot.triangles.material, shown.triangles.material
    by_path: dict[str, list[NDArray]] = {}
    for a, b in pairs_in(old, new):
        if shot.materials[a].why_not_editable or _same(shot.materials[a], shown.materials[b]):
            continue
        by_path.setdefault(shown.materials[b].path, []).append(np.flatnonzero((old == a) & (new == b)))
    for path, parts in by_path.items():
        yield path, np.concatenate(parts)


def _same(a: Material, b: Material) -> bool:
    for name in (f.name for f in fields(Material) if f.name not in _NOT_SEEN):
        x, y = getattr(a, name), getattr(b, name)
        if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
            if not np.array_equal(x, y):
                return False
        elif type(x) is not type(y) or x != y:
            return False
    return True
