"""Tools: what each tool asks of the light field under a stroke, seen from its eye.

A tool is an operator M on the light field L, and a stroke of strength s asks for

    L + s (M L - L)        replace: M L = painted colour     clone:   M L = L at the offset source
                           brighten:    = 2 L                darken:      = 0
                           blur:        = B                  sharpen:     = L^2 / B
                           fixate:      = L

so that brighten asks for (1 + s) L and darken for (1 - s) L.  sharpen is unsharp masking of the logarithm,
log L + (log L - log B): unlike 2 L - B it asks for no negative light, and of a GGX lobe whose blur has the width
a' it asks for one of width a^2 / a', at its peak and in its tail.  L is the mean over a dab.  B is the mean over a
disk of BLUR_REACH times the brush on the surface, and over directions about the eye's:

    B = mean of L(x', w'),   |x' - x| < BLUR_REACH r,   tan^2(w, w') = sigma^2 u / (1 - u),  u uniform in 0..1
    sigma^2 = BLUR_ANGLE^2 + (BLUR_LOBE alpha)^2

The directions have the shape of GGX's lobe, so that a blurred highlight is one of a larger roughness, and sigma
grows with the lobe's own width, so that each blur is a like step for a dull surface and a shiny one.  Towards the
horizon sigma shrinks with the height of the eye.  No parameters give a blurred or sharpened picture exactly; such
targets count with SHAPE_ERROR.  All is read from the light field before any edit: a tool does not chase what it did.

Source: Nguyen et al. 2013, 4 and 4.1; Walter et al. 2007 (the shape).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import StrokeError
from usdslf.geometry.closest_point import nearest_on_triangles
from usdslf.inference.bilinear import bilinear
from usdslf.inference.evidence import evaluate_columns, mean_by, sent_radiance, unchanging_radiance
from usdslf.inference.footprint import footprint
from usdslf.inference.pictured import Pictured
from usdslf.inference.samples import RAYS, SAMPLES, Samples, trace_samples
from usdslf.light_field.light_field import LightField
from usdslf.sampling.frames import frames_about
from usdslf.sampling.low_discrepancy import random_shifts, sobol_points
from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import F64, Camera, Scene
from usdslf.strokes.anchors import Located, locate_stroke, points_on_triangles
from usdslf.strokes.remarks import About, Remark
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.surface_points import evaluate_surface

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

BLUR_REACH = 1.25  # brush radii over the surface
BLUR_ANGLE = 0.08  # radians over directions
BLUR_LOBE = 1.4  # alphas over directions
WIDEST_BLUR = 0.6  # radians
BLUR_TAIL = 0.95  # of the directions, where the far ones are cut
BLUR_POINTS = 36  # of a dab
BLUR_EYES = 4  # directions of each point
BLUR_RAYS = 48  # of each of those
MOST_CONTRAST = 4.0  # that sharpen asks for
SHAPE_ERROR = 0.12  # relative, of what blur and sharpen ask for


@dataclass(frozen=True)
class SeenDabs:
    """What the eye sees at a stroke's n dabs before any edit: radiance (n, 3), the last two where a tool needs them."""

    radiance: F64
    painted: F64  # the stroke's colours as radiance
    source: F64 | None = None  # at the point to clone from
    blurred: F64 | None = None  # B


def replace(seen: SeenDabs) -> F64:
    """Returns what was painted."""
    return seen.painted


def clone(seen: SeenDabs) -> F64:
    """Returns what the same eye sees at the source."""
    assert seen.source is not None
    return seen.source


def brighten(seen: SeenDabs) -> F64:
    """Returns twice the light."""
    return 2 * seen.radiance


def darken(seen: SeenDabs) -> F64:
    """Returns darkness."""
    return 0 * seen.radiance


def blur(seen: SeenDabs) -> F64:
    """Returns the mean over near directions and points."""
    assert seen.blurred is not None
    return seen.blurred


def sharpen(seen: SeenDabs) -> F64:
    """Returns the light as many times its mean again, MOST_CONTRAST times at most."""
    assert seen.blurred is not None
    least = np.maximum(seen.blurred, 1e-9 + seen.radiance / MOST_CONTRAST)
    return seen.radiance**2 / least


def fixate(seen: SeenDabs) -> F64:
    """Returns the light as it is."""
    return seen.radiance


OPERATORS: dict[str, Callable[[SeenDabs], F64]] = {
    f.__name__: f for f in (replace, clone, brighten, darken, blur, sharpen, fixate)
}


def apply_tool(tool: str, seen: SeenDabs, strength: float) -> F64:
    """Returns the radiance (n, 3) that a tool of a strength asks for, never below zero."""
    asked = seen.radiance + strength * (OPERATORS[tool](seen) - seen.radiance)
    return np.maximum(asked, 0)


def asks_for_nothing(stroke: Stroke) -> bool:
    """Whether the stroke wants no change where it lies."""
    return stroke.tool == "fixate" or stroke.strength == 0


def expected_error(strokes: Sequence[Stroke]) -> float:
    """Returns how far off [relative] what the strokes ask for may be from any picture of a surface."""
    return max(SHAPE_ERROR if s.tool in ("blur", "sharpen") else 0.0 for s in strokes)


def wanted_radiance(
    stroke: Stroke, stroke_row: NDArray, samples: Samples, scene: Scene, light: Pictured, warnings: list[str]
) -> F64 | None:
    """Reads the radiance (n, 3) that the stroke asks for at its dabs; None where it is just the painted colours.

    Args:
        stroke_row: (n,) the stroke's point of each dab, as of `gather_samples`.
        light: before any edit.

    Raises: StrokeError where a source to clone lies on no surface.
    """
    if stroke.tool == "replace" and stroke.strength == 1:
        return None
    n, field = len(stroke_row), light.field
    columns = evaluate_columns(samples, field, samples.surface.roughness[:, None].astype(np.float64))
    radiance = mean_by(_sum(columns, samples, field), samples.dab)[:n]
    if asks_for_nothing(stroke):
        return radiance
    painted = stroke.colors[stroke_row].astype(np.float64)
    if stroke.space == "reflectance":
        painted = painted * mean_by(columns[:, 0, 0] + columns[:, 0, 1], samples.dab)[:n]
    source = blurred = None
    if stroke.tool == "clone":
        source = _at_source(stroke, stroke_row, scene, light, warnings)
    if stroke.tool in ("blur", "sharpen"):
        blurred = _blurred(stroke, stroke_row, scene, light)
    return apply_tool(stroke.tool, SeenDabs(radiance, painted, source, blurred), stroke.strength)


def _sum(columns: F64, samples: Samples, field: LightField) -> F64:
    """Radiance (S, 3) from columns (S, 1, 4, 3)."""
    d, f0, f90 = (x.astype(np.float64) for x in (samples.surface.diffuse, samples.surface.f0, samples.surface.f90))
    return bilinear(columns, d, f0, f90, False, field.model).p[:, 0] + unchanging_radiance(samples, field)


def _blurred(stroke: Stroke, stroke_row: NDArray, scene: Scene, light: Pictured) -> F64:
    """B (n, 3): rays of their own for each point and direction, so that sharp lobes are met too."""
    located = locate_stroke(scene, stroke)
    rows = np.searchsorted(located.row, stroke_row)
    points = footprint(stroke, scene, light.tracer, located, rows, BLUR_POINTS, BLUR_REACH)
    dab, triangle, barycentric = (np.repeat(x, BLUR_EYES, 0) for x in points)
    order = np.argsort(dab, kind="stable")
    dab, surface = dab[order], evaluate_surface(scene, triangle[order], barycentric[order])
    towards = stroke.eye[stroke_row][dab].astype(np.float64) - surface.position
    distance = np.linalg.norm(towards, axis=1, keepdims=True)
    frame = frames_about(towards / distance)

    # each dab's directions are spread evenly over the lobe, in an order that its points do not follow
    rng = np.random.default_rng(5)
    even = sobol_points(0, BLUR_POINTS * BLUR_EYES, random_shifts(len(rows), rng))
    even = np.take_along_axis(even, rng.random(even.shape[:2]).argsort(1)[..., None], 1)
    u, v = even[dab, np.arange(len(dab)) - np.searchsorted(dab, dab)].T
    u = u * BLUR_TAIL
    sigma = np.minimum(np.hypot(BLUR_ANGLE, BLUR_LOBE * surface.roughness.astype(np.float64) ** 2), WIDEST_BLUR)
    height = np.arcsin(np.clip(np.abs(np.einsum("ni,ni->n", frame[:, 2], surface.normal)), 0, 1))
    sigma = np.minimum(sigma, height / np.sqrt(BLUR_TAIL / (1 - BLUR_TAIL)))
    aside = (sigma * np.sqrt(u / (1 - u)))[:, None] * np.stack([np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)], -1)
    turned = frame[:, 2] + np.einsum("nc,ncj->nj", aside, frame[:, :2])
    seen_from = surface.position + turned * distance / np.linalg.norm(turned, axis=1, keepdims=True)
    samples = trace_samples(dab, surface, seen_from, light, BLUR_RAYS)
    return mean_by(sent_radiance(samples, light.field), dab)


def _at_source(stroke: Stroke, stroke_row: NDArray, scene: Scene, light: Pictured, warnings: list[str]) -> F64:
    """Radiance (n, 3) at the points to clone from, through the same brush, to the same eye.

    A source that lies on no surface is the one that the eye sees behind or before it.
    """
    here = locate_stroke(scene, stroke)
    point = here.position[np.searchsorted(here.row, stroke_row)].astype(np.float64) + stroke.clone_offset
    nearest = nearest_on_triangles(scene.triangles.positions, point)
    triangle, barycentric = nearest.triangle.copy(), nearest.barycentric.copy()
    off = np.flatnonzero(nearest.distance > 0.5 * stroke.widths[stroke_row])
    if len(off):
        eye = stroke.eye[stroke_row[off]].astype(np.float64)
        way = point[off] - eye
        hits = light.tracer.intersect(eye, way / np.linalg.norm(way, axis=1, keepdims=True))
        triangle[off], barycentric[off] = hits.triangle, hits.barycentric
    found = np.flatnonzero(triangle >= 0)
    if not len(found):
        raise StrokeError(
            f"{stroke.path} clones from a place that is on no surface; choose a clone offset that leads to one"
        )
    if len(found) < len(triangle):
        lost = len(triangle) - len(found)
        what = f"{lost} dabs clone from no surface; the source of the next dab is used"
        warnings.append(Remark((stroke.path,), what, About.PLACE))
    on, at = triangle[found].astype(np.int32), barycentric[found].astype(np.float32)
    located = Located(stroke_row[found], on, at, *points_on_triangles(scene, on, at), False)
    points = footprint(stroke, scene, light.tracer, located, np.arange(len(found)), SAMPLES[0])
    order = np.argsort(points[0], kind="stable")
    dab, triangle, barycentric = (x[order] for x in points)
    surface = evaluate_surface(scene, triangle, barycentric)
    seen_from = stroke.eye[stroke_row[found]][dab].astype(np.float64)
    samples = trace_samples(dab, surface, seen_from, light, RAYS // SAMPLES[0])
    sent = mean_by(sent_radiance(samples, light.field), dab)
    next_one = np.abs(np.arange(len(stroke_row))[:, None] - found[None]).argmin(1)
    return sent[next_one]


def offset_on_picture(
    scene: Scene, tracer: RayTracer, camera: Camera, paths: Sequence[ArrayLike], shift: ArrayLike,
    aspect: float | None = None,
) -> list[float]:  # fmt: skip
    """Returns the way (3,) in the world from what a stroke starts on to what lies `shift` from there on the picture.

    Args:
        paths: each (k, 2), as for `paint_stroke`; the first point that has a surface at both ends counts.
        shift: (2,) picture coordinates, x to the right and y down.

    Raises: StrokeError where no point has a surface at both ends.
    """
    at = np.concatenate([np.asarray(p, np.float64).reshape(-1, 2) for p in paths])
    aspect = aspect or camera.horizontal_aperture / camera.vertical_aperture
    ends = []
    for end in (at, at + np.asarray(shift, np.float64)):
        rays = camera_rays(camera, end, aspect)
        hits = tracer.intersect(rays.origin, rays.direction)
        seen = (hits.triangle >= 0) & (hits.distance <= rays.limit)
        ends.append((seen, points_on_triangles(scene, np.maximum(hits.triangle, 0), hits.barycentric)[0]))
    both = np.flatnonzero(ends[0][0] & ends[1][0])
    if not len(both):
        raise StrokeError("the clone offset leads off every surface that the camera sees: choose another one")
    return [float(x) for x in ends[1][1][both[0]] - ends[0][1][both[0]]]
