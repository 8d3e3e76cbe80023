"""Look: a Solution as a USD layer, and what the layer shows.

    author(shot, solution, path, ...) -> Look       writes the layer and reads it back
    render_shot(shot, camera, look, ...)            pictures of the shot, or of it under a look

Both tell how far they are (progress.py); as generators that `close` cancels: `stepwise(lambda: author(...))`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color, color_of
from usdslf.edits.edits import MaterialChange
from usdslf.edits.read_back import why_missing
from usdslf.elements.elements import refresh_reflectance
from usdslf.errors import AuthorError
from usdslf.inference.answer_residuals import residual_as_written
from usdslf.inference.answers import Pool
from usdslf.inference.asked import asked_of
from usdslf.inference.changes import with_varying
from usdslf.light_field.light_field import Surface
from usdslf.progress import step, tell
from usdslf.render.picture import LitScene, PictureOptions, render_bands
from usdslf.scene.records import Camera
from usdslf.shot import Shot, converge
from usdslf.solution import Solution
from usdslf.stylize.changes import with_styles
from usdslf.surfaces.reflectance import model_of
from usdslf.usd.author.author import author_look, author_review_root, check_look_place
from usdslf.usd.author.read_back import kept_unless_whole, scene_under
from usdslf.usd.layer.baked_files import textures_folder
from usdslf.usd.layer.wins import AuthoredEdit

MUCH_WORSE = 1.5  # times the residual, where a look falls short of what was found
PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Look:
    """A look layer as it was written.

    Attributes:
        path: its file.
        edits: what was written, each with what hides and what shows it.
        solution: what it is of, without what was not worth while as it can be written.
        as_written: residuals of answers that vary, as the look shows them.
        warnings: sentences.
        seconds: by step.
    """

    path: str
    edits: tuple[AuthoredEdit, ...]
    solution: Solution
    as_written: Mapping[Pool, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)


def author(
    shot: Shot, solution: Solution, path: PathLike, strokes_path: PathLike | None = None,
    review_root: PathLike | None = None, mode: str = "",
) -> Look:  # fmt: skip
    """Writes a Solution as a look layer, and on request a review root over look, strokes and shot.

    Args:
        shot: that the Solution is of; its files are not changed.
        solution: empty: a look that changes nothing.
        path: of the look; what people added to it by hand stays.
        strokes_path: the stroke layer that the Solution is of, for provenance and the review root.
        review_root: a layer to write over look, strokes and shot.
        mode: override (all that show the material) | new (a material for what was painted only) | class (all
            instances of the asset, by the class that it inherits); "": as each stroke's scope says.

    Returns: the Look.

    Raises: AuthorError where it cannot be written.
    """
    said: list[str] = []
    seconds: dict[str, float] = {}
    if not model_of(shot.model).is_authored:
        said.append(_of_phong(solution))
    while True:
        edits = _write(shot, solution, path, strokes_path, review_root, mode, said, seconds)
        _say(said, *(f"{e.prim}.{e.attribute} is hidden by {e.hidden_by}: {e.mend}" for e in edits if not e.wins))
        solution, as_written = _read_back(shot, solution, path, edits, said, seconds)
        worse = [s for s in solution.stylized.styles if s.is_worse_as_written] if solution.stylized else []
        if not worse or solution.stylized is None:
            break
        for style in worse:
            was, became = style.residual_before, style.residual_as_written
            _say(
                said,
                f"{shot.scene.materials[style.material].path} stays as it is: as it can be written, its change brings "
                f"it no nearer to what was wanted, {was:.3f} became {became:.3f}",
            )
        solution = replace(solution, stylized=solution.stylized.without(worse))
    return Look(
        os.fspath(path), tuple(edits), solution, MappingProxyType(as_written), tuple(said), MappingProxyType(seconds)
    )


def render_shot(
    shot: Shot, camera: Camera | str | None = None, look: Look | PathLike | None = None,
    size: tuple[int, int] = (640, 360), aovs: tuple[str, ...] = (), samples: int = 16, **options: Any,
) -> dict[str, NDArray[np.float32]]:  # fmt: skip
    """Renders a shot as it is, or under a look.

    Args:
        shot: it keeps its light field.
        camera: one, or its path; None: the shot's first, or one that sees everything.
        look: None: as the shot is.  What is rendered more than once is better kept: `shot.edited(look)`.
        size: width and height [pixels].
        aovs: further layers, names of `usdslf.render.picture.AOVS`.
        samples: gathered rays a pixel.
        options: of `usdslf.render.picture.PictureOptions`.

    Returns: name -> (height, width, channels), scene-linear; `color` first.

    Raises: StageError for an unknown camera, InputError for a look that cannot be read, a size or an AOV.
    """
    if look is not None:
        shot = shot.edited(look.path if isinstance(look, Look) else look)
    view = camera if isinstance(camera, Camera) else shot.camera(camera)
    field, lights = shot.light_field, shot.lights
    with step("render", shot.seconds):
        lit = LitScene(shot.scene, shot.tracer, field, lights, shot.device)
        asked = PictureOptions(samples, shot.element_count, **options)
        for share, pictures in render_bands(lit, view, size, ("color", *aovs), asked):  # noqa: B007
            tell(share)
    return pictures


def _say(said: list[str], *sentences: str) -> None:
    said.extend(s for s in dict.fromkeys(sentences) if s not in said)


def _write(
    shot: Shot, solution: Solution, path: PathLike, strokes_path: PathLike | None, review_root: PathLike | None,
    mode: str, said: list[str], seconds: dict[str, float],
) -> list[AuthoredEdit]:  # fmt: skip
    """Writes textures, look and review root."""
    color = color_of(shot.ocio, shot.scene.working_space)
    provenance = {
        "version": _version(),
        "ocioConfig": color.config_name,
        "workingSpace": shot.scene.working_space,
        "device": shot.device.name,
        "solve": _how(shot, solution),
        **({"frame": shot.scene.frame} if np.isfinite(shot.scene.frame) else {}),
    }
    check_look_place(shot.source, path)
    with step("author", seconds), kept_unless_whole(path):
        changes = _with_textures(shot, solution, solution.changes(shot, mode), path, color, said)
        tell()
        edits = author_look(
            shot.source, changes, path, provenance, strokes_path, warnings=said, color=color, mode=mode, made=shot.made,
            frame=shot.scene.frame,
        )  # fmt: skip
        tell()
        _require_shown(shot, solution, path, edits, said)
        if review_root is not None:
            author_review_root(review_root, path, strokes_path, shot.source.GetRootLayer().realPath)
    return edits


def _require_shown(
    shot: Shot, solution: Solution, look: PathLike, edits: list[AuthoredEdit], said: list[str]
) -> None:
    """Reads the look back at what was painted; what it does not show is said, or refused where nothing hides it."""
    asked = asked_of(list(solution.answers), list(solution.painted), shot.scene)
    if not asked:
        return
    under = scene_under(shot.source, look, shot.frame, shot.refine, shot.ocio)
    missing = why_missing(asked, shot.scene, under)
    if missing and all(e.wins for e in edits):
        raise AuthorError(f"{missing[0]}; nothing is written to {look}: solve with --scope prim or --mode new")
    _say(said, *missing)


def _with_textures(
    shot: Shot, solution: Solution, changes: list[MaterialChange], look: PathLike, color: Color, said: list[str]
) -> list[MaterialChange]:
    """Gives changes that vary over surfaces their textures beside the look, where they can have them."""
    s, folder = solution.stylized, textures_folder(look)
    if s is None:
        return with_varying(changes, list(solution.answers), shot.scene, folder, color, said)
    styles = [style for style in s.styles if style.freed]
    return [
        with_styles(c, style, s, shot.scene, shot.elements, folder, color, said)
        for c, style in zip(changes, styles, strict=True)
    ]


def _read_back(
    shot: Shot, solution: Solution, look: PathLike, edits: list[AuthoredEdit], said: list[str],
    seconds: dict[str, float],
) -> tuple[Solution, dict[Pool, float]]:  # fmt: skip
    """Looks at what a look shows where textures or points hold a change: they do only so well."""
    has_texture = any(e.representation == "texture" for e in edits)
    varying = [a for a in solution.answers if a.varying or (has_texture and a.chosen.freed and not a.others)]
    if not (varying or solution.stylized) or not shot.source.GetRootLayer().realPath:
        return solution, {}  # a shot in memory alone is in no look's reach
    other = shot.edited(look)
    if len(other.scene.triangles.mesh) != len(shot.scene.triangles.mesh):
        return solution, {}
    as_written: dict[Pool, float] = {}
    field = shot.light_field
    with step("author", seconds):
        field = field.with_surface(Surface.of(refresh_reflectance(shot.elements, shot.scene, other.scene)))
        converge(field, shot.bounces)
        if solution.stylized:
            solution = replace(solution, stylized=solution.stylized.as_written(field))
        for a in varying:
            residual = residual_as_written(a, other.scene, list(solution.painted), field)
            as_written[a.pool] = residual
            if residual > MUCH_WORSE * max(a.residual_after, 0.02):
                _say(
                    said,
                    f"{shot.scene.materials[a.pool.material].path}: the written look has a residual of "
                    f"{residual:.3f}, the change that was found one of {a.residual_after:.3f}",
                )
    return solution, as_written


def _of_phong(solution: Solution) -> str:
    """Says what a look holds that was solved with phong, and how far off it is where that was measured."""
    off = [
        f"{a.residual_after:.3f} becomes {solution.as_preview[a.pool]:.3f}"
        for a in solution.answers
        if a.pool in solution.as_preview and a.chosen.freed
    ]
    measured = f"; the residual of {', '.join(off)}" if off else ""
    return (
        "solved with phong: the look holds its k_d, k_s and width of lobe as diffuse, specular and roughness of "
        f"UsdPreviewSurface, which reflects otherwise, more so at grazing angles{measured}"
    )


def _how(shot: Shot, solution: Solution) -> str:
    """How the look came about, for its provenance."""
    how = f"{shot.model}, {len(shot.elements)} elements, 1024 directions, {shot.bounces} bounces"
    how += f", {solution.how}" if solution.how else ""
    s = solution.stylized
    return how if s is None else f"stylized by {s.amount:g} within {s.radius:g} of the diagonal; {how}"


def _version() -> str:
    try:
        return version("usdslf")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"
