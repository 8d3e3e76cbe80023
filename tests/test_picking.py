"""What is picked is what the reference rays meet, with its material, and what nothing hides is seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kit.moving_stages import roll

from usdslf import Shot, are_seen, frame_range, pick, project_points, seen_prims, stage_files, stage_prims

ASPECT = 4 / 3


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    return Shot.open(str(roll(tmp_path_factory.mktemp("shot"))))


def middle(shot: Shot, path: str) -> np.ndarray:
    return next(m for m in shot.scene.meshes if m.path == path).positions.mean(0, keepdims=True)


def test_a_pick_is_the_surface_that_is_seen(shot: Shot) -> None:
    camera = shot.camera()
    at, _ = project_points(camera, middle(shot, "/World/ball"), ASPECT)
    found = pick(shot, camera, at[0], ASPECT)
    assert found is not None and (found.path, found.material) == ("/World/ball", "/World/mtl/red")
    center = middle(shot, "/World/ball")[0]
    assert np.linalg.norm(found.point - center) == pytest.approx(0.2, abs=0.01)  # the ball's radius
    eye = camera.world_from_camera[:3, 3]
    np.testing.assert_allclose(found.normal, (eye - center) / np.linalg.norm(eye - center), atol=0.1)
    assert found.distance == pytest.approx(np.linalg.norm(found.point - eye), rel=1e-5)
    back, _ = project_points(camera, found.point[None], ASPECT)
    np.testing.assert_allclose(back, at, atol=1e-5)
    assert pick(shot, camera, (0.01, 0.01), ASPECT) is None


def test_all_pixels_show_what_single_picks_show(shot: Shot) -> None:
    camera, seen = shot.camera(), seen_prims(shot, shot.camera(), (40, 30))
    paths = [*(m.path for m in shot.scene.meshes), ""]
    materials = [*(m.path for m in shot.scene.materials), ""]
    for y in range(0, 30, 3):
        for x in range(0, 40, 3):
            found = pick(shot, camera, ((x + 0.5) / 40, (y + 0.5) / 30), ASPECT)
            assert paths[seen.mesh[y, x]] == (found.path if found else "")
            assert materials[seen.material[y, x]] == (found.material if found else "")


def test_what_is_hidden_is_not_seen(shot: Shot) -> None:
    camera = shot.camera()
    eye, center = camera.world_from_camera[:3, 3], middle(shot, "/World/ball")[0]
    towards = (eye - center) / np.linalg.norm(eye - center)
    front, back, behind_eye = center + 0.2 * towards, center - 0.2 * towards, eye + towards
    np.testing.assert_array_equal(are_seen(shot, camera, [front, back, behind_eye], ASPECT), [True, False, False])


def test_the_tree_of_a_stage_has_parents_before_children(shot: Shot) -> None:
    rows = stage_prims(shot.stage)
    for n, row in enumerate(rows):
        assert row.parent < n and row.path == (rows[row.parent].path if row.parent >= 0 else "") + "/" + row.name
    by_path = {row.path: row for row in rows}
    assert by_path["/World/ball"].is_gprim and by_path["/World/ball"].material == "/World/mtl/red"
    assert by_path["/World/camera"].type_name == "Camera" and not by_path["/World/camera"].is_gprim
    frames = frame_range(shot.stage)
    assert frames is not None and (frames.first, frames.last, frames.per_second) == (1.0, 5.0, 24.0)
    assert stage_files(shot.stage) == [str(Path(shot.path).resolve())]
