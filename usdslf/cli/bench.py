"""Bench: time of each step beside what the machine can do at most, in the same run.

Limits: embreex's own run() on the same rays for visibility; for a bounce the larger of a copy kernel over the same
bytes and of its products at the rate of a kernel that only multiplies and adds; bounces of this light field for
stylize: each asks for 21 levels of roughness in a round, of which a bounce reflects two.
Paper: Nguyen et al. 2013, table of section 7, 10000 elements on a GPU of 2012.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from usdslf.animation.frames import PlacedFrame, carry
from usdslf.cache import switched
from usdslf.cli.bench_live import final_step, live_steps
from usdslf.cli.bench_start import start_steps
from usdslf.cli.bench_strokes import stroke_steps
from usdslf.cli.bench_subject import Chosen, demo, staged
from usdslf.cli.bench_timing import Timed, best, moved_by
from usdslf.gpu.device import Device
from usdslf.light_field.visibility import BATCH, rays_of_bins, trace_visibility
from usdslf.rays import RayTracer
from usdslf.sampling.hemisphere import D
from usdslf.session import Session
from usdslf.surfaces.reflectance import LEVEL_COUNT

if TYPE_CHECKING:
    from usdslf.progress import Say

SIZE = (900, 450)  # of the paper's pictures
RAY_SHARE = 8  # the ray limit is measured on every eighth block
BYTES_OF_LINK = 4 + 12 + 12 + 12  # a bounce reads link, fixed and outgoing light, and writes outgoing light

Row = dict[str, Any]


def measure(device: str | None, ocio: str | None, elements: int, say: Say, stage: str | None = None) -> dict[str, Any]:
    """Runs a shot's flow once, cold, and the steps that have a limit again, warm.

    Args:
        stage: its file; None: the demo.

    Returns: device, elements, directions, rows (as DESIGN's bench table), total_seconds from an empty
    session to the look layer, memory_bytes (peak of this process).
    """
    with switched("weights"), tempfile.TemporaryDirectory(prefix="usdslf_bench_") as name:
        folder = Path(name)
        options: dict[str, Any] = {"device": device, "ocio": ocio, "say": say, "elements": elements}
        subject = staged(stage, SIZE[0] / SIZE[1], **options) if stage else demo(folder, **options)
        began = time.perf_counter()
        session = subject.session
        strokes = subject.paint()
        for stroke in strokes:
            session.add_stroke(stroke)
        session.solve()
        answered = session.solution.materials(session.shot) or session.scene.materials
        session.author(folder / "look.usda")
        total = time.perf_counter() - began
        cold = dict(session.seconds)
        session.render(subject.view, SIZE)
        camera, chosen = subject.camera, subject.choose()
        final = final_step(session, camera, SIZE)  # while its files are there
        rounds = len(session.stylize().rounds)
        session.author(folder / "style.usda")
        starts = list(start_steps(session.shot.path, elements, SIZE, device))
    n = len(session.elements)
    links, field = n * D, n * D * 12
    bounce = _bounce(session)
    levels = rounds * (LEVEL_COUNT + 1) / 2
    style = f"stylize, rounds: {rounds}", session.seconds["stylize"], f"{levels:g} bounces", levels * bounce.seconds
    rows = [
        Timed("read", cold["read"]),
        Timed("elements", cold["elements"]),
        _visibility(session),
        *_moved(session, chosen),
        Timed("static light", cold["light"], size=field),
        Timed("light field, all bounces", cold["light field"], size=2 * field),
        replace(bounce, size=links * BYTES_OF_LINK, paper=138),
        Timed("evidence of the strokes", cold["evidence"], paper=50),
        Timed("solve, all bounces", cold["solve"], paper=270),
        Timed(*style),
        Timed("its look, read back", session.seconds["author"] - cold["author"]),
        final,
        *stroke_steps(session, strokes),
        *live_steps(session, camera, SIZE, answered, chosen),
        *starts,
    ]
    return {
        "device": session.device.name,
        "elements": n,
        "directions": D,
        "rows": [_row(timed) for timed in rows],
        "total_seconds": total,
        "memory_bytes": peak_memory(),
    }


def _row(t: Timed) -> Row:
    return {
        "step": t.step,
        "seconds": t.seconds,
        "limit": t.limit,
        "limit_seconds": t.limit_seconds,
        "ratio": t.seconds / t.limit_seconds if t.limit_seconds else None,
        "bytes": t.size,
        "moved_bytes": t.moved,
        "paper_ms": t.paper or None,
        "rays": t.rays,
    }


def _visibility(session: Session) -> Timed:
    """The warm step, and embreex alone on the same rays, made beforehand."""
    elements, tracer = session.elements, session.tracer

    def see() -> None:
        trace_visibility(elements, session.lookup, tracer, session.device)

    seconds, moved = best(see, repeats=2), moved_by(session.device, see)
    rays = []
    for first in range(0, len(elements), BATCH * RAY_SHARE):
        made = rays_of_bins(elements, tracer, session.device, slice(first, min(first + BATCH, len(elements))))
        rays.append(made)

    def run() -> None:
        for _ in tracer.map_ahead(lambda i: tracer.intersect_columns(*rays[i]), range(len(rays))):
            pass

    links = len(elements) * D
    share = sum(len(o) for o, _ in rays) / links
    limit = "embreex run() on the same rays", best(run) / share
    return Timed("visibility", seconds, *limit, moved, session.visibility.rays, size=links * 4, paper=870)


def _moved(session: Session, chosen: Chosen) -> Iterator[Timed]:
    """Elements, tables, tree and rays again after an object was lifted, and all rays; nothing where all starts anew."""
    meshes = list(session.scene.meshes)
    lifted = meshes[chosen.mover]
    meshes[chosen.mover] = replace(lifted, positions=lifted.positions + chosen.lift)
    scene = replace(session.scene, meshes=tuple(meshes))
    placed = PlacedFrame(session.scene, session.elements, session.lookup, session.visibility, session.dark_probes)

    def move() -> object:
        return carry(placed, scene, RayTracer(scene), session.device)

    def trace() -> None:
        trace_visibility(session.elements, session.lookup, session.tracer, session.device)

    if not isinstance(move(), PlacedFrame):
        return
    turns = [(best(move, 1), best(trace, 1)) for _ in range(2)]
    seconds, whole = np.min(turns, axis=0).tolist()
    moved = moved_by(session.device, move)
    yield Timed("visibility, one object moved", seconds, "a trace of everything", whole, moved)


def _bounce(session: Session) -> Timed:
    """A bounce, and the larger of a copy of as many bytes and of as many multiply-adds."""
    field = session.light_field

    def bounce() -> None:
        field.bounce()
        session.device.finish()

    seconds = best(bounce)
    links = len(session.elements) * D
    copied = links * BYTES_OF_LINK / copy_bandwidth(session.device)
    multiplied = field.products() / multiply_add_rate(session.device)
    what = "copy kernel over the same bytes" if copied > multiplied else "as many multiply-adds"
    return Timed("one bounce", seconds, what, max(copied, multiplied), moved_by(session.device, bounce))


def copy_bandwidth(device: Device, size: int = 1 << 28) -> float:
    """Returns bytes a second, read and written together, that a copy kernel moves."""
    size = min(size, device.largest_array)
    source_d, target_d = device.zeros((size // 16, 4), np.float32), device.zeros((size // 16, 4), np.float32)
    kernel = device.kernel("bench", "copy")

    def copy() -> None:
        kernel((size // 16,), None, np.uint32(size // 16), source_d, target_d)
        device.finish()

    copy()
    return 2 * size / best(copy)


def multiply_add_rate(device: Device, items: int = 1 << 14, rounds: int = 512) -> float:
    """Returns multiply-adds a second of a kernel that does nothing else."""
    out_d, kernel = device.empty((items, 16), np.float32), device.kernel("bench", "multiply_add")

    def multiply() -> None:
        kernel((items,), (64,), np.uint32(rounds), np.float32(0.5), out_d)
        device.finish()

    multiply()
    return 8 * 16 * items * rounds / best(multiply)


def peak_memory() -> int:
    """Returns the most memory that this process had so far [bytes]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def lines_of_table(found: Mapping[str, Any]) -> Iterator[str]:
    """Yields the table that people read."""
    yield f"{found['device']}: {found['elements']} elements x {found['directions']} directions"
    head = f"{'ms':>9}{'limit ms':>10}{'ratio':>7}{'MB':>8}{'moved MB':>10}{'paper ms':>10}{'M rays':>8}"
    yield f"{'step':<33}{head}  limit"
    for row in found["rows"]:
        limit = f"{row['limit_seconds'] * 1000:.0f}" if row["limit_seconds"] else ""
        ratio = f"{row['ratio']:.2f}" if row["ratio"] else ""
        size = f"{row['bytes'] / 1e6:.0f}" if row["bytes"] else ""
        moved = "" if row["moved_bytes"] is None else f"{row['moved_bytes'] / 1e6:.2f}"
        rays = f"{row['rays'] / 1e6:.1f}" if row["rays"] else ""
        yield (
            f"{row['step']:<33}{row['seconds'] * 1000:>9.0f}{limit:>10}{ratio:>7}{size:>8}{moved:>10}"
            f"{row['paper_ms'] or '':>10}{rays:>8}  {row['limit']}"
        )
    yield (
        f"stage to look layer, cold: {found['total_seconds']:.1f} s; "
        f"peak memory of the process: {found['memory_bytes'] / 2**30:.2f} GiB"
    )
