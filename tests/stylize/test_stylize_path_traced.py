"""A stylized shot in another renderer: a path tracer sees the local contrast rise, and the energy stay."""

from __future__ import annotations

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, TextureInput, ball, checker, rectangle
from pxr import Usd
from reference.mitsuba_setup import why_no_pathtracer
from scipy.ndimage import gaussian_filter

from usdslf.session import Session
from usdslf.usd.edited import open_edited

if why_no_pathtracer():
    pytest.skip(why_no_pathtracer(), allow_module_level=True)

from reference.pathtracer import Tracer

AMOUNTS = (0.5, 1.0)
SIZE, SPP = (120, 90), 192
BLUR = 7.0  # [pixels], about a tenth of the scene's diagonal


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> dict[float, np.ndarray]:
    """Path-traced pictures (h, w, 3) of the shot, and of the looks of each amount, with the same paths."""
    b = StageBuilder(tmp_path_factory.mktemp("traced"))
    squares = TextureInput(b.image("tiles.png", checker((0.6, 0.55, 0.5), (0.3, 0.33, 0.36))))
    tiles = b.material("tiles", diffuseColor=squares, roughness=0.7)
    red = b.material("red", diffuseColor=(0.5, 0.1, 0.07), roughness=0.4)
    grey = b.material("grey", diffuseColor=(0.5, 0.5, 0.5), roughness=0.8)
    b.mesh("floor", rectangle((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3)), tiles)
    b.mesh("ball", ball(0.6), red)
    b.mesh("back", rectangle((-1.5, 0, -1.5), (3, 0, 0), (0, 2, 0)), grey)
    b.rect_light("lamp", (1, 3, 1.5), (0, 0, 0), 0.8, 0.8, (12, 12, 11))
    b.camera((0, 1.8, 4.2), (0, 0.5, 0))
    path = b.save()

    def traced(stage: Usd.Stage) -> np.ndarray:
        picture = Tracer(stage, "smith", max_depth=6, hide_lights=True).render("/World/camera", *SIZE, SPP, seed=5)
        return picture.astype(np.float64)

    found = {0.0: traced(Usd.Stage.Open(str(path)))}
    session = Session(str(path), elements=1500, bounces=4)
    for amount in AMOUNTS:
        look = path.parent / f"look_{amount}.usda"
        session.stylize(amount)
        session.author(look)
        found[amount] = traced(open_edited(str(path), look))
    return found


def _detail(picture: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """What unsharp masking adds: the picture less its surroundings, where surfaces are seen."""
    share = gaussian_filter(seen.astype(float), BLUR)[..., None]
    return (picture - gaussian_filter(picture * seen[..., None], (BLUR, BLUR, 0)) / share)[seen]


def test_local_contrast_rises_with_the_amount(pictures: dict[float, np.ndarray]) -> None:
    """The share of the detail that was there which was added to it."""
    before = pictures[0.0]
    seen = before.max(2) > 0.002
    detail = _detail(before, seen)
    added = {a: (_detail(pictures[a] - before, seen) * detail).sum() / (detail * detail).sum() for a in AMOUNTS}
    assert 0.1 < added[0.5] < 0.6 and 1.5 * added[0.5] < added[1.0] < 1.1, added
    aligned = np.corrcoef((pictures[1.0] - before)[seen].ravel(), detail.ravel())[0, 1]
    assert aligned > 0.6, aligned


def test_energy_is_kept(pictures: dict[float, np.ndarray]) -> None:
    before = pictures[0.0].mean((0, 1))
    for amount in AMOUNTS:
        np.testing.assert_allclose(pictures[amount].mean((0, 1)) / before, 1, atol=0.12)


def test_nothing_blotches(pictures: dict[float, np.ndarray]) -> None:
    """The factor by which a place changed is smooth where the shot was: on the wall, which has no edges."""
    wall = (slice(4, 20), slice(28, 50))
    before, after = (gaussian_filter(pictures[a].mean(2)[wall], 1) for a in (0.0, 1.0))
    factor = after / before
    assert np.abs(factor - gaussian_filter(factor, 3)).mean() < 0.02
