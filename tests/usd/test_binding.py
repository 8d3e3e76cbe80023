"""One answer to which material shows on a prim, for the reader and for the author."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from pxr import Usd, UsdGeom, UsdShade

import usdslf
from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.usd.binding import bound_material, bound_relationship, named_material
from usdslf.usd.notes import Notes
from usdslf.usd.read.materials import MaterialTable

PREVIEW, FULL, ALL = UsdShade.Tokens.preview, UsdShade.Tokens.full, UsdShade.Tokens.allPurpose


def _card(surfaces: dict[str, bool]) -> Usd.Stage:
    """A gprim /card bound for purposes to materials with or without a UsdPreviewSurface."""
    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Sphere.Define(stage, "/card").GetPrim()
    for purpose, has_surface in surfaces.items():
        material = UsdShade.Material.Define(stage, "/for_" + {PREVIEW: "preview", FULL: "full", ALL: "all"}[purpose])
        if has_surface:
            shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("s"))
            shader.CreateIdAttr("UsdPreviewSurface")
            material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, UsdShade.Tokens.weakerThanDescendants, purpose)
    return stage


@pytest.mark.parametrize("has", [*itertools.product((None, False, True), repeat=3)])
def test_reader_and_author_see_the_same_material(has: tuple[bool | None, ...]) -> None:
    surfaces = {p: h for p, h in zip((PREVIEW, FULL, ALL), has) if h is not None}
    stage = _card(surfaces)
    prim = stage.GetPrimAtPath("/card")
    path, relationship = bound_relationship(prim)
    table = MaterialTable(Usd.TimeCode.Default(), color_of(None, USD_DEFAULT_SPACE), Notes())
    index = table(prim)
    assert table.materials[index].path == str(path)
    assert named_material(prim) == path
    assert not surfaces or bound_material(prim).GetPath() == path
    # USD falls back to all-purpose; preview goes first unless it alone has nothing that a preview can show.
    for_preview, for_full = (next((p for p in (q, ALL) if p in surfaces), None) for q in (PREVIEW, FULL))
    shown = for_full if for_preview is None or (not surfaces[for_preview] and surfaces.get(for_full)) else for_preview
    names = {PREVIEW: "preview", FULL: "full", ALL: "all", None: ""}
    assert str(path) == (f"/for_{names[shown]}" if shown is not None else "")
    assert relationship == ("material:binding" if shown in (None, ALL) else f"material:binding:{names[shown]}")


def test_what_is_bound_is_asked_of_usd_in_one_module() -> None:
    asking = [
        file.relative_to(Path(usdslf.__file__).parent).as_posix()
        for file in Path(usdslf.__file__).parent.rglob("*.py")
        if "ComputeBoundMaterial" in file.read_text() or "GetDirectBinding" in file.read_text()
    ]
    assert asking == ["usd/binding.py"]
