"""Understanding card: what was inferred from strokes that ask together, and what can be chosen instead."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from hydra_viewer.model.previews import Effect
from hydra_viewer.model.understanding import Alternative, ParameterChange, Understood, value_in_words
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.alternative_tile import AlternativeTile
from hydra_viewer.ui.choice_row import choice_row
from hydra_viewer.ui.swatches import ColorChange, ValueChange
from hydra_viewer.ui.words import tooltip
from usdslf import SCOPES

Shown = Callable[[Sequence[float]], QColor]
MOST_EFFECTS = 4


class UnderstandingCard(QWidget):
    """What was inferred, in words and swatches.

    Attributes:
        group: what was understood.
        tiles: by id of the alternative.
        has_keys: its alternatives have shortcuts.
        sentence: the line that says it.
        chosen: Signal(str): an explanation was clicked; "": the solver's own is wanted again.
        scope_chosen: Signal(str): how far the change is to go.
        scope_looked_at: Signal(str): a scope is pointed at, "": none is any more.
        dab_asked: Signal(bool): where to dab next is to be marked, or not.
    """

    chosen = Signal(str)
    scope_chosen = Signal(str)
    scope_looked_at = Signal(str)
    dab_asked = Signal(bool)

    def __init__(self, group: Understood, shown: Shown, keys: bool, parent: QWidget | None = None) -> None:
        """Shows it; pictures come later.

        Args:
            shown: the screen's colour of a scene-linear one.
            keys: its alternatives have shortcuts.
        """
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.group, self._shown, self.has_keys, self._words = group, shown, keys, _in_words(group)
        self.tiles: dict[str, AlternativeTile] = {}
        self._changes: list[tuple[ColorChange | ValueChange, QLabel | None]] = []
        self.setObjectName("card")
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(8, 8, 8, 8)
        self._layout.setSpacing(6)
        self._add_head()
        self._add_changes()
        self._add_alternatives()
        self._add_scope()
        self._effects = QVBoxLayout()
        self._effects.setSpacing(2)
        self._layout.addLayout(self._effects)

    def reads_as(self, group: Understood) -> bool:
        """Whether a card of a group would say the same, word by word."""
        return group == self.group or self._words == _in_words(group)

    def fits(self, group: Understood) -> bool:
        """Whether it can say a group as well: that has the same parts, and other numbers and colours at most."""
        return group == self.group or _parts(self.group) == _parts(group)

    def take(self, group: Understood) -> None:
        """Says another group that it fits.

        A new card costs ten times as much, and flickers: an answer is refined again and again.
        """
        is_same = self.reads_as(group)
        self.group, self._words = group, _in_words(group)
        if is_same:
            return
        self.sentence.setText(_breakable(group.sentence))
        for (picture, said), change in zip(self._changes, group.changes, strict=True):
            self._show_change(picture, change)
            if said is not None:
                said.setText(change.range_in_words)
        for tile, alternative in zip(self.tiles.values(), _in_order(group), strict=True):
            tile.take(alternative)

    # ── what it says ───────────────────────────────────────────────────────────────────────────

    def _add_head(self) -> None:
        group = self.group
        names = ", ".join(n.replace("stroke_", "").lstrip("0") or n for n in group.strokes)
        head = QLabel(f"<b>{group.material.rsplit('/', 1)[-1] or '—'}</b>")
        head.setToolTip(group.material)
        which = _dim(words.of_strokes(names, len(group.strokes)))
        row = QHBoxLayout()
        row.addWidget(head, 1)
        row.addWidget(which)
        self._layout.addLayout(row)
        self.sentence = _wrapped(_breakable(group.sentence))
        self.sentence.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._layout.addWidget(self.sentence)
        if group.is_chosen_by_hand:
            row = QHBoxLayout()
            row.addWidget(_dim(words.BY_HAND), 1)
            self.let_decide = _button(words.LET_DECIDE, lambda: self.chosen.emit(""))
            row.addWidget(self.let_decide)
            self._layout.addLayout(row)

    def _add_changes(self) -> None:
        grid = QGridLayout()
        grid.setHorizontalSpacing(8)
        grid.setVerticalSpacing(3)
        grid.setColumnStretch(1, 1)
        for change in self.group.changes:
            row = grid.rowCount()
            picture = ColorChange() if change.is_color else ValueChange()
            said = _dim(change.range_in_words) if change.low else None
            self._show_change(picture, change)
            self._changes.append((picture, said))
            grid.addWidget(_dim(change.name), row, 0)
            grid.addWidget(picture, row, 1)
            if said is not None:
                grid.addWidget(said, row + 1, 0, 1, 2)
        self._layout.addLayout(grid)
        for note in (*self.group.notes, *self.group.also):
            self._layout.addWidget(_dim(note))

    def _show_change(self, picture: ColorChange | ValueChange, change: ParameterChange) -> None:
        if isinstance(picture, ColorChange):
            picture.show_colors(self._shown(change.before), self._shown(change.after))
        else:
            ends = (change.low[0], change.high[0]) if change.low else None
            picture.show_values(change.before[0], change.after[0], ends)
        picture.setToolTip(f"{change.in_words}\n{change.range_in_words}".rstrip())
        picture.setAccessibleName(f"{change.name} {value_in_words(change.after)}")

    # ── what can be chosen ─────────────────────────────────────────────────────────────────────

    def _add_alternatives(self) -> None:
        group = self.group
        if not group.offered:
            return
        asked = group.question
        if asked:
            question = QLabel(words.QUESTION)
            question.setToolTip(words.QUESTION_TIP)
            question.setStyleSheet(f"color: {theme.ACCENT}; font-weight: bold;")
            self._layout.addWidget(question)
            self._add_tiles(asked)
            self._add_dab_button()
        rest = group.offered[len(asked) :]
        if rest:
            self._layout.addWidget(_dim(words.ALTERNATIVES))
            self._add_tiles(rest)
        if not asked:
            self._add_dab_button()

    def _add_tiles(self, alternatives: Sequence[Alternative]) -> None:
        grid = QGridLayout()
        grid.setSpacing(6)
        for n, alternative in enumerate(alternatives):
            number = len(self.tiles) + 1
            key = f"Alt+{number}" if self.has_keys and number <= 4 else ""
            tile = AlternativeTile(alternative, key)
            tile.clicked.connect(lambda _=False, tile=tile: self._click(tile.alternative))
            grid.addWidget(tile, n // 2, n % 2)
            self.tiles[alternative.id] = tile
        for column in (0, 1):
            grid.setColumnStretch(column, 1)
        self._layout.addLayout(grid)

    def choose_number(self, number: int) -> None:
        """Clicks the tile of a number, from 1."""
        tiles = list(self.tiles.values())
        if number <= len(tiles) and tiles[number - 1].isEnabled():
            self._click(tiles[number - 1].alternative)

    def _click(self, alternative: Alternative) -> None:
        """An explanation is taken: also the one that is shown, which answers the question."""
        if not alternative.is_chosen or self.group.rival:
            self.chosen.emit(alternative.id)

    def _add_dab_button(self) -> None:
        self.dab_button = QPushButton(words.NEXT_DAB[0])
        self.dab_button.setCheckable(True)
        self.dab_button.setToolTip(tooltip(*words.NEXT_DAB, "N" if self.has_keys else ""))
        self.dab_button.toggled.connect(self.dab_asked)
        self._layout.addWidget(self.dab_button)

    # ── how far it goes ────────────────────────────────────────────────────────────────────────

    def _add_scope(self) -> None:
        self._layout.addWidget(_dim(words.SCOPE_TITLE))
        row, self.scopes = choice_row(self, SCOPES, words.SCOPES, self.scope_chosen.emit, look_at=self._look_at)
        for button in self.scopes.values():
            button.setProperty("isTight", True)
        self.scopes[self.group.scope].setChecked(True)
        self._layout.addLayout(row)
        if self.group.sharing and self.group.scope in ("material", "similar"):
            shared = _dim(words.shared_by(len(self.group.sharing), self.group.sharing[0].rsplit("/", 1)[-1]))
            shared.setToolTip("\n".join(self.group.sharing[:20]))
            self._layout.addWidget(shared)

    def _look_at(self, scope: str) -> None:
        """A scope that is pointed at, or has the focus, is shown on the picture."""
        self.scope_looked_at.emit(scope)

    # ── what else changes ──────────────────────────────────────────────────────────────────────

    def show_effects(self, effects: Sequence[Effect]) -> None:
        """Says what of the picture changes, painted or not."""
        while (item := self._effects.takeAt(0)) is not None:
            widget = item.widget()
            if widget is not None:
                widget.deleteLater()
        if not effects:
            return
        self._effects.addWidget(_dim(words.EFFECTS))
        for effect in effects[:MOST_EFFECTS]:
            kind = words.EFFECT_KINDS[effect.is_painted, effect.shows_material]
            line = QLabel(words.effect(effect.path.rsplit("/", 1)[-1], effect.change, kind))
            line.setToolTip(effect.path)
            self._effects.addWidget(line)
        if len(effects) > MOST_EFFECTS:
            rest = _dim(words.more(len(effects) - MOST_EFFECTS))
            rest.setToolTip("\n".join(e.path for e in effects[MOST_EFFECTS : MOST_EFFECTS + 20]))
            self._effects.addWidget(rest)


def _in_order(group: Understood) -> tuple[Alternative, ...]:
    """The alternatives in the order of the tiles."""
    asked = group.question
    return (*asked, *group.offered[len(asked) :]) if group.offered else ()


def _parts(group: Understood) -> tuple[object, ...]:
    """What a card of a group is made of: cards of others with the same parts differ in numbers and colours alone."""
    changes = [(c.name, c.is_color, bool(c.low)) for c in group.changes]
    offered = [a.id for a in _in_order(group)]
    rest = group.material, group.strokes, group.is_chosen_by_hand, group.sharing, group.also, group.notes, group.scope
    return changes, offered, len(group.question), rest


def _breakable(text: str) -> str:
    """A text whose paths may go on in another line."""
    return text.replace("/", "/\u200b")


def _in_words(group: Understood) -> tuple[object, ...]:
    """All that a card says of a group."""
    said = [(c.in_words, c.range_in_words) for c in group.changes]
    others = [
        (a.id, a.title, a.is_chosen, None if a.chance is None else words.chance(a.chance),
         [c.in_words for c in a.changes])
        for a in group.alternatives
    ]  # fmt: skip
    rest = group.strokes, group.rival, group.is_chosen_by_hand, group.sharing, group.also, group.notes, group.scope
    return group.sentence, said, others, rest


def _wrapped(text: str) -> QLabel:
    """A label that never makes the panel wider."""
    label = QLabel(text)
    label.setWordWrap(True)
    label.setMinimumWidth(40)
    return label


def _dim(text: str) -> QLabel:
    label = _wrapped(text) if len(text) > 24 else QLabel(text)
    label.setProperty("isDim", True)
    return label


def _button(words_of: tuple[str, str], do: Callable[[], object]) -> QPushButton:
    button = QPushButton(words_of[0])
    button.setToolTip(tooltip(*words_of, ""))
    button.clicked.connect(lambda _=False: do())
    return button
