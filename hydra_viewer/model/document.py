"""Document: one owner of the shot, the strokes on it, what was found, and their files.

All of it is changed by these methods alone; who shows something of it connects to the announcers.  The shot is never
written to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hydra_viewer.model.announcer import Announcer
from hydra_viewer.model.found import Found
from hydra_viewer.model.history import History
from hydra_viewer.model.prim_tree import PrimTree
from usdslf import FrameRange, Shot, Stroke, frame_range, next_name

Strokes = tuple[Stroke, ...]


def are_same(some: Sequence[Stroke], others: Sequence[Stroke]) -> bool:
    """Returns whether two lists hold the very same strokes, in the same order."""
    return len(some) == len(others) and all(a is b for a, b in zip(some, others))


@dataclass(frozen=True)
class Files:
    """Where things are kept: paths, "" where there is none yet."""

    stage: str = ""
    strokes: str = ""
    look: str = ""


class Document:
    """What is worked on.

    Attributes:
        shot: None: nothing is open.
        files: of it.
        prims, frames: of the shot: its tree, and its frames where there are several.
        found: what the strokes ask for, of the last solve that is whole; None: of no strokes.
        message: a sentence that people should see.
        selected: path of the prim that is selected; "": none.
        shot_changed, strokes_changed, found_changed, files_changed, selection_changed, message_changed: whom to tell.
    """

    def __init__(self) -> None:
        self.shot: Shot | None = None
        self.files = Files()
        self.prims: PrimTree | None = None
        self.frames: FrameRange | None = None
        self.found: Found | None = None
        self.message = ""
        self.selected = ""
        self._history: History[Strokes] = History(())
        self._saved: Strokes = ()
        self.shot_changed, self.strokes_changed, self.found_changed = Announcer(), Announcer(), Announcer()
        self.files_changed, self.selection_changed, self.message_changed = Announcer(), Announcer(), Announcer()

    # ── the shot ───────────────────────────────────────────────────────────────────────────────

    def open(
        self, shot: Shot, files: Files, strokes: Sequence[Stroke] = (), prims: PrimTree | None = None,
        is_saved: bool = True,
    ) -> None:  # fmt: skip
        """Takes a shot in, in place of what was open.

        Args:
            shot: with what pictures need already made.
            files: of it.
            strokes: on it.
            prims: its tree; None: not shown.
            is_saved: the strokes are those of the file.
        """
        self.shot, self.files, self.found, self.selected = shot, files, None, ""
        self.prims, self.frames = prims, frame_range(shot.stage)
        self._history = History(tuple(strokes))
        self._saved = tuple(strokes) if is_saved else ()
        for tell in (self.shot_changed, self.files_changed, self.strokes_changed, self.found_changed):
            tell()

    def take_shot(self, shot: Shot, found: Found | None, prims: PrimTree | None = None) -> None:
        """Takes another frame of the same shot, or what is on the disk now; strokes stay.

        Args:
            shot: in that state.
            found: with the same look over it; None: strokes have to be solved anew.
            prims: its tree; None: as it was.
        """
        self.shot, self.found, self.prims = shot, found, prims or self.prims
        self.shot_changed()
        self.found_changed()

    def report(self, sentence: str) -> None:
        """Says something that people should see."""
        self.message = sentence
        self.message_changed()

    # ── strokes ────────────────────────────────────────────────────────────────────────────────

    @property
    def strokes(self) -> Strokes:
        """All strokes, those too that are switched off, in the order in which they count."""
        return self._history.now

    @property
    def active(self) -> Strokes:
        """Those that count."""
        return tuple(s for s in self.strokes if s.active)

    @property
    def next_name(self) -> str:
        """Of the stroke that is painted next."""
        return next_name(self.strokes)

    @property
    def undoes(self) -> str:
        """What undo would take back, in words; "": nothing."""
        return self._history.undoes

    @property
    def redoes(self) -> str:
        """What redo would do again, in words; "": nothing."""
        return self._history.redoes

    def change_strokes(self, what: str, strokes: Sequence[Stroke]) -> None:
        """Puts other strokes in the place of all; one step of undo.

        Args:
            what: in words, for the menu.
            strokes: all.
        """
        if not are_same(strokes, self.strokes):
            self._history.do(what, tuple(strokes))
            self.strokes_changed()

    def undo(self) -> None:
        """Takes the last change of strokes back."""
        if self._history.undo():
            self.strokes_changed()

    def redo(self) -> None:
        """Makes the change again that was taken back."""
        if self._history.redo():
            self.strokes_changed()

    # ── what was found, and files ──────────────────────────────────────────────────────────────

    @property
    def is_answered(self) -> bool:
        """Whether what was found is of the strokes as they are; in the light as it was, perhaps."""
        return are_same(self.found.strokes if self.found is not None else (), self.active)

    @property
    def is_solved(self) -> bool:
        """Whether it is, and the light that it sends round was followed."""
        return self.is_answered and (self.found is None or not self.found.is_first)

    @property
    def is_shown(self) -> bool:
        """Whether it is, with its look and its light: nothing more comes."""
        return self.is_answered and (self.found is None or self.found.is_whole)

    def take_found(self, found: Found | None) -> None:
        """Takes what was found of the active strokes."""
        self.found = found
        self.found_changed()

    @property
    def is_saved(self) -> bool:
        """Whether the files hold the strokes as they are."""
        return are_same(self.strokes, self._saved)

    def mark_saved(self, files: Files, strokes: Sequence[Stroke]) -> None:
        """Notes that strokes are in files."""
        self.files, self._saved = files, tuple(strokes)
        self.files_changed()

    def select(self, path: str) -> None:
        """Selects a prim; "": none."""
        if path != self.selected:
            self.selected = path
            self.selection_changed()
