"""Look: a Solution as a USD layer.

    author(shot, solution, path, ...) -> Look       writes the layer and reads it back

It tells how far it is (progress.py); as a generator that `close` cancels: `stepwise(lambda: author(...))`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from usdslf.color import Color, color_of
from usdslf.edits.collateral import Collateral
from usdslf.edits.edits import MaterialChange
from usdslf.edits.read_back import Missing, why_missing
from usdslf.elements.elements import refresh_reflectance
from usdslf.errors import AuthorError
from usdslf.inference.answer_residuals import residual_as_written
from usdslf.inference.answers import Pool
from usdslf.inference.asked import asked_of
from usdslf.inference.changes import with_varying
from usdslf.light_field.importance import seen_from
from usdslf.light_field.renewal import renew
from usdslf.light_field.surface import Surface
from usdslf.progress import step, tell, tell_during
from usdslf.provenance import program_version, said_of_solve, words_of_phong, words_of_solve
from usdslf.scene.difference import MaterialsSeen, look_alike, materials_seen
from usdslf.scene.records import Scene
from usdslf.shot import Shot
from usdslf.solution import Solution
from usdslf.strokes.anchors import locate_stroke
from usdslf.stylize.changes import with_styles
from usdslf.stylize.unsharp_mask import Stylized
from usdslf.surfaces.reflectance import model_of
from usdslf.usd.author.author import author_look, author_review_root, check_look_place
from usdslf.usd.author.collateral import Reading, look_collateral
from usdslf.usd.author.read_back import scene_under, stage_under
from usdslf.usd.author.rebase import Rebase, earlier_look, rebased, silence_again
from usdslf.usd.author.whole import whole_or_as_before
from usdslf.usd.author.writing import Instead
from usdslf.usd.layer.baked_files import textures_folder
from usdslf.usd.layer.wins import AuthoredEdit

MUCH_WORSE = 1.5  # times the residual, where a look falls short of what was found
# Where a change as it is usually written does not show: other ways, those that keep more first.
OTHER_WAYS = (Instead(True, False), Instead(False, True), Instead(True, True))
PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Look:
    """A look layer as it was written.

    Attributes:
        path: its file.
        edits: what was written, each with what hides and what shows it.
        solution: what it is of, without what was not worth while as it can be written.
        as_written: residuals of answers that vary, as the look shows them.
        not_shown: sentences: what was asked for and the shot hides.
        collateral: what it changes beyond what it is meant to, the worst first.
        warnings: sentences.
        seconds: by step.
        rebase: what became of the look that stood there before; None: there was none.
        read: the materials as the look was read back; None: it was not.
    """

    path: str
    edits: tuple[AuthoredEdit, ...]
    solution: Solution
    as_written: Mapping[Pool, float] = field(default_factory=dict)
    not_shown: tuple[str, ...] = ()
    collateral: tuple[Collateral, ...] = ()
    warnings: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    rebase: Rebase | None = None
    read: MaterialsSeen | None = field(default=None, repr=False)

    def over(self, shot: Shot, shown: Shot | None = None) -> Shot:
        """Returns a shot with the look over it, whose light follows; see `Shot.sharing`.

        Args:
            shot: that it is of.
            shown: what `Solution.over` gave: where the look is read as the same materials on the same surfaces, value
                by value, that is returned, with the light that it may have already.

        Raises: InputError where the look cannot be read.
        """
        there = materials_seen(shown.scene) if shown is not None else None
        if shown is not None and self.read is not None and look_alike(self.read, there):
            return shown
        edited = shot.edited(self.path, follows=True)
        return shown if shown is not None and look_alike(materials_seen(edited.scene), there) else edited


def author(
    shot: Shot, solution: Solution, path: PathLike, strokes_path: PathLike | None = None,
    review_root: PathLike | None = None, mode: str = "", alternatives: int = 0,
) -> Look:  # fmt: skip
    """Writes a Solution as a look layer, and on request a review root over look, strokes and shot.

    What it says is read back.  A change that does not show is written another way, which is said; where none shows and
    something stronger hides it, the look is written all the same and `not_shown` says so.

    Args:
        shot: that the Solution is of; its files are not changed.
        solution: empty: a look that changes nothing.
        path: of the look; what people added to it by hand stays, and what was silenced (usdslf toggle) stays silent.
        strokes_path: the stroke layer that the Solution is of, for provenance and the review root.
        review_root: a layer to write over look, strokes and shot.
        mode: override (all that show the material) | new (a material for what was painted only) | class (all
            instances of the asset, by the class that it inherits); "": as each stroke's scope says.
        alternatives: other explanations of each change that the look holds too, as variants (author/variants.py).

    Returns: the Look.

    Raises: AuthorError where it cannot be written, or nothing hides it and yet no way of writing it shows.  Then, and
        where it is cancelled, files are as they were before.
    """
    said: list[str] = []
    seconds: dict[str, float] = {}
    target = _Target(shot, path, strokes_path, mode, alternatives)
    if not model_of(shot.model).is_authored:
        said.append(words_of_phong(solution))
    check_look_place(shot.source, path)
    earlier = earlier_look(path)
    with whole_or_as_before(path, review_root) as kept:
        look = _author(target, solution, review_root, said, seconds)
        still = silence_again(path, earlier) if earlier else ()
        look = replace(look, warnings=(*look.warnings, *still), read=None if still else look.read)
    if earlier:
        strokes = [s for s in solution.strokes if s.has_anchors and locate_stroke(shot.scene, s).moved]
        moved, there = [s.path for s in strokes], [s.path for s in solution.strokes]
        look = replace(look, rebase=rebased(earlier, shot.source, look.edits, moved, there))
    return replace(look, warnings=(*look.warnings, *kept))


def _author(
    target: _Target, solution: Solution, review_root: PathLike | None, said: list[str], seconds: dict[str, float]
) -> Look:
    """Writes a look until all that it shows is worth while."""
    shot, path = target.shot, target.path
    while True:
        found, not_shown = _write(target, solution, review_root, said, seconds)
        _say(said, *not_shown)
        solution, as_written = _read_back(target, solution, found, said, seconds)
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
    with step("author", seconds):
        scene, reading = shot.scene, Reading(shot.frame, shot.refine, shot.ocio)
        beside = lambda: look_collateral(shot.source, scene, path, reading, found.under)  # noqa: E731
        collateral = tell_during(beside) if found.edits else []
    _say(said, *(c.in_words() for c in collateral if c.is_finding))
    own = os.fspath(path), tuple(found.edits), solution, MappingProxyType(as_written), tuple(not_shown)
    read = materials_seen(found.under) if found.under else None
    return Look(*own, tuple(collateral), tuple(said), MappingProxyType(seconds), read=read)


def _say(said: list[str], *sentences: str) -> None:
    said.extend(s for s in dict.fromkeys(sentences) if s not in said)


@dataclass(frozen=True)
class _Target:
    """What a look is of, and where it goes."""

    shot: Shot
    path: PathLike
    strokes_path: PathLike | None
    mode: str
    alternatives: int

    def provenance(self, solution: Solution) -> dict[str, Any]:
        """What the layer says of where it comes from."""
        shot, color = self.shot, self.color
        return {
            "version": program_version(),
            "ocioConfig": color.config_name,
            "workingSpace": shot.scene.working_space,
            "device": shot.device.name,
            "solve": words_of_solve(shot, solution),
            **({} if solution.stylized else {"settings": said_of_solve(shot, solution.settings, self.mode)}),
            **({"frame": shot.scene.frame} if np.isfinite(shot.scene.frame) else {}),
            **({"missing": [m.sentence for m in shot.scene.missing]} if shot.scene.missing else {}),
        }

    @property
    def color(self) -> Color:
        """Of the shot."""
        return color_of(self.shot.ocio, self.shot.scene.working_space)


@dataclass(frozen=True)
class _Try:
    """A look as it was written, and read back."""

    edits: list[AuthoredEdit]
    missing: list[Missing]
    said: list[str]
    instead: dict[str, Instead]  # by material: how it was written otherwise than usual
    under: Scene | None = None  # the shot with it, where that was read

    @property
    def materials(self) -> set[str]:
        """Whose change is not shown."""
        return {m.material for m in self.missing}


def _write(
    target: _Target, solution: Solution, review_root: PathLike | None, said: list[str], seconds: dict[str, float]
) -> tuple[_Try, list[str]]:
    """Writes textures, look and review root, as they show; returns also what does not, in words."""
    shot, path = target.shot, target.path
    with step("author", seconds):
        found = _as_shown(target, solution)
        hidden = [f"{e.prim}.{e.attribute} is hidden by {e.hidden_by}: {e.mend}" for e in found.edits if not e.wins]
        if found.missing and not hidden:
            why = found.missing[0].sentence
            raise AuthorError(f"{why}; nothing is written to {path}: solve with --scope prim or --mode new")
        _say(said, *found.said)
        for material, instead in found.instead.items():
            _say(said, f"the change of {material} is written as {instead}: as it is usually written it does not show")
        if review_root is not None:
            author_review_root(review_root, path, target.strokes_path, shot.source.GetRootLayer().realPath)
    return found, [*hidden, *(m.sentence for m in found.missing)]


def _as_shown(target: _Target, solution: Solution) -> _Try:
    """Writes the look; what it does not show, another way, unless a person hid it or the way was asked for."""
    found = last = _try(target, solution, {})
    for instead in OTHER_WAYS if not target.mode else ():
        again = found.materials - _hidden_by_hand(target.shot.scene, found)
        if not again:
            break
        try:
            last = _try(target, solution, {**found.instead, **dict.fromkeys(again, instead)})
        except AuthorError:
            continue  # there is no such way
        found = last if last.materials < found.materials else found
    return found if found is last else _try(target, solution, found.instead)


def _try(target: _Target, solution: Solution, instead: dict[str, Instead]) -> _Try:
    """Writes a look and reads it back."""
    shot, said = target.shot, list[str]()
    changes = tell_during(
        lambda: _with_textures(shot, solution, solution.changes(shot, target.mode), target.path, target.color, said)
    )
    others = solution.rivals(target.alternatives)
    rivals = {i: _with_textures(shot, s, s.changes(shot), target.path, target.color, said) for i, s in others.items()}
    edits = author_look(
        shot.source, changes, target.path, target.provenance(solution), target.strokes_path, warnings=said,
        color=target.color, mode=target.mode, made=shot.made, frame=shot.scene.frame, instead=instead,
        rivals=rivals, keeps_textures=True,
    )  # fmt: skip
    tell()
    asked = asked_of(list(solution.answers), list(solution.painted), shot.scene, shot.light_field, target.mode)
    if not asked:
        return _Try(edits, [], said, instead)
    under = scene_under(shot.source, target.path, shot.frame, shot.refine, shot.ocio)
    scene = shot.scene
    return _Try(edits, tell_during(lambda: why_missing(asked, scene, under)), said, instead, under)


def _hidden_by_hand(scene: Scene, found: _Try) -> set[str]:
    """The materials whose change is hidden by what a person wrote into the look, which is what that person wants."""
    by_hand = [e for e in found.edits if e.is_hidden_by_hand]
    shown = {m.path: (m.path, *scene.shown_on(i)) for i, m in enumerate(scene.materials)}
    return {m for m in found.materials if any(e.shown_at.startswith(shown[m]) for e in by_hand)}


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
    target: _Target, solution: Solution, found: _Try, said: list[str], seconds: dict[str, float]
) -> tuple[Solution, dict[Pool, float]]:
    """Looks at what a look shows where textures or points hold a change: they do only so well."""
    shot = target.shot
    has_texture = any(e.representation == "texture" for e in found.edits)
    varying = [a for a in solution.answers if a.varying or (has_texture and a.chosen.freed and not a.others)]
    if not (varying or solution.stylized):
        return solution, {}
    scene = found.under if not shot.made else None
    scene = scene or shot.reopened(stage_under(shot.source, target.path)).scene
    if len(scene.triangles.mesh) != len(shot.scene.triangles.mesh):
        return solution, {}
    as_written: dict[Pool, float] = {}
    field = shot.light_field

    def looked_at() -> tuple[Stylized | None, list[float]]:
        """What the light field of the look is to a style, and the residuals of what varies."""
        start = solution.stylized.light if solution.stylized and solution.stylized.light else field
        under = start.with_surface(Surface.of(refresh_reflectance(shot.elements, shot.scene, scene)))
        matters = None
        if varying:
            matters = seen_from(field, np.sum([p.samples.met(field) for p in solution.painted], axis=0))
        renew(under, shot.bounces, matters=matters)
        style = solution.stylized.as_written(under) if solution.stylized else None
        return style, [residual_as_written(a, scene, list(solution.painted), under) for a in varying]

    with step("author", seconds):
        style, residuals = tell_during(looked_at)
        for a, residual in zip(varying, residuals, strict=True):
            as_written[a.pool] = residual
            if residual > MUCH_WORSE * max(a.residual_after, 0.02):
                _say(
                    said,
                    f"{shot.scene.materials[a.pool.material].path}: the written look has a residual of "
                    f"{residual:.3f}, the change that was found one of {a.residual_after:.3f}",
                )
    return replace(solution, stylized=style), as_written
