"""How long the steps of a shot say nothing, and how long a cancel of them takes, on the first scene of the gallery.

    python tests/bench/silences.py [--elements 10000] [--blocks | --cancel]

prints a table in Markdown: for each step how often it told how far it is, its longest silence, and the line of the
program at which most of that silence was spent.  Where other programs use the processors, time on the clock says
little: the table gives the time that this process computed for meanwhile, too.

With `--blocks` only what is told between blocks counts: the longest that work goes on after it was cancelled.

With `--cancel` each call is cancelled after 150 ms, and again and again, each time a third later, until it comes to its
end, going on from what was made before: the table gives for each step how long it took at most from the wish to cancel
until the work had ended.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

import usdslf
from usdslf import progress
from usdslf.gallery import ENTRIES
from usdslf.gallery.still_life import RADIUS, STROKES
from usdslf.usd.build_stage import write_stage

os.environ.setdefault("USDSLF_CACHE", "weights")  # nothing of the shot is read from an earlier run
PACKAGE = str(Path(usdslf.__file__).parent)
SAMPLED = 0.02  # seconds between two looks at where the program is
CANCELLED = 0.15  # seconds until work is cancelled first
PATIENCE = 1.3  # each time it is given so many times as long, until it comes to its end


@dataclass
class Silences:
    """A listener that notes how long nothing was told."""

    told: Counter[str] = field(default_factory=Counter)
    longest: dict[str, tuple[float, float, str]] = field(default_factory=dict)  # wall, CPU [s], place
    places: Counter[str] = field(default_factory=Counter)  # of this silence
    began: tuple[float, float] = (0.0, 0.0)
    step: str = ""

    def __post_init__(self) -> None:
        self.began = time.perf_counter(), time.process_time()

    def hear(self, step: str, share: float) -> None:
        """Ends a silence; it is one of the step that was told last."""
        now = time.perf_counter(), time.process_time()
        wall, cpu = now[0] - self.began[0], now[1] - self.began[1]
        places, self.places = self.places, Counter()
        if wall > self.longest.get(self.step, (0.0,))[0]:
            place = places.most_common(1)[0][0] if places else ""
            self.longest[self.step] = wall, cpu, place
        self.told[step] += 1
        self.step = step
        self.began = time.perf_counter(), time.process_time()

    def sample(self, stopped: threading.Event) -> None:
        """Notes where the program is, again and again."""
        while not stopped.wait(SAMPLED):
            frames = sys._current_frames()
            threads = {t.name: t.ident or 0 for t in threading.enumerate()}
            ident = threads.get("usdslf-call", threads.get("MainThread", 0))
            self.places.update(filter(None, [place_of(frames.get(ident))]))


def place_of(frame: FrameType | None) -> str:
    """The line of the program that a frame is in."""
    while frame is not None:
        file = frame.f_code.co_filename
        if file.startswith(PACKAGE) and not file.endswith("progress.py"):
            return f"{file[len(PACKAGE) + 1 :]}:{frame.f_lineno}"
        frame = frame.f_back
    return ""


def steps_of(session: usdslf.Session, folder: Path) -> Iterator[tuple[str, Callable[[], object]]]:
    """What a user does with a shot, one after the other."""
    yield "read", lambda: (session.scene, session.tracer)
    width, height = 800, 450
    for number, script in enumerate(STROKES, start=1):
        colors = [rgb for rgb, places in script.dabs for _ in places for _ in (0, 1)]
        paths = [[(x / width, y / height)] for _, places in script.dabs for x, y in places]
        stroke = usdslf.paint_stroke(
            session.scene, session.tracer, session.camera(), paths, RADIUS, colors[0], aspect=width / height,
            name=f"stroke_{number:04d}",
        )  # fmt: skip
        stroke.colors[:] = colors
        session.add_stroke(stroke)
    yield "light field", lambda: session.light_field
    yield "solve", session.solve
    yield "author", lambda: session.author(folder / "look.usda")
    yield "edited", lambda: session.edited(folder / "look.usda").light_field
    yield "render", lambda: session.render(size=(320, 180), samples=16)
    yield "stylize", session.stylize
    yield "author", lambda: session.author(folder / "style.usda")


def print_silences(stage: Path, folder: Path, elements: int) -> None:
    """Does all of it once."""
    heard, stopped = Silences(), threading.Event()
    sampler = threading.Thread(target=heard.sample, args=(stopped,))
    sampler.start()
    try:
        session = usdslf.open(str(stage), elements=elements, say=heard.hear)
        for _, call in steps_of(session, folder):
            call()
    finally:
        stopped.set()
        sampler.join()
    print("| step | told | longest silence [ms] | computing in it [ms] | at |\n|---|---|---|---|---|")
    for step, (wall, cpu, place) in heard.longest.items():
        print(f"| {step or 'open'} | {heard.told[step]} | {wall * 1e3:.0f} | {cpu * 1e3:.0f} | {place} |")


def print_cancels(stage: Path, folder: Path, elements: int) -> None:
    """Cancels each call again and again, each time later, until it gets to its end."""
    latencies: dict[str, list[float]] = defaultdict(list)
    wished, patience = [float("inf")], CANCELLED
    now = [""]

    def hear(step: str, share: float) -> None:
        now[0] = step
        if time.perf_counter() >= wished[0]:
            raise usdslf.Cancelled

    session = usdslf.open(str(stage), elements=elements, say=hear)
    for name, call in steps_of(session, folder):
        patience, now[0] = CANCELLED, name
        while True:
            wished[0] = time.perf_counter() + patience
            try:
                call()
            except usdslf.Cancelled:
                latencies[now[0]].append(time.perf_counter() - wished[0])
                patience *= PATIENCE
            else:
                break
            finally:
                wished[0] = float("inf")
    print("| step | cancelled | took at most [ms] |\n|---|---|---|")
    for step, took in latencies.items():
        print(f"| {step} | {len(took)} | {max(took) * 1e3:.0f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--elements", type=int, default=10000)
    parser.add_argument("--cancel", action="store_true", help="cancel again and again instead")
    parser.add_argument("--blocks", action="store_true", help="say nothing while something is waited for")
    told = parser.parse_args()
    if told.blocks:
        progress.TOLD_EVERY = 3600.0
    with tempfile.TemporaryDirectory() as folder:
        stage = write_stage(ENTRIES[0].build(Path(folder), None), Path(folder))
        (print_cancels if told.cancel else print_silences)(stage, Path(folder), told.elements)


if __name__ == "__main__":
    main()
