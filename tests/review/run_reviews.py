"""Reviews looks of the gallery's figures and of real stages, each as a supervisor does: in a browser, by a hand.

    python tests/review/run_reviews.py OUT [NAME ...] [--elements N] [--size WxH] [--frames N]

NAME is a figure (`usdslf demo`), or a shot of kit/asset_shots.py, on whose largest materials strokes are painted that
want another colour; none: all figures and REAL.  The review is checked against its schema, its page opened in Chromium
from its file; wipe, blink, difference, indirect effects, a click to a material, a rejection with a note, saving; then
`accept --verdict` leaves out what was rejected and nothing else.  OUT/NAME has the page and what was seen (.png): look
at it.  A line is printed for each, and what went wrong.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import jsonschema
import numpy as np
from kit.asset_shots import ASPECT, SHOTS, build_shot
from kit.browser import Page, opened
from numpy.typing import NDArray
from scipy import ndimage

import usdslf
from usdslf.gallery import ENTRIES
from usdslf.gallery.play import Play
from usdslf.review.page import page_of, write_pictures
from usdslf.review.review import Review, ReviewSettings, review
from usdslf.review.verdict import read_verdict
from usdslf.scene.cameras import camera_rays
from usdslf.strokes.stroke import Stroke
from usdslf.usd.review.accept import accept_look
from usdslf.usd.schema import schema_folder

ASSETS = Path(__file__).resolve().parents[3] / "shared/assets"
REAL = ("hull", "fancy_teapot", "living_room")
TINTS = ((1.25, 0.5, 0.4), (0.55, 0.75, 1.2))  # of what the picture shows, of each material that is painted
DABS, RADIUS = 14, 0.012  # of a stroke; of a dab, in picture heights
PLACES = 320, 240  # of the picture, that dabs are laid on


@dataclass(frozen=True)
class Asked:
    """How it is reviewed."""

    out: Path
    elements: int
    size: tuple[int, int]
    frames: int


# ---- a look to review -------------------------------------------------------------------------------
def looks_of(name: str, asked: Asked) -> Iterator[tuple[str, str, str]]:
    """Yields name, shot and look of what there is to review of a figure or a real shot."""
    entry = next((e for e in ENTRIES if e.name == name), None)
    if entry is None:
        yield name, *_painted(name, asked)
        return
    play = Play(entry, asked.out / name / "figure", elements=asked.elements, pictures=False)
    entry.run(play)
    last = next((s for s in reversed(play.steps) if s.report["edits"]), None)
    if last is not None:
        yield name, last.before.scene.stage, str(last.folder / "look.usda")
    elif (look := play.folder / "look.usda").is_file():  # of no stroke: a style
        yield name, play.session.shot.path, str(look)
    else:
        print(f"{name:18s} writes no look", flush=True)


def _painted(name: str, asked: Asked) -> tuple[str, str]:
    """A real shot with three strokes: two on the material that fills most of the picture, one on the next."""
    shot, folder = SHOTS[name], asked.out / name
    stage = build_shot(shot, ASSETS, folder)
    session = usdslf.open(str(stage), elements=asked.elements)
    camera = session.camera(shot.camera)
    picture = session.render(camera, PLACES, samples=16)["color"]
    shown = _materials(session, camera)
    counts = np.bincount(shown[shown >= 0])
    for rank, material in enumerate(np.argsort(counts)[::-1][: len(TINTS)]):
        for number in range(2 - rank):
            at = _places(shown == material, 2 * rank + number)
            colors = picture[at[:, 1], at[:, 0]] * np.array(TINTS[rank])
            session.add_stroke(_stroke(session, camera, at, colors, f"stroke_{2 * rank + number + 1:04d}"))
    session.solve()
    usdslf.write_strokes(folder / "strokes.usda", session.strokes, session.stage)
    session.author(folder / "look.usda", strokes_path=folder / "strokes.usda")
    return str(stage), str(folder / "look.usda")


def _materials(session: Any, camera: Any) -> NDArray:
    """The material (h, w) in the middle of each place of the picture, -1 where nothing is seen."""
    x, y = ((np.arange(n) + 0.5) / n for n in PLACES)
    rays = camera_rays(camera, np.stack(np.meshgrid(x, y), -1).reshape(-1, 2), ASPECT)
    met = session.tracer.intersect(rays.origin, rays.direction)
    found = session.scene.triangles.material[np.maximum(met.triangle, 0)]
    return np.where(met.triangle >= 0, found, -1).reshape(PLACES[::-1])


def _places(mask: NDArray, seed: int) -> NDArray:
    """Places (DABS, 2; column, row) that lie together, well inside of a mask."""
    depth = ndimage.distance_transform_edt(mask)
    rows, columns = np.nonzero(depth >= min(4.0, 0.5 * float(depth.max())))
    rng = np.random.default_rng(seed)
    start = rng.integers(len(rows))
    near = np.argsort(np.hypot(rows - rows[start], columns - columns[start]))[: max(12 * DABS, len(rows) // 12)]
    chosen = rng.choice(near, min(DABS, len(near)), replace=False)
    return np.stack([columns[chosen], rows[chosen]], 1)


def _stroke(session: Any, camera: Any, at: NDArray, colors: NDArray, name: str) -> Stroke:
    paths = [((c + 0.5) / PLACES)[None] for c in at]
    stroke = usdslf.paint_stroke(session.scene, session.tracer, camera, paths, RADIUS, aspect=ASPECT, name=name)
    return replace(stroke, colors=np.repeat(colors.astype(np.float32), stroke.counts, axis=0))


# ---- the hand ---------------------------------------------------------------------------------------
def work(page: Page, found: Review, folder: Path) -> list[str]:
    """Uses a page as a supervisor does; returns what went wrong."""
    wrong: list[str] = []

    def see(name: str) -> None:
        page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        page.screenshot(folder / f"{name}.png")

    def pixels() -> NDArray:
        script = """(async () => { await draw(); const c = document.getElementById('canvas');
          const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', { willReadFrequently: true });
          copy.drawImage(c, 0, 0);
          return Array.from(copy.getImageData(0, 0, c.width, c.height).data); })()"""
        return np.array(page.run(script)).reshape(-1, 4)[:, :3]

    page.run("draw()")
    see("1_wipe")
    box = page.run("(() => { const b = document.getElementById('canvas').getBoundingClientRect(); "
                   "return [b.left, b.top, b.width, b.height]; })()")  # fmt: skip
    at = lambda x, y: (box[0] + x * box[2], box[1] + y * box[3])  # noqa: E731
    page.drag(at(0.5, 0.5), at(0.4, 0.5), at(0.3, 0.5))
    if abs(page.run("state.wipe") - 0.3) > 0.01:
        wrong.append("the wipe does not follow the hand")
    shows = {}
    page.run("state.strokes = false")
    for mode in ("before", "after", "difference", "indirect"):
        page.run(f"document.querySelector('[data-mode={mode}]').click()")
        shows[mode] = pixels()
        see(f"2_{mode}")
    if not (shows["before"] != shows["after"]).any():
        wrong.append("before and after are the same")
    page.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: '4' }))")
    page.wait("state.second")
    page.run("state.strokes = true; setMode('after')")
    part = found.views[0].pictures.gprim
    if (part >= 0).any():
        y, x = np.argwhere(part >= 0)[(part >= 0).sum() // 2]
        page.drag(at((x + 0.5) / part.shape[1], (y + 0.5) / part.shape[0]))
        page.wait("state.picked >= 0")
    see("3_picked")
    page.run("document.getElementById('by').value = 'Ada'")
    page.run("document.querySelector('.card .reject').click()")
    note = "const n = document.querySelector('.card input'); n.value = 'too much'; n.dispatchEvent(new Event('input'))"
    page.run(f"(() => {{ {note}; }})()")
    for number, part_of in enumerate(("changes", "survive"), 4):
        page.run(f"document.getElementById('{part_of}').scrollIntoView()")
        see(f"{number}_{part_of}")
    page.run("window.scrollTo(0, 0); document.getElementById('save').click()")
    page.wait("document.getElementById('saved').textContent.includes('saved')")
    page.resize(900, 1000)
    see("6_narrow")
    return wrong + page.troubles


def saved(folder: Path) -> Path:
    """The verdict that the browser saved."""
    until = time.monotonic() + 20
    while not (files := list(folder.glob("*.verdict.json"))) and time.monotonic() < until:
        time.sleep(0.05)
    return files[0]


# ---- one after another ------------------------------------------------------------------------------
def reviewed(name: str, shot: str, look: str, asked: Asked) -> str:
    """Reviews a look; returns a line about it."""
    folder = asked.out / name
    began = time.process_time()
    how = ReviewSettings(size=asked.size, frames=asked.frames, quality={"elements": asked.elements})
    found = review(shot, look, how)
    seconds = time.process_time() - began
    values = json.loads(json.dumps(found.as_values()))
    jsonschema.validate(values, _schema("review"))
    page = folder / "review.html"
    page.write_text(page_of(found), encoding="utf-8")
    write_pictures(folder / "pictures", found)
    for old in folder.glob("*.verdict.json"):
        old.unlink()
    shutil.rmtree(folder / "profile", ignore_errors=True)  # of a browser that remembers what was decided before
    with opened(page, folder) as at:
        at.wait(f"document.getElementById('canvas').width === {asked.size[0]}")
        wrong = work(at, found, folder)
    verdict = saved(folder)
    jsonschema.validate(json.loads(verdict.read_text()), _schema("verdict"))
    wish = read_verdict(verdict, look).wish()
    done = accept_look(shot, look, folder / "accepted.usda", wish)
    (rejected,) = [t for t, keep in wish.said.items() if not keep]
    if {t for t in found.look.inputs if t.startswith(f"{rejected}.")} != set(done.left_out):
        wrong.append(f"rejected {rejected}, left out {done.left_out}")
    views = [v.pictures.view.kind for v in found.views]
    if views.count("held out") < 2 or views[-1] != "light":
        wrong.append(f"views: {views}")
    kept = len(found.look.materials), len(found.look.inputs), len(found.look.gprims), len(found.look.findings)
    return (
        f"{name:18s} {kept[0]:3d} materials {kept[1]:3d} inputs {kept[2]:3d} gprims {kept[3]:2d} findings "
        f"{len(views)} views {page.stat().st_size / 1e6:5.2f} MB {seconds:5.1f} s  " + ("; ".join(wrong) or "ok")
    )


def _schema(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((schema_folder() / f"{name}.schema.json").read_text())
    return found


def main() -> int:
    """Prints a line for each; 1 where something went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--elements", type=int, default=1500)
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--frames", type=int, default=4)
    told = parser.parse_intermixed_args()
    width, _, height = told.size.partition("x")
    asked = Asked(told.out, told.elements, (int(width), int(height)), told.frames)
    lines = []
    for name in told.names or [*(e.name for e in ENTRIES), *REAL]:
        (asked.out / name).mkdir(parents=True, exist_ok=True)
        for row in looks_of(name, asked):
            lines.append(reviewed(*row, asked))
            print(lines[-1], flush=True)
    return int(any(not line.endswith("  ok") for line in lines))


if __name__ == "__main__":
    sys.exit(main())
