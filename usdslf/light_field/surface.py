"""Surface: reflectance of the elements, the part of them that an edit changes."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import Elements

CHANGED = np.inf  # light that waits where the reflectance changed; see renewal.py
GRAZING = 1 / 21  # mean of Schlick's ramp over the hemisphere
SMALL = 0.05  # relative change of what is reflected, up to which it is foreseen without reflecting anew
MARGIN = 1.25  # by which it is foreseen to be more, as the colour of what arrives is not looked at
OF_LOBE = 3.0  # relative change (L1), at most, of what a lobe reflects by one of its roughness (GGX: 2, grazing more)


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


def relative_changes(old: Surface, new: Surface, rows: NDArray[np.int64]) -> NDArray[np.float32]:
    """Returns by how much of itself, at most about, what some elements send changes (r,), seen from the reflectance.

    CHANGED where it is more than SMALL, or what they emit or their coat is another.
    """
    of = lambda s, name: getattr(s, name)[rows]  # noqa: E731
    apart = {k: np.abs(of(new, k) - of(old, k)).reshape(len(rows), -1).sum(1) for k in vars(old)}
    f0, f90 = of(old, "f0"), of(old, "f90")
    lobe = (f0 + GRAZING * (f90 - f0)).sum(1)
    reflected = np.maximum((of(old, "diffuse") * (1 - f0)).sum(1) + lobe, 1e-3)
    by_lobe = OF_LOBE * apart["roughness"] / np.maximum(of(old, "roughness"), 1e-2)
    found = MARGIN * (apart["diffuse"] + apart["f0"] + GRAZING * apart["f90"] + lobe * by_lobe) / reflected
    other = sum(x for k, x in apart.items() if k not in ("diffuse", "f0", "f90", "roughness"))
    return np.where((found > SMALL) | (other > 0), CHANGED, found).astype(np.float32)


def albedo(s: Surface) -> NDArray[np.float32]:
    """Returns about how much light elements reflect (N,), 0..1: the most of the channels."""
    specular = s.f0 + GRAZING * (s.f90 - s.f0)
    coat = s.clearcoat * (s.coat_f0 + GRAZING * (1 - s.coat_f0))
    return np.clip((s.diffuse * (1 - s.f0) + specular).max(1) + coat, 0, 1)


def diffuse_albedo(s: Surface) -> NDArray[np.float32]:
    """Returns about how much light elements reflect evenly (N,), 0..1: the most of the channels."""
    return np.clip((s.diffuse * (1 - s.f0)).max(1), 0, 1)
