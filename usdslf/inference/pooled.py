"""Pooled: the evidence of several shots about one material, as files hold it and as one problem.

    arrays_of(tables) / tables_of(arrays)      for np.savez, and back
    join_tables(parts) -> Tables               what several shots say, each in its own light
    choose_jointly(parts, options) -> Joint    the change that explains all of them
    fit_jointly(parts, chosen, ...)            its value, in the light that it sends round

Light has another strength in each shot: everything is linear in it, and residuals are relative, so that each shot's
radiance is divided by the mean of what is seen there before any change.

Source: Nguyen et al. 2013, 5.3 (Eqs. 3 to 6), pooled over shots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.whole_set import Colored
from usdslf.errors import StrokeError
from usdslf.inference.answers import TIED_COST
from usdslf.inference.bilinear import MOST_SWATCHES, Bilinear, Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.refits import refit_tables
from usdslf.inference.solve import enumerate_candidates
from usdslf.inference.weights import Options

BILINEAR = ("dabs", "background", "elsewhere")
RADIANCE = ("target", "scale", "noise", "doubt", "factor_u", "factor_w", "factor_v", "background_scale")
PLACES = ("place", "has_one_color", "dab_levels")
ANY = ("is_textured", "is_textured_f0", "is_textured_roughness", "must_hold_energy")


def arrays_of(t: Tables) -> dict[str, NDArray]:
    """Returns tables as arrays by name."""
    found: dict[str, NDArray] = {}
    for f in fields(t):
        value = getattr(t, f.name)
        if isinstance(value, Bilinear):
            found |= {f"{f.name}.{k}": getattr(value, k) for k in "puvw"}
        else:
            found[f.name] = np.asarray(value.name if isinstance(value, Enum) else value)
    return found


def tables_of(arrays: Mapping[str, NDArray]) -> Tables:
    """Returns the tables that `arrays_of` gave.  Raises: KeyError where one is missing."""
    values: dict[str, Any] = {}
    for f in fields(Tables):
        if f.name in BILINEAR:
            values[f.name] = Bilinear(*(arrays[f"{f.name}.{k}"] for k in "puvw"))
        elif f.name == "colored":
            values[f.name] = Colored[str(arrays[f.name])]
        else:
            value = arrays[f.name]
            values[f.name] = value if value.ndim else value.item()
    return Tables(**values)


def join_tables(parts: Sequence[Tables]) -> Tables:
    """Returns the tables of one material in several shots as one; all on the same levels.

    The numbers of strokes go on from part to part.
    """
    parts = [_of_unit_light(t) for t in parts]
    first, values = parts[0], dict[str, Any]()
    for name in BILINEAR:
        values[name] = Bilinear.joined([getattr(t, name) for t in parts])
    for name in (*RADIANCE, *PLACES):
        values[name] = np.concatenate([getattr(t, name) for t in parts])
    before = np.cumsum([0, *(int(t.stroke.max()) + 1 for t in parts[:-1])])
    values["stroke"] = np.concatenate([t.stroke + k for t, k in zip(parts, before, strict=True)])
    swatches = [np.where(t.swatch < 0, -1, t.swatch + MOST_SWATCHES * k) for t, k in zip(parts, before, strict=True)]
    values["swatch"] = np.concatenate(swatches)
    values["levels"] = values["dab_levels"].mean(0)
    values["roughness"] = float(values["dab_levels"][:, -1].mean())
    share = np.array([len(t.target) for t in parts], float) / len(values["target"])
    for name in ("diffuse", "f0"):
        values[name] = sum(w * getattr(t, name) for w, t in zip(share, parts, strict=True))
    values |= {name: any(getattr(t, name) for t in parts) for name in ANY}
    values["is_metal"] = all(t.is_metal for t in parts)
    values["most_diffuse"] = min(t.most_diffuse for t in parts)
    return replace(first, **values)


def _of_unit_light(t: Tables) -> Tables:
    """The tables in light by which the painted places look 1 in the mean."""
    by = 1 / max(float(np.abs(t.before).mean()), 1e-12)
    values: dict[str, Any] = {name: by * getattr(t, name) for name in RADIANCE}
    values["noise"] = np.broadcast_to(values["noise"], t.target.shape)
    for name in BILINEAR:
        b = getattr(t, name)
        values[name] = Bilinear(by * b.p, by * b.u, by * b.v, by * b.w)
    return replace(t, **values)


@dataclass(frozen=True)
class Joint:
    """What several shots together say of one material.

    Attributes:
        chosen: the cheapest explanation that the norm admits.
        candidates: all, the cheapest first.
        tables: of all shots.
    """

    chosen: Candidate
    candidates: tuple[Candidate, ...]
    tables: Tables

    @property
    def ties(self) -> tuple[str, ...]:
        """Ids of explanations that cost about as little."""
        others = (c for c in self.candidates if c.id != self.chosen.id and c.is_admitted)
        return tuple(c.id for c in others if abs(c.cost - self.chosen.cost) < TIED_COST)


def choose_jointly(parts: Sequence[Tables], options: Options, wanted: str = "") -> Joint:
    """Finds the change that explains the dabs of all shots with the fewest freedoms.

    Args:
        parts: of each shot, in its light as it is.
        wanted: id of the explanation to take; "": the cheapest.

    Raises: StrokeError for an explanation that is none.
    """
    tables = join_tables(parts)
    candidates = enumerate_candidates(tables, options)
    chosen = next((c for c in candidates if not wanted or c.id == wanted), None)
    if chosen is None:
        known = ", ".join(c.id for c in candidates)
        raise StrokeError(f"there is no alternative '{wanted}' for the shots together; choose one of {known}")
    return Joint(chosen, tuple(candidates), tables)


def fit_jointly(
    parts: Sequence[Tables], chosen: Candidate, options: Options, painted: bool
) -> tuple[Candidate, Tables]:
    """Fits a chosen change again to all shots, each in the light that the change sends round.

    Args:
        parts: of each shot; on levels about the chosen one where glossiness changes.
        painted: all strokes are colours that a painter chose.

    Returns: the change, at a level of the joint tables, and these.
    """
    tables = join_tables(parts)
    return refit_tables(tables, chosen, options, painted), tables
