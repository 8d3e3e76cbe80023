"""Rows of the bench that are about the live picture, each beside embreex's own time for the same rays."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.rays import RayTracer
from usdslf.render.live.picture import LivePicture
from usdslf.render.picture import LitScene, render
from usdslf.scene.records import Camera, Material, Scene, constant
from usdslf.session import Session

REPEATS = 3
TURN, TURNS = 0.01, 8  # angle between frames of a camera that turns about the scene, and how many are timed
RAY_SHARE = 8  # of a large picture's calls of embreex, the rays of every so manyth are traced again
LIMIT = "embreex on the same rays"
WALL, VASE = "/still_life/materials/plaster", "/still_life/materials/pewter"

Timed = tuple[str, float, str, float | None]
"""Step, seconds, limit in words, its seconds."""


class RecordingTracer(RayTracer):
    """A tracer that counts the rays it traces, and keeps those of some calls."""

    def __init__(self, scene: Any, every: int = 1) -> None:
        """Keeps the rays of every so manyth call of a kind."""
        super().__init__(scene)
        self.kept: list[tuple[bool, tuple[NDArray, ...]]] = []
        self.every, self.calls = every, [0, 0]
        self.rays, self.rays_kept = [0, 0], [0, 0]  # occluded, intersected

    def _note(self, is_whole: bool, rays: Any) -> None:
        count = int(np.count_nonzero(rays[2] > 0))
        self.rays[is_whole] += count
        if self.calls[is_whole] % self.every == 0:
            self.rays_kept[is_whole] += count
            self.kept.append((is_whole, tuple(a.copy() for a in rays)))
        self.calls[is_whole] += 1

    def intersect_into(self, rays: Any, found: Any, stop_at_translucent: bool = False) -> None:
        self._note(True, rays)
        super().intersect_into(rays, found, stop_at_translucent)

    def occluded_into(self, rays: Any, blocked: Any) -> None:
        self._note(False, rays)
        super().occluded_into(rays, blocked)

    def seconds_of_all(self) -> float:
        """Time of all rays so far, by that of those that were kept; forgets them."""
        kept, counts, out = self.kept, tuple(zip(self.rays, self.rays_kept)), 0.0
        for is_whole, (count, count_kept) in enumerate(counts):
            self.kept = [k for k in kept if k[0] == bool(is_whole)]
            out += self.seconds() * count / max(count_kept, 1)
        self.rays, self.rays_kept = [0, 0], [0, 0]
        return out

    def seconds(self) -> float:
        """Time of the rays that are kept, without those of length 0; forgets them."""
        kept, self.kept = self.kept, []
        asked = []
        for is_whole, (origin, direction, length) in kept:
            rows = length > 0
            asked.append((is_whole, (origin[rows], direction[rows], length[rows])))
        floats = [[np.empty(len(r[2]), np.float32) for _ in range(3)] for _, r in asked]
        found = [(np.empty(len(r[2]), np.int32), u, v, away) for (_, r), (u, v, away) in zip(asked, floats)]
        blocked = [np.empty(len(r[2]), np.uint8) for _, r in asked]

        def trace() -> None:
            for (is_whole, rays), hits, hidden in zip(asked, found, blocked):
                if is_whole:
                    super(RecordingTracer, self).intersect_into(rays, hits)
                else:
                    super(RecordingTracer, self).occluded_into(rays, hidden)

        return best(trace)


def best(work: Callable[[], object], repeats: int = 0) -> float:
    """Least time of some runs [s]; 0: of REPEATS."""
    found = []
    for _ in range(repeats or REPEATS):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return min(found)


def live_steps(
    session: Session, camera: Camera, size: tuple[int, int], answered: Sequence[Material]
) -> Iterator[Timed]:
    """Yields the steps of a live picture of the demo, warm.

    Args:
        answered: the materials as strokes ask for them.
        size: of a whole picture [pixels].
    """
    lights, half = session.light_set, (max(1, size[0] // 2), max(1, size[1] // 2))
    lit = LitScene(session.scene, session.tracer, session.light_field, session.lights, session.device)
    tracer = RecordingTracer(session.scene)
    picture = LivePicture.of(lit, lights, camera, size)
    watched = LivePicture.of(replace(lit, tracer=tracer), lights, camera, size)
    tracer.seconds()
    first(picture, camera, half)  # builds the kernels
    for name, pixels in (("live, first frame at half size", half), ("live, first frame", size)):
        seconds = best(lambda pixels=pixels: first(picture, camera, pixels))  # type: ignore[misc]
        first(watched, camera, pixels)
        yield name, seconds, LIMIT, tracer.seconds()
    yield "live, half size, camera turning", *_turning(picture, watched, camera, half)
    for made in (picture, watched):
        for _ in made.frames(3):
            pass
    tracer.seconds()
    seconds = best(lambda: one_more(picture))
    one_more(watched)
    yield "live, one more frame", seconds, LIMIT, tracer.seconds()
    yield "answer to live picture", best(lambda: shown_with(picture, answered)), "", None
    yield "live, after a change of diffuse", *_edited(session, picture, WALL, "diffuse_color", constant(0.2, 0.5, 0.3))
    yield "live, after one of roughness", *_edited(session, picture, VASE, "roughness", constant(0.35))


def final_step(session: Session, camera: Camera, size: tuple[int, int]) -> tuple[float, str, float, int]:
    """Returns the time of a final picture, its limit in words and seconds, and how many rays it traces."""
    seconds, every = session.seconds["render"], RAY_SHARE if size[0] * size[1] > 1 << 16 else 1
    tracer = RecordingTracer(session.scene, every)
    render(LitScene(session.scene, tracer, session.light_field, session.lights, session.device), camera, size)
    count = sum(tracer.rays)
    return seconds, LIMIT, tracer.seconds_of_all(), count


def first(picture: LivePicture, camera: Camera, size: tuple[int, int]) -> None:
    """Shows what another camera sees, once."""
    other = picture.seen_by(camera, size)
    other.gather_frame(1)
    other.now()


def _turning(
    picture: LivePicture, watched: LivePicture, camera: Camera, size: tuple[int, int]
) -> tuple[float, str, float]:
    """Time of a frame while the camera turns, with all that it sees anew, and of embreex for its rays."""
    scene, tracer = picture.scene.geometry.scene, watched.scene.geometry.tracer
    assert isinstance(tracer, RecordingTracer)
    cameras = [turned(camera, scene, k * TURN) for k in range(TURNS)]

    def turn(shown: LivePicture) -> None:
        for one in cameras:
            first(shown, one, size)

    seconds = best(lambda: turn(picture))
    turn(watched)
    return seconds / TURNS, LIMIT, tracer.seconds() / TURNS


def turned(camera: Camera, scene: Scene, angle: float) -> Camera:
    """Returns a camera turned about the upright axis through the middle of a scene, by an angle [radians]."""
    middle, up = np.mean(scene.bounds, axis=0), scene.up
    across = np.cross(np.eye(3), up)
    turn = np.eye(4)
    turn[:3, :3] = np.cos(angle) * np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * np.outer(up, up)
    turn[:3, 3] = middle - turn[:3, :3] @ middle
    return replace(camera, world_from_camera=turn @ camera.world_from_camera)


def shown_with(picture: LivePicture, materials: Sequence[Material]) -> None:
    """Shows what is seen with other materials, once."""
    other = picture.with_materials(materials)
    other.gather_frame(1)
    other.now()


def one_more(picture: LivePicture) -> None:
    """Adds a frame, and shows it."""
    picture.gather_frame(picture.now().number + 1)
    picture.now()


def _edited(session: Session, picture: LivePicture, path: str, name: str, value: Any) -> tuple[float, str, None]:
    """Time from a change of an input of a material to what it shows."""
    shown = session.scene.materials
    number = next(i for i, m in enumerate(shown) if m.path == path)
    step = iter(np.linspace(0.9, 1, 2 * REPEATS))

    def edit() -> None:
        changed = replace(shown[number], **{name: (value * next(step)).astype(np.float32)})
        shown_with(picture, (*shown[:number], changed, *shown[number + 1 :]))

    return best(edit), "", None
