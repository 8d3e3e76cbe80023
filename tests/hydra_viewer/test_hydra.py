"""The Hydra viewport: what it draws against the program's own rays, its display pass, and what a look changes in it.

Collected where a pxr with UsdImagingGL is installed; elsewhere test_no_hydra.py tests what is said instead.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from kit.displays import ROOT
from kit.hydra_colors import GLOW
from scipy import ndimage

Pictures = dict[str, np.ndarray]


def run_kit(program: str, result: str, display: dict[str, str], folder: Path) -> Pictures:
    """Runs a program of the kit in a process of its own; what it prints on stderr is a failure, as a warning is."""
    command = [sys.executable, "-W", "error", str(ROOT / "tests/kit" / program), str(folder)]
    run = subprocess.run(command, env=display, capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stderr[-3000:]
    assert not run.stderr.strip(), run.stderr[-3000:]
    return dict(np.load(folder / result))


@pytest.fixture(scope="module")
def pictures(display: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    return run_kit("hydra_pictures.py", "pictures.npz", display, tmp_path_factory.mktemp("hydra"))


def is_on_edge(labels: np.ndarray) -> np.ndarray:
    """Pixels within two of a border between two things: on software OpenGL Storm's pictures come a little soft."""
    return ndimage.maximum_filter(labels, 5) != ndimage.minimum_filter(labels, 5)


@pytest.mark.parametrize("place", ["near", "far"])
@pytest.mark.parametrize("camera", ["plain", "offset", "orthographic"])
def test_everything_is_where_the_programs_own_rays_meet_it(pictures: Pictures, place: str, camera: str) -> None:
    drawn, traced = pictures[f"{place} {camera} drawn"], pictures[f"{place} {camera} traced"]
    colors = np.array([*GLOW.values(), (0.0, 0.0, 0.0)])
    distance = np.abs(drawn[..., None, :] - colors).max(-1)
    seen = np.where(distance.argmin(-1) == len(GLOW), -1, distance.argmin(-1))
    inside = ~is_on_edge(traced)
    assert distance.min(-1)[inside].max() < 2e-3  # the colours themselves, linear and untouched
    assert set(np.unique(traced)) == {-1, 0, 1, 2, 3}
    differ = seen != traced
    assert not (differ & inside).any()
    assert differ.mean() < 0.004
    assert bool(np.abs(pictures[f"{place} origin"]).max()) == (place == "far")


def test_a_dome_is_seen_behind_everything(pictures: Pictures) -> None:
    corners = pictures["sky"][[2, 2, -3, -3], [2, -3, 2, -3]]
    assert corners == pytest.approx(np.tile([0.2, 0.4, 0.8], (4, 1)), rel=0.02)


def test_a_stage_without_light_is_lit_as_stated(pictures: Pictures) -> None:
    """The key light's irradiance 2 from 35 degrees up and 30 aside, over pi, and a dome of .35."""
    expected = 2 * np.cos(np.radians(35)) * np.cos(np.radians(30)) / np.pi + 0.35
    assert pictures["dark"][90, 160] == pytest.approx(np.full(3, expected), rel=0.15)  # Storm's sheen adds some


def test_each_selection_of_a_looks_alternatives_shows(pictures: Pictures) -> None:
    """On materials that are local, referenced and in an instance, as where the shot itself says so."""
    painted, shot = pictures["plain painted"], pictures["plain shot"]
    assert (np.abs(painted - shot).max(-1) > 0.02).mean() > 0.01
    np.testing.assert_allclose(pictures["selected diffuse"], painted, atol=2e-3)
    np.testing.assert_allclose(pictures["selected as it was"], shot, atol=2e-3)


def test_display_on_the_gpu_is_that_of_the_processor(pictures: Pictures) -> None:
    np.testing.assert_array_equal(pictures["pixels back"], pictures["pixels"])
    names = [n.split(" ", 1)[1] for n in pictures if n.startswith("gpu ")]
    assert len(names) == 8
    for name in names:
        gpu, cpu = pictures[f"gpu {name}"].astype(int), pictures[f"cpu {name}"].astype(int)
        assert np.abs(gpu - cpu).max() <= (0 if name == "false_color" else 1), name
        assert (gpu != cpu).mean() < 1e-3, name
        assert len(np.unique(gpu)) > 10, name


def test_the_first_picture_shows_the_ball(pictures: Pictures) -> None:
    linear, shown = pictures["first linear"], pictures["first"]
    assert linear.shape == shown.shape == (180, 320, 3)
    assert linear[90, 160].min() > 0.02 and (linear[:8, :8] == 0).all()
    assert shown[90, 160].min() > 20 and shown[4, 4].max() < 8


def test_a_move_of_the_camera_moves_the_picture_and_back_it_is_the_same(pictures: Pictures) -> None:
    middle = lambda p: ndimage.center_of_mass(p.sum(-1))[1] / p.shape[1]  # noqa: E731
    assert middle(pictures["moving linear"]) < middle(pictures["first linear"]) - 0.05
    assert np.abs(pictures["back"].astype(int) - pictures["first"]).mean() < 1.0


def test_a_look_shows_in_the_next_picture_and_goes_with_it(pictures: Pictures) -> None:
    before, red, after = (pictures[n] for n in ("first linear", "red linear", "without linear"))
    lit = before[..., 1] > 0.1
    assert lit.sum() > 400
    assert (red[lit][:, 0] > 1.5 * before[lit][:, 0]).mean() > 0.9  # .4 became .8
    assert (red[lit][:, 1] < 0.5 * before[lit][:, 1]).mean() > 0.9  # a highlight stays
    assert np.abs(after - before).mean() < 0.01 * before.mean()
    assert pictures["unchanged"]


def test_exposure_and_channel_act_on_what_is_there(pictures: Pictures) -> None:
    shown, expected = pictures["green"].astype(int), pictures["green expected"].astype(int)
    assert np.ptp(shown, axis=-1).max() <= 1  # a grey of the view is not the same number three times
    assert np.abs(shown - expected).max() <= 1


def test_an_error_is_a_sentence_and_the_viewport_lives_on(pictures: Pictures) -> None:
    assert "no display" in str(pictures["error"][0]) and "Sepia" in str(pictures["error"][0])
    assert np.abs(pictures["after error"].astype(int) - pictures["first"]).mean() < 1.0
    assert pictures["end"]


def test_storm_is_listed_first_and_the_pxr_is_named(pictures: Pictures) -> None:
    assert pictures["storm"] and pictures["kinds"][0] == "Hydra: Storm"
    assert str(pictures["choice"]).startswith("Hydra by the UsdImagingGL of")


# ── the window ────────────────────────────────────────────────────────────────────────────────────
@pytest.fixture(scope="module")
def work(display: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    return run_kit("hydra_window.py", "window.npz", display, tmp_path_factory.mktemp("window"))


def mean_color(picture: np.ndarray) -> np.ndarray:
    return picture.mean((0, 1))


def test_alt_and_the_mouse_look_round_in_the_hydra_viewport(work: Pictures) -> None:
    assert work["name"] == "Hydra: Storm" and not work["said"].size
    assert np.abs(work["orbited"] - work["hydra"]).mean() > 0.1 * work["hydra"].mean()


def test_a_stroke_is_understood_and_shows_in_hydra_and_is_undone_and_done_again(work: Pictures) -> None:
    assert "grey" in str(work["sentence"])
    before, painted, undone, again = (mean_color(work[n]) for n in ("orbited", "painted", "undone", "done again"))
    assert np.ptp(before) < 0.02 * before.mean()  # a grey ball
    assert painted[1] > 2 * max(painted[0], painted[2])  # a green one
    assert np.abs(undone - before).max() < 0.01 * before.max()
    assert np.abs(again - painted).max() < 0.01 * painted.max()


def test_what_hydra_showed_is_saved_and_the_shot_is_not_touched(work: Pictures) -> None:
    assert 'over "grey"' in str(work["look"]) and work["shot unchanged"]


def test_a_stage_that_changed_on_the_disk_is_read_anew_while_hydra_shows_it(work: Pictures) -> None:
    assert work["brighter"].sum() == pytest.approx(2 * work["as before"].sum(), rel=0.02)


def test_the_built_in_viewport_shows_the_same_from_the_same_camera(work: Pictures) -> None:
    hydra, built_in = work["done again"], work["built in"]
    assert work["same camera"]
    rows, columns = (
        ((np.arange(n) + 0.5) * m / n).astype(int) for n, m in zip(built_in.shape[:2], hydra.shape[:2], strict=True)
    )
    rims = []
    for picture in (hydra[rows][:, columns], built_in):
        green = (picture[..., 1] > 0.01) & (picture[..., 1] > 2 * picture[..., [0, 2]].max(-1))
        assert green.mean() > 0.02
        # The lit side's rim is the ball's; where the other side turns dark is the renderer's affair.
        rims.append((np.flatnonzero(green.any(1))[0], np.flatnonzero(green.any(0))[-1]))
    assert np.abs(np.subtract(*rims)).max() <= 1


def test_two_viewports_never_draw_at_the_same_time(display: dict[str, str], tmp_path: Path) -> None:
    """Storm crashes where two of them are drawn on two threads at once."""
    two = run_kit("hydra_two.py", "two.npz", display, tmp_path)
    assert not two["failed"].size and two["threads"] == 2 and two["drawn"].min() >= 6
    assert two["most"] == 1
