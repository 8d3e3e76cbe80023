"""Residuals of answers that are not one change for all dabs: exact, sample by sample, under the light of now.

A residual is the relative root mean square of the painted radiance of a pool's dabs minus what is seen.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.answers import Answer, Painted
from usdslf.inference.bilinear import bilinear
from usdslf.inference.evidence import evaluate_columns, mean_by, unchanging_radiance
from usdslf.inference.varying import Varying
from usdslf.light_field.light_field import LightField
from usdslf.scene.records import Scene
from usdslf.similarity.similarity import places_of
from usdslf.surfaces.surface_points import evaluate_surface


def varying_residual(
    answer: Answer, varying: Varying, painted: list[Painted], field: LightField, model: str = ""
) -> float:
    """Returns the residual of a change that varies, as it is at each sample under the light of now.

    Args:
        model: of reflection; "": that of the light field.
    """

    def changed(p: Painted) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        s = p.samples.surface
        d, f0, f90, rough = (x.astype(np.float64) for x in (s.diffuse, s.f0, s.f90, s.roughness))
        here = s.material == answer.pool.material
        delta = varying.at(places_of(s).rows(here))
        if varying.parameter == "glossiness":
            rough[here] += delta[:, 0]
        elif varying.parameter == "diffuse":
            d[here] += delta
        else:
            f0[here] += delta
            f90 = f0 if answer.tables.is_metal else f90
        return d, f0, f90, rough

    return _residual_of(answer, painted, field, changed, model or field.model)


def residual_as_written(answer: Answer, written: Scene, painted: list[Painted], field: LightField) -> float:
    """Returns the residual of an answer where a look layer shows it, under the light of now.

    Args:
        written: the shot with the look, triangle by triangle that of before.
    """

    def changed(p: Painted) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        old = p.samples.surface
        s = evaluate_surface(written, old.triangle, old.barycentric)
        return s.diffuse, s.f0, s.f90, s.roughness

    return _residual_of(answer, painted, field, changed, field.model)


def residual_as_preview(answer: Answer, painted: list[Painted], field: LightField) -> float:
    """Returns the residual of an answer by phong where UsdPreviewSurface reflects the same light with its parameters.

    That is what a look layer holds: d = k_d, F0 = k_s, and the roughness whose GGX lobe is as wide.
    """
    if answer.varying:
        return varying_residual(answer, answer.varying, painted, field, "preview_surface")
    c = answer.chosen

    def changed(p: Painted) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        s = p.samples.surface
        d, f0, f90 = (x.astype(np.float64) for x in (s.diffuse, s.f0, s.f90))
        own = s.roughness.astype(np.float64)
        new = c.f0_of(f0)
        f90 = np.where(np.abs(f90 - f0).max(1, keepdims=True) < 2e-3, new, f90)
        return c.diffuse_of(d), new, f90, c.roughness_of(own) if c.freed else own

    return _residual_of(answer, painted, field, changed, "preview_surface")


def _residual_of(
    answer: Answer, painted: list[Painted], field: LightField,
    changed: Callable[[Painted], tuple[NDArray, NDArray, NDArray, NDArray]], model: str,
) -> float:  # fmt: skip
    """Residual of an answer with another reflectance (d, F0, F90, roughness) of each sample."""
    t, seen = answer.tables, []
    for i in answer.pool.strokes:
        p = painted[i]
        d, f0, f90, rough = (np.asarray(x, np.float64) for x in changed(p))
        columns = evaluate_columns(p.samples, field, rough[:, None], model)
        radiance = bilinear(columns, d, f0, f90, False, model)[0][:, 0] + unchanging_radiance(p.samples, field)
        n = len(p.rows)
        material = p.samples.surface.material[np.searchsorted(p.samples.dab, np.arange(n))]
        seen.append(mean_by(radiance, p.samples.dab)[:n][material == answer.pool.material])
    return float(np.sqrt(np.mean(((np.concatenate(seen) - t.target) / t.scale) ** 2)))
