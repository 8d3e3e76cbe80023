"""Solution: what strokes, or a style, ask of a shot's materials.

    solve(shot, strokes, settings) -> generator of Progress that returns a Solution
    stylize_shot(shot, amount, radius, norm) -> the same, of unsharp masking the whole shot
    find_solution, find_style                    the same without the generator, for one who waits

The generators deliver their Solution as generators do, by `return`: `run(solve(shot, strokes), say)` is the Solution,
and so is `value` of the StopIteration that `next` ends with.  `close` cancels; the shot and earlier Solutions stay what
they are in any case, as work goes on with a light field of its own.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from usdslf.edits.edits import MaterialChange
from usdslf.edits.unwritten import materials_under
from usdslf.errors import SolveError, StrokeError
from usdslf.gpu.ahead import built_ahead
from usdslf.inference.ahead import programs_of_answers
from usdslf.inference.answer_residuals import residual_as_preview
from usdslf.inference.answers import Answer, Painted, Pool
from usdslf.inference.changes import changes_of
from usdslf.inference.direct import MOST_ROUNDS, gather_stroke, infer_changes
from usdslf.inference.first_answers import Asking
from usdslf.inference.gathered import name_of
from usdslf.inference.indirect import infer_indirect
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.progress import Progress, step, stepwise, tell, tell_during
from usdslf.scene.records import Material
from usdslf.shot import Shot
from usdslf.similarity.similarity import Weights
from usdslf.strokes.remarks import About, Remark
from usdslf.strokes.stroke import Stroke
from usdslf.stylize.changes import restyled
from usdslf.stylize.surroundings import find_surroundings
from usdslf.stylize.unsharp_mask import (
    AMOUNT,
    RADIUS,
    Stylized,
    check_numbers,
    check_surroundings,
    editable_materials,
    stylize_light,
)
from usdslf.surfaces.reflectance import model_of
from usdslf.threads import one_blas_thread


@dataclass(frozen=True)
class Settings:
    """What a solve is told beside its strokes.

    Attributes:
        norm: l2 | l0 | mixed for all strokes; None: each stroke's own.
        choose: stroke name -> id of an alternative.
        weights: of the choice: `Options.of((1, 5, 25))` or `Options.of({"group": 8})`.
        similarity: weights of what strokes of scope `similar` change beside the painted material.
        bounces: most bounces of a round; None: the shot's.
        follows_light: False: what direct strokes ask for in the light as it is, before what a change sends round is
            followed; it is found on the way to the whole answer, which costs no more afterwards.
    """

    norm: str | None = None
    choose: Mapping[str, str] = field(default_factory=dict)
    weights: Options | None = None
    similarity: Weights | None = None
    bounces: int | None = None
    follows_light: bool = True

    def in_words(self) -> str:
        """Returns what is not as usual, for provenance."""
        said = [f"norm {self.norm}" if self.norm else "", self.weights.in_words() if self.weights else ""]
        return ", ".join(filter(None, said))


@dataclass(frozen=True, eq=False)
class Solution:
    """What was found.  It never changes, and is whole.

    Attributes:
        strokes: the active ones; pools of the answers count them.
        answers: one for each material and scope that was painted, or that an indirect stroke changes.
        stylized: what became of a shot that was stylized; None: strokes were solved.
        painted: strokes with their samples, what the solve looked at.
        as_preview: residuals of answers by phong, as UsdPreviewSurface shows them.
        left_out: of the light that surfaces send to direct strokes, what each round left out, 0..1; below
            `UNSEEN` unless the bounces were too few.
        settings: what it was found with.
        warnings: sentences.
        seconds: by step.
    """

    strokes: tuple[Stroke, ...] = ()
    answers: tuple[Answer, ...] = ()
    stylized: Stylized | None = None
    painted: tuple[Painted, ...] = field(default=(), repr=False)
    as_preview: Mapping[Pool, float] = field(default_factory=dict)
    left_out: tuple[float, ...] = ()
    settings: Settings = field(default_factory=Settings)
    warnings: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)

    def closest_call(self, stroke: str | None = None) -> Answer:
        """Returns the direct answer whose two leading explanations cost most nearly the same.

        Args:
            stroke: name or path of a stroke that it has to be of; None: any.

        Raises: SolveError where there is none.
        """
        of = {i for i, s in enumerate(self.strokes) if stroke is None or stroke in (s.name, s.path)}
        gaps: list[tuple[float, int]] = []
        for k, a in enumerate(self.answers):
            rivals = [c.cost for c in a.candidates if c.id != a.chosen.id]
            if rivals and not a.others and not a.pool.is_held and of & set(a.pool.strokes):
                gaps.append((min(rivals) - a.chosen.cost, k))
        if not gaps:
            which = f"the stroke {stroke}" if stroke else "any stroke"
            raise SolveError(f"there is no direct answer to {which}; solve direct strokes first")
        return self.answers[min(gaps)[1]]

    def rivals(self, count: int) -> dict[int, Solution]:
        """Returns the next best explanations of each change that is constant, as Solutions, by row of `changes`.

        Args:
            count: of each, at most.
        """
        found = {}
        freed = [a for a in self.answers if a.chosen.freed]
        for row, a in enumerate(freed if count and self.stylized is None else ()):
            if a.varying or a.others or a.pool.scope == "stroke" or a.pool.similar or a.pool.similar_in_part:
                continue
            others = [c for c in a.candidates if c.freed and c.is_admitted and c.id != a.chosen.id]
            others = [c for c in others if c.id in a.if_chosen][:count]
            answers = [replace(a, chosen=c, after=a.if_chosen[c.id], residual_after=np.nan) for c in others]
            if answers:
                found[row] = replace(self, answers=tuple(answers))
        return found

    def as_chosen(self, stroke: str, choice: str) -> Solution:
        """Returns what it would be by another explanation, at once, for who wants to see what that looks like.

        It is of the light as it was: what the change sends round is not followed, as `solve` with `choose` does.

        Args:
            stroke: name or path of a direct stroke; those that were asked together with it go with it.
            choice: id of an alternative.

        Raises: SolveError where there is no such alternative, or the stroke is indirect.
        """
        of = {i for i, s in enumerate(self.strokes) if stroke in (s.name, s.path)}
        mine = [a for a in self.answers if of & set(a.pool.strokes)]
        if not mine:
            raise SolveError(f"there is no answer to the stroke {stroke}; solve it first")
        answers = tuple(a.as_chosen(choice) if any(a is m for m in mine) else a for a in self.answers)
        return replace(self, answers=answers)

    def changes(self, shot: Shot, mode: str = "") -> list[MaterialChange]:
        """Returns what was found as changes of materials.

        Args:
            shot: that this is of.
            mode: as of `author`; `new` is of painted gprims only.
        """
        if self.stylized is not None:
            return restyled(self.stylized.styles, shot.scene)
        return changes_of(list(self.answers), shot.scene, list(self.strokes), shot.light_field, mode)

    def materials(self, shot: Shot) -> list[Material] | None:
        """Returns the materials of a shot under what was found, at once: no look is written and read.

        None where only a look says it: a part of what shows a material changes, or the change varies.

        Args:
            shot: that this is of.
        """
        varies = any(a.varying or a.onto_similar for a in self.answers)
        if varies or self.stylized is not None or not model_of(shot.model).is_authored:
            return None
        return materials_under(self.changes(shot), shot.scene)

    def over(self, shot: Shot) -> Shot | None:
        """Returns a shot under what was found, as `materials` does; its light follows when it is asked for."""
        materials = self.materials(shot)
        return None if materials is None else shot.under(materials)


def solve(
    shot: Shot, strokes: Sequence[Stroke], settings: Settings | None = None
) -> Generator[Progress, None, Solution]:
    """Finds the smallest change of materials that explains strokes.

    Args:
        shot: stays as it is; several may be solved at once.
        strokes: those that are active count.
        settings: None: as usual.

    Yields how far it is; returns the Solution (`run` hands it out).  `close` cancels.

    Raises, when it is run: StrokeError for strokes that say nothing or contradict each other, SolveError where nothing
    can be solved.

    Source: Nguyen et al. 2013, 5.3 and 5.4.
    """
    return stepwise(lambda: find_solution(shot, strokes, settings))


def stylize_shot(
    shot: Shot, amount: float = AMOUNT, radius: float = RADIUS, norm: str = "mixed"
) -> Generator[Progress, None, Solution]:
    """Unsharp masks the light field of a whole shot.  Yields and returns as `solve` does.

    Args:
        shot: stays as it is.
        amount: contrast that is added, as a multiple of what is there; 0 changes nothing.
        radius: of the surroundings that a place is set off from, as a fraction of the scene's diagonal.
        norm: l0 | mixed | l2: how freely diffuse, specular and glossiness of a place change together.

    Raises, when it is run: InputError for numbers that cannot be, AuthorError where no material can be edited.

    Source: Nguyen et al. 2013, 7 and figure 22.
    """
    return stepwise(lambda: find_style(shot, amount, radius, norm))


def check_stroke(stroke: Stroke) -> None:
    """Raises StrokeError for a stroke with numbers that are not finite."""
    if not all(np.isfinite(x).all() for x in (stroke.points, stroke.widths, stroke.colors, stroke.eye)):
        raise StrokeError(f"{stroke.path} has points, widths, colours or eyes that are not finite; paint it again")


@one_blas_thread()
def find_solution(shot: Shot, strokes: Sequence[Stroke], settings: Settings | None = None) -> Solution:
    """Finds the smallest change of materials that explains the active strokes.

    Raises: StrokeError for strokes that say nothing or contradict each other, SolveError where nothing can be solved.

    Source: Nguyen et al. 2013, 5.3 and 5.4.
    """
    s = settings or Settings()
    active = [stroke for stroke in strokes if stroke.active]
    if not active:
        raise SolveError("there is no active stroke; paint one with: usdslf stroke")
    for stroke in active:
        check_stroke(stroke)
    asked = [replace(stroke, norm=s.norm) if s.norm else stroke for stroke in active]
    seconds: dict[str, float] = {}
    said: list[str] = []
    with built_ahead(shot.device, programs_of_answers(shot.model)):
        light = shot.light_field
        light.lend_soon()
        painted = _gathered(shot, asked, said, seconds)
    with step("solve", seconds):
        name = name_of("answers", [p.name for p in painted], s, shot.bounces)
        find = lambda own: _answers(shot, light, painted, s, own)  # noqa: E731
        found = tell_during(lambda: shot.gathered.once(name, find, said))
    for a in found.answers:
        if a.is_ambiguous and not a.others:
            what = f"{a.chosen.id} and {a.ties[0]} explain it about equally well; paint more or choose"
            remark = Remark([active[i].path for i in a.pool.strokes], what, About.TIE)
            if remark not in said:
                said.append(remark)
    return Solution(
        tuple(active), found.answers, None, tuple(painted), MappingProxyType(found.as_preview), found.left_out,
        s, tuple(said), MappingProxyType(seconds),
    )  # fmt: skip


def _gathered(shot: Shot, asked: list[Stroke], said: list[str], seconds: dict[str, float]) -> list[Painted]:
    """The strokes with what was traced for them."""
    painted: list[Painted] = []
    with step("evidence", seconds):
        for stroke in asked:
            gather = partial(gather_stroke, stroke, shot.scene, shot.pictured)
            painted.append(tell_during(partial(shot.gathered.of, stroke, gather, said)))
            tell(len(painted) / len(asked))
    return painted


@dataclass(frozen=True)
class _Found:
    """What strokes ask for, by the names of Solution."""

    answers: tuple[Answer, ...]
    as_preview: Mapping[Pool, float]
    left_out: tuple[float, ...]


def _answers(shot: Shot, light: LightField, painted: list[Painted], s: Settings, said: list[str]) -> _Found:
    """The answers, and the residuals of those by phong as UsdPreviewSurface shows them; work on light of their own."""
    with light.lent() as field:
        return _answers_in(shot, field, light, painted, s, said)


def _answers_in(
    shot: Shot, field: LightField, light: LightField, painted: list[Painted], s: Settings, said: list[str]
) -> _Found:
    """The same on a light field that changes; `light` stays."""
    left = list[float]()
    bounces, choose = s.bounces or shot.bounces, dict(s.choose)
    direct: list[Answer] = []
    as_preview: dict[Pool, float] = {}
    if any(p.stroke.mode == "direct" for p in painted):
        weights = s.weights or Options()
        asked = shot.scene, field, weights, choose, bounces, s.similarity, said, left, shot.gathered
        ask = Asking(*asked, s.follows_light, light)
        rounds = infer_changes(painted, ask)
        for number, direct in enumerate(rounds):  # noqa: B007
            tell((number + 1) / MOST_ROUNDS)
    if not model_of(shot.model).is_authored:
        as_preview = {a.pool: residual_as_preview(a, painted, field) for a in direct}
    if not s.follows_light or not any(p.stroke.mode == "indirect" for p in painted):
        return _Found(tuple(direct), as_preview, tuple(left))
    indirect = infer_indirect(painted, shot.scene, field, s.weights, bounces, said, choose, direct)
    return _Found((*direct, *indirect), as_preview, tuple(left))


@one_blas_thread()
def find_style(shot: Shot, amount: float = AMOUNT, radius: float = RADIUS, norm: str = "mixed") -> Solution:
    """Unsharp masks the light field of the whole shot, and finds the reflectance that explains it.

    Args:
        amount: contrast that is added, as a multiple of what is there; 0 changes nothing.
        radius: of the surroundings that a place is set off from, as a share of the scene's diagonal.
        norm: l0 | mixed | l2: how freely diffuse, specular and glossiness of a place change together.

    Raises: InputError for numbers that cannot be, AuthorError where no material can be edited.

    Source: Nguyen et al. 2013, 7 and figure 22.
    """
    check_numbers(amount, radius)
    said: list[str] = []
    seconds: dict[str, float] = {}
    scene = shot.scene
    free = editable_materials(scene, [int(m) for m in np.unique(scene.triangles.material)], said)
    free = [m for m in free if (shot.elements.material == m).any()]  # where light lives
    field = shot.light_field
    field = field.with_surface(field.surface)

    def stylized() -> Stylized:
        near = find_surroundings(shot.elements, shot.tracer, radius * scene.diagonal)
        check_surroundings(near, scene)
        for number, found in enumerate(stylize_light(field, near, amount, radius, free, shot.bounces, norm)):  # noqa: B007
            tell((number + 1) / 2)
        return found

    with step("stylize", seconds):
        found = tell_during(stylized)
    return Solution(stylized=found, warnings=tuple(said), seconds=MappingProxyType(seconds))
