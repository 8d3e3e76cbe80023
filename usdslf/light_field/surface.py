"""Surface: reflectance of the elements, the part of them that an edit changes."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import Elements

CHANGED = np.inf  # light that waits where the reflectance changed; see renewal.py
GRAZING = 1 / 21  # mean of Schlick's ramp over the hemisphere


@dataclass(frozen=True)
class Surface:
    """Reflectance of the elements, the part of them that an edit changes.  N elements, float32."""

    diffuse: NDArray  # (N, 3) d
    f0: NDArray  # (N, 3)
    f90: NDArray  # (N, 3)
    roughness: NDArray  # (N,)
    emission: NDArray  # (N, 3)
    clearcoat: NDArray  # (N,)
    clearcoat_roughness: NDArray  # (N,)
    coat_f0: NDArray  # (N,)

    @staticmethod
    def of(elements: Elements) -> Surface:
        """Takes the reflectance that the elements were sampled with."""
        return Surface(**{f.name: np.asarray(getattr(elements, f.name), np.float32) for f in fields(Surface)})

    def with_rows(self, rows: NDArray, **values: NDArray) -> Surface:
        """Returns a copy in which `rows` (boolean or index) have other values."""
        new = {}
        for name, value in values.items():
            array = np.array(getattr(self, name))
            array[rows] = value
            new[name] = array
        return replace(self, **new)


def changed_rows(old: Surface, new: Surface) -> NDArray[np.bool_]:
    """Tells which elements (N,) have another reflectance or emission."""
    found = np.zeros(len(old.roughness), bool)
    for name, before in vars(old).items():
        after = getattr(new, name)
        if after is not before:
            found |= (after != before).reshape(len(found), -1).any(1)
    return found


def albedo(s: Surface) -> NDArray[np.float32]:
    """Returns about how much light elements reflect (N,), 0..1: the most of the channels."""
    specular = s.f0 + GRAZING * (s.f90 - s.f0)
    coat = s.clearcoat * (s.coat_f0 + GRAZING * (1 - s.coat_f0))
    return np.clip((s.diffuse * (1 - s.f0) + specular).max(1) + coat, 0, 1)
