"""A review of many edits holds no more pictures than one of few."""

from __future__ import annotations

from pathlib import Path

from kit.many_edits import write_many

from usdslf.review.page import page_of
from usdslf.review.review import ReviewSettings, review

TILES = 9


def test_pictures_are_shared_by_all_strokes_and_edits(tmp_path: Path) -> None:
    shot, look = write_many(tmp_path, TILES)
    found = review(shot, look, ReviewSettings(size=(96, 54), frames=1, held_out=1, quality={"elements": 300}))
    assert len(found.look.edits) == 2 * TILES and len(found.strokes) == TILES
    assert [v.pictures.view.kind for v in found.views] == ["stroke", "held out", "light"]
    assert len(found.views[0].strokes) == TILES  # all in one picture
    page = page_of(found)
    assert page.count("data:image/png;base64,") == 4 * len(found.views)
    pictures = sum(len(x.split('"')[0]) for x in page.split("base64,")[1:])
    per_tile = (len(page) - pictures) / TILES
    assert 200 * per_tile + pictures * (960 * 540) / (96 * 54) < 40e6  # what 200 strokes and full pictures come to
