"""What a user's script does with the public names of usdslf; it is checked by mypy --strict, and not run."""

from __future__ import annotations

import contextlib
import sys

import numpy as np
from numpy.typing import NDArray

import usdslf


def strokes_of(session: usdslf.Session, path: str) -> list[usdslf.Stroke]:
    said: list[str] = []
    strokes = usdslf.read_strokes(path, warnings=said)
    painted: usdslf.Stroke = usdslf.paint_stroke(
        session.scene, session.tracer, session.camera("/World/camera"), [[(0.4, 0.5), (0.6, 0.5)]], 0.02,
        color=(0.5, 0.1, 0.1), tool="replace", strength=0.5, name="stroke_0002",
    )  # fmt: skip
    usdslf.write_strokes(path, [*strokes, painted], session.stage)
    return [*strokes, painted]


def size_of(scene: usdslf.Scene) -> float:
    low, high = scene.bounds
    return float(np.linalg.norm(high - low)) * scene.meters_per_unit


def follow(path: str, strokes: list[usdslf.Stroke]) -> usdslf.Look:
    shot = usdslf.Shot.open(path, elements=4000)
    settings = usdslf.Settings(norm="mixed")
    solution: usdslf.Solution = usdslf.run(usdslf.solve(shot, strokes, settings), lambda step, share: None)
    for warning in solution.warnings:
        if isinstance(warning, usdslf.Remark) and warning.about is not usdslf.About.TIE:
            print(warning.what, warning.strokes)
    styled = usdslf.stylize_shot(shot, 0.5)
    first: usdslf.Progress = next(styled)
    styled.close()
    print(first.step, first.share)
    look: usdslf.Look = usdslf.author(shot, solution, "look.usda")
    with contextlib.suppress(usdslf.Cancelled):
        usdslf.run(usdslf.stepwise(lambda: usdslf.render_shot(shot, None, look)["color"]))
    return look


def watch(shot: usdslf.Shot) -> usdslf.LivePicture:
    picture: usdslf.LivePicture = usdslf.live_picture(shot, None, size=(320, 180))
    for frame in picture.frames(2):
        shown: usdslf.LiveFrame = frame
        print(shown.picture.shape, shown.number, shown.share, shown.error)
    return picture.with_materials(shot.scene.materials).seen_by(shot.camera(), (160, 90))


def look_around(session: usdslf.Session) -> dict[str, tuple[float, float, float]]:
    shot, camera = session.shot, session.camera()
    aspect = usdslf.film_aspect(camera)
    color: usdslf.Color = usdslf.color_of(shot.ocio, shot.scene.working_space)
    seen: usdslf.Pick | None = usdslf.pick(shot, camera, (0.5, 0.5), aspect)
    if seen is not None:
        at, _ = usdslf.project_points(camera, seen.point[None], aspect)
        print(seen.path, at, usdslf.camera_rays(camera, at, aspect).direction, color.display(seen.normal))
    everything: usdslf.Seen = usdslf.seen_prims(shot, camera, (32, 18))
    print(everything.mesh.max(), usdslf.are_seen(shot, camera, np.zeros((1, 3)), aspect))
    print(usdslf.stage_files(shot.stage))
    usdslf.reload_stage(shot.source)
    rows: list[usdslf.PrimRow] = usdslf.stage_prims(shot.stage)
    frames: usdslf.FrameRange | None = usdslf.frame_range(shot.stage)
    print(len(rows), frames.last if frames else None, usdslf.frame_of(session.strokes, None, []))
    print("\n".join(usdslf.lines_of_report(usdslf.report_of(shot, session.solution, session.look))))
    reviewed: usdslf.LookReview = usdslf.review_look(shot.path, session.look.path if session.look else "", shot.ocio)
    print(reviewed.look_hash, usdslf.similarity_to(shot, session.strokes, camera).max())
    dab: usdslf.NextDab = usdslf.find_next_dab(shot, session.solution)
    return dab.expected


def show(session: usdslf.Session, look: str) -> int:
    usdslf.require_viewer()
    choice: usdslf.PxrChoice = usdslf.choose_pxr()
    print(choice.sentence)
    shot, camera = session.shot, session.camera()
    live: usdslf.LiveStage = usdslf.LiveStage.of(shot.stage, shot.scene)
    live.show(look)
    view, projection = usdslf.view_and_projection(camera, 2.0, 0.1, 100.0)
    settings = usdslf.DisplaySettings(exposure=1.0, channel=usdslf.CHANNELS[1])
    display = usdslf.DisplayPass.of(usdslf.color_of(shot.ocio, shot.scene.working_space), settings)
    codes = display.codes(session.render()["color"], settings)
    shader: usdslf.DisplayShader = display.shader
    print(view, projection, shader.text, usdslf.FALSE_COLORS[0])
    return int(codes.max())


def kinds(view: usdslf.Camera) -> tuple[str, ...]:
    print(view.path, usdslf.next_name([]))
    return (*usdslf.TOOLS, *usdslf.MODES, *usdslf.SPACES, *usdslf.NORMS, *usdslf.SCOPES)


def main() -> int:
    try:
        session = usdslf.open("shot.usda", elements=4000)
        for stroke in strokes_of(session, "strokes.usda"):
            session.add_stroke(stroke)
        session.solve()
        session.author("look.usda", strokes_path="strokes.usda", review_root="review.usda")
        picture: NDArray[np.float32] = session.render("/World/camera")["color"]
        report = session.report()
        print(usdslf.__version__, size_of(session.scene), picture.shape, report["strokes"])
    except usdslf.UsdslfError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
