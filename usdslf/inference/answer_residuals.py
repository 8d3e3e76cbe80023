"""Residuals of answers that are not one change for all dabs: exact, sample by sample, under the light of now.

A residual is the relative root mean square of the painted radiance of a pool's dabs minus what is seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from usdslf.inference.answers import Answer, Painted
from usdslf.inference.bilinear import bilinear
from usdslf.inference.evidence import evaluate_columns, mean_by, unchanging_radiance
from usdslf.inference.residuals import relative_rms
from usdslf.inference.varying import Varying
from usdslf.light_field.light_field import LightField
from usdslf.scene.records import Scene
from usdslf.similarity.similarity import places_of
from usdslf.surfaces.reflectance import Parameters, are_metal
from usdslf.surfaces.surface_points import evaluate_surface


def varying_residual(
    answer: Answer, varying: Varying, painted: list[Painted], field: LightField, model: str = ""
) -> float:
    """Returns the residual of a change that varies, as it is at each sample under the light of now.

    Args:
        model: of reflection; "": that of the light field.
    """

    def changed(p: Painted) -> Parameters:
        s = p.samples.surface
        now = Parameters.of(s).astype(np.float64)
        here = s.material == answer.pool.material
        delta = varying.at(places_of(s).rows(here))
        if varying.parameter == "glossiness":
            now.roughness[here] += delta[:, 0]
        elif varying.parameter == "diffuse":
            now.diffuse[here] += delta
        else:
            now.f0[here] += delta
            now = replace(now, f90=now.f0 if answer.tables.is_metal else now.f90)
        return now

    return _residual_of(answer, painted, field, changed, model or field.model)


def residual_as_written(answer: Answer, written: Scene, painted: list[Painted], field: LightField) -> float:
    """Returns the residual of an answer where a look layer shows it, under the light of now.

    Args:
        written: the shot with the look, triangle by triangle that of before.
    """

    def changed(p: Painted) -> Parameters:
        old = p.samples.surface
        s = evaluate_surface(written, old.triangle, old.barycentric)
        return Parameters.of(s)

    return _residual_of(answer, painted, field, changed, field.model)


def residual_as_preview(answer: Answer, painted: list[Painted], field: LightField) -> float:
    """Returns the residual of an answer by phong where UsdPreviewSurface reflects the same light with its parameters.

    That is what a look layer holds: d = k_d, F0 = k_s, and the roughness whose GGX lobe is as wide.
    """
    if answer.varying:
        return varying_residual(answer, answer.varying, painted, field, "preview_surface")
    c = answer.chosen

    def changed(p: Painted) -> Parameters:
        now = Parameters.of(p.samples.surface).astype(np.float64)
        return c.apply(now, are_metal(now.diffuse, now.f0, now.f90))

    return _residual_of(answer, painted, field, changed, "preview_surface")


def _residual_of(
    answer: Answer, painted: list[Painted], field: LightField, changed: Callable[[Painted], Parameters], model: str
) -> float:
    """Residual of an answer with other parameters of each sample."""
    t, seen = answer.tables, []
    for i in answer.pool.strokes:
        p = painted[i]
        now = changed(p).astype(np.float64)
        columns = evaluate_columns(p.samples, field, now.roughness[:, None], model)
        radiance = bilinear(columns, now.diffuse, now.f0, now.f90, False, model).p[:, 0]
        radiance += unchanging_radiance(p.samples, field)
        n = len(p.rows)
        material = p.samples.surface.material[np.searchsorted(p.samples.dab, np.arange(n))]
        seen.append(mean_by(radiance, p.samples.dab)[:n][material == answer.pool.material])
    return relative_rms(np.concatenate(seen), t.target, t.scale)
