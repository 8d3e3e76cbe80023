"""Hints: what helps who paints.  Both leave the shot as it is, and tell how far they are (progress.py).

find_next_dab(shot, solution, stroke, camera) -> NextDab     where one more dab decides
similarity_to(shot, strokes, camera, ...) -> (h, w, 1)       what looks like what was painted
"""

from __future__ import annotations

from collections.abc import Sequence

from usdslf.inference.next_dab import NextDab, next_dab
from usdslf.progress import tell_during
from usdslf.scene.records import F32, Camera
from usdslf.shot import Shot
from usdslf.similarity.materials import similarity_of
from usdslf.similarity.similarity import Weights
from usdslf.solution import Solution
from usdslf.strokes.stroke import Stroke


def find_next_dab(
    shot: Shot, solution: Solution, stroke: str | None = None, camera: Camera | str | None = None
) -> NextDab:
    """Finds where one more dab best tells the two leading explanations of a stroke apart.

    Args:
        shot: whose light field is asked.
        solution: of strokes on the shot.
        stroke: its name or path; None: the one whose explanations are nearest to each other.
        camera: on whose picture, or its path; None: the shot's first, or one that sees everything.

    Returns: a place (0..1 of the picture and in the world [stage units]), the scene-linear radiance that each
        explanation expects there, and whether one dab there decides.

    Raises: SolveError where nothing was solved, the stroke is indirect, or the camera does not see its material.
    """
    answer = solution.closest_call(stroke)
    view = camera if isinstance(camera, Camera) else shot.camera(camera)
    seen = shot.scene, shot.tracer, shot.light_field, shot.light_set
    return tell_during(lambda: next_dab(answer, view, *seen))


def similarity_to(
    shot: Shot, strokes: Stroke | Sequence[Stroke], camera: Camera | str | None = None,
    size: tuple[int, int] = (640, 360), weights: Weights | None = None, warnings: list[str] | None = None,
) -> F32:  # fmt: skip
    """Returns a picture (h, w, 1): how similar what each pixel shows is to the dabs of strokes.

    Args:
        shot: that they are on.
        strokes: one or several.
        camera: one, or its path; None: the shot's first, or one that sees everything.
        size: width and height [pixels].
        weights: of position, normal and reflectance.
        warnings: takes sentences.

    Raises: StrokeError for a stroke that lies on no surface.
    """
    painted = [strokes] if isinstance(strokes, Stroke) else list(strokes)
    view = camera if isinstance(camera, Camera) else shot.camera(camera)
    scene, tracer = shot.scene, shot.tracer
    return tell_during(lambda: similarity_of(painted, scene, tracer, view, size, weights, warnings))
