"""Strokes: what was painted on a surface, and from where, as a record without USD.

    Stroke                                              frozen record that mirrors the stroke layer (below)
    validate_stroke(stroke) -> None                     StrokeError for what cannot be meant
    paint_stroke(scene, tracer, camera, paths, radius, color=..., image=None, ...) -> Stroke
    next_name(strokes) -> str                           the name of the stroke that is painted after these
    dab_rows(stroke) -> (k,) int                        one row per dab: the twin of a single dab left out

A picture's coordinates run over 0..1 with the origin at the top left; the brush radius is a fraction of the
picture's height.  In the world it is a ball of that size at the depth of the surface; what a dab covers of the picture
is the disc of it that is parallel to the film, so that it is round on the picture also away from its middle.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import StrokeError
from usdslf.scene.records import F32, I32
from usdslf.strokes.words import MODES, NORMS, SCOPES, SPACES, TOOLS


@dataclass(frozen=True)
class Stroke:
    """A painted stroke: n points on k curves; a single dab is a curve of the same point twice.

    World space, stage units, scene-linear working space.  Anchors (`surface_index`, `face`, `barycentric`) have n rows,
    or none where they are unknown.

    Attributes:
        name: of the prim; letters, digits and _.
        points: (n, 3) on the surface [stage units].
        widths: (n,) diameter of the brush [stage units], above 0.
        colors: (n, 3) what was painted, in the working space.
        eye: (n, 3) where each point was seen from [stage units].
        normals: (n, 3) unit, on the side of the eye; or (0, 3).
        curve_counts: points of each curve, 2 or more, together n; () for one curve.
        tool: replace | clone | brighten | darken | blur | sharpen | fixate.
        mode: direct | indirect: whether what was painted changes, or what its light comes from.
        strength: of the tool, 0..1.
        space: scene: colors are radiance as seen | reflectance: they are albedo-like.
        surfaces: paths of the gprims that were painted.
        surface_index: (n,) into surfaces; -1 for a single unknown one.
        face: (n,) face of the gprim as it was authored.
        barycentric: (n, 2) u + the number of the triangle within the face, and v; u and v in 0..1.
        frame: time code that it was painted at; nan: default time.
        norm: l2 | l0 | mixed: how many parameters its change may free.
        scope: stroke | prim | material | similar: how far its change may spread.
        choice: id of the alternative that was chosen; "" for the solver's best.
        clone_offset: (3,) from each point to the source of tool clone [stage units].
        film_normal: (3,) unit, towards the eyes: of the picture that was painted on, on which dabs are round; (0, 0, 0)
            where it is unknown, and each dab is round for its eye.
        active: False for one that is switched off.
        prim: path that it was read from; "" for one that is new.
        origin: (3,) of the world that points and eye are relative to, as `Scene.origin` [stage units].
    """

    name: str
    points: F32
    widths: F32
    colors: F32
    eye: F32
    normals: F32 = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    curve_counts: tuple[int, ...] = ()
    tool: str = "replace"
    mode: str = "direct"
    strength: float = 1.0
    space: str = "scene"
    surfaces: tuple[str, ...] = ()
    surface_index: I32 = field(default_factory=lambda: np.zeros(0, np.int32))
    face: I32 = field(default_factory=lambda: np.zeros(0, np.int32))
    barycentric: F32 = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    frame: float = float("nan")
    norm: str = "mixed"
    scope: str = "material"
    choice: str = ""
    clone_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    film_normal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    active: bool = True
    prim: str = ""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def path(self) -> str:
        """Path of its prim in the stroke layer."""
        return self.prim or f"/SlfStrokes/{self.name}"

    def seen_from(self, origin: tuple[float, float, float]) -> Stroke:
        """Returns the same stroke with points and eyes relative to an origin, that of the scene it is looked at in."""
        if origin == self.origin:
            return self
        away = np.subtract(self.origin, origin)
        points, eye = ((np.asarray(p, np.float64) + away).astype(np.float32) for p in (self.points, self.eye))
        return replace(self, points=points, eye=eye, origin=origin)

    @property
    def counts(self) -> tuple[int, ...]:
        """Points of each curve."""
        return self.curve_counts or (len(self.points),)

    @property
    def has_anchors(self) -> bool:
        """Each point says which face of which surface it lies on."""
        return bool(self.surfaces) and len(self.points) == len(self.surface_index)


def validate_stroke(stroke: Stroke) -> None:
    """Raises StrokeError, in one sentence, for a stroke that says nothing or something impossible."""
    s, n = stroke, len(stroke.points)
    where = f"stroke {s.path}"
    if not re.fullmatch(r"[A-Za-z_]\w*", s.name):
        raise StrokeError(f"{where} has the name {s.name!r}: use letters, digits and _")
    if n == 0:
        raise StrokeError(f"{where} is empty: paint at least one point or remove it")
    shapes = {"points": (n, 3), "widths": (n,), "colors": (n, 3), "eye": (n, 3)}
    shapes |= {"normals": (n, 3)} if len(s.normals) else {}
    if len(s.surface_index) or len(s.face) or len(s.barycentric):
        shapes |= {"surface_index": (n,), "face": (n,), "barycentric": (n, 2)}
    for name, shape in shapes.items():
        value = np.asarray(getattr(s, name))
        if value.shape != shape:
            raise StrokeError(f"{where} has {name} of shape {value.shape} for {n} points: paint it again")
        if not np.isfinite(value).all():
            raise StrokeError(f"{where} has {name} that are not finite numbers: paint it again")
    if (s.widths <= 0).any():
        raise StrokeError(f"{where} has a brush width of zero or less: give a positive one")
    if any(c < 2 for c in s.counts) or sum(s.counts) != n:
        raise StrokeError(f"{where} has curves of {list(s.counts)} points for {n}: each needs two or more")
    choices = {"tool": TOOLS, "mode": MODES, "space": SPACES, "norm": NORMS, "scope": SCOPES}
    for name, allowed in choices.items():
        if getattr(s, name) not in allowed:
            known = ", ".join(allowed)
            raise StrokeError(f"{where} has the unknown {name} {getattr(s, name)!r}: use one of {known}")
    if not 0 <= s.strength <= 1:
        raise StrokeError(f"{where} has a strength of {s.strength:g}: it lies in 0..1")
    if not np.isfinite(s.clone_offset).all():
        raise StrokeError(f"{where} has a clone offset that is no finite number: choose the source again")
    if not np.isfinite(s.film_normal).all():
        raise StrokeError(f"{where} has a film normal that is no finite number: paint it again")
    if s.tool == "clone" and not np.any(s.clone_offset):
        raise StrokeError(f"{where} clones from itself: give it a clone offset")
    if s.has_anchors and ((s.surface_index < -1) | (s.surface_index >= len(s.surfaces))).any():
        raise StrokeError(f"{where} points to surfaces that it does not list: paint it again")


def frame_of(strokes: Iterable[Stroke], asked: float | None, warnings: list[str]) -> float | None:
    """Returns the time code at which strokes are to be looked at: what is asked for, else their own.

    Args:
        strokes: that are looked at together.
        asked: time code; None: as the strokes have it.
        warnings: takes a sentence where strokes are looked at elsewhere than they were painted.

    Raises:
        StrokeError: nothing is asked for, and the strokes are of several frames.
    """
    painted: dict[float | None, list[str]] = {}
    for stroke in strokes:
        painted.setdefault(None if math.isnan(stroke.frame) else stroke.frame, []).append(stroke.path)
    if asked is None:
        if len(painted) > 1:
            several = ", ".join(f"{paths[0]} at {_in_words(own)}" for own, paths in painted.items())
            raise StrokeError(
                f"the strokes were painted at several frames, {several}: name one with --frame, "
                "or keep those of each frame in a layer of their own"
            )
        return next(iter(painted), None)
    for own, paths in painted.items():
        if own is not None and own != asked:
            names = ", ".join(paths)
            warnings.append(f"{names}: painted at {_in_words(own)}, looked at in the light of frame {asked:g}")
    return asked


def _in_words(frame: float | None) -> str:
    return "no frame" if frame is None else f"frame {frame:g}"


def next_name(strokes: Iterable[Stroke]) -> str:
    """Returns the name of the stroke after these: numbers go on behind the highest, `stroke_0001` is the first."""
    numbers = [int(s.name[7:]) for s in strokes if re.fullmatch(r"stroke_[0-9]+", s.name)]
    return f"stroke_{max(numbers, default=0) + 1:04d}"


def dab_rows(stroke: Stroke) -> NDArray[np.int64]:
    """Returns the rows (k,) of the points that stand for dabs: without the twin of a single dab."""
    p, last = stroke.points, np.cumsum(stroke.counts) - 1
    twin = [e for e, c in zip(last, stroke.counts) if c == 2 and (p[e] == p[e - 1]).all()]
    return np.setdiff1d(np.arange(len(stroke.points)), twin)


def _double_single_points(counts: tuple[int, ...]) -> tuple[NDArray, tuple[int, ...]]:
    """Rows and counts of the curves with curves of one point turned into the point twice."""
    single = np.repeat(np.asarray(counts) == 1, counts)
    return np.repeat(np.arange(len(single)), 1 + single), tuple(max(c, 2) for c in counts)

