"""An artist's work on real stages in the window, by mouse and keys, with a screenshot of each state.

    python tests/hydra_viewer/artist.py FOLDER [SHOT ...] [--twice] [--hydra]

Opens a shot, looks round, paints what is wanted, misjudges and undoes, takes another explanation, compares, saves,
opens again, reviews, rejects a change and hands the verdict to `usdslf accept`.  --twice: two pixels a point;
--hydra: in the Hydra viewport, where there is one.  Each step that does not come out as it should ends it.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from usdslf import choose_pxr

choose_pxr()

import numpy as np  # noqa: E402
import OpenImageIO  # noqa: E402
from kit.asset_shots import DOME, SHOTS, build_shot  # noqa: E402
from kit.displays import NO_DISPLAY, ROOT, display  # noqa: E402
from kit.windows import ALT, CTRL, LEFT, SHIFT, drag, pixel, sentences, wait_for  # noqa: E402
from pxr import Usd  # noqa: E402
from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication, QDockWidget, QScrollArea, QWidget  # noqa: E402

from hydra_viewer.model.document import Files  # noqa: E402
from hydra_viewer.ui import panel_words  # noqa: E402
from hydra_viewer.ui.application import make_application  # noqa: E402
from hydra_viewer.ui.cheat_sheet import CheatSheet  # noqa: E402
from hydra_viewer.ui.explaining import GROUPS  # noqa: E402
from hydra_viewer.ui.window import Window  # noqa: E402
from usdslf import read_strokes  # noqa: E402
from usdslf.review.verdict import read_verdict  # noqa: E402
from usdslf.usd.review.accept import accept_look  # noqa: E402

ASSETS = ROOT.parent / "shared" / "assets"
SIZE = 1600, 1000  # of the window [points]
SHARE = 0.03  # of the light that a picture at rest is to have
ROI = OpenImageIO.ROI(0, 128, 0, 64, 0, 1, 0, 3)  # of a small dome
Path2 = tuple[tuple[float, float], ...]  # places 0..1 of the picture


@dataclass(frozen=True)
class Wish:
    """What is painted on a shot.

    Attributes:
        selected: a place whose gprim is looked at first.
        wanted: where the wish is painted, and in which colour of the screen.
        misjudged: the same of a stroke that is taken back.
    """

    selected: tuple[float, float]
    wanted: tuple[Path2, str]
    misjudged: tuple[Path2, str]


WISHES = {
    "living_room": Wish((0.62, 0.59), (((0.5, 0.585), (0.62, 0.6), (0.75, 0.585)), "#2f6f78"),
                        (((0.2, 0.75), (0.3, 0.78)), "#e04030")),
    "avocado": Wish((0.45, 0.63), (((0.35, 0.6), (0.45, 0.64), (0.5, 0.63)), "#5a2a1c"),
                    (((0.46, 0.4), (0.5, 0.41)), "#f0f0f0")),
    "car": Wish((0.27, 0.62), (((0.2, 0.6), (0.28, 0.62), (0.34, 0.58)), "#d8a020"),
                (((0.32, 0.38), (0.38, 0.38)), "#20c040")),
}  # fmt: skip


class Artist:
    """Works on one shot in one window, and takes pictures of it."""

    def __init__(self, folder: Path, name: str, prefix: str) -> None:
        self.folder, self.name, self.prefix, self.number = folder, name, prefix, 0
        self.errors: list[str] = []
        self.window = self.opened_window()

    def opened_window(self) -> Window:
        window = Window({"elements": 1500})
        window.resize(*SIZE)
        window.show()
        assert QTest.qWaitForWindowExposed(window)
        window.activateWindow()
        wait_for(window.isActiveWindow)
        for failed in (window.painting.failed, window.explaining.failed, window.review_panel.failed):
            failed.connect(self.errors.append)
        return window

    # ── acts ───────────────────────────────────────────────────────────────────────────────────

    def open(self, files: Files) -> None:
        window = self.window
        window.filing.open(files)
        self.wait(lambda: window.document.shot is not None)

    def wait(self, condition: Callable[[], bool]) -> None:
        """Lets events happen until a condition holds, or something fails."""
        wait_for(lambda: condition() or bool(self.errors), 240)
        assert not self.errors, self.errors

    def rest(self) -> None:
        """Waits until all that was begun is there: solve, pictures of the explanations, most of the light."""
        window, canvas = self.window, self.window.painting.canvas
        shares = [0.0]
        tell = canvas.progress.connect(shares.append)
        self.wait(lambda: window.worker.is_idle and window.document.is_shown and window.explaining.is_current)
        self.wait(lambda: not (window.worker.is_doing(GROUPS) or window.explaining.is_making_pictures))
        found = window.document.found
        seen = lambda: canvas.viewport.shown  # noqa: E731
        self.wait(lambda: found is None or (seen() is not None and seen().edited is found.shot))
        shares.append(0.0)
        window.easel.view_changed()  # the picture is asked for once more, and tells how far it is
        self.wait(lambda: canvas.viewport.pixels() is not None and shares[-1] > SHARE)
        canvas.progress.disconnect(tell)
        drawn = lambda: getattr(canvas.viewport, "_drawn", None)  # noqa: E731  # Hydra's, which may be of the last view
        self.wait(lambda: drawn() is None or drawn().wish.camera is window.easel.view.camera)

    def key(self, key: Qt.Key, held: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        QTest.keyClick(self.window, key, held)

    def color(self, code: str) -> None:
        field = self.window.brush_panel.picker.hex
        field.setFocus()
        field.selectAll()
        QTest.keyClicks(field, code)
        QTest.keyClick(field, Qt.Key.Key_Return)
        self.window.painting.canvas.setFocus()

    def paint(self, path: Path2, code: str) -> None:
        self.color(code)
        drag(self.window.painting.canvas, list(path))

    def panel(self, title: str) -> QDockWidget:
        dock = next(d for d in self.window.findChildren(QDockWidget) if d.windowTitle() == title)
        dock.raise_()
        return dock

    def click(self, widget: QWidget) -> None:
        QTest.mouseClick(widget, LEFT, pos=widget.rect().center())

    # ── pictures ───────────────────────────────────────────────────────────────────────────────

    def shoot(self, what: str, of: QWidget | None = None) -> None:
        QApplication.processEvents()
        self.number += 1
        path = self.folder / f"{self.prefix}_{self.number:02d}_{what}.png"
        assert (of or self.window).grab().save(str(path))
        print(f"  {path.name}: {self.window.bar.text or sentences(self.window) or '-'}", flush=True)

    def pixels(self) -> np.ndarray:
        found = self.window.painting.canvas.viewport.pixels()
        assert found is not None
        return np.array(found)


def work(folder: Path, name: str, prefix: str, is_hydra: bool) -> None:
    """All of it, on one shot."""
    shutil.rmtree(folder / f"{prefix}_stage", ignore_errors=True)
    stage = build_shot(SHOTS[name], ASSETS, folder / f"{prefix}_stage")
    if is_hydra and SHOTS[name].hdri:
        make_dome_small(stage)
    before = stage.read_bytes()
    files = Files(str(stage), str(stage.with_name("strokes.usda")), str(stage.with_name("look.usda")))
    artist, wish = Artist(folder, name, prefix), WISHES[name]
    artist.open(files)
    if is_hydra:
        hydra = artist.window.viewport_menu.actions()[1]
        assert hydra.isEnabled(), hydra.toolTip()
        artist.key(Qt.Key.Key_2, CTRL)
    artist.rest()
    artist.shoot("opened")
    look_round(artist, wish)
    paint_and_misjudge(artist, wish)
    disambiguate(artist)
    compare(artist)
    said, picture = save(artist), artist.pixels()
    reopen(artist, files, said, picture)
    send_to_review(artist, files)
    assert stage.read_bytes() == before, "the shot was written to"
    artist.window.close()


def make_dome_small(stage: Path) -> None:
    """Gives a shot's dome a small picture: a processor that stands in for a GPU filters a large one for minutes."""
    opened = Usd.Stage.Open(str(stage))
    texture = opened.GetPrimAtPath(DOME).GetAttribute("inputs:texture:file")
    large = OpenImageIO.ImageBuf(texture.Get().resolvedPath)
    small = OpenImageIO.ImageBufAlgo.resize(large, filtername="triangle", roi=ROI)  # which makes nothing negative
    file = stage.with_name("small.exr")
    assert small.write(str(file))
    texture.Set(str(file))
    opened.Save()


def look_round(artist: Artist, wish: Wish) -> None:
    canvas, easel = artist.window.painting.canvas, artist.window.easel
    camera = easel.view.camera
    drag(canvas, [(0.5, 0.5), (0.55, 0.48), (0.6, 0.48)], ALT)
    assert easel.view.camera is not camera
    artist.key(Qt.Key.Key_Q)
    QTest.mouseClick(canvas, LEFT, pos=pixel(canvas, (0.5, 0.5)))
    artist.key(Qt.Key.Key_0)
    QTest.mouseClick(canvas, LEFT, pos=pixel(canvas, wish.selected))
    assert artist.window.document.selected, "nothing is there to be selected"
    artist.rest()
    artist.shoot("selected")
    artist.key(Qt.Key.Key_F)
    artist.rest()
    artist.shoot("framed")
    artist.key(Qt.Key.Key_0)
    artist.key(Qt.Key.Key_W)
    artist.key(Qt.Key.Key_F1)
    sheet = artist.window.findChildren(CheatSheet)[-1]
    artist.shoot("keys", sheet)
    sheet.close()


def paint_and_misjudge(artist: Artist, wish: Wish) -> None:
    document = artist.window.document
    artist.paint(*wish.wanted)
    assert len(document.strokes) == 1, artist.window.bar.text
    artist.rest()
    artist.shoot("painted")
    artist.paint(*wish.misjudged)
    assert len(document.strokes) == 2, artist.window.bar.text
    artist.rest()
    artist.shoot("misjudged")
    artist.key(Qt.Key.Key_Z, CTRL)
    assert len(document.strokes) == 1
    artist.rest()


def disambiguate(artist: Artist) -> None:
    window = artist.window
    card = window.understanding_panel.cards[0]
    before = card.group.chosen
    assert before is not None and len(card.tiles) > 1, "there is nothing to choose from"
    artist.key(Qt.Key.Key_N)
    artist.wait(lambda: window.explaining.marked is not None)
    artist.shoot("where to dab next")
    artist.key(Qt.Key.Key_N)
    artist.key(Qt.Key.Key_M)
    wait_for(lambda: window.explaining.mask is not None)
    artist.shoot("what it covers")
    artist.key(Qt.Key.Key_M)
    tile = next(t for t in card.tiles.values() if not t.isChecked() and t.isEnabled())
    artist.click(tile)
    artist.rest()
    taken = window.understanding_panel.cards[0].group
    assert taken.is_chosen_by_hand and taken.chosen is not None and taken.chosen.id == tile.alternative.id
    artist.shoot("another explanation")


def compare(artist: Artist) -> None:
    window = artist.window
    artist.key(Qt.Key.Key_K)
    artist.panel(panel_words.COMPARE_PANEL)
    artist.key(Qt.Key.Key_V)
    wait_for(lambda: window.compare_layer.other is not None and window.compare_layer.other.pixels() is not None)
    artist.rest()
    artist.shoot("wipe")
    artist.key(Qt.Key.Key_V, SHIFT)
    wait_for(lambda: not window.compare_layer.difference.image.isNull())
    artist.shoot("difference")
    artist.key(Qt.Key.Key_V, SHIFT)
    artist.panel(panel_words.STROKES_PANEL)
    window.strokes_panel.select(("stroke_0001",))
    artist.shoot("strokes")


def save(artist: Artist) -> str:
    window = artist.window
    artist.rest()
    said = sentences(window)
    artist.key(Qt.Key.Key_S, CTRL)
    wait_for(lambda: window.worker.is_idle and window.document.is_saved)
    assert not window.isWindowModified()
    return said


def reopen(artist: Artist, files: Files, said: str, picture: np.ndarray) -> None:
    kind = artist.window.painting.canvas.kind.name
    artist.window.close()
    artist.window = artist.opened_window()
    artist.open(files)
    if artist.window.painting.canvas.kind.name != kind:
        artist.key(Qt.Key.Key_2, CTRL)
    artist.rest()
    assert [s.choice for s in read_strokes(files.strokes)] == [s.choice for s in artist.window.document.strokes]
    assert sentences(artist.window) == said, (sentences(artist.window), said)
    again = artist.pixels()
    if again.shape == picture.shape:
        apart = float(np.abs(again - picture).mean() / picture.mean())
        assert apart < 0.03, f"the picture is another one: {apart:.3f}"
        print(f"  opened again: the same sentence, pictures {100 * apart:.2f} % apart")
    artist.shoot("opened again")


def send_to_review(artist: Artist, files: Files) -> None:
    window = artist.window
    dock = artist.panel(panel_words.REVIEW_PANEL)
    panel = window.review_panel
    artist.click(panel.review_button)
    artist.wait(lambda: panel.review is not None and window.worker.is_idle)
    artist.shoot("review")
    artist.click(panel.modes["blink"])
    artist.wait(lambda: panel.picture.shows_after)
    artist.shoot("review blinks")
    artist.click(panel.modes["difference"])
    panel.gain.setValue(16)
    artist.shoot("review magnified")
    artist.click(panel.modes["wipe"])
    head = panel.tree.topLevelItem(0)
    assert head is not None
    row = head.child(0)
    panel.tree.setCurrentItem(row)
    panel.tree.setFocus()
    QTest.keyClick(panel.tree, Qt.Key.Key_Space)
    assert row.checkState(0) == Qt.CheckState.Unchecked
    panel.note.setFocus()
    QTest.keyClicks(panel.note, "too much, see the daily")
    artist.shoot("rejected")
    switch_off(artist, files)
    artist.click(panel.modes["indirect"])
    area = dock.widget()
    assert isinstance(area, QScrollArea)
    area.verticalScrollBar().setValue(area.verticalScrollBar().maximum())
    artist.shoot("review below")
    verdict = Path(files.look).with_suffix(".verdict.json")
    panel.save_verdict(str(verdict))
    read = read_verdict(verdict, files.look)
    done = accept_look(files.stage, files.look, str(verdict.with_name("accepted.usda")), read.wish())
    assert done.left_out, "nothing was left out"
    print(f"  accepted {len(done.kept)} inputs, left {len(done.left_out)} out", flush=True)


def switch_off(artist: Artist, files: Files) -> None:
    """Switches a change off, which stays so when the strokes are saved again, and on."""
    panel = artist.window.review_panel
    for is_off in (True, False):
        before = panel.review
        artist.click(panel.switch)
        artist.wait(lambda before=before: panel.review not in (None, before) and artist.window.worker.is_idle)
        assert panel.tree.selected is not None and panel.tree.selected.is_off == is_off
        if is_off:
            artist.shoot("switched off")
            artist.key(Qt.Key.Key_S, CTRL)
            artist.wait(lambda: artist.window.worker.is_idle)
            assert "SlfSilent" in Path(files.look).read_text(), "what was off is on again"


def main(arguments: Sequence[str]) -> int:
    """Runs itself on a display of its own, once a shot."""
    names = [a for a in arguments[1:] if not a.startswith("--")] or list(WISHES)
    options = [a for a in arguments if a.startswith("--")]
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    scale = "2" if "--twice" in options else "1"
    prefix = lambda name: f"{name}_{'hydra' if '--hydra' in options else 'live'}_{scale}x"  # noqa: E731
    if "--here" in options:
        make_application()
        for name in names:
            work(folder, name, prefix(name), "--hydra" in options)
        return 0
    with display() as environment:
        if environment is None:
            print(NO_DISPLAY)
            return 1
        for name in names:
            print(prefix(name), flush=True)
            command = [sys.executable, __file__, str(folder), name, *options, "--here"]
            run = subprocess.run(command, env=environment | {"QT_SCALE_FACTOR": scale})
            if run.returncode:
                return run.returncode
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
