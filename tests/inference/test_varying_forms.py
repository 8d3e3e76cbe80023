"""What varies and how: factors of textures, what is painted over them, roughness, specular; where it is stored."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.stage_parts import InputValue, StageBuilder, TextureInput, checker, write_image
from kit.varying_floor import (
    F0,
    GREY,
    LEFT,
    RIGHT,
    ROUGHNESS,
    add_lamp,
    gradient,
    places,
    seen,
    stroke,
    surface_at,
    write_floor,
)
from pxr import Sdf, Usd, UsdGeom, UsdShade

import usdslf
from usdslf.errors import StrokeError
from usdslf.inference.weights import Options
from usdslf.session import Session
from usdslf.strokes.stroke import Stroke
from usdslf.usd.layer.baked_files import textures_folder

P = places()
ALONG = ((P[:, 0] + 0.7) / 1.4)[:, None]  # 0..1 over the stroke
PLAIN: dict[str, InputValue] = {"diffuseColor": (0.1, 0.1, 0.1), "roughness": 0.35}  # a dielectric, metal workflow


def solved(path: Path, *strokes: Stroke, **options: Any) -> tuple[Session, dict]:
    session = usdslf.open(str(path), elements=400)
    session.strokes = list(strokes)
    session.solve(**options)
    return session, session.report()["strokes"][0]


def written(session: Session, look: Path) -> Session:
    """The shot with its look; what was written is as good as what was found."""
    edits = session.author(look)
    assert edits and all(e.wins for e in edits)
    found = session.report()["strokes"][0]
    assert found["residual_as_written"] < max(1.5 * found["residual_after"], 0.03), found
    return session.edited(look)


def checkered(folder: Path) -> Path:
    """A floor of dark and light squares, wider than a dab; texels of 3 mm."""
    write_image(folder / "squares.png", checker((0.75,) * 3, (0.35,) * 3, squares=5, size=640))
    return write_floor(
        folder, useSpecularWorkflow=1.0, diffuseColor=TextureInput("squares.png"), specularColor=(F0,) * 3,
        roughness=ROUGHNESS,
    )  # fmt: skip


def texels(session: Session) -> np.ndarray:
    return surface_at(session.scene, P).diffuse.astype(float)


def test_a_gradient_over_a_texture_multiplies_it(tmp_path: Path) -> None:
    path = checkered(tmp_path)
    own = texels(usdslf.open(str(path), elements=400))
    assert np.ptp(own) > 0.3
    wanted = own * gradient(P) * 1.5
    session, found = solved(path, stroke(seen(P, wanted)))
    assert found["varies"] and found["inferred"] == "diffuse"
    assert found["residual_after"] < 0.06 < found["residual_before"]
    shown = texels(written(session, tmp_path / "look.usda"))
    np.testing.assert_allclose(shown, wanted, atol=0.04)
    # between the dabs too: the texture times a smooth factor
    x = np.stack([np.linspace(-0.6, 0.6, 60), np.zeros(60), np.full(60, 0.1)], 1)
    other = session.edited(tmp_path / "look.usda")
    before, after = surface_at(session.scene, x).diffuse, surface_at(other.scene, x).diffuse
    np.testing.assert_allclose(after / before, gradient(x) * 1.5, rtol=0.2, atol=0.05)


def test_a_picture_painted_over_a_texture_replaces_it(tmp_path: Path) -> None:
    session, found = solved(checkered(tmp_path), stroke(seen(P, gradient(P))))
    assert found["varies"] and session.answers[0].varying.form == "value" and found["residual_after"] < 0.04
    np.testing.assert_allclose(texels(written(session, tmp_path / "look.usda")), gradient(P), atol=0.04)


def test_roughness_varies(tmp_path: Path) -> None:
    path = write_floor(
        tmp_path, useSpecularWorkflow=1.0, diffuseColor=(0.1,) * 3, specularColor=(0.3,) * 3, roughness=0.4
    )
    wanted = 0.2 + 0.4 * ALONG
    session, found = solved(path, stroke(seen(P, (0.1,) * 3, (0.3,) * 3, wanted[:, 0])))
    assert found["varies"] and found["inferred"] == "glossiness" and found["residual_after"] < 0.03
    other = written(session, tmp_path / "look.usda")
    np.testing.assert_allclose(surface_at(other.scene, P).roughness, wanted[:, 0], atol=0.04)
    (file,) = [e for e in session.edits if e.attribute == "inputs:file"]
    shader = UsdShade.Shader(other.source.GetPrimAtPath("/World/mtl/floor/surface"))
    assert [i.GetBaseName() for i in shader.GetInputs() if i.HasConnectedSource()] == ["roughness"]
    texture = UsdShade.Shader(other.source.GetPrimAtPath(file.prim))
    assert texture.GetInput("sourceColorSpace").Get() == "raw" and texture.GetOutput("r")


def test_a_grey_specular_of_a_dielectric_varies_by_its_ior(tmp_path: Path) -> None:
    f0 = (0.02 + 0.2 * ALONG) * np.ones(3)
    options = Options.of({"variation": 5.0})
    session, found = solved(write_floor(tmp_path, **PLAIN), stroke(seen(P, (0.1,) * 3, f0, 0.35)), options=options)
    assert found["varies"] and found["inferred"] == "specular" and session.answers[0].varying.is_grey
    surface = surface_at(written(session, tmp_path / "look.usda").scene, P)
    np.testing.assert_allclose(surface.f0, f0, atol=0.02)
    np.testing.assert_allclose(surface.diffuse, 0.1, atol=1e-6)
    assert not [e for e in session.edits if "orkflow" in e.attribute]


def test_a_coloured_specular_of_a_dielectric_takes_it_to_the_specular_workflow(tmp_path: Path) -> None:
    f0 = 0.04 + ALONG * np.array([0.5, 0.3, 0.05])
    options = Options.of({"variation": 5.0})
    session, found = solved(write_floor(tmp_path, **PLAIN), stroke(seen(P, (0.1,) * 3, f0, 0.35)), options=options)
    assert found["varies"] and found["inferred"] == "specular"
    surface = surface_at(written(session, tmp_path / "look.usda").scene, P)
    np.testing.assert_allclose(surface.f0, f0, atol=0.03)
    np.testing.assert_allclose(surface.diffuse, 0.1, atol=1e-6)
    np.testing.assert_allclose(surface.f90, 1, atol=1e-6)
    flags = [e.after for e in session.edits if e.attribute == "inputs:useSpecularWorkflow"]
    assert flags == [1]


def test_a_metal_varies_by_its_colour(tmp_path: Path) -> None:
    f0 = 0.2 + ALONG * np.array([0.7, 0.5, 0.1])
    path = write_floor(tmp_path, diffuseColor=(0.5, 0.5, 0.5), metallic=1.0, roughness=0.35)
    session, found = solved(path, stroke(seen(P, (0.0,) * 3, f0, 0.35, f0)))
    assert found["varies"] and found["inferred"] == "specular"
    surface = surface_at(written(session, tmp_path / "look.usda").scene, P)
    np.testing.assert_allclose(surface.f0, f0, atol=0.04)
    np.testing.assert_allclose(surface.f90, surface.f0, atol=1e-6)


def test_scope_stroke_fades_where_nothing_was_painted(tmp_path: Path) -> None:
    """The floor is one face, so that the stroke's material is that of all of it."""
    painted = replace(stroke(seen(P, gradient(P))), scope="stroke")
    session, found = solved(write_floor(tmp_path), painted)
    assert found["varies"]
    other = written(session, tmp_path / "look.usda")
    np.testing.assert_allclose(surface_at(other.scene, P).diffuse, gradient(P), atol=0.05)
    corners = np.array([[x, 0, z] for x in (-0.97, 0.97) for z in (-0.97, 0.97)])
    np.testing.assert_allclose(surface_at(other.scene, corners).diffuse, 0.4, atol=0.002)


def test_a_band_in_other_colours_varies(tmp_path: Path) -> None:
    """It has nearly as many freedoms as dabs, but no constant comes near it."""
    band = np.exp(-((P[:, :1] / 0.35) ** 2))
    wanted = LEFT * band + RIGHT * (1 - band)
    session, found = solved(write_floor(tmp_path), stroke(seen(P, wanted)))
    assert found["varies"] and found["residual_after"] < 0.25 < 1 < found["residual_before"]
    np.testing.assert_allclose(texels(written(session, tmp_path / "look.usda")), wanted, atol=0.1)


def test_an_answer_that_varies_can_be_chosen_or_refused(tmp_path: Path) -> None:
    painted = stroke(seen(P, gradient(P)))
    session, found = solved(write_floor(tmp_path), painted)
    ids = [a["id"] for a in found["alternatives"]]
    assert found["varies"] and "varying diffuse" in ids and "diffuse" in ids
    session.solve(choose={"stroke_0001": "diffuse"})
    assert not session.report()["strokes"][0]["varies"]
    session.strokes = [stroke(seen(P, (0.5, 0.3, 0.2)) * (1 + 0.2 * ALONG))]
    session.solve()
    assert not session.report()["strokes"][0]["varies"]
    session.solve(choose={"stroke_0001": "varying diffuse"})
    assert session.report()["strokes"][0]["varies"]
    np.testing.assert_allclose(
        texels(written(session, tmp_path / "look.usda")), np.array([0.5, 0.3, 0.2]) * (1 + 0.2 * ALONG), atol=0.03
    )
    with pytest.raises(StrokeError, match=r"choose one of .*varying diffuse"):
        session.solve(choose={"stroke_0001": "varying colour"})


def test_what_cannot_be_stored_is_constant_and_said(tmp_path: Path) -> None:
    """Two points on a side are the corners of the floor: they cannot hold a picture."""
    band = np.exp(-((P[:, :1] / 0.35) ** 2))
    painted = stroke(seen(P, LEFT * band + RIGHT * (1 - band)))
    options = Options.of({"variation": 0.0, "freedom": 0.0})
    session, found = solved(write_floor(tmp_path, points_on_a_side=2), painted, options=options)
    assert not found["varies"]
    (said,) = [w for w in session.warnings if "cannot be stored" in w]
    assert "its points are too far apart" in said and "/World/mtl/floor" in said
    edits = session.author(tmp_path / "look.usda")
    assert {e.representation for e in edits} == {"constant"}
    # what is reported is that of the constant
    (mean,) = [e.after for e in edits if e.attribute == "inputs:diffuseColor"]
    np.testing.assert_allclose(mean, found["after"]["diffuse"], atol=1e-5)


def test_points_of_instances_each_get_their_own(tmp_path: Path) -> None:
    """Two instances of a floor without coordinates; one is painted on."""
    b = StageBuilder(tmp_path)
    look = b.material("floor", **GREY)
    asset = UsdGeom.Xform.Define(b.stage, "/Asset")
    mesh = UsdGeom.Mesh.Define(b.stage, "/Asset/plane")
    n = 33
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    mesh.CreatePointsAttr(np.stack([u, 0 * u, v], 1).astype(np.float32))
    mesh.CreateFaceVertexIndicesAttr(np.stack([i, i + n, i + n + 1, i + 1], 1).ravel().astype(np.int32))
    mesh.CreateFaceVertexCountsAttr([4] * len(i))
    mesh.CreateSubdivisionSchemeAttr("none")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(UsdShade.Material(b.stage.GetPrimAtPath(look)))
    asset.GetPrim().SetSpecifier(Sdf.SpecifierClass)
    for name, at in (("near", 0.0), ("far", 3.0)):
        copy = UsdGeom.Xform.Define(b.stage, f"/World/{name}")
        copy.GetPrim().GetInherits().AddInherit("/Asset")
        copy.GetPrim().SetInstanceable(True)
        copy.AddTranslateOp().Set((at, 0, 0))
    add_lamp(b)
    painted = replace(stroke(seen(P, gradient(P))), scope="prim")
    session, found = solved(b.save(), painted)
    assert found["varies"], session.warnings
    other = written(session, tmp_path / "look.usda")
    np.testing.assert_allclose(surface_at(other.scene, P).diffuse, gradient(P), atol=0.05)
    np.testing.assert_allclose(surface_at(other.scene, P + np.array([3, 0, 0])).diffuse, 0.4, atol=1e-5)


def test_textures_that_the_look_no_longer_names_go(tmp_path: Path) -> None:
    look, shot = tmp_path / "look.usda", write_floor(tmp_path)
    session, _ = solved(shot, stroke(seen(P, gradient(P))))
    session.author(look)
    (first,) = textures_folder(look).iterdir()
    (textures_folder(look) / "note.txt").write_text("a person's")
    again, _ = solved(shot, stroke(seen(P, gradient(P)[::-1])))
    again.author(look)
    (second,) = textures_folder(look).glob("*.exr")
    assert second != first and (textures_folder(look) / "note.txt").exists()
    # a copy of the look keeps what it names
    Sdf.Layer.FindOrOpen(str(look)).Export(str(tmp_path / "copy.usda"))
    session.author(look)
    assert second.exists() and first.exists()
    (tmp_path / "copy.usda").unlink()
    session.remove_stroke("stroke_0001")
    session.author(look)
    assert second.exists() and not first.exists()  # what only the copy named is nobody's to delete now
    assert not Usd.Stage.Open(str(look)).GetPrimAtPath("/World/mtl/floor/slf_diffuseColor")


@pytest.mark.parametrize("seed", [0, 1])
def test_an_uneven_hand_over_a_texture_asks_for_a_constant(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = checkered(tmp_path)
    own = texels(usdslf.open(str(path), elements=400))
    drift = 1 + 0.1 * np.sin(P[:, :1] * rng.uniform(2, 4) + P[:, 2:] * rng.uniform(-3, 3) + rng.uniform(0, 6))
    colors = seen(P, own * [0.9, 0.5, 0.3]) * drift * (1 + 0.05 * rng.normal(size=3))
    _, found = solved(path, stroke(colors))
    assert found["inferred"] == "diffuse" and not found["varies"]


def test_a_tinted_metal_texture_is_scaled(tmp_path: Path) -> None:
    """A constant factor on a specular colour that a texture drives: one scale, not a texture of its own."""
    write_image(tmp_path / "squares.png", checker((0.85,) * 3, (0.35,) * 3, squares=5, size=640))
    path = write_floor(tmp_path, diffuseColor=TextureInput("squares.png"), metallic=1.0, roughness=0.35)
    own = surface_at(usdslf.open(str(path), elements=400).scene, P).f0.astype(float)
    wanted = own * np.array([0.9, 0.6, 0.3])
    session, found = solved(path, stroke(seen(P, (0.0,) * 3, wanted, 0.35, wanted)))
    assert found["inferred"] == "specular" and not found["varies"] and found["residual_after"] < 0.08
    edits = session.author(tmp_path / "look.usda")
    assert [(e.representation, e.attribute) for e in edits] == [("scale", "inputs:scale")]
    np.testing.assert_allclose(surface_at(session.edited(tmp_path / "look.usda").scene, P).f0, wanted, atol=0.01)


@pytest.mark.parametrize(("term", "stored"), [((0.22, 0.17, 0.19), "texture"), ((-0.05, -0.1, -0.12), "scale")])
def test_a_term_on_a_texture_is_a_bias_or_a_texture_of_its_own(tmp_path: Path, term: tuple, stored: str) -> None:
    """Light squares end at white, which no scale and bias can say; what is taken away leaves all above black."""
    write_image(tmp_path / "squares.png", checker((0.45,) * 3, (0.95,) * 3, squares=5, size=640))
    path = write_floor(
        tmp_path, useSpecularWorkflow=1.0, diffuseColor=TextureInput("squares.png"), specularColor=(F0,) * 3,
        roughness=ROUGHNESS,
    )  # fmt: skip
    wanted = lambda d: np.clip(d + np.array(term), 0, 1)  # noqa: E731
    own = texels(usdslf.open(str(path), elements=400))
    session, found = solved(path, stroke(seen(P, wanted(own))))
    assert found["inferred"] == "diffuse" and not found["varies"]
    edits = session.author(tmp_path / "look.usda")
    assert {e.representation for e in edits} == {stored} and all(e.wins for e in edits)
    said = [w for w in session.warnings if "gets a texture of its own" in w]
    assert bool(said) == (stored == "texture")
    other = session.edited(tmp_path / "look.usda")
    np.testing.assert_allclose(texels(other), wanted(own), atol=0.07)  # dabs on two squares are cut off in part
    x = np.stack([np.linspace(-0.95, 0.95, 200), np.zeros(200), np.full(200, 0.83)], 1)  # also where nobody painted
    before, after = surface_at(session.scene, x).diffuse, surface_at(other.scene, x).diffuse
    assert np.abs(after - wanted(before)).mean() < 0.03 and after.max() <= 1


def test_beside_a_texture_of_metal_only_what_is_no_metal_changes(tmp_path: Path) -> None:
    """The strip that nobody painted is metal; metallic is driven, as in packed maps."""
    metal = np.zeros((64, 64, 3), np.float32)
    metal[:8] = 1  # the far eighth of the floor
    write_image(tmp_path / "metal.exr", metal)
    path = write_floor(
        tmp_path, diffuseColor=(0.4, 0.4, 0.4), metallic=TextureInput("metal.exr"), roughness=ROUGHNESS
    )  # fmt: skip
    session, found = solved(path, stroke(seen(P, gradient(P))))
    strip = np.array([(x, 0.0, -0.94) for x in (-0.5, 0.0, 0.5)])
    assert surface_at(session.scene, strip).metallic.min() > 0.99 and surface_at(session.scene, P).metallic.max() < 0.01
    assert found["varies"] and found["inferred"] == "diffuse", session.warnings
    other = written(session, tmp_path / "look.usda")
    np.testing.assert_allclose(texels(other), gradient(P), atol=0.06)
    np.testing.assert_allclose(surface_at(other.scene, strip).f0, 0.4, atol=0.005)
    np.testing.assert_allclose(surface_at(other.scene, strip).diffuse, 0, atol=0.005)


def test_a_tiled_set_holds_what_varies(tmp_path: Path) -> None:
    """The floor as two faces, one in each of two UDIM tiles."""
    for tile, shade in (("1001", 0.6), ("1002", 0.75)):
        write_image(tmp_path / f"floor.{tile}.png", np.full((64, 64, 3), shade, np.float32))
    b = StageBuilder(tmp_path)
    look = b.material("floor", **{**GREY, "diffuseColor": TextureInput("floor.<UDIM>.png")})
    mesh = UsdGeom.Mesh.Define(b.stage, "/World/floor")
    mesh.CreatePointsAttr([(x, 0, z) for z in (1, -1) for x in (-1, 0, 1)])
    mesh.CreateFaceVertexCountsAttr([4, 4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 4, 3, 1, 2, 5, 4])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    st.Set([(0, 0), (1, 0), (1, 1), (0, 1), (1, 0), (2, 0), (2, 1), (1, 1)])
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(UsdShade.Material(b.stage.GetPrimAtPath(look)))
    add_lamp(b)
    session, found = solved(b.save(), stroke(seen(P, gradient(P))))
    assert found["varies"], session.warnings
    np.testing.assert_allclose(texels(written(session, tmp_path / "look.usda")), gradient(P), atol=0.06)
    files = sorted(f.name.split(".")[-2] for f in textures_folder(tmp_path / "look.usda").iterdir())
    assert files == ["1001", "1002"]


def test_a_stroke_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    session = usdslf.open(str(write_floor(tmp_path)), elements=400)
    with pytest.raises(StrokeError, match="not finite"):
        session.add_stroke(stroke(np.full((len(P), 3), np.nan)))


def test_a_glass_reflects_no_more_than_its_opacity(tmp_path: Path) -> None:
    """Paint that would need more is not said to be met."""
    path = write_floor(tmp_path, **{**GREY, "opacity": 0.5})
    session, found = solved(path, stroke(seen(P, (0.7, 0.2, 0.15))))
    assert found["inferred"].startswith("diffuse") and found["after"]["diffuse"][0] <= 0.5 + 1e-6
    session.author(tmp_path / "look.usda")
    shown = surface_at(session.edited(tmp_path / "look.usda").scene, P).diffuse
    np.testing.assert_allclose(shown, np.tile(found["after"]["diffuse"], (len(P), 1)), atol=0.005)
