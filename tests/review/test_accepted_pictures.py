"""What is accepted of a look shows, in pictures, what a shot shows that says the same itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kit.reviewed_looks import PACKED, RED, write_look
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom

from usdslf.pictures import render_shot
from usdslf.shot import Shot
from usdslf.usd.review.accept import Wish, accept_look
from usdslf.usd.review.toggle import toggle

PAINT = "/World/one/mtl/paint"


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    """A row of balls: of a red and of a packed material, and an asset three times; its look edits all of them."""
    folder = tmp_path_factory.mktemp("accepted")
    write_look(folder)
    stage = Usd.Stage.Open(str(folder / "shot.usda"))
    for place, name in enumerate(("ball", "other", "crate", "one", "two", "three")):
        UsdGeom.Xformable(stage.GetPrimAtPath(f"/World/{name}")).AddTranslateOp().Set(Gf.Vec3d(2.5 * place, 0, 0))
    stage.GetRootLayer().Save()
    return Shot.open(str(folder / "shot.usda"), elements=64, bounces=1)


def picture(shot: Shot, look: Path | None) -> NDArray[np.float32]:
    return render_shot(shot, None, look, (64, 36), samples=1)["color"]


def accepted(shot: Shot, **wish: tuple[str, ...]) -> NDArray[np.float32]:
    home = Path(shot.path).parent
    accept_look(shot.path, home / "look.usda", home / "accepted.usda", Wish(**wish))
    return picture(shot, home / "accepted.usda")


def test_all_none_each_half_and_what_is_off(shot: Shot) -> None:
    home = Path(shot.path).parent
    look, plain = picture(shot, home / "look.usda"), picture(shot, None)
    assert (look != plain).any()
    np.testing.assert_array_equal(accepted(shot), look)
    np.testing.assert_array_equal(accepted(shot, but=(RED, PACKED, PAINT)), plain)
    by_hand = Usd.Stage.Open(shot.path)  # a session layer: the shot stays as it is
    by_hand.SetEditTarget(by_hand.GetSessionLayer())
    red = by_hand.GetPrimAtPath(f"{RED}/pbr")
    red.GetAttribute("inputs:diffuseColor").Set(Gf.Vec3f(0.1, 0.4, 0.3))
    red.GetAttribute("inputs:roughness").Set(0.2)
    half = picture(shot.reopened(by_hand), None)
    assert (half != plain).any() and (half != look).any()
    np.testing.assert_allclose(accepted(shot, but=(PACKED, PAINT)), half, atol=1e-6)
    other, whole = accepted(shot, but=(RED,)), (home / "look.usda").read_bytes()
    assert (other != plain).any() and (other != look).any()
    toggle(home / "look.usda", [RED], on=False)
    np.testing.assert_array_equal(picture(shot, home / "look.usda"), other)
    toggle(home / "look.usda", [RED], on=True)
    assert (home / "look.usda").read_bytes() == whole  # on again: what is seen is the first picture
