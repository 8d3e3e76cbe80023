"""Shots: what compositions and frames of a shot share, work on several threads, and work that is cancelled."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.stage_parts import StageBuilder
from pxr import Gf, Sdf, Usd, UsdLux

from usdslf import (
    Cancelled,
    Progress,
    Session,
    Settings,
    Shot,
    Solution,
    Stroke,
    progress,
    render_shot,
    run,
    solve,
    stepwise,
)
from usdslf.progress import hearing, step, tell
from usdslf.scene.difference import is_same_but_for_reflectance


def build(folder: Path, **floor: object) -> Path:
    """A floor and a ball under a lamp."""
    b = StageBuilder(folder)
    look = b.material("floor", diffuseColor=(0.4, 0.3, 0.2), roughness=0.4, **floor)
    b.sphere("ball", 0.4, b.material("ball", diffuseColor=(0.2, 0.4, 0.6), roughness=0.3, opacity=1.0), (0, 0.4, 0))
    b.cube("floor", (3, 0.1, 3), look, (0, -0.05, 0))
    lamp = UsdLux.SphereLight.Define(b.stage, "/World/lamp")
    lamp.CreateRadiusAttr(0.2)
    lamp.CreateIntensityAttr(30.0)
    lamp.AddTranslateOp().Set(Gf.Vec3d(0.8, 2.0, 0.6))
    b.camera((0, 1.2, 2.5), (0, 0.3, 0))
    return b.save()


def over(stage: Path, name: str, values: dict[str, Any]) -> Path:
    """A composition of the shot that sets attributes in a stronger layer."""
    layer = Sdf.Layer.CreateNew(str(stage.with_name(name)))
    layer.subLayerPaths.append(f"./{stage.name}")
    layer.Save()
    other = Usd.Stage.Open(layer)
    for path, value in values.items():
        other.GetAttributeAtPath(path).Set(value)
    layer.Save()
    return stage.with_name(name)


def dabs(shot: Shot, at: list[tuple[float, float]], color: tuple[float, float, float]) -> Stroke:
    from usdslf import paint_stroke

    return paint_stroke(shot.scene, shot.tracer, shot.camera(), [[p] for p in at], 0.03, color, aspect=16 / 9)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("shot"))


@pytest.fixture(scope="module")
def shot(stage: Path) -> Shot:
    return Shot.open(str(stage), elements=400, bounces=3)


AT = [(0.3, 0.8), (0.4, 0.85), (0.6, 0.8), (0.7, 0.85)]


def test_a_composition_with_another_light_has_its_own_light(shot: Shot, stage: Path) -> None:
    dark = over(stage, "dark.usda", {"/World/lamp.inputs:intensity": 3.0})
    shown, afresh = shot.reopened(str(dark)), Shot.open(str(dark), elements=400, bounces=3)
    np.testing.assert_allclose(shown.fixed_light.sum(), afresh.fixed_light.sum(), rtol=1e-5)
    assert shown.fixed_light.sum() < 0.2 * shot.fixed_light.sum()


def test_a_composition_that_is_seen_through_lets_light_pass(shot: Shot, stage: Path) -> None:
    clear = over(stage, "clear.usda", {"/World/mtl/ball/surface.inputs:opacity": 0.2})
    shown = shot.reopened(str(clear))
    afresh = Shot.open(str(clear), elements=400, bounces=3)
    assert not is_same_but_for_reflectance(shot.scene, shown.scene)
    np.testing.assert_array_equal(shown.visibility.hit, afresh.visibility.hit)


def test_a_composition_of_other_reflectance_shares_all_but_it(shot: Shot, stage: Path) -> None:
    red = over(stage, "red.usda", {"/World/mtl/ball/surface.inputs:diffuseColor": Gf.Vec3f(0.8, 0.1, 0.1)})
    shown = shot.reopened(str(red))
    assert shown.visibility is shot.visibility and shown.lookup is shot.lookup
    assert shown.fixed_light is shot.fixed_light and shown.elements is not shot.elements


def test_a_frame_of_a_shot_with_made_materials_is_one_of_the_plain_shot(stage: Path) -> None:
    session = Session(str(stage), elements=150, bounces=1, make_preview=True)
    other = session.at_frame(2.0)
    assert other.made is session.made and other.stage is session.stage
    assert other.source is session.source
    assert not other.source.GetRootLayer().anonymous


def test_solves_and_a_picture_of_one_shot_at_once_give_what_each_gives_alone(shot: Shot) -> None:
    red, blue = dabs(shot, AT, (0.5, 0.1, 0.1)), dabs(shot, AT, (0.1, 0.1, 0.4))
    work: dict[str, Callable[[], Any]] = {
        "red": lambda: after(run(solve(shot, [red]))),
        "blue": lambda: after(run(solve(shot, [blue], Settings(norm="l2")))),
        "picture": lambda: render_shot(shot, None, None, (96, 54), samples=4)["color"].tobytes(),
    }
    alone = {name: call() for name, call in work.items()}
    for _ in range(2):
        at_once: dict[str, Any] = {}
        threads = [
            threading.Thread(target=lambda n, c, into: into.update({n: c()}), args=(n, c, at_once))
            for n, c in work.items()
        ]
        for t in threads:
            t.start()
        for t in threads:
            t.join()
        assert at_once == alone


def after(solution: Solution) -> list[tuple]:
    return [
        (a.chosen.id, *(v.tobytes() for v in a.after.values()), a.residual_after, a.rounds) for a in solution.answers
    ]


def test_what_is_made_at_once_by_several_threads_is_made_once(stage: Path) -> None:
    shot = Shot.open(str(stage), elements=150, bounces=1)
    found: list[Any] = []
    threads = [threading.Thread(target=lambda: found.append(shot.elements)) for _ in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len({id(x) for x in found}) == 1 and len(found) == 4


@pytest.fixture()
def told_by_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is told by the clock: the same words each time."""
    monkeypatch.setattr(progress, "TOLD_EVERY", 3600.0)


def test_a_solve_that_is_closed_anywhere_changes_nothing(shot: Shot, told_by_blocks: None) -> None:
    stroke = dabs(shot, AT, (0.5, 0.1, 0.1))
    field = shot.light_field
    before, whole = shot.device.download(field.outgoing_d).tobytes(), after(run(solve(shot, [stroke])))
    said = list(solve(shot, [stroke]))
    assert [p.share for p in said if p.step == "solve"] == sorted(p.share for p in said if p.step == "solve")
    for count in (1, len(said) // 3, 2 * len(said) // 3, len(said) - 1):
        steps = solve(shot, [stroke])
        for _ in range(count):
            next(steps)
        began = time.perf_counter()
        steps.close()
        assert time.perf_counter() - began < 1  # its thread stands still: nothing is waited for
    assert shot.device.download(shot.light_field.outgoing_d).tobytes() == before
    assert shot.light_field is field and after(run(solve(shot, [stroke]))) == whole


def test_what_a_session_hears_can_end_its_work_and_the_last_answer_stays(stage: Path) -> None:
    session = Session(str(stage), elements=200, bounces=1)
    session.add_stroke(dabs(session.shot, AT, (0.5, 0.1, 0.1)))
    session.solve()
    kept = session.solution

    def stop(step: str, share: float) -> None:
        if step == "solve":
            raise Cancelled

    session.say = stop
    with pytest.raises(Cancelled):
        session.solve(norm="l2")
    assert session.solution is kept


def test_work_that_is_cancelled_while_it_makes_something_leaves_what_was_made_before(stage: Path) -> None:
    shot = Shot.open(str(stage), elements=200, bounces=1)
    steps = stepwise(lambda: shot.light_field)
    for told in steps:
        if told.step == "visibility":
            break
    steps.close()
    assert "elements" in vars(shot) and "visibility" not in vars(shot)
    assert len(shot.visibility.hit) == len(shot.elements)


def work_with(session: Session, look: Path) -> list[Callable[[], Any]]:
    """All kinds of steps, one after the other; each goes on from what was made before."""
    return [
        lambda: (session.scene, session.tracer), lambda: session.elements, lambda: session.lookup,
        lambda: session.visibility, lambda: session.fixed_light, lambda: session.light_set,
        lambda: session.light_field, session.solve, lambda: session.author(look),
        lambda: session.render(size=(64, 36), samples=4), lambda: session.at_frame(2.0), session.stylize,
        lambda: session.author(look),
    ]  # fmt: skip


def test_a_cancel_at_any_kind_of_step_leaves_everything_as_it_was(
    shot: Shot, stage: Path, tmp_path: Path, told_by_blocks: None
) -> None:
    """Each is cancelled at its first word, at one on the way and at its last; then it is done, as if never before.

    What was made before is still there, no file has changed or come, and the answer and the picture are those of a
    session that nobody disturbed.
    """
    stroke = dabs(shot, AT, (0.5, 0.1, 0.1))
    said: dict[int, list[Progress]] = {}
    hear: list[Callable[[str, float], None]] = [lambda step, share: None]
    say = lambda step, share: hear[0](step, share)  # noqa: E731
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    whole, cut = (Session(str(stage), elements=200, bounces=2, say=say) for _ in range(2))
    results = []
    for session in (whole, cut):
        session.add_stroke(stroke)
    for number, call in enumerate(work_with(whole, tmp_path / "a/look.usda")):
        hear[0] = lambda step, share, n=number: said.setdefault(n, []).append(Progress(step, share))  # type: ignore[misc]
        results.append(call())
    for number, call in enumerate(work_with(cut, tmp_path / "b/look.usda")):
        words = said[number]
        for at in (1, len(words) // 3, words[-1]):
            before = dict(vars(cut.shot)), cut.solution, cut.look, files_in(tmp_path)
            assert cancelled_at(at, call, hear), (number, at, len(words))
            made, solution, look, files = before
            assert {k: v for k, v in vars(cut.shot).items() if k in made} == made
            assert (cut.solution, cut.look, files_in(tmp_path)) == (solution, look, files)
        results[number] = results[number], call()
    kinds = {p.step for words in said.values() for p in words}
    assert kinds >= {"read", "elements", "visibility", "light", "light field", "evidence", "solve", "author", "render",
                     "stylize"}  # fmt: skip
    (one, other), (picture, again) = results[7], results[9]
    assert after(Solution(answers=tuple(one))) == after(Solution(answers=tuple(other)))
    assert picture["color"].tobytes() == again["color"].tobytes()
    a, b = ((tmp_path / x / "look.usda").read_bytes() for x in "ab")
    assert a == b


def cancelled_at(
    word: int | Progress, call: Callable[[], Any], hear: list[Callable[[str, float], None]]
) -> bool:
    """Whether a call ends by a cancel at one of its words, or from the nth on; waits for what it left running."""
    heard = [0]

    def stop(step: str, share: float) -> None:
        heard[0] += 1
        if Progress(step, share) == word or (isinstance(word, int) and heard[0] >= word):
            raise Cancelled

    hear[0] = stop
    try:
        call()
    except Cancelled:
        return True
    finally:
        hear[0] = lambda step, share: None
        for thread in threading.enumerate():
            if thread.name == "usdslf-call":
                thread.join(60)
    return False


def files_in(folder: Path) -> dict[str, bytes]:
    """Names and contents of all files, and names of all folders."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}


def test_steps_say_a_word_for_each_block_of_their_work(stage: Path, told_by_blocks: None) -> None:
    """As many words as there are blocks, of the sizes that the modules say, beside beginnings and ends."""
    from usdslf.elements import neighbours
    from usdslf.light_field import static_light, visibility
    from usdslf.rays import CHUNK
    from usdslf.render.live import gather, still

    said: list[str] = []
    session = Session(str(stage), elements=3000, bounces=1, say=lambda step, share: said.append(step))
    n = len(session.elements)
    assert said.count("elements") >= 2 + 8 * n / CHUNK  # candidates, each asked by a ray or more
    said.clear()
    entries = len(session.lookup.elements_of_entry)
    assert said.count("elements") >= 2 + 2 * (entries // neighbours.BATCH)
    said.clear()
    assert session.visibility and said.count("visibility") >= 2 + n / visibility.BATCH
    said.clear()
    assert len(session.fixed_light) == n and said.count("light") >= 2 + n / static_light.BATCH
    session.light_field  # noqa: B018
    said.clear()
    session.render(size=(160, 90), samples=16)
    assert said.count("render") >= 2 + still.RAYS * 4 * (160 * 90 * 4 // gather.BATCH + 1)


@pytest.mark.usefixtures("nothing_kept")
def test_work_says_how_far_it_is_all_the_time(stage: Path, tmp_path: Path) -> None:
    said: list[tuple[str, float]] = []
    at = [time.perf_counter()]

    def say(name: str, share: float) -> None:
        said.append((name, share))
        at.append(time.perf_counter())

    session = Session(str(stage), elements=400, bounces=2, say=say)
    assert session.scene and session.tracer  # `dabs` asks the shot, which nobody hears
    session.add_stroke(dabs(session.shot, AT, (0.5, 0.1, 0.1)))
    session.solve()
    session.author(tmp_path / "look.usda")
    gaps = np.diff([*at, time.perf_counter()])
    longest = int(gaps.argmax())
    print(f"longest gap {gaps[longest]:.2f} s, after {said[longest - 1] if longest else 'nothing'}")
    assert gaps[longest] < 20
    # Beginnings and ends are said anyway: two each of what is read, and of elements and light.
    for name, least in (("read", 5), ("elements", 6), ("visibility", 6), ("light", 6), ("evidence", 3)):
        assert sum(step == name for step, _ in said) >= least, (name, said)


# ── progress itself ──────────────────────────────────────────────────────────────────────────────


def test_a_function_is_a_generator_of_what_it_tells() -> None:
    done: list[int] = []

    def work() -> str:
        with step("count"):
            for i in range(4):
                done.append(i)
                tell((i + 1) / 4)
        return "counted"

    steps = stepwise(work)
    assert next(steps) == Progress("count", 0.0) and done == []  # nothing is done that was not asked for
    assert next(steps) == Progress("count", 0.25) and done == [0]
    steps.close()
    assert done == [0]
    done.clear()
    assert run(stepwise(work)) == "counted" and done == [0, 1, 2, 3]


def test_an_error_of_the_work_is_one_of_the_generator() -> None:
    def work() -> None:
        tell()
        raise ValueError("no such thing")

    with pytest.raises(ValueError, match="no such thing"):
        run(stepwise(work))


def test_time_of_a_step_within_another_is_its_own() -> None:
    seconds: dict[str, float] = {}
    with hearing(lambda progress: None), step("outer", seconds), step("inner", seconds):
        time.sleep(0.05)
    assert seconds["inner"] >= 0.05 > seconds["outer"]
