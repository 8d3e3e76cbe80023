"""Where to dab next: the visible place that best tells the leading explanations of a stroke apart.

    next_dab(answer, seen, scene, tracer, field, lights, others) -> NextDab

Places on a grid of the picture that show the answer's material are lit as dabs are (evidence.py), each explanation says
what they would look like, and the place is taken where one dab tells the answer from its rivals best:

    gain = d' C^-1 d,    d = (L_1 - L_2) / (m + 0.1 mean m),    C = drift^2 1 + (tint^2 + dab^2) I

over the three channels, m the mean of |L_1| and |L_2|, and the errors of weights.py.  Rivals count by their
probabilities, and each with MOST_GAIN at most, as what is decided need not be decided twice.  Where the gain over the
nearest rival is small no single dab decides, which `is_decisive` says.

Source: Lindley 1956, On a measure of the information provided by an experiment (for two hypotheses of one variance).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from usdslf.errors import SolveError
from usdslf.inference.answers import Answer, Painted
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import build_evidence
from usdslf.inference.samples import gather_samples
from usdslf.inference.uncertainty import TEMPERATURE
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet
from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import F64, Camera, Scene
from usdslf.strokes.paint import paint_stroke

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

ACROSS = 24  # places on the longer side of the picture
RADIUS = 0.01  # of a dab, in picture heights
MARGIN = 0.04  # of the picture's sides, where nobody paints
LEAST_GAIN = 9.0  # three standard deviations: a dab there decides
MOST_GAIN = 25.0  # five of them, beyond which a rival is gone
RIVAL_COST = 12.0  # beyond the nearest rival's, above which one is none


@dataclass(frozen=True)
class NextDab:
    """A place to paint, and what each explanation would look like there.

    Attributes:
        xy: 0..1 of the picture, from its top left.
        position: in the world [stage units].
        expected: id of an explanation -> scene-linear radiance.
        gain: squared difference over a painter's variance.
        is_decisive: whether one dab there tells the two apart.
    """

    xy: tuple[float, float]
    position: tuple[float, float, float]
    expected: dict[str, tuple[float, float, float]]
    gain: float
    is_decisive: bool


def next_dab(
    answer: Answer, camera: Camera, scene: Scene, tracer: RayTracer, field: LightField, lights: LightSet,
    options: Options | None = None,
) -> NextDab:  # fmt: skip
    """Returns the place on a camera's picture that best separates an answer from its nearest rival.

    Args:
        answer: its `candidates` are the explanations; the chosen one and the cheapest other are compared.
        field: the light field of the shot as it is.

    Raises: SolveError where the camera does not see the material, or there is one explanation only.
    """
    options = options or Options()
    rivals = sorted((c for c in answer.candidates if c.id != answer.chosen.id), key=lambda c: c.cost)
    if not rivals:
        raise SolveError("there is one explanation only; no dab is needed to tell it from others")
    pair = (answer.chosen, rivals[0])
    path = scene.materials[answer.pool.material].path or "the material"
    aspect = camera.horizontal_aperture / camera.vertical_aperture
    nx, ny = (ACROSS, max(2, round(ACROSS / aspect))) if aspect >= 1 else (max(2, round(ACROSS * aspect)), ACROSS)
    x, y = (MARGIN + (1 - 2 * MARGIN) * (np.arange(n) + 0.5) / n for n in (nx, ny))
    places = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    places = places[_shows(answer.pool.material, places, camera, scene, tracer)]
    if not len(places):
        raise SolveError(f"the camera {camera.path} sees nothing of {path}; choose another with --camera")
    places = places[np.linspace(0, len(places) - 1, min(len(places), 96)).round().astype(int)]
    stroke = paint_stroke(scene, tracer, camera, [p[None] for p in places], RADIUS, aspect=aspect)
    samples, rows = gather_samples(stroke, scene, tracer, field, lights, [])
    painted = Painted(stroke, samples, rows)
    evidence = build_evidence(stroke, rows, samples, field, None)
    here = np.flatnonzero(evidence.material == answer.pool.material)
    tables = pool_tables([evidence], answer.pool.material, field.model)
    look = _look(tables, answer.chosen)
    near = [c for c in rivals if c.cost < pair[1].cost + RIVAL_COST]
    chance = np.exp(-np.array([c.cost - pair[1].cost for c in near]) / TEMPERATURE)
    gains = np.stack([_gain(look, _look(tables, c), options) for c in near])
    best = int((chance[:, None] * np.minimum(gains, MOST_GAIN)).sum(0).argmax())
    gain = gains[0]
    looks = [look, _look(tables, pair[1])]
    at = stroke.points[painted.rows[here[best]]]
    where = places[_curve_of(stroke.counts, int(painted.rows[here[best]]))]
    return NextDab(
        (float(where[0]), float(where[1])), (float(at[0]), float(at[1]), float(at[2])),
        {c.id: tuple(float(v) for v in look[best]) for c, look in zip(pair, looks, strict=True)},  # type: ignore[misc]
        float(gain[best]), bool(gain[best] >= LEAST_GAIN),
    )  # fmt: skip


def _gain(one: F64, other: F64, o: Options) -> F64:
    """Squared difference (n,) of two looks (n, 3) over the variance of one dab."""
    size = 0.5 * (np.abs(one) + np.abs(other))
    off = (one - other) / (size + 0.1 * size.mean() + 1e-9)
    c = o.drift_error**2 * np.ones((3, 3)) + (o.tint_error**2 + o.dab_error**2) * np.eye(3)
    found: F64 = np.einsum("ni,ij,nj->n", off, np.linalg.inv(c), off)
    return found


def _shows(material: int, places: F64, camera: Camera, scene: Scene, tracer: RayTracer) -> np.ndarray:
    """Tells which places (n, 2) of the picture show a material."""
    rays = camera_rays(camera, places, camera.horizontal_aperture / camera.vertical_aperture)
    hits = tracer.intersect(rays.origin, rays.direction)
    seen = (hits.triangle >= 0) & (hits.distance <= rays.limit)
    return seen & (scene.triangles.material[np.maximum(hits.triangle, 0)] == material)


def _look(t: Tables, c: Candidate) -> F64:
    """Radiance (n, 3) of the places by a candidate, on the level nearest to its roughness."""
    if "glossiness" not in c.freed:
        return replace(c, level=t.own).radiance(t)
    wanted = float(c.roughness_of(np.array([t.roughness]))[0])
    return replace(c, level=int(np.abs(t.levels[:-1] - wanted).argmin())).radiance(t)


def _curve_of(counts: tuple[int, ...], row: int) -> int:
    return int(np.searchsorted(np.cumsum(counts), row, side="right"))
