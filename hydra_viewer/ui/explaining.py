"""Explaining: what was understood, pictures of the alternatives, and marks, kept up with what was found.

All of it is made by quiet jobs, which hold nothing up; a stroke that is painted or changed cancels them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.found import Found
from hydra_viewer.model.previews import Effects, Preview, Sight, WholePicture, previewing
from hydra_viewer.model.scope_mask import scope_mask
from hydra_viewer.model.stroke_edits import changed, chosen, is_same_paint
from hydra_viewer.model.understanding import Understood, understood
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui.solving import KIND as SOLVE
from hydra_viewer.ui.worker import Job, Worker
from usdslf import Camera, NextDab, Stroke, find_next_dab, stepwise

MASK_PIXELS = 160_000
PREVIEW = 168, 112  # of a preview, width and height [pixels]
KINDS = GROUPS, PREVIEWS, DAB, MASK = "understand", "previews", "next dab", "scope"


@dataclass(frozen=True, eq=False)
class Marked:
    """A place to dab next, and what was understood of the stroke that it is for."""

    group: Understood
    dab: NextDab


class Explaining(QObject):
    """What was understood of the strokes.

    Attributes:
        groups: what strokes ask for together.
        preview_size, aspect: of previews [pixels], and of the picture.
        looked_at: names of the strokes that are to be explained first.
        previews: by number of the group and id of the alternative.
        effects: what of the picture changes; None: not known yet.
        marked: a place to dab next; None: none was asked for.
        mask: (h, w) what a scope covers; None: not shown.
        groups_changed, effects_changed, marks_changed: Signal().
        preview_made: Signal(int, str): number of the group, id of the alternative.
        work_changed: Signal(): pictures are made, or not any more.
        failed: Signal(str): a sentence.
    """

    groups_changed = Signal()
    preview_made = Signal(int, str)
    effects_changed = Signal()
    marks_changed = Signal()
    work_changed = Signal()
    failed = Signal(str)

    def __init__(self, document: Document, easel: Easel, worker: Worker, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._document, self._easel, self._worker = document, easel, worker
        self.aspect = 1.6
        self.preview_size = PREVIEW
        self._found: Found | None = None
        self._whole = WholePicture()
        self._forget()
        document.found_changed.connect(self._take_found)
        document.strokes_changed.connect(self._strokes_changed)
        document.shot_changed.connect(self._shot_changed)
        worker.idle_changed.connect(self._take_idle)

    def _take_idle(self, is_idle: bool) -> None:
        if is_idle:
            self.groups_changed.emit()

    def _forget(self) -> None:
        self.groups: tuple[Understood, ...] = ()
        self.looked_at: tuple[str, ...] = ()
        self.previews: dict[tuple[int, str], Preview] = {}
        self._pictured: tuple[tuple[Stroke, ...], Camera] | None = None  # what the previews are of
        self.effects: Effects | None = None
        self.marked: Marked | None = None
        self.mask: NDArray | None = None

    # ── what was understood ────────────────────────────────────────────────────────────────────

    @property
    def is_current(self) -> bool:
        """Whether what was understood is of the strokes as they are."""
        return self._document.is_answered and bool(self.groups or not self._document.active)

    @property
    def is_coming(self) -> bool:
        """Whether what is not current yet is being looked for; False: that was cancelled, or failed."""
        return self._worker.is_doing(SOLVE) or self._worker.is_doing(GROUPS)

    @property
    def is_making_pictures(self) -> bool:
        """Whether pictures of alternatives are under way."""
        return self._worker.is_doing(PREVIEWS)

    def _cancel(self) -> None:
        for kind in KINDS:
            self._worker.cancel(kind)
        self.work_changed.emit()

    def _shot_changed(self) -> None:
        self._cancel()
        self._found = None
        self._whole = WholePicture()
        self._forget()
        self._tell_all()

    def _strokes_changed(self) -> None:
        self._cancel()
        self.marked = self.mask = None
        self.marks_changed.emit()
        self.groups_changed.emit()

    def _take_found(self) -> None:
        found, shot = self._document.found, self._document.shot
        before, self._found = self._found, found
        if found is None or shot is None or not found.strokes:
            self._cancel()
            self._forget()
            self._tell_all()
            return
        if before is None or before.solution is not found.solution:
            self._start(GROUPS, lambda: stepwise(lambda: understood(shot, found)), self._take_groups)
        elif found.is_lit and not before.is_lit and self.groups and not self._worker.is_doing(GROUPS):
            self._make_previews()

    def _take_groups(self, groups: tuple[Understood, ...]) -> None:
        self._worker.cancel(PREVIEWS)
        self.previews = self._still_right(groups)
        self.groups, self.effects, self.marked = groups, None, None
        self._tell_all()
        if self._found is not None and self._found.is_lit:
            self._make_previews()

    def _still_right(self, groups: tuple[Understood, ...]) -> dict[tuple[int, str], Preview]:
        """The pictures that are of the same paint, seen by the same camera: a choice changes none of them."""
        view, found = self._easel.view, self._found
        if self._pictured is None or view is None or found is None or self._pictured[1] is not view.camera:
            return {}
        before, now = ({s.name: s for s in strokes} for strokes in (self._pictured[0], found.strokes))
        same = {name for name in now if name in before and is_same_paint(before[name], now[name])}
        numbers = {g.strokes: n for n, g in enumerate(groups) if same.issuperset(g.strokes)}
        kept = {}
        for (number, id_), preview in self.previews.items():
            there = numbers.get(self.groups[number].strokes)
            if there is not None:
                kept[there, id_] = replace(preview, group=there)
        return kept

    def _make_previews(self) -> None:
        found, shot, view, groups = self._found, self._document.shot, self._easel.view, self.groups
        if found is None or shot is None or view is None:
            return
        sight = Sight(view.camera, self.aspect, self.preview_size, self._easel.display)
        known, whole = set(self.previews), self._whole
        self._pictured = found.strokes, view.camera
        steps = lambda: previewing(shot, found, groups, sight, whole, known)  # noqa: E731
        self._start(PREVIEWS, steps, self._end_pictures, self._take_part)
        self.work_changed.emit()

    def _end_pictures(self, _: None) -> None:
        self.work_changed.emit()

    def _take_part(self, part: Preview | Effects) -> None:
        if isinstance(part, Effects):
            self.effects = part
            self.effects_changed.emit()
            return
        self.previews[part.group, part.id] = part
        self.preview_made.emit(part.group, part.id)

    # ── what a person does with it ─────────────────────────────────────────────────────────────

    def choose(self, group: Understood, id_: str) -> None:
        """Takes an explanation; "": the likeliest."""
        found = group.alternative(id_)
        name = words.chose(found.title) if found else words.LET_DECIDE[0]
        self._document.change_strokes(name, chosen(self._document.strokes, group.strokes, id_))

    def look_at(self, names: tuple[str, ...]) -> None:
        """Explains what was understood of some strokes first."""
        if names != self.looked_at:
            self.looked_at = names
            self.groups_changed.emit()

    def set_scope(self, group: Understood, scope: str) -> None:
        """Lets the change spread as far as a scope."""
        strokes = changed(self._document.strokes, group.strokes, scope=scope)
        self._document.change_strokes(words.edited("scope", scope), strokes)

    def mark_next_dab(self, group: Understood) -> None:
        """Marks where one more dab tells the leading explanations apart."""
        found, shot, view = self._found, self._document.shot, self._easel.view
        if found is None or shot is None or view is None:
            return

        def mark(dab: NextDab) -> None:
            self.marked = Marked(group, dab)
            self.marks_changed.emit()

        find = lambda: find_next_dab(shot, found.solution, group.strokes[0], view.camera)  # noqa: E731
        self._start(DAB, lambda: stepwise(find), mark)

    def unmark(self) -> None:
        """Takes the mark off the picture."""
        self._worker.cancel(DAB)
        self.marked = None
        self.marks_changed.emit()

    def show_scope(self, group: Understood, scope: str) -> None:
        """Marks what a scope would cover, before it is accepted."""
        shot, view = self._document.shot, self._easel.view
        stroke = next((s for s in self._document.strokes if s.name in group.strokes), None)
        if shot is None or view is None or stroke is None:
            return
        high = (MASK_PIXELS / self.aspect) ** 0.5
        size, material, camera = (max(1, round(high * self.aspect)), max(1, round(high))), group.material, view.camera

        def show(mask: NDArray) -> None:
            self.mask = mask
            self.marks_changed.emit()

        find = lambda: scope_mask(shot, stroke, scope, material, camera, size)  # noqa: E731
        self._start(MASK, lambda: stepwise(find), show)

    def hide_scope(self) -> None:
        """Takes the marks of a scope off the picture."""
        self._worker.cancel(MASK)
        if self.mask is not None:
            self.mask = None
            self.marks_changed.emit()

    @property
    def is_finding_dab(self) -> bool:
        """Whether a place to dab next is looked for."""
        return self._worker.is_doing(DAB)

    def stop_previews(self) -> None:
        """Makes no more pictures of these strokes."""
        self._worker.cancel(PREVIEWS)
        self.work_changed.emit()

    # ── the worker ─────────────────────────────────────────────────────────────────────────────

    def _start(self, kind: str, steps: Any, done: Any, part: Any = lambda part: None) -> None:
        self._worker.start(Job(kind, steps, done, self._fail, part, is_quiet=True))

    def _fail(self, sentence: str, error: BaseException) -> None:
        self.work_changed.emit()
        self.failed.emit(sentence)

    def _tell_all(self) -> None:
        for signal in (self.groups_changed, self.effects_changed, self.marks_changed):
            signal.emit()
