"""Evidence: what light arrives where something was painted, and what each reflectance would make of it.

A stroke is laid as dabs; each dab holds some hundred surface points over its footprint as the painter saw it
(samples.py), and light arrives at each along rays (sample_rays.py).  The unpainted directions, which tell a
highlight from a colour, come from the bins of the nearest element.

Source: Nguyen et al. 2013, 5.3 (Eq. 2); Veach 1997 (multiple importance sampling); Heitz 2018 (visible normals).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.inference.columns import DeviceColumns
from usdslf.inference.sample_rays import SHARPEST
from usdslf.inference.samples import Beside, Samples
from usdslf.light_field.light_field import LightField
from usdslf.light_field.storage import constants_of
from usdslf.sampling.hemisphere import SOLID_ANGLE, D, bin_directions
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.reflectance import gloss_levels, lobe_parameter, model_of, moved_roughness
from usdslf.surfaces.surface_points import SurfacePoints

BACKGROUND = 24  # unpainted directions of a dab
SHARPEST_BACKGROUND = 0.2  # roughness; sharper lobes fall between the bins
Made = TypeVar("Made")
MOST_BACKGROUND = 32  # dabs of a stroke whose unpainted directions are looked at
VARIED = 5e-3  # range of roughness above which it varies


@dataclass(frozen=True)
class Arriving:
    """Radiance over density of all rays and light samples of samples, device arrays (S, 3, row) as of RayLight."""

    light_d: Any
    specular_d: Any  # by the lights' specular factors; `light_d` where these are no others

    @staticmethod
    def at(samples: Samples, field: LightField) -> Arriving:
        """What arrives now: what surfaces send in a light field, and what no edit changes."""
        light_d = arriving_light(samples, field)
        is_split = samples.light.fixed_specular_d is not samples.light.fixed_d
        return Arriving(light_d, arriving_light(samples, field, specular=True) if is_split else light_d)


@dataclass(frozen=True)
class Evidence:
    """What a stroke asks for, and the columns to answer with.  n dabs, S samples, J levels, B background rows.

    The last level of `levels` is each sample's own roughness.
    """

    stroke: Stroke
    target: NDArray[np.float64]  # (n, 3) painted radiance
    material: NDArray[np.int64]  # (n,)
    dab_of_sample: NDArray[np.int64]  # (S,) 0..n-1; n and above: unpainted points seen by the same eye
    surface: SurfacePoints  # (S,)
    levels: NDArray[np.float64]  # (S, J)
    columns: NDArray[np.float32] | DeviceColumns  # (S, J, 4, 3) X, Y, A, B
    unchanging: NDArray[np.float64]  # (S, 3) radiance that no parameter of ours changes: `unchanging_radiance`
    background_sample: NDArray[np.int64]  # (B,) the sample whose reflectance a background row has
    background: NDArray[np.float32]  # (B, J, 4, 3)
    doubtful: NDArray[np.float64] | None = None  # (S, 3, 3) radiance before any edit, see doubt.py; None: not known
    arriving: Arriving | None = None  # that the columns were made of, on the device
    _made: dict[tuple[Any, ...], Any] = dataclass_field(default_factory=dict, init=False, repr=False)

    def once(self, name: tuple[Any, ...], make: Callable[[], Made]) -> Made:
        """Returns what is made of this evidence, the same for one name."""
        if name not in self._made:
            self._made[name] = make()
        made: Made = self._made[name]
        return made


def build_evidence(
    stroke: Stroke, stroke_row: NDArray, samples: Samples, field: LightField, wanted: NDArray | None = None,
    is_weighed: bool = True, on_levels: bool = True,
) -> Evidence:  # fmt: skip
    """Turns the light that arrives now into columns, on all levels and in unpainted directions too.

    Args:
        wanted: (n, 3) radiance that the stroke's tool asks for; None: the stroke's colours.
        is_weighed: False: without unpainted directions.
        on_levels: False: for the samples' own roughness alone.
    """
    surface = samples.surface
    n = len(stroke_row)
    own = surface.roughness.astype(np.float64)
    first = np.searchsorted(samples.dab, np.arange(n))
    levels = sample_levels(own, float(own[samples.dab < n].mean()), field.model) if on_levels else own[:, None]
    arriving = Arriving.at(samples, field)
    columns = kept_columns(samples, field, levels, arriving)
    background_sample, background = np.zeros(0, np.int64), np.zeros((0, *columns.shape[1:]))
    if is_weighed:
        background_sample, background = _background(samples, field, levels, first)
    unchanging = unchanging_radiance(samples, field)
    target = stroke.colors[stroke_row].astype(np.float64)
    if stroke.space == "reflectance":
        e_over_pi = mean_by(columns[:, -1, 0].astype(np.float64) + columns[:, -1, 1], samples.dab)[:n]
        target = target * e_over_pi
    if wanted is not None:
        target = wanted
    return Evidence(
        stroke, target, surface.material[first].astype(np.int64), samples.dab, surface, levels, columns, unchanging,
        background_sample, background, samples.doubtful, arriving,
    )  # fmt: skip


def sample_levels(own: NDArray, mean: float, model: str) -> NDArray[np.float64]:
    """Levels (S, J + 1) of samples: their mean moved onto each level, contrast kept, and their own at the end."""
    shift = gloss_levels(model)[None] - mean
    return np.concatenate([moved_roughness(own[:, None], shift, mean if varies(own) else 0.0), own[:, None]], 1)


def varies(roughness: NDArray) -> bool:
    """Whether roughness (S,) varies, and so changes by a factor."""
    return float(np.ptp(roughness)) > VARIED


def arriving_light(samples: Samples, field: LightField, specular: bool = False) -> Any:
    """Returns radiance over density of all rays and light samples, a device array (S, 3, row) as of RayLight.

    Args:
        field: whose light of now surfaces send.
        specular: by the lights' specular factors.
    """
    device, of = field.device, samples.light
    shape = of.fixed_d.shape
    light_d, count = device.empty(shape, np.float32), shape[0] * shape[2]
    fixed_d = of.fixed_specular_d if specular else of.fixed_d
    device.kernel("evidence", "add_arriving", **model_of(field.model).constants, **constants_of(field.outgoing_d))(
        groups(count), (GROUP,), np.uint32(count), np.uint32(of.rays), np.uint32(shape[2]), fixed_d, of.gain_d,
        of.links_d, of.weights_d, field.outgoing_d, light_d,
    )  # fmt: skip
    return light_d


def evaluate_columns(
    samples: Samples, field: LightField, levels: NDArray, model: str | None = None
) -> NDArray[np.float64]:
    """Returns X, Y, A, B (S, J, 4, 3) of every sample at roughness `levels` (S, J), mirrors a little blurred.

    Args:
        model: reflects the light that arrives; default: the light field's.
    """
    return single_columns(samples, field, levels, model).astype(np.float64)


def single_columns(
    samples: Samples, field: LightField, levels: NDArray, model: str | None = None, arriving: Arriving | None = None
) -> NDArray[np.float32]:
    """Returns the same in single precision, for many levels.

    Args:
        arriving: the light that arrives now, where it is known.
    """
    levels = np.maximum(levels, SHARPEST)
    rows, of = np.arange(len(samples.eye)), samples.light
    arriving = arriving or Arriving.at(samples, field)
    found = _columns(field, samples.eye, rows, of.towards_d, arriving.light_d, levels, model)
    if arriving.specular_d is not arriving.light_d:
        by_specular = _columns(field, samples.eye, rows, of.towards_d, arriving.specular_d, levels, model)
        found[:, :, 2:] = by_specular[:, :, 2:]
    return found


def kept_columns(
    samples: Samples, field: LightField, levels: NDArray, arriving: Arriving
) -> NDArray[np.float32] | DeviceColumns:
    """Returns the same on the device, where they are all of one light; their means are made there."""
    if arriving.specular_d is not arriving.light_d:
        return single_columns(samples, field, levels, arriving=arriving)
    levels, rows, of = np.maximum(levels, SHARPEST), np.arange(len(samples.eye)), samples.light
    columns_d = _columns_on_device(field, samples.eye, rows, of.towards_d, arriving.light_d, levels, field.model)
    return DeviceColumns(field.device, columns_d, field.model)


def columns_of_light(
    field: LightField, eye: NDArray, towards: NDArray, light: NDArray, levels: NDArray
) -> NDArray[np.float32]:
    """Returns X, Y, A, B (S, J, 4, 3) of light (S, 3, row) over density from local directions (S, 3, row)."""
    levels, upload = np.maximum(levels, SHARPEST), field.device.upload
    towards_d, light_d = (upload(np.ascontiguousarray(x, np.float32)) for x in (towards, light))
    return _columns(field, eye, np.arange(len(eye)), towards_d, light_d, levels)


def _columns(
    field: LightField, eye: NDArray, light_row: NDArray, towards_d: Any, light_d: Any, levels: NDArray,
    model: str | None = None,
) -> NDArray[np.float32]:  # fmt: skip
    out_d = _columns_on_device(field, eye, light_row, towards_d, light_d, levels, model or field.model)
    found: NDArray[np.float32] = field.device.download(out_d)
    return found


def _columns_on_device(
    field: LightField, eye: NDArray, light_row: NDArray, towards_d: Any, light_d: Any, levels: NDArray, model: str
) -> Any:
    device, (s, j) = field.device, levels.shape
    out_d = device.empty((s, j, 4, 3), np.float32)
    parameters = lobe_parameter(model, levels).astype(np.float32)
    kernel = device.kernel("evidence", "columns", **model_of(model).constants)
    kernel(
        groups(s), (GROUP,), device.upload(eye.astype(np.float32)), device.upload(light_row.astype(np.int32)),
        towards_d, light_d, device.upload(parameters), np.uint32(light_d.shape[2] // 16),
        np.uint32(j), np.uint32(s), out_d,
    )  # fmt: skip
    return out_d


def _background(samples: Samples, field: LightField, levels: NDArray, first: NDArray) -> tuple[NDArray, NDArray]:
    """Columns (B, J, 4, 3) of unpainted directions of dabs, from the bins of their nearest elements."""
    surface = samples.surface
    first = first[np.linspace(0, len(first) - 1, min(len(first), MOST_BACKGROUND)).round().astype(int)]
    near = field.lookup.nearest(surface.triangle[first], surface.barycentric[first], samples.side[first])
    element, is_reached = near[0][:, 0], near[1][:, :1, None] > 0
    incident = field.incident(element) * is_reached  # a side that no light reaches has no elements
    directions = bin_directions().astype(np.float32)
    chosen = np.linspace(0, D - 1, BACKGROUND + 2).round().astype(int)[1:-1]
    chosen = chosen[directions[chosen, 2] > 0.1]
    n, w = len(first), len(chosen)
    eye = np.tile(directions[chosen], (n, 1))
    rows = np.repeat(np.arange(n), w)
    towards_d = field.device.upload(by_sixteen(np.broadcast_to(directions, (n, D, 3))))
    light_d = field.device.upload(by_sixteen(incident * np.float32(SOLID_ANGLE)))
    clamped = np.maximum(levels[first][rows], SHARPEST_BACKGROUND)
    return first[rows], _columns(field, eye, rows, towards_d, light_d, clamped)


def by_sixteen(rows: NDArray) -> NDArray[np.float32]:
    """Lays rows (R, K, 3) out as (R, 3, K') with K filled up to a multiple of 16 by zeros."""
    r, k, _ = rows.shape
    out = np.zeros((r, 3, -(-k // 16) * 16), np.float32)
    out[:, :, :k] = rows.transpose(0, 2, 1)
    return out


def unchanging_radiance(samples: Samples, field: LightField) -> NDArray[np.float64]:
    """Returns what no parameter of ours changes (S, 3): clearcoat, emission, and what dabs show beside the material."""
    surface = samples.surface
    out = surface.emission.astype(np.float64)
    if samples.weight is not None:
        out = out * samples.weight[:, None]
    if model_of(field.model).has_coat and np.any(surface.clearcoat > 0):
        columns = evaluate_columns(samples, field, surface.clearcoat_roughness[:, None].astype(np.float64))[:, 0]
        f0 = surface.coat_f0[:, None]
        out = out + surface.clearcoat[:, None] * (f0 * columns[:, 2] + columns[:, 3])
    if samples.beside is not None:
        here = samples.dab < len(samples.beside.light)
        out[here] += _radiance_beside(samples.beside, field)[samples.dab[here]]
    return out


def sent_radiance(samples: Samples, field: LightField) -> NDArray[np.float64]:
    """Returns the radiance (S, 3) that samples send to their eyes, with the reflectance that they were laid on."""
    s = samples.surface
    columns = evaluate_columns(samples, field, s.roughness[:, None].astype(np.float64))
    d, f0, f90 = (x.astype(np.float64)[:, None] for x in (s.diffuse, s.f0, s.f90))
    return model_of(field.model).bilinear(columns, d, f0, f90, False)[0][:, 0] + unchanging_radiance(samples, field)


def _radiance_beside(beside: Beside, field: LightField) -> NDArray[np.float64]:
    """Radiance (n, 3) of dabs that is not of the painted material, under the light of now."""
    out = beside.light.copy()
    if beside.samples is not None:
        out[beside.has_some] += mean_by(sent_radiance(beside.samples, field), beside.samples.dab)
    return out


def mean_by(values: NDArray, group: NDArray) -> NDArray:
    """Means of rows by group, for every group, in double precision."""
    count = np.bincount(group)
    out = np.zeros((len(count), *values.shape[1:]))
    if (group[1:] < group[:-1]).any():
        order = np.argsort(group, kind="stable")
        values, group = values[order], group[order]
    out[count > 0] = np.add.reduceat(values, np.searchsorted(group, np.flatnonzero(count)), axis=0, dtype=np.float64)
    return out / count.reshape(-1, *[1] * (values.ndim - 1))
