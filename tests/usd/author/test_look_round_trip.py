"""Round trip in another program: looks that were solved from strokes show the painted change in Mitsuba.

A shot with a textured ball and two instances of one asset is path-traced with a change of each ball in turn; a
stroke takes its colours from that picture; the look layer is composed over the shot by USD alone and path-traced
again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom
from reference.mitsuba_setup import why_no_pathtracer

if why_no_pathtracer():
    pytest.skip(why_no_pathtracer(), allow_module_level=True)

from kit.stage_parts import StageBuilder, TextureInput, ball, noise
from reference.pathtracer import Tracer, camera_rays

import usdslf
from usdslf.session import Session
from usdslf.shot import Shot

CAMERA, SIZE, SPP = "/World/camera", (128, 72), 256
F = Sdf.ValueTypeNames
# inferred: gprim, its place on the floor, what is changed (prim, input, type, value)
CHANGES: dict[str, tuple[str, float, str, str, Sdf.ValueTypeName, Any]] = {
    "diffuse": ("/World/left", -1.15, "/World/mtl/noise/diffuseColor_texture", "scale", F.Float4,
                Gf.Vec4f(0.9, 0.35, 0.3, 1)),
    "specular": ("/World/middle/ball", 0.0, "/World/middle/mtl/paint/surface", "ior", F.Float, 2.6),
    "glossiness": ("/World/right/ball", 1.15, "/World/right/mtl/paint/surface", "roughness", F.Float, 0.2),
}  # fmt: skip
# of the mean difference between the shot and what was painted, what is left; roughness is the least sure
LEFT = {"diffuse": 0.05, "specular": 0.1, "glossiness": 0.35}


def write_shot(folder: Path) -> Path:
    """A floor, a textured ball on the left, and two instances of a painted ball; a lamp and a dim sky."""
    (folder / "asset").mkdir()
    asset = StageBuilder(folder / "asset")
    paint = asset.material("paint", diffuseColor=(0.15, 0.25, 0.4), roughness=0.45)
    asset.mesh("ball", ball(0.5, 48), paint)
    asset.save()
    b = StageBuilder(folder)
    b.plane("floor", 6.0, 6.0, b.material("floor", diffuseColor=(0.35, 0.33, 0.3), roughness=0.9))
    file = b.image("noise.png", noise((0.75, 0.7, 0.6), (0.45, 0.5, 0.4)))
    b.mesh("left", ball(0.5, 48), b.material("noise", diffuseColor=TextureInput(file), roughness=0.6), (-1.15, 0, 0))
    for name, x in (("middle", 0.0), ("right", 1.15)):
        instance = UsdGeom.Xform.Define(b.stage, f"/World/{name}")
        instance.GetPrim().GetReferences().AddReference("./asset/stage.usda")
        instance.GetPrim().SetInstanceable(True)
        instance.AddTranslateOp().Set((x, 0, 0))
    b.rect_light("lamp", (-1.0, 3.0, 2.0), (0, 0.5, 0), 1.5, 1.2, (9.0, 8.5, 8.0))
    b.dome_light("sky", 0.25)
    b.camera((0.0, 1.3, 4.0), (0.0, 0.45, 0.0), 34.0, SIZE[0] / SIZE[1])
    return b.save()


def traced(stage: Usd.Stage | Path) -> tuple[NDArray, NDArray]:
    """The picture (h, w, 3), and which prim is seen in the middle of each pixel (h, w)."""
    tracer = Tracer(stage)
    assert not tracer.warnings
    y, x = np.indices(SIZE[::-1])
    xy = np.stack([(x.ravel() + 0.5) / SIZE[0], (y.ravel() + 0.5) / SIZE[1]], 1)
    names = tracer.first_hits(*camera_rays(tracer.stage, CAMERA, xy, SIZE[0] / SIZE[1]))[0]
    return tracer.render(CAMERA, *SIZE, SPP).astype(np.float64), names.reshape(SIZE[::-1])


def with_the_change(shot: Path, name: str) -> Usd.Stage:
    """The shot as it is meant to become; the changed ball is no instance there."""
    _, _, prim, port, kind, value = CHANGES[name]
    layer = Sdf.Layer.CreateAnonymous(".usda")
    spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, prim), f"inputs:{port}", kind, declaresCustom=False)
    spec.default = value
    above = Sdf.Path(prim).GetPrefixes()[1]
    if above.name in ("middle", "right"):
        layer.GetPrimAtPath(above).instanceable = False
    return Usd.Stage.Open(Sdf.Layer.FindOrOpen(str(shot)), layer)


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shot(tmp_path_factory.mktemp("round_trip"))


@pytest.fixture(scope="module")
def opened(shot: Path) -> Shot:
    return usdslf.open(str(shot), elements=1500).shot


@pytest.fixture
def session(opened: Shot) -> Session:
    return Session(opened)


@pytest.fixture(scope="module")
def before(shot: Path) -> tuple[NDArray, NDArray]:
    return traced(shot)


@pytest.mark.parametrize("name", CHANGES)
def test_a_solved_look_shows_the_painted_change(
    name: str, shot: Path, session: Session, before: tuple[NDArray, NDArray], tmp_path: Path
) -> None:
    gprim, x = CHANGES[name][:2]
    truth = traced(with_the_change(shot, name))[0]
    centre = 0.5 + x / 4.0 / (2 * np.tan(np.radians(17)) * SIZE[0] / SIZE[1]) * 0.97
    paths = [[[centre - 0.06, v], [centre + 0.06, v]] for v in (0.32, 0.42, 0.52, 0.62)]
    session.add_stroke(
        usdslf.paint_stroke(session.scene, session.tracer, session.camera(CAMERA), paths, 0.02, image=truth)
    )
    (answer,) = session.solve()
    assert answer.chosen.id.split("+")[0] == name
    root = tmp_path / "review.usda"
    edits = session.author(tmp_path / "look.usda", review_root=root)
    assert edits and all(e.wins and e.affects == (gprim,) for e in edits)
    review = Usd.Stage.Open(str(root))
    assert review.GetPrimAtPath("/World/middle").IsInstance() and review.GetPrimAtPath("/World/right").IsInstance()
    after, names = traced(review)
    picture, seen = before
    assert np.array_equal(names, seen)
    on = seen == gprim
    missed, change = (np.abs(p - truth)[on].mean() for p in (after, picture))
    assert missed < LEFT[name] * change
    # The other balls keep their look: what changes there is light that the painted one throws.
    others = np.isin(seen, [g for g, *_ in CHANGES.values() if g != gprim])
    missed_others = np.abs(after - truth)[others].mean() / truth[others].mean()
    assert missed_others < 0.02
