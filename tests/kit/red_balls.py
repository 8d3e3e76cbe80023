"""Red balls, the change that makes one green, and which gprims show another colour then."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from kit.look_stages import (
    F,
    add_material,
    author,
    bind,
    change_of,
    compose,
    shown,
    validate,
)
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits.edits import MaterialChange
from usdslf.usd.binding import gprims_of, parts_of
from usdslf.usd.review.validate import validate as find_wrong

RED, GREEN = (0.6, 0.2, 0.1), (0.1, 0.4, 0.2)


def ball(stage: Usd.Stage, path: str, material: UsdShade.Material | None = None) -> Usd.Prim:
    made = UsdGeom.Sphere.Define(stage, path)
    made.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(-1, -1, -1), Gf.Vec3f(1, 1, 1)]))
    if material:
        bind(made.GetPrim(), material)
    return made.GetPrim()


def red(stage: Usd.Stage, path: str) -> UsdShade.Material:
    return add_material(stage, path, diffuseColor=Gf.Vec3f(*RED))


def changed(before: Usd.Stage, after: Usd.Stage) -> set[str]:
    """The gprims and GeomSubsets that show another material or other values than before."""
    parts = [p for g in gprims_of(before) for p in parts_of(g)]
    return {str(p.GetPath()) for p in parts if shown(before, str(p.GetPath())) != shown(after, str(p.GetPath()))}


def green(stage: Usd.Stage, prim: str, **more: Any) -> MaterialChange:
    return change_of(stage, prim, "diffuse", GREEN, **more)


def assert_changes(stage: Usd.Stage, folder: Path, expected: set[str], change: MaterialChange, **options: Any) -> None:
    """Exactly these gprims change, each edit wins and lists them, and validators have nothing new to say."""
    stage.GetRootLayer().Save()
    edits = author(stage, folder, change, **options)
    assert edits and all(e.wins and not e.hidden_by and not e.mend for e in edits), edits
    review = compose(folder)
    assert changed(stage, review) == expected
    for prim in expected:
        assert shown(review, prim)["d"] == pytest.approx(GREEN, rel=1e-5)
    for edit in edits:
        assert set(edit.affects) == expected
    assert set(validate(review)) <= set(validate(stage))
    assert find_wrong(review, None) == []
    assert validate(Usd.Stage.Open(str(folder / "look.usda"))) == []


def put(layer: Sdf.Layer, prim: str) -> None:
    spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, prim), "inputs:diffuseColor", F.Color3f)
    spec.default = Gf.Vec3f(*GREEN)
