"""The panel Understood: what the strokes were taken for, and what may be meant instead."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import NDArray
from PySide6.QtCore import QTimer
from PySide6.QtGui import QColor, QImage
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QToolButton, QVBoxLayout, QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.previews import Effect, Preview
from hydra_viewer.model.understanding import Understood
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.explaining import PREVIEW, Explaining
from hydra_viewer.ui.swatches import image_of, shown, shown_picture
from hydra_viewer.ui.tab_order import tab_through
from hydra_viewer.ui.understanding_card import UnderstandingCard
from hydra_viewer.ui.words import tooltip
from usdslf import Shot

MOST_CARDS = 5  # others are shown when their strokes are selected
SHARPEST = 1.5  # pixels of a preview by those of the panel


class UnderstandingPanel(QWidget):
    """A card for what strokes ask for together: of the selected strokes first, then of the last painted ones.

    Attributes:
        cards: in the order of the panel.
    """

    def __init__(self, document: Document, easel: Easel, explaining: Explaining, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self._easel, self._explaining = document, easel, explaining
        self.cards: list[UnderstandingCard] = []
        self._wanted: tuple[Understood, ...] = ()  # the groups that there are to be cards of
        self._before: list[UnderstandingCard] = []  # cards of other groups, that go or are used again
        self._images: dict[int, tuple[NDArray, QImage]] = {}  # of previews as the screen shows them, by their picture
        self._make_others = QTimer(self)
        self._make_others.timeout.connect(self._make_rest)
        sharp = min(self.devicePixelRatioF(), SHARPEST)
        explaining.preview_size = round(PREVIEW[0] * sharp), round(PREVIEW[1] * sharp)
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(6, 6, 6, 6)
        self._layout.setSpacing(8)
        self._said = QLabel()
        self._said.setWordWrap(True)
        self._said.setStyleSheet(f"color: {theme.DIM};")
        self._layout.addWidget(self._said)
        self._layout.addWidget(self._progress_row())
        self._layout.addStretch(1)
        explaining.groups_changed.connect(self._fill)
        explaining.preview_made.connect(self._show_preview)
        explaining.effects_changed.connect(self._show_effects)
        explaining.marks_changed.connect(self._show_marked)
        explaining.work_changed.connect(self._show_work)
        document.found_changed.connect(self._say)
        easel.display_changed.connect(self._show_colors)
        self._fill()

    def _progress_row(self) -> QWidget:
        self._work = QWidget()
        row = QHBoxLayout(self._work)
        row.setContentsMargins(0, 0, 0, 0)
        label, bar, stop = QLabel(words.MAKING_PICTURES), QProgressBar(textVisible=False), QToolButton()
        label.setStyleSheet(f"color: {theme.DIM};")
        bar.setRange(0, 0)
        bar.setFixedWidth(60)
        stop.setText(words.STOP[0])
        stop.setToolTip(tooltip(words.STOP[1], "", ""))
        stop.clicked.connect(self._explaining.stop_previews)
        for each, stretch in ((label, 1), (bar, 0), (stop, 0)):
            row.addWidget(each, stretch)
        self._work.hide()
        return self._work

    @property
    def sentences(self) -> tuple[str, ...]:
        """What it says of the strokes as they are; () while that is looked for."""
        return tuple(group.sentence for group in self._wanted) if self._explaining.is_current else ()

    # ── cards ──────────────────────────────────────────────────────────────────────────────────

    def _fill(self) -> None:
        explaining = self._explaining
        wanted = tuple(sorted(explaining.groups, key=self._order))[:MOST_CARDS]
        if self._wanted != wanted:
            self._make_cards(wanted)
        for card in self.cards:
            card.setEnabled(explaining.is_current)
        self._say()

    def _order(self, group: Understood) -> int:
        """Groups of the strokes that are looked at first, then of the latest."""
        names = [s.name for s in self._document.strokes]
        is_first = bool(set(group.strokes) & set(self._explaining.looked_at))
        return -max((names.index(n) for n in group.strokes if n in names), default=0) - is_first * len(names)

    def _make_cards(self, groups: Sequence[Understood]) -> None:
        """Makes cards of groups; those that read the same already stay.

        The first one is there at once, the others one after another when there is nothing else to do: a card takes some
        milliseconds.
        """
        self._wanted, self._before, self.cards = tuple(groups), [*self.cards, *self._before], []
        for card in self._before:
            card.setVisible(any(card.fits(g) for g in groups))
        kept = {id(p.picture) for p in self._explaining.previews.values()}
        self._images = {key: pair for key, pair in self._images.items() if key in kept}
        if groups:
            self._make_next()
        self._make_others.start()

    def _make_next(self) -> None:
        number = len(self.cards)
        group = self._wanted[number]
        at_hand = [c for c in self._before if c.has_keys == (number == 0)]
        kept = next((c for c in at_hand if c.reads_as(group)), None)
        kept = kept or next((c for c in at_hand if c.fits(group) and not self._is_wanted(c)), None)
        card = kept or self._new_card(group, number)
        if kept is not None:
            self._before.remove(kept)
            kept.take(group)
            kept.show()
        if kept is None or self._layout.indexOf(kept) != 2 + number:
            self._layout.insertWidget(2 + number, card)
        card.setEnabled(self._explaining.is_current)
        self.cards.append(card)
        of = next((n for n, g in enumerate(self._explaining.groups) if g == group), -1)
        for at, id_ in self._explaining.previews:
            if at == of:
                self._show_preview(at, id_)
        if number == 0:
            self._show_effects()
            self._show_marked()

    def _is_wanted(self, card: UnderstandingCard) -> bool:
        """Whether a card says what is to be said as it is."""
        return any(card.reads_as(g) for g in self._wanted)

    def _new_card(self, group: Understood, number: int) -> UnderstandingCard:
        card = UnderstandingCard(group, self._shown, keys=number == 0)
        card.chosen.connect(lambda id_: self._explaining.choose(card.group, id_))
        card.scope_chosen.connect(lambda scope: self._explaining.set_scope(card.group, scope))
        card.scope_looked_at.connect(lambda scope: self._look_at(card.group, scope))
        card.dab_asked.connect(lambda is_asked: self._ask_dab(card.group, is_asked))
        return card

    def _make_rest(self) -> None:
        """The next card, or the end: what is not wanted any more goes, Tab walks through what is there."""
        if len(self.cards) < len(self._wanted):
            self._make_next()
            return
        self._make_others.stop()
        for card in self._before:
            self._layout.removeWidget(card)
            card.hide()
            card.deleteLater()
        self._before = []
        tab_through(self)

    def _show_colors(self) -> None:
        """The screen shows colours otherwise: all cards are made anew."""
        groups, self._images = self._wanted, {}
        self._drop()
        self._make_cards(groups)

    def _drop(self) -> None:
        for card in (*self.cards, *self._before):
            self._layout.removeWidget(card)
            card.hide()
            card.deleteLater()
        self.cards, self._before, self._wanted = [], [], ()

    def _shown(self, linear: Sequence[float]) -> QColor:
        shot = self._document.shot
        assert shot is not None
        return shown(linear, shot, self._easel.display)

    def _say(self) -> None:
        document = self._document
        if not document.active:
            text = words.NOTHING_PAINTED
        elif not self._explaining.is_current:
            text = words.LOOKING if self._explaining.is_coming or document.shot is None else words.NOT_LOOKED
        else:
            text = "" if document.is_solved else words.FOLLOWING
        self._said.setText(text)
        self._said.setVisible(bool(text))

    def _card_of(self, number: int) -> UnderstandingCard | None:
        groups = self._explaining.groups
        group = groups[number] if number < len(groups) else None
        return next((c for c in self.cards if c.group == group), None)

    def _show_preview(self, number: int, id_: str) -> None:
        card, shot = self._card_of(number), self._document.shot
        tile, preview = card.tiles.get(id_) if card else None, self._explaining.previews.get((number, id_))
        if tile is None or preview is None or shot is None or tile.preview is preview:
            return
        tile.preview = preview
        if preview.picture is None:
            tile.forbid(preview.why_not)
        else:
            tile.show_picture(self._image_of(preview.picture, preview, shot))

    def _image_of(self, picture: NDArray, preview: Preview, shot: Shot) -> QImage:
        """A preview as the screen shows it: as it came with it, where the screen still shows colours in that way."""
        key, display = id(picture), self._easel.display
        if key not in self._images:
            codes = preview.codes if preview.display == display else None
            self._images[key] = picture, image_of(codes) if codes is not None else shown_picture(picture, shot, display)
        return self._images[key][1]

    def _show_effects(self) -> None:
        """What changes beside the paint is said once, on the first card."""
        effects = self._explaining.effects
        rows: tuple[Effect, ...] = effects.rows if effects else ()
        for number, card in enumerate(self.cards):
            card.show_effects(rows if number == 0 else ())

    def _show_work(self) -> None:
        self._work.setVisible(self._explaining.is_making_pictures)

    # ── marks ──────────────────────────────────────────────────────────────────────────────────

    def _look_at(self, group: Understood, scope: str) -> None:
        if scope:
            self._explaining.show_scope(group, scope)
        else:
            self._explaining.hide_scope()

    def _ask_dab(self, group: Understood, is_asked: bool) -> None:
        if is_asked:
            self._explaining.mark_next_dab(group)
        else:
            self._explaining.unmark()

    def _show_marked(self) -> None:
        marked = self._explaining.marked
        for card in self.cards:
            button = getattr(card, "dab_button", None)
            if button is not None and marked is None and not self._explaining.is_finding_dab:
                button.blockSignals(True)
                button.setChecked(False)
                button.blockSignals(False)

    # ── keys ───────────────────────────────────────────────────────────────────────────────────

    def choose_number(self, number: int) -> None:
        """Takes the alternative of a number, from 1, of the first card."""
        if self.cards and self._explaining.is_current:
            self.cards[0].choose_number(number)

    def toggle_dab(self) -> None:
        """Marks where to dab next for the first card, or takes the mark away."""
        button = getattr(self.cards[0], "dab_button", None) if self.cards else None
        if button is not None and self._explaining.is_current:
            button.toggle()

    def toggle_scope(self) -> None:
        """Marks on the picture what the first card's change covers, or takes the mark away."""
        if self._explaining.mask is not None:
            self._explaining.hide_scope()
        elif self.cards:
            self._explaining.show_scope(self.cards[0].group, self.cards[0].group.scope)
