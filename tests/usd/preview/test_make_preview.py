"""Surfaces without UsdPreviewSurface are painted and edited: in the session, in the look, on the command line.

A plane under a rect light shows its displayColor only, or has a material of another context; what was painted
comes from a float64 model of the plane, as in test_session.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from kit.lit_plane import dabs, places, seen, write_plane
from kit.look_stages import validate
from kit.shader_nodes import Nodes
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils

import usdslf
from usdslf.errors import AuthorError
from usdslf.scene.records import Texture
from usdslf.strokes.stroke import Stroke
from usdslf.textures.images import write_image
from usdslf.usd.edited import open_edited
from usdslf.usd.read.read import read_scene
from usdslf.usd.review.validate import validate as find_wrong
from usdslf.usd.stroke_layer import write_strokes

Run = Callable[..., tuple[int, str, str]]
SHOWN = {"diffuse": (0.4, 0.3, 0.2), "specular": (0.04,) * 3, "roughness": 0.5}  # on the fallbacks
AFTER = SHOWN | {"diffuse": (0.55, 0.15, 0.1)}


def plain(folder: Path, context: str = "") -> Path:
    """The plane without its material; with two more gprims of the same colour, far away."""
    path = write_plane(folder)
    stage = Usd.Stage.Open(str(path))
    stage.RemovePrim("/World/mtl/floor")
    floor = UsdGeom.Plane(stage.GetPrimAtPath("/World/floor"))
    floor.GetPrim().RemoveProperty("material:binding")
    floor.CreateDisplayColorAttr([Gf.Vec3f(*SHOWN["diffuse"])])
    for i, color in enumerate((SHOWN["diffuse"], (0.1, 0.1, 0.1))):
        twin = UsdGeom.Sphere.Define(stage, f"/World/twin{i}")
        twin.CreateExtentAttr([(-1, -1, -1), (1, 1, 1)])
        twin.AddTranslateOp().Set((30 + 3 * i, 0, 0))
        twin.CreateDisplayColorAttr([Gf.Vec3f(*color)])
    if context:
        material = UsdShade.Material.Define(stage, "/World/mtl/final")
        node = UsdShade.Shader.Define(stage, "/World/mtl/final/node")
        node.CreateIdAttr("standard_surface")
        node.CreateInput("base_color", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*SHOWN["diffuse"]))
        node.CreateInput("specular_roughness", Sdf.ValueTypeNames.Float).Set(SHOWN["roughness"])
        material.CreateSurfaceOutput(context).ConnectToSource(node.CreateOutput("out", Sdf.ValueTypeNames.Token))
        UsdShade.MaterialBindingAPI.Apply(floor.GetPrim()).Bind(material)
    stage.GetRootLayer().Save()
    return path


def painted() -> Stroke:
    return dabs(places(), seen(places(), AFTER["diffuse"], AFTER["specular"], AFTER["roughness"]))


@pytest.mark.parametrize("context", ["", "arnold"])
def test_a_surface_without_preview_is_solved_and_the_look_shows_it(tmp_path: Path, context: str) -> None:
    shot = plain(tmp_path, context)
    before = shot.read_bytes()
    session = usdslf.open(str(shot), elements=150, make_preview=True)
    assert {m.why_not_editable for m in session.scene.materials} == {""}
    session.add_stroke(painted())
    session.solve()
    session.author(tmp_path / "look.usda", review_root=tmp_path / "review.usda")
    report = session.report()
    assert report["stage"] == str(shot) and report["strokes"][0]["inferred"] == "diffuse"
    (edit,) = report["edits"]
    assert edit["wins"] and edit["hidden_by"] == ""
    # The twin shows the same; it shares the material unless the floor's is that of a final render.
    assert edit["affects"] == ["/World/floor"] + ([] if context else ["/World/twin0"])
    assert shot.read_bytes() == before

    review = Usd.Stage.Open(str(tmp_path / "review.usda"))
    scene = read_scene(review)
    of_mesh = {m.path: scene.materials[m.material_of_triangle[0]] for m in scene.meshes}
    assert_allclose(of_mesh["/World/floor"].diffuse_color, AFTER["diffuse"], atol=0.02)
    assert not of_mesh["/World/floor"].why_not_editable
    assert_allclose(of_mesh["/World/twin1"].diffuse_color, (0.1,) * 3, atol=1e-6)
    assert of_mesh["/World/twin1"].why_not_editable  # nothing was made for what was not painted
    assert find_wrong(review, None) == [] and validate(Usd.Stage.Open(str(tmp_path / "look.usda"))) == []
    full = UsdShade.MaterialBindingAPI(review.GetPrimAtPath("/World/floor")).ComputeBoundMaterial("full")[0]
    assert (str(full.GetPath()) == "/World/mtl/final") == bool(context)
    said = " ".join(session.warnings)
    assert ("final renders of /World/floor by arnold show /World/mtl/final" in said) == bool(context)
    assert "preview_floor is new: a UsdPreviewSurface that shows what /World/floor" in said
    # Solved again over the earlier look: the same bytes.
    first = (tmp_path / "look.usda").read_bytes()
    session.author(tmp_path / "look.usda")
    assert (tmp_path / "look.usda").read_bytes() == first


def test_the_new_material_of_one_painted_gprim_leaves_its_twin(tmp_path: Path) -> None:
    session = usdslf.open(str(plain(tmp_path)), elements=150, make_preview=True)
    session.add_stroke(painted())
    session.solve()
    (edit,) = session.author(tmp_path / "look.usda", mode="new")
    assert edit.wins and edit.affects == ("/World/floor",)
    scene = read_scene(open_edited(session.source.GetRootLayer().realPath, tmp_path / "look.usda"))
    of_mesh = {m.path: scene.materials[m.material_of_triangle[0]] for m in scene.meshes}
    assert_allclose(of_mesh["/World/floor"].diffuse_color, AFTER["diffuse"], atol=0.02)
    assert_allclose(of_mesh["/World/twin0"].diffuse_color, SHOWN["diffuse"], atol=1e-6)


def test_without_the_option_the_reason_and_the_option_are_named(tmp_path: Path) -> None:
    session = usdslf.open(str(plain(tmp_path, "arnold")), elements=150)
    session.add_stroke(painted())
    session.solve()
    with pytest.raises(AuthorError, match=r"no UsdPreviewSurface .it has arnold.*--make-preview"):
        session.author(tmp_path / "look.usda")


def test_a_binding_that_this_build_cannot_read_keeps_final_renders(tmp_path: Path) -> None:
    shot = plain(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    floor = stage.GetPrimAtPath("/World/floor")
    UsdShade.MaterialBindingAPI.Apply(floor).GetDirectBindingRel().SetTargets(["/World/mtl/from_mtlx"])
    stage.GetRootLayer().Save()
    session = usdslf.open(str(shot), elements=150, make_preview=True)
    session.add_stroke(painted())
    session.solve()
    session.author(tmp_path / "look.usda")
    look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    assert not look.GetRelationshipAtPath("/World/floor.material:binding")
    assert look.GetRelationshipAtPath("/World/floor.material:binding:preview")
    wanted = "final renders of /World/floor (bound to /World/mtl/from_mtlx) keep materials that this build cannot read"
    assert len([w for w in session.warnings if "from_mtlx" in w and wanted in w]) == 1


def test_the_command_line_makes_them_and_takes_a_mode(tmp_path: Path, run: Run) -> None:
    shot = plain(tmp_path)
    write_strokes(tmp_path / "strokes.usda", [painted()], Usd.Stage.Open(str(shot)))
    arguments = ("solve", shot, tmp_path / "strokes.usda", "-o", tmp_path / "look.usda", "--elements", "150")
    code, _, err = run(*arguments)
    assert code == 6 and "--make-preview" in err and not (tmp_path / "look.usda").exists()
    report = tmp_path / "report.json"
    code, out, err = run(*arguments, "--make-preview", "--mode", "new", "--report", report)
    assert code == 0, err
    (edit,) = json.loads(report.read_text())["edits"]
    assert edit["affects"] == ["/World/floor"] and edit["wins"] and edit["mend"] == ""
    assert "shown by 1: /World/floor" in out
    code, _, err = run(*arguments, "--make-preview", "--mode", "class")
    assert code == 6 and "inherit no class" in err
    code, _, err = run(*arguments, "--mode", "everything")
    assert code == 2 and "everything" in err


def test_a_stage_where_all_can_be_edited_is_left_alone(tmp_path: Path) -> None:
    session = usdslf.open(str(write_plane(tmp_path)), elements=150, make_preview=True)
    assert session.made is not None and not session.made.material_of
    assert np.isfinite(session.scene.materials[0].roughness).all()


def test_usds_own_diagnostics_stay_off_stderr(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shot = plain(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    floor = stage.GetPrimAtPath("/World/floor")
    floor.CreateRelationship("material:binding").SetTargets(["/World/mtl/from_mtlx"])  # without its API schema
    stage.GetPrimAtPath("/World/mtl").GetReferences().AddReference("./none.mtlx")
    stage.GetRootLayer().Save()
    del stage, floor
    capfd.readouterr()
    usdslf.open(str(shot), elements=150, make_preview=True)
    assert capfd.readouterr().err == ""


def test_an_image_of_materialx_is_edited_and_its_file_named_from_the_look(tmp_path: Path) -> None:
    shot = plain(tmp_path, "mtlx")
    write_image(tmp_path / "plain.exr", np.tile(np.float32(SHOWN["diffuse"]) / 0.8, (4, 4, 1)))
    stage = Usd.Stage.Open(str(shot))
    node = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/final/node"))
    node.CreateIdAttr("ND_standard_surface_surfaceshader")
    node.CreateInput("base", Sdf.ValueTypeNames.Float).Set(0.8)
    image = UsdShade.Shader.Define(stage, "/World/mtl/final/image")
    image.CreateIdAttr("ND_image_color3")
    image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath("./plain.exr"))
    node.GetInput("base_color").ConnectToSource(image.CreateOutput("out", Sdf.ValueTypeNames.Color3f))
    stage.GetRootLayer().Save()
    session = usdslf.open(str(shot), elements=150, make_preview=True)
    session.add_stroke(painted())
    session.solve()
    (tmp_path / "looks").mkdir()
    session.author(tmp_path / "looks/look.usda", review_root=tmp_path / "review.usda")
    edits = session.report()["edits"]
    assert edits and all(e["wins"] and e["prim"].endswith("preview_floor/diffuseColor_texture") for e in edits)
    review = Usd.Stage.Open(str(tmp_path / "review.usda"))
    assert find_wrong(review, None) == []  # a path from the root would be named
    scene = read_scene(review)
    of_mesh = {m.path: scene.materials[m.material_of_triangle[0]] for m in scene.meshes}
    texture = of_mesh["/World/floor"].diffuse_color
    assert isinstance(texture, Texture) and Path(texture.path).samefile(tmp_path / "plain.exr")
    texel = np.array(SHOWN["diffuse"]) / 0.8
    assert_allclose(texel * texture.scale[:3] + texture.bias[:3], AFTER["diffuse"], atol=0.02)


def test_a_shot_in_a_package_is_edited_with_its_own_texture(tmp_path: Path, run: Run) -> None:
    shot = Nodes(tmp_path / "shot.usda")
    write_image(tmp_path / "a.png", np.full((4, 4, 3), 0.5, np.float32))
    texture = shot.node("color", "ND_image_color3", file=Sdf.AssetPath("./a.png"))
    shot.surface("ND_standard_surface_surfaceshader", base_color=texture)
    package, look, review = (tmp_path / n for n in ("shot.usdz", "looks/look.usda", "review.usda"))
    look.parent.mkdir()
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "shot.usda"), str(package))
    for source in ("shot.usda", "a.png"):
        (tmp_path / source).unlink()
    strokes = tmp_path / "strokes.usda"
    paint = ("--path", "0.5,0.5", "--radius", "0.05", "--color", "0.3,0.05,0.05", "--size", "64x64")
    code, _, err = run("stroke", package, strokes, *paint)
    assert code == 0, err
    few = ("--elements", "100", "--bounces", "1", "--make-preview")
    code, _, err = run("solve", package, strokes, "-o", look, "--review-root", review, *few)
    assert code == 0, err
    assert "@../shot.usdz[a.png]@" in look.read_text()
    code, out, _ = run("info", review)
    assert code == 0 and "findings: 0" in out and "diffuse_color texture a.png, " in out
    # Where the package lacks it, it is named.
    look.write_text(look.read_text().replace("[a.png]", "[b.png]"))
    code, out, _ = run("info", review)
    assert "MissingFile" in out and "../shot.usdz[b.png], which is not there" in out


def test_a_picture_shows_what_would_be_edited(tmp_path: Path, run: Run) -> None:
    shot = plain(tmp_path, "arnold")
    stage = Usd.Stage.Open(str(shot))
    UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/final/node")).GetInput("base_color").Set(Gf.Vec3f(0.8, 0, 0))
    stage.GetRootLayer().Save()
    few = ("--size", "24x24", "--samples", "1", "--elements", "150", "--bounces", "1", "--aov", "albedo")
    albedo = []
    for more in ((), ("--make-preview",)):
        out = tmp_path / f"picture{len(more)}.exr"
        code, _, err = run("render", shot, "-o", out, *few, *more)
        assert code == 0, err
        layers = OpenImageIO.ImageBuf(str(out))
        names = list(layers.spec().channelnames)
        at = [names.index(f"albedo.{c}") for c in "RGB"]
        albedo.append(layers.get_pixels(OpenImageIO.FLOAT)[..., at].reshape(-1, 3).max(0))
    assert_allclose(albedo[0], SHOWN["diffuse"], atol=1e-3)  # displayColor
    assert_allclose(albedo[1], (0.8, 0, 0), atol=1e-3)
