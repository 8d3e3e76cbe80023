"""The page of a review: in a browser, from a file, by the hand of a reader; and its JSON by the published schema."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from kit.browser import Page, find_browser, opened
from kit.varying_floor import places, seen, stroke, write_floor
from pxr import Sdf, Vt

import usdslf
from usdslf.review.page import page_of, shown, write_pictures
from usdslf.review.review import Review, ReviewSettings, review
from usdslf.review.verdict import read_verdict
from usdslf.usd.review.accept import accept_look
from usdslf.usd.schema import schema_folder
from usdslf.usd.stroke_layer import write_strokes

SIZE = 128, 72
HOSTILE = "a\"'<script>document.title='x'<img src=x onerror=alert(1)>\u202e&amp;"  # name of a folder and of a look
STROKE = "/SlfStrokes/<img src=x onerror=\"document.title='x'\">\u202e../../etc"  # in what a look says


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def reviewed(folder: Path) -> Review:
    """A floor painted red, in a folder with a hostile name; its look names a stroke that is markup."""
    home = folder / HOSTILE
    home.mkdir()
    shot, look, strokes = write_floor(home), home / f"{HOSTILE}.usda", home / "strokes.usda"
    session = usdslf.open(str(shot), elements=400)
    session.add_stroke(stroke(seen(places(), (0.6, 0.2, 0.1))))
    write_strokes(strokes, session.strokes, session.stage)
    session.solve()
    session.author(home / "look.usda", strokes_path=strokes)
    (home / "look.usda").rename(look)
    layer = Sdf.Layer.FindOrOpen(str(look))
    spec = layer.GetPrimAtPath("/World/mtl/floor")
    data = dict(spec.customData["usdslf"])
    data["strokes"] = Vt.StringArray([*data["strokes"], STROKE])
    spec.SetInfo("customData", {"usdslf": data})
    layer.Save()
    return review(shot, look, ReviewSettings(size=SIZE, frames=1, turns=2, quality={"elements": 400}))


@pytest.fixture(scope="module")
def html(reviewed: Review, folder: Path) -> Path:
    file = folder / "review.html"
    file.write_text(page_of(reviewed), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def page(html: Path, folder: Path) -> Iterator[Page]:
    if not find_browser():
        pytest.skip("there is no Chromium: apt-get install chromium")
    with opened(html, folder) as found:
        found.wait(f"document.getElementById('canvas').width === {SIZE[0]}")
        yield found


def pixels(page: Page) -> np.ndarray:
    """What the large picture shows, (h, w, 3)."""
    script = """(async () => { await draw(); const c = document.getElementById('canvas');
      return Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data); })()"""
    return np.array(page.run(script)).reshape(SIZE[1], SIZE[0], 4)[..., :3]


# ---- JSON -------------------------------------------------------------------------------------------
def schema(name: str) -> dict:
    return json.loads((schema_folder() / f"{name}.schema.json").read_text())


def test_the_json_is_what_the_schema_says(reviewed: Review) -> None:
    values = json.loads(json.dumps(reviewed.as_values()))
    jsonschema.validate(values, schema("review"))
    jsonschema.validate(json.loads(json.dumps(reviewed.look.as_values())), schema("review"))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(values | {"look_hash": 3}, schema("review"))


def test_it_looks_from_the_stroke_from_elsewhere_and_in_another_light(reviewed: Review) -> None:
    kinds = [v.pictures.view.kind for v in reviewed.views]
    assert kinds == ["stroke", "held out", "held out", "turntable", "turntable", "light"]
    assert reviewed.views[-1].light
    for seen_ in reviewed.views[:3]:
        assert (seen_.pictures.gprim == 0).mean() > 0.01  # all of them show what changes
    (on,) = reviewed.views[0].strokes
    target, after, before = (np.array(x) for x in (on.target, on.seen_after, on.seen_before))
    assert np.linalg.norm(after - target) < 0.25 * np.linalg.norm(before - target)


def test_indirect_effects_are_those_of_what_is_not_edited(reviewed: Review) -> None:
    p = reviewed.views[0].pictures
    assert (p.indirect[p.gprim >= 0] == 0).all()


def test_pictures_are_written_as_exr_and_png(reviewed: Review, folder: Path) -> None:
    files = write_pictures(folder / "pictures", reviewed)
    assert len(files) == 6 * len(reviewed.views) and all(f.stat().st_size for f in files)


# ---- text -------------------------------------------------------------------------------------------
def test_what_hides_or_turns_text_is_written_out() -> None:
    assert shown("a\u202eb\u200f\x07") == "a\\u202eb\\u200f\\u0007"
    assert shown("\u0627\u0644\u0639\u0645\u0644 ../x") == "\u0627\u0644\u0639\u0645\u0644 ../x"


def test_a_page_asks_nothing_of_a_network_and_holds_each_picture_once(html: Path) -> None:
    text = html.read_text()
    assert "http://" not in text.replace("http://www.w3.org", "") and "https://" not in text
    encoded = [part.split('"')[0] for part in text.split("data:image/png;base64,")[1:]]
    assert len(encoded) == len(set(encoded)) or len(encoded) == 24  # six views of four


def test_hostile_names_come_out_as_text(page: Page) -> None:
    assert page.run("document.title") == shown(f"{HOSTILE}.usda")
    assert page.run("document.querySelectorAll('img, script[src], iframe').length") == 0
    said = page.run("document.getElementById('stroke-table').innerText")
    assert shown(STROKE) in said.replace("\n", "") and "\u202e" not in page.run("document.body.innerText")
    assert page.troubles == []


# ---- pictures ---------------------------------------------------------------------------------------
def test_before_after_wipe_and_difference_are_what_they_say(page: Page) -> None:
    page.run("state.strokes = false")
    found = {}
    for mode in ("before", "after", "difference", "wipe"):
        page.run(f"document.querySelector('[data-mode={mode}]').click()")
        found[mode] = pixels(page)
    before, after, wipe = found["before"], found["after"], found["wipe"]
    assert (before != after).any()
    half = SIZE[0] // 2
    np.testing.assert_array_equal(wipe[:, : half - 2], before[:, : half - 2])
    np.testing.assert_array_equal(wipe[:, half + 2 :], after[:, half + 2 :])
    np.testing.assert_array_equal(found["difference"], np.minimum(4 * np.abs(after - before), 255))
    page.run("const g = document.getElementById('gain'); g.value = 0; g.dispatchEvent(new Event('input'))")
    page.run("document.querySelector('[data-mode=difference]').click()")
    np.testing.assert_array_equal(pixels(page), np.abs(after - before))


def test_a_hand_drags_the_wipe_and_blinks(page: Page) -> None:
    page.run("setMode('wipe'); state.wipe = 0.5; window.scrollTo(0, 0)")
    box = page.run("(() => { const b = document.getElementById('canvas').getBoundingClientRect(); "
                   "return [b.left, b.top, b.width, b.height]; })()")  # fmt: skip
    y = box[1] + box[3] / 2
    page.drag(*[(box[0] + share * box[2], y) for share in (0.5, 0.4, 0.25)])
    assert page.run("state.wipe") == pytest.approx(0.25, abs=0.01)
    page.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: '4' }))")
    assert page.run("state.mode") == "blink"
    seen_ = page.run("new Promise((done) => { const was = state.second; const t = setInterval(() => { "
                     "if (state.second !== was) { clearInterval(t); done(true); } }, 20); })")  # fmt: skip
    assert seen_


def test_a_pixel_leads_to_its_material_and_strokes(page: Page, reviewed: Review) -> None:
    y, x = np.argwhere(reviewed.views[0].pictures.gprim == 0)[5]
    page.run("setView(0); setMode('after'); if (state.picked >= 0) pick(state.picked); window.scrollTo(0, 0)")
    box = page.run("(() => { const b = document.getElementById('canvas').getBoundingClientRect(); "
                   "return [b.left, b.top, b.width, b.height]; })()")  # fmt: skip
    page.drag((box[0] + (x + 0.5) / SIZE[0] * box[2], box[1] + (y + 0.5) / SIZE[1] * box[3]))
    page.wait("state.picked === 0")
    assert "/World/mtl/floor" in page.run("document.querySelector('.card.is-picked').innerText")


def test_an_input_follows_its_material_until_it_is_judged(page: Page) -> None:
    script = """(() => {
      const rows = [...document.querySelectorAll('#changes [data-target]')];
      const [whole, part] = [rows.find((n) => !n.dataset.target.includes('.')), rows.find((n) => n.dataset.target.includes('.'))];
      const says = () => ['accept', 'reject'].map((name) => {
        const button = part.querySelector('.' + name);
        return button.getAttribute('aria-pressed') === 'true' ? 'own' : button.classList.contains('follows') ? 'follows' : '';
      });
      const seen = [says()];
      for (const [row, name] of [[whole, 'reject'], [part, 'accept'], [part, 'accept'], [whole, 'reject']]) {
        row.querySelector('.' + name).click();
        seen.push(says());
      }
      return seen;
    })()"""  # noqa: E501
    assert page.run(script) == [["", ""], ["", "follows"], ["own", ""], ["", "follows"], ["", ""]]
    assert page.run("document.querySelector('#changes tr.of').innerText").count("from ") == 1  # the strokes


# ---- verdict ----------------------------------------------------------------------------------------
def test_a_verdict_is_saved_and_executed(page: Page, reviewed: Review, folder: Path) -> None:
    page.run("""(() => {
      const rows = [...document.querySelectorAll('#changes [data-target]')];
      const row = rows.find((n) => n.dataset.target.includes('.inputs:'));
      row.querySelector('.reject').click();
      document.getElementById('by').value = 'Ada';
      const note = document.querySelector('.card input');
      note.value = 'too red'; note.dispatchEvent(new Event('input'));
      document.getElementById('save').click();
    })()""")
    look = Path(reviewed.look.look)
    file = folder / f"{look.stem}.verdict.json"
    page.wait("document.getElementById('saved').textContent.includes('saved')")
    saved = next(iter(_appearing(page, folder)))
    values = json.loads(saved.read_text())
    jsonschema.validate(values, schema("verdict"))
    assert values["look"] == file.name.replace(".verdict.json", ".usda") and values["by"] == "Ada"
    verdict = read_verdict(saved, look)
    done = accept_look(reviewed.look.shot, look, folder / "accepted.usda", verdict.wish())
    assert done.left_out == ("/World/mtl/floor.inputs:diffuseColor",)
    assert {d.target: d.note for d in verdict.decided}["/World/mtl/floor"] == "too red"


def _appearing(page: Page, folder: Path) -> list[Path]:
    """What the page saved, as soon as it is whole."""
    for _ in range(400):
        found = [f for f in folder.glob("*.json") if f.stat().st_size]
        if found:
            return found
        page.run("new Promise((done) => setTimeout(done, 25))")
    return []
