"""The Python examples of the README run as they stand there, one after another, on a small shot."""

from __future__ import annotations

import re
import shutil
from functools import partial, partialmethod
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.batch_shots import write_look
from kit.joint_shots import AFTER, BEFORE, LAMPS, painted, ring, write_asset, write_shot
from kit.look_stages import shown
from kit.stage_parts import StageBuilder, rectangle
from kit.varying_floor import GREY, add_lamp, part, places
from pxr import Sdf, Usd

import usdslf
from usdslf.batch import run_job
from usdslf.review.review import ReviewSettings
from usdslf.session import Session
from usdslf.shot import Shot

README = Path(__file__).parents[2] / "README.md"
SMALLER = {
    "(900, 450)": "(48, 24)", "(450, 225)": "(24, 12)", "(300, 100, 600, 300)": "(16, 8, 32, 16)",
    "frames(64": "frames(2",
    'on_cluster("tcp://farm:8786")': "in_this_process",
    "together]}))": "together], **smaller}), in_this_process)",
}  # fmt: skip
SMALLER_JOBS = {"pictures": False, "options": {"elements": 64, "bounces": 1}}
BATCH = """output = "looks"
elsewhere = ["studio.hdr"]
pictures = false
[options]
elements = 64
bounces = 1
[[jobs]]
shots = ["shot.usda"]
strokes = ["strokes.usda"]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A floor and a patch beside it, each painted; two artists, other shots, a sky, a manifest, an asset."""
    b = StageBuilder(tmp_path)
    for name, left in (("floor", -1.0), ("patch", 0.0)):
        b.mesh(name, rectangle((left, 0, 1), (1, 0, 0), (0, 0, -2)), b.material(name, **GREY))
    add_lamp(b)
    b.save().rename(tmp_path / "shot.usda")
    strokes = []
    for number, (side, color) in enumerate(((-1, (0.6, 0.2, 0.1)), (1, (0.15, 0.5, 0.15))), 1):
        strokes.append(part(f"stroke_{number:04d}", side * places()[:, 0] > 0, color))
    usdslf.write_strokes(tmp_path / "strokes.usda", strokes, Usd.Stage.Open(str(tmp_path / "shot.usda")))
    for name in ("anna", "carl"):
        shutil.copy(tmp_path / "strokes.usda", tmp_path / f"{name}.usda")
    shutil.copy(tmp_path / "shot.usda", tmp_path / "other_shot.usda")
    sky = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + bytes((128, 128, 128, 129)) * 8 * 16
    (tmp_path / "studio.hdr").write_bytes(sky)  # radiance 1 everywhere
    (tmp_path / "batch.toml").write_text(BATCH)
    (tmp_path / "shots/010").mkdir(parents=True)
    shutil.copy(tmp_path / "shot.usda", tmp_path / "shots/010/shot.usda")
    write_look(tmp_path / "teapot_look.usda")
    asset = write_asset(tmp_path / "set", BEFORE)
    for name in ("over", "wide"):
        shot = write_shot(tmp_path / "set" / name, asset, LAMPS[name])
        dabs = painted(ring("ring6"), LAMPS[name], AFTER["glossiness"])
        usdslf.write_strokes(tmp_path / "set" / name / "strokes.usda", [dabs], Usd.Stage.Open(str(shot)))
    opened, small = Shot.open, {"elements": 64, "bounces": 1}
    monkeypatch.setattr(Shot, "open", staticmethod(lambda stage, *a, **k: opened(stage, *a, **(small | k))))
    monkeypatch.setattr("usdslf.review.review.ReviewSettings", partial(ReviewSettings, size=(48, 27), frames=1))
    monkeypatch.setattr(Session, "render", partialmethod(Session.render, size=(48, 27), samples=1))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_they_do_what_they_say(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = README.read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    for of, into in SMALLER.items():
        assert of in "".join(blocks), of
        blocks = [block.replace(of, into) for block in blocks]
    names: dict[str, Any] = {"in_this_process": lambda jobs, found, tell: ((job, run_job(job)) for job in jobs)}
    names["smaller"] = SMALLER_JOBS
    for number, block in enumerate(blocks):
        exec(compile(block, f"README.md, example {number + 1}", "exec"), names)
    said = capsys.readouterr().out
    assert names["picture"].shape == (27, 48, 3)
    assert names["found"].job("shot") and names["summary"].count("done") == 1 and not names["summary"].failed
    jobs = names["looks"]
    assert not jobs.failed and [r.job for r in jobs.rows if r.kind in ("propagate", "settle")] == [
        "accepted/010",
        "teapot/look",
    ]
    assert names["rebase"].edits == () and "shot done" in said
    assert "<html" in (folder / "review.html").read_text(encoding="utf-8")
    assert len(usdslf.read_strokes(folder / "both.usda")) == 4 and (folder / "farm.yaml").is_file()
    assert said.count("studio.hdr") >= 2 and "other_shot.usda" in said
    grey, green = (0.4, 0.4, 0.4), (0.15, 0.5, 0.15)
    np.testing.assert_allclose(diffuse(folder, "one.usda"), [grey, green], atol=0.02)  # stroke_0001 changes nothing
    np.testing.assert_allclose(diffuse(folder, "accepted.usda"), [grey, grey], atol=0.02)  # no stroke_0002; all is off


def diffuse(folder: Path, look: str) -> list[tuple[float, ...]]:
    """The diffuse colours of floor and patch under a look."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [str(folder / look), str(folder / "shot.usda")]
    stage = Usd.Stage.Open(root)
    return [tuple(shown(stage, f"/World/{name}")["d"]) for name in ("floor", "patch")]
