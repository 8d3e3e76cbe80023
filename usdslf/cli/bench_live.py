"""Rows of the bench that are about the live picture, each beside embreex's own time for the same rays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.cli import bench_timing
from usdslf.cli.bench_subject import Chosen
from usdslf.cli.bench_timing import Timed, best, moved_by
from usdslf.rays import RayTracer
from usdslf.render.live.picture import LivePicture
from usdslf.render.picture import LitScene, render
from usdslf.scene.records import Camera, Material, Scene, constant
from usdslf.session import Session

TURN, TURNS = 0.01, 8  # angle between frames of a camera that turns about the scene, and how many are timed
RAY_SHARE = 8  # of a large picture's calls of embreex, the rays of every so manyth are traced again
LIMIT = "embreex on the same rays"


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

    def forget(self) -> None:
        """Forgets all rays."""
        self.kept, self.rays, self.rays_kept = [], [0, 0], [0, 0]

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


def live_steps(
    session: Session, camera: Camera, size: tuple[int, int], answered: Sequence[Material], chosen: Chosen
) -> Iterator[Timed]:
    """Yields the steps of a live picture, warm.

    Args:
        answered: the materials as strokes ask for them.
        size: of a whole picture [pixels].
        chosen: materials that are edited.
    """
    lights, half = session.light_set, (max(1, size[0] // 2), max(1, size[1] // 2))
    lit = LitScene(session.scene, session.tracer, session.light_field, session.lights, session.device)
    tracer = RecordingTracer(session.scene)
    picture = LivePicture.of(lit, lights, camera, size)
    watched = LivePicture.of(replace(lit, tracer=tracer), lights, camera, size)
    first(picture, camera, half)  # builds the kernels
    for name, pixels in (("live, first frame at half size", half), ("live, first frame", size)):
        yield _beside_embreex(name, picture, watched, partial(first, camera=camera, size=pixels))
    yield _turning(picture, watched, camera, half)
    for made in (picture, watched):
        for _ in made.frames(3):
            pass
    yield _beside_embreex("live, one more frame", picture, watched, one_more)
    answer = lambda: shown_with(picture, answered)  # noqa: E731
    yield Timed("answer to live picture", best(answer), moved=moved_by(session.device, answer))
    for name, material, changes, value in (
        ("live, after a change of diffuse", chosen.recolored, "diffuse_color", constant(0.2, 0.5, 0.3)),
        ("live, after one of roughness", chosen.reroughened, "roughness", constant(0.35)),
    ):
        edit = _edit_of(session, picture, material, changes, value)
        yield Timed(name, best(edit), moved=moved_by(session.device, edit))


def _beside_embreex(
    name: str, picture: LivePicture, watched: LivePicture, work: Callable[[LivePicture], object], times: int = 1
) -> Timed:
    """A step beside embreex alone on the same rays.

    Args:
        watched: the same picture, whose rays are recorded.
        work: does the step `times` times.
    """
    seconds, geometry = best(lambda: work(picture)), watched.scene.geometry
    tracer = geometry.tracer
    assert isinstance(tracer, RecordingTracer)
    tracer.forget()
    moved = moved_by(geometry.device, lambda: work(watched))
    rays = sum(tracer.rays)
    return Timed(name, seconds / times, LIMIT, tracer.seconds() / times, moved // times, rays // times)


def final_step(session: Session, camera: Camera, size: tuple[int, int]) -> Timed:
    """Returns the step of the final picture, which the session has rendered."""
    every = RAY_SHARE if size[0] * size[1] > 1 << 16 else 1
    tracer = RecordingTracer(session.scene, every)
    lit = LitScene(session.scene, tracer, session.light_field, session.lights, session.device)
    moved = moved_by(session.device, lambda: render(lit, camera, size))
    rays = sum(tracer.rays)
    name = f"picture {size[0]} x {size[1]}"
    return Timed(name, session.seconds["render"], LIMIT, tracer.seconds_of_all(), moved, rays, paper=75)


def first(picture: LivePicture, camera: Camera, size: tuple[int, int]) -> None:
    """Shows what another camera sees, once."""
    other = picture.seen_by(camera, size)
    other.gather_frame(1)
    other.now()


def _turning(picture: LivePicture, watched: LivePicture, camera: Camera, size: tuple[int, int]) -> Timed:
    """A frame while the camera turns, with all that it sees anew."""
    scene = picture.scene.geometry.scene
    cameras = [turned(camera, scene, k * TURN) for k in range(TURNS)]

    def turn(shown: LivePicture) -> None:
        for one in cameras:
            first(shown, one, size)

    return _beside_embreex("live, half size, camera turning", picture, watched, turn, TURNS)


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


def _edit_of(
    session: Session, picture: LivePicture, number: int, name: str, value: Any
) -> Callable[[], None]:  # fmt: skip
    """What changes an input of a material, each time by another value, and shows it."""
    shown = session.scene.materials
    step = iter(np.linspace(0.9, 1, 2 * bench_timing.REPEATS + 1))

    def edit() -> None:
        changed = replace(shown[number], **{name: (value * next(step)).astype(np.float32)})
        shown_with(picture, (*shown[:number], changed, *shown[number + 1 :]))

    return edit
