"""What holds an answer that varies where others use the same node, mesh, coordinates or folder."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, TextureInput, rectangle, write_image
from kit.varying_floor import (
    GREY,
    LEFT,
    RIGHT,
    add_lamp,
    gradient,
    grid,
    places,
    seen,
    stroke,
    surface_at,
    write_floor,
)
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

import usdslf
from usdslf.color import color_of
from usdslf.edits import baked_texture as bake
from usdslf.edits.storage import Storage
from usdslf.errors import AuthorError
from usdslf.inference import direct, refits
from usdslf.inference.answers import changed_surface
from usdslf.inference.changes import with_varying
from usdslf.session import Session
from usdslf.strokes.stroke import Stroke
from usdslf.usd.layer.baked_files import textures_folder

P = places()
RECTANGLE = rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2))


@pytest.fixture(autouse=True)
def small_textures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bake, "PLAIN_SIZE", 256)


def solved(path: Path, *strokes: Stroke, model: str = "preview_surface") -> Session:
    session = usdslf.open(str(path), elements=300, model=model)
    session.strokes = list(strokes)
    session.solve()
    return session


def painted(colors: np.ndarray, at: np.ndarray = P, name: str = "stroke_0001", **more: object) -> Stroke:
    """A stroke with other places or of other dabs than those of the floor."""
    twice = lambda x: np.repeat(np.float32(x), 2, 0)  # noqa: E731
    s, n = stroke(np.zeros((len(P), 3))), 2 * len(at)
    return replace(
        s, name=name, points=twice(at), widths=s.widths[:n], colors=twice(colors), eye=s.eye[:n],
        curve_counts=(2,) * len(at), **more,
    )  # fmt: skip


def bind(prim: Usd.Prim, look: str) -> None:
    material = UsdShade.Material(prim.GetStage().GetPrimAtPath(look))
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


@pytest.mark.parametrize("kind", ["hidden", "curves"])
def test_points_of_gprims_that_are_not_seen_are_left_alone(tmp_path: Path, kind: str) -> None:
    b = StageBuilder(tmp_path)
    look = b.material("floor", **GREY)
    grid(b.stage, 33, look)
    add_lamp(b)
    if kind == "hidden":
        other = UsdGeom.Mesh.Define(b.stage, "/World/other")
        other.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 0, 1)])
        other.CreateFaceVertexCountsAttr([3])
        other.CreateFaceVertexIndicesAttr([0, 1, 2])
        other.CreateVisibilityAttr("invisible")
    else:
        other = UsdGeom.BasisCurves.Define(b.stage, "/World/other")
        other.CreatePointsAttr([(0, 0, 0), (1, 0, 0)])
        other.CreateCurveVertexCountsAttr([2])
    bind(other.GetPrim(), look)
    session = solved(b.save(), stroke(seen(P, gradient(P))))
    (edit,) = session.author(tmp_path / "look.usda")
    assert (edit.prim, edit.attribute) == ("/World/floor", "primvars:slf:diffuseColor")
    np.testing.assert_allclose(
        surface_at(session.edited(tmp_path / "look.usda").scene, P).diffuse, gradient(P), atol=0.05
    )


def test_two_materials_on_one_mesh_have_values_of_their_own_at_its_points(tmp_path: Path) -> None:
    b, n = StageBuilder(tmp_path), 33
    looks = [b.material(name, **GREY) for name in ("left", "right")]
    grid(b.stage, n, looks[0])
    add_lamp(b)
    faces = np.arange((n - 1) ** 2, dtype=np.int32)
    mesh = UsdGeom.Imageable(b.stage.GetPrimAtPath("/World/floor"))
    for look, keep in zip(looks, (faces % (n - 1) < 16, faces % (n - 1) >= 16)):
        part = UsdGeom.Subset.CreateGeomSubset(
            mesh, look[-4:], "face", Vt.IntArray.FromNumpy(faces[keep]), "materialBind", "partition"
        )
        bind(part.GetPrim(), look)
    t = ((P[:, 2:] + 0.4) / 1.0).clip(0, 1)
    halves = [P * (1 / 1.7, 1, 1) + (x, 0, 0) for x in (-0.53, 0.53)]
    colors = [LEFT * (1 - t) + RIGHT * t, np.array([0.1, 0.6, 0.1]) * (1 - t) + np.array([0.6, 0.6, 0.1]) * t]
    strokes = [
        painted(seen(at, c), at, f"stroke_000{i}") for i, (at, c) in enumerate(zip(halves, colors), start=1)
    ]
    session = solved(b.save(), *strokes)
    assert all(e.wins for e in session.author(tmp_path / "look.usda"))
    other = session.edited(tmp_path / "look.usda")
    for at, c in zip(halves, colors):
        np.testing.assert_allclose(surface_at(other.scene, at).diffuse, c, atol=0.05)


def test_dabs_of_another_scope_on_the_same_material_are_known_places_too(tmp_path: Path) -> None:
    """A stroke of scope similar and one of scope material ask together; a panel is like the floor in part."""
    image = np.full((64, 128, 3), 0.6652)  # .4 in sRGB
    image[:, 64:] = (0.05, 0.1, 0.6)
    write_image(tmp_path / "halves.exr", image)
    b = StageBuilder(tmp_path)
    b.mesh("floor", RECTANGLE, b.material("floor", **GREY))
    panel = b.material("panel", **{**GREY, "diffuseColor": TextureInput("halves.exr")})
    b.mesh("panel", rectangle((-1, 0, 3.2), (2, 0, 0), (0, 0, -2)), panel)
    add_lamp(b)
    colors, even = seen(P, gradient(P)), np.arange(len(P)) % 2 == 0
    session = solved(
        b.save(),
        painted(colors[even], P[even], scope="similar"),
        painted(colors[~even], P[~even], "stroke_0002"),
    )
    (answer,) = session.answers
    assert answer.varying and [session.scene.materials[m].path for m in answer.pool.similar_in_part] == [panel]
    session.author(tmp_path / "look.usda")
    other = session.edited(tmp_path / "look.usda")
    np.testing.assert_allclose(surface_at(other.scene, P).diffuse, gradient(P), atol=0.05)
    blue = np.array([[x, 0.0, 2.2] for x in (0.3, 0.6)])
    np.testing.assert_array_equal(surface_at(other.scene, blue).diffuse, surface_at(session.scene, blue).diffuse)


@pytest.mark.parametrize(("scale", "varies"), [(2.0, False), (-1.0, True)])
def test_a_texture_that_its_transform_repeats_cannot_hold_it(tmp_path: Path, scale: float, varies: bool) -> None:
    write_image(tmp_path / "grey.png", np.full((64, 64, 3), 0.7))
    path = write_floor(tmp_path, **{**GREY, "diffuseColor": TextureInput("grey.png")})
    stage = Usd.Stage.Open(str(path))
    texture = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/floor/diffuseColor_texture"))
    turn = UsdShade.Shader.Define(stage, "/World/mtl/floor/turn")
    turn.CreateIdAttr("UsdTransform2d")
    turn.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(scale, scale))
    turn.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(
        UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/floor/st")).GetOutput("result")
    )
    texture.GetInput("st").ConnectToSource(turn.CreateOutput("result", Sdf.ValueTypeNames.Float2))
    stage.Save()
    session = solved(path, stroke(seen(P, gradient(P))))
    assert (session.answers[0].varying is not None) == varies
    assert any("st lie upon each other or outside" in w for w in session.warnings) != varies


@pytest.mark.parametrize("shared", ["wrap", "file", "channel"])
def test_what_an_interface_gives_to_several_textures_stays_for_the_others(tmp_path: Path, shared: str) -> None:
    """Roughness by g and metallic by b of one file, which the material names once."""
    packed = np.zeros((64, 64, 3))
    packed[..., 0], packed[..., 1] = 1, 0.35
    write_image(tmp_path / "packed.png", packed)
    b = StageBuilder(tmp_path)
    look = b.material("floor", useSpecularWorkflow=1.0, diffuseColor=(0.1,) * 3, specularColor=(0.3,) * 3)
    b.mesh("floor", RECTANGLE, look)
    add_lamp(b)
    material = UsdShade.Material(b.stage.GetPrimAtPath(look))
    surface = UsdShade.Shader(b.stage.GetPrimAtPath(f"{look}/surface"))
    names, kind = Sdf.ValueTypeNames, {"file": Sdf.ValueTypeNames.Asset}
    reader = UsdShade.Shader.Define(b.stage, f"{look}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", names.String).Set("st")
    inputs = {"file": "./packed.png", "wrapS": "repeat", "wrapT": "repeat", "sourceColorSpace": "raw"}
    textures = []
    for name in ("one", "two"):
        texture = UsdShade.Shader.Define(b.stage, f"{look}/{name}")
        texture.CreateIdAttr("UsdUVTexture")
        for key, value in inputs.items():
            texture.CreateInput(key, kind.get(key, names.Token)).Set(value)
        texture.CreateInput("st", names.Float2).ConnectToSource(reader.CreateOutput("result", names.Float2))
        textures.append(texture)
    one, two = textures
    surface.CreateInput("roughness", names.Float)
    surface.GetInput("roughness").ConnectToSource(one.CreateOutput("g", names.Float))
    of, channel, reads = (one, "g", "clearcoatRoughness") if shared == "channel" else (two, "b", "metallic")
    surface.CreateInput(reads, names.Float).ConnectToSource(of.CreateOutput(channel, names.Float))
    for key in ("wrapS", "wrapT") if shared == "wrap" else ("file",):
        port = material.CreateInput(key, kind.get(key, names.Token))
        port.Set(inputs[key])
        for texture in textures:
            texture.GetInput(key).ConnectToSource(port)
    wanted = 0.2 + 0.4 * (P[:, 0] + 0.7) / 1.4
    session = solved(b.save(), stroke(seen(P, (0.1,) * 3, (0.3,) * 3, wanted)))
    assert session.report()["strokes"][0]["varies"]
    assert all(e.wins for e in session.author(tmp_path / "look.usda"))
    other = session.edited(tmp_path / "look.usda")
    np.testing.assert_allclose(surface_at(other.scene, P).roughness, wanted, atol=0.04)
    surface, files = UsdShade.Shader(other.source.GetPrimAtPath(f"{look}/surface")), []
    for name in ("roughness", reads):
        node = surface.GetInput(name).GetValueProducingAttributes()[0].GetPrim()
        files.append(UsdShade.Shader(node).GetInput("file").GetValueProducingAttributes()[0].Get().path)
    assert files[0].endswith(".exr") and files[1] == "./packed.png"


def test_a_textures_folder_that_is_a_link_is_never_left_without_its_end(tmp_path: Path) -> None:
    look = tmp_path / "look.usda"
    (tmp_path / "store").mkdir()
    os.symlink(tmp_path / "store", textures_folder(look))
    session = solved(write_floor(tmp_path), stroke(seen(P, gradient(P))))
    session.author(look)
    changes, session.answers = session.answers, []
    assert session.author(look) == [] and not any((tmp_path / "store").iterdir())
    session.answers = changes
    session.author(look)
    assert len(list((tmp_path / "store").iterdir())) == 1


def test_a_folder_that_is_called_like_a_layer_is_none(tmp_path: Path) -> None:
    (tmp_path / "shots.usd").mkdir()
    session = solved(write_floor(tmp_path), stroke(seen(P, gradient(P))))
    session.author(tmp_path / "look.usda")
    session.answers = []
    session.author(tmp_path / "look.usda")
    assert not (tmp_path / "look.textures").exists()


def test_another_solve_drops_what_was_said_of_the_look_before(tmp_path: Path) -> None:
    session = solved(write_floor(tmp_path), stroke(seen(P, gradient(P))))
    session.author(tmp_path / "look.usda")
    assert "residual_as_written" in session.report()["strokes"][0]
    session.solve(choose={"stroke_0001": "diffuse"})
    report = session.report()
    assert "residual_as_written" not in report["strokes"][0] and report["edits"] == []


def test_phong_says_the_residual_of_what_varies(tmp_path: Path) -> None:
    """Of a dull floor: both models show nearly the same there."""
    session = solved(write_floor(tmp_path), stroke(seen(P, gradient(P))), model="phong")
    found = session.report()["strokes"][0]
    assert found["varies"] and found["residual_as_preview_surface"] < 0.1, found


def test_what_can_no_longer_be_stored_is_written_as_its_mean(tmp_path: Path) -> None:
    """The light that goes round may have moved a change after its storage was looked for."""
    session = solved(write_floor(tmp_path, points_on_a_side=33), stroke(seen(P, gradient(P))))
    (answer,) = session.answers
    said: list[str] = []
    rough = replace(answer.varying, q=np.where(np.arange(len(P))[:, None] % 2, answer.varying.q, -answer.varying.q))
    (tmp_path / "coarse").mkdir()
    coarse = usdslf.open(str(write_floor(tmp_path / "coarse", points_on_a_side=2)), elements=300).scene
    color, answers = color_of(None, coarse.working_space), [replace(answer, varying=rough)]
    changes = with_varying(session.changes(), answers, coarse, tmp_path, color, said)
    assert not changes[0].by_vertex and not changes[0].baked
    (sentence,) = said
    assert "too far apart" in sentence and sentence.endswith("its change is written as its mean")


def test_an_answer_that_the_light_moves_out_of_storage_stays_as_it_could_be_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, gone = refits.storage_of, []
    monkeypatch.setattr(direct, "changed_surface", lambda *a: gone.append(True) or changed_surface(*a))
    monkeypatch.setattr(refits, "storage_of", lambda *a: Storage(0, why_not="it is gone") if gone else real(*a))
    session = solved(write_floor(tmp_path), stroke(seen(P, gradient(P))))
    edits = session.author(tmp_path / "look.usda")
    found = session.report()["strokes"][0]
    said = [w for w in session.warnings if "could not be stored" in w]
    # the first round's answer, which could be stored, is better than a constant: it stays, and nothing else is said
    assert found["varies"] and found["residual_after"] < 0.05 and not said
    assert {e.representation for e in edits} == {"texture"} and found["residual_as_written"] < 0.05


def test_the_written_look_is_measured_beside_the_other_new_materials(tmp_path: Path) -> None:
    """A floor beside a red wall, both without UsdPreviewSurface: only the floor's new material is in the look."""
    b = StageBuilder(tmp_path)
    floor, wall = b.material("floor"), b.material("wall")
    b.mesh("floor", RECTANGLE, floor)
    b.mesh("wall", rectangle((1, 0, 1), (0, 0, -2), (0, 1.6, 0)), wall)
    add_lamp(b)
    names = Sdf.ValueTypeNames
    for look, color in ((floor, (0.4,) * 3), (wall, (0.9, 0.1, 0.1))):
        surface = UsdShade.Shader(b.stage.GetPrimAtPath(f"{look}/surface"))
        surface.CreateIdAttr("PxrDisney")
        surface.CreateInput("baseColor", names.Color3f).Set(color)
        surface.CreateInput("roughness", names.Float).Set(0.6)
        material = UsdShade.Material(b.stage.GetPrimAtPath(look))
        material.GetPrim().RemoveProperty("outputs:surface")
        material.CreateSurfaceOutput("ri").ConnectToSource(surface.CreateOutput("out", names.Token))
    session = usdslf.open(str(b.save()), elements=300, make_preview=True)
    session.strokes = [stroke(seen(P, gradient(P)))]
    session.solve()
    session.author(tmp_path / "look.usda")
    found = session.report()["strokes"][0]
    assert found["residual_as_written"] < 1.3 * found["residual_after"], found


@pytest.mark.parametrize("harm", ["damaged", "zero"])
def test_over_a_texture_that_shows_nothing_it_is_constant(tmp_path: Path, harm: str) -> None:
    write_image(tmp_path / "grey.png", np.full((64, 64, 3), 0.7))
    path = write_floor(tmp_path, **{**GREY, "diffuseColor": TextureInput("grey.png")})
    stage, names = Usd.Stage.Open(str(path)), Sdf.ValueTypeNames
    texture = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/floor/diffuseColor_texture"))
    if harm == "damaged":
        (tmp_path / "grey.png").write_bytes(b"no image")
        texture.CreateInput("fallback", names.Float4).Set(Gf.Vec4f(0.4, 0.4, 0.4, 1))
    else:
        texture.CreateInput("scale", names.Float4).Set(Gf.Vec4f(0, 0, 0, 1))
        texture.CreateInput("bias", names.Float4).Set(Gf.Vec4f(0.4, 0.4, 0.4, 0))
    stage.Save()
    session = solved(path, stroke(seen(P, gradient(P))))
    (said,) = [w for w in session.warnings if "cannot be stored" in w]
    assert ("grey.png cannot be read" if harm == "damaged" else "scales its texels by zero") in said
    session.author(tmp_path / "look.usda")
    shown = surface_at(session.edited(tmp_path / "look.usda").scene, P).diffuse
    np.testing.assert_allclose(shown, np.tile(session.answers[0].after["diffuse"], (len(P), 1)), atol=0.01)


def test_a_look_that_cannot_be_leaves_no_textures(tmp_path: Path) -> None:
    shot = write_floor(tmp_path)
    session = solved(shot, stroke(seen(P, gradient(P))))
    before = sorted(tmp_path.iterdir())
    for place in (shot, tmp_path / "look.usdz", tmp_path / "none" / "look.usda"):
        with pytest.raises(AuthorError):
            session.author(place)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("texels", [1, 8])
def test_a_texture_of_few_texels_gets_more(tmp_path: Path, texels: int) -> None:
    write_image(tmp_path / "grey.png", np.full((texels, texels, 3), 0.7))
    path = write_floor(tmp_path, **{**GREY, "diffuseColor": TextureInput("grey.png")})
    session = solved(path, stroke(seen(P, gradient(P))))
    session.author(tmp_path / "look.usda")
    other = session.edited(tmp_path / "look.usda")
    np.testing.assert_allclose(surface_at(other.scene, P).diffuse, gradient(P), atol=0.05)
