"""A look that edits a variant says nothing where a shot has chosen another one."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom

from usdslf.errors import InputError
from usdslf.usd.review.other_variants import other_variants


def test_an_edit_of_a_variant_that_is_not_chosen_is_said(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/thing").GetPrim()
    colors = prim.GetVariantSets().AddVariantSet("color")
    for name in ("red", "blue"):
        colors.AddVariant(name)
    colors.SetVariantSelection("blue")
    look = Usd.Stage.CreateNew(str(tmp_path / "look.usda"))
    over = look.OverridePrim("/thing")
    edited = over.GetVariantSets().AddVariantSet("color")
    edited.AddVariant("red")
    edited.SetVariantSelection("red")
    with edited.GetVariantEditContext():
        over.CreateAttribute("x", Sdf.ValueTypeNames.Float).Set(1.0)
    edited.ClearVariantSelection()
    look.GetRootLayer().Save()
    said = ["the look edits /thing in the variant color=red, and the shot shows color=blue"]
    assert other_variants(stage, tmp_path / "look.usda") == said
    colors.SetVariantSelection("red")
    assert other_variants(stage, tmp_path / "look.usda") == []
    with pytest.raises(InputError, match="not a readable USD file"):
        other_variants(stage, tmp_path / "none.usda")
