"""Is what was solved there?  Reflectance at the painted places, as a look shows it, against what was asked for.

    Asked(material, triangle, barycentric, before, after, freed)     one answer at its painted samples
    why_missing(asked, before, shown) -> list[Missing]               what is not there, in words

An opinion that resolves may still be one that nothing shows: a fallback that no gprim falls back to, a node that
is replaced at the frame.  So what counts is what the whole reading path gives.  No light is needed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.edits import Reflectance
from usdslf.scene.records import Scene
from usdslf.surfaces.surface_points import evaluate_surface

# Share of a change that has to be seen in each channel: means through textures, and what is cut off at 0 and 1, differ.
ARRIVED = 0.5
NOTICED = 0.01  # of a reflectance or roughness: smaller changes are not looked for
_FIELDS = {"diffuse": "diffuse", "specular": "f0", "glossiness": "roughness"}


@dataclass(frozen=True)
class Asked:
    """What an answer asks of the S places that were painted."""

    material: str  # path of the one that was painted
    triangle: NDArray  # (S,) into Scene.triangles
    barycentric: NDArray  # (S, 2)
    before: Reflectance  # means over the painted area
    after: Reflectance
    freed: tuple[str, ...]  # diffuse | specular | glossiness


@dataclass(frozen=True)
class Missing:
    """A change that was asked for and is not shown."""

    material: str  # path
    sentence: str


def why_missing(asked: Iterable[Asked], before: Scene, shown: Scene) -> list[Missing]:
    """Returns a record for each answer, and each parameter of it, that the shot with its look does not show.

    Args:
        before: the shot.
        shown: the shot with the look over it; triangle by triangle that of before.
    """
    if len(before.triangles.mesh) != len(shown.triangles.mesh):
        return []  # other geometry: nothing can be compared
    out = []
    for each in asked:
        if not len(each.triangle):
            continue
        old, new = (evaluate_surface(s, each.triangle, each.barycentric, normal_maps=False) for s in (before, shown))
        for name in each.freed:
            field = _FIELDS[name]
            wanted = np.clip(_of(each.after, field), 0, 1) - np.clip(_of(each.before, field), 0, 1)
            got = np.mean(getattr(new, field), axis=0) - np.mean(getattr(old, field), axis=0)
            most = np.abs(wanted).max()
            if most > NOTICED and np.abs(got - wanted).max() > (1 - ARRIVED) * most:
                sentence = (
                    f"the change of {name} of {each.material} cannot be written so that the shot shows it at what was "
                    f"painted: wanted is {_words(wanted)}, the look gives {_words(got)}"
                )
                out.append(Missing(each.material, sentence))
    return out


def _of(r: Reflectance, field: str) -> NDArray:
    return np.atleast_1d(np.asarray(getattr(r, field), np.float64))


def _words(change: NDArray) -> str:
    return ", ".join(f"{x:+.3f}" for x in np.atleast_1d(change))
