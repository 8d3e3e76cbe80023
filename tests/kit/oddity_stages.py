"""A floor under a lamp, of which the radiance has a closed form, for stages that are authored in odd ways.

The floor lies at z = 0, from -2 to 2; it is four quads.  What was painted comes from the float64 model of
lit_plane, so that a stage reads, shows and solves rightly only where its floor lies, shines and is bound as it
should be.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from kit.lit_plane import EYE, FLOOR, LAMP, POWER, SIZE, dabs, places, seen
from kit.stage_parts import StageBuilder
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

import usdslf
from usdslf.geometry.closest_point import nearest_on_triangles
from usdslf.scene.records import Mesh, Scene
from usdslf.session import Session
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface
from usdslf.usd.layer.wins import AuthoredEdit

AFTER = FLOOR | {"diffuse": (0.6, 0.15, 0.1)}
FACES = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
GRID = np.array([(x, y, 0.0) for y in (-2, 0, 2) for x in (-2, 0, 2)])
CAMERA = "/World/camera"
F = Sdf.ValueTypeNames


def floor_shot(folder: Path, up: str = "Y") -> StageBuilder:
    """A builder with floor, lamp and camera; its stage is not saved yet."""
    folder.mkdir(exist_ok=True)
    b = StageBuilder(folder, up)
    look = b.material(
        "floor", useSpecularWorkflow=1.0, diffuseColor=FLOOR["diffuse"], specularColor=FLOOR["specular"],
        roughness=FLOOR["roughness"],
    )  # fmt: skip
    add_floor(b.stage, "/World/floor", look)
    add_lamp(b.stage, "/World/lamp")
    b.camera(tuple(EYE), (0, 0, 0))
    return b


def add_floor(stage: Usd.Stage, path: str, material: str) -> UsdGeom.Mesh:
    """The floor, with texture coordinates `st` from 0 to 1."""
    mesh = add_mesh(stage, path, GRID, FACES)
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
    st.Set(as_2f(GRID[:, :2] / 4 + 0.5))
    if material:
        bound = UsdShade.Material(stage.GetPrimAtPath(material))
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(bound)
    return mesh


def add_lamp(stage: Usd.Stage, path: str) -> UsdLux.RectLight:
    light = UsdLux.RectLight.Define(stage, path)
    light.CreateWidthAttr(SIZE[0])
    light.CreateHeightAttr(SIZE[1])
    light.CreateColorAttr(Gf.Vec3f(*POWER))
    light.AddTranslateOp().Set(Gf.Vec3d(*LAMP))
    return light


def add_mesh(stage: Usd.Stage, path: str, points: Any, faces: Any, scheme: str = "none") -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in points])
    mesh.CreateFaceVertexCountsAttr([len(f) for f in faces])
    mesh.CreateFaceVertexIndicesAttr([int(i) for f in faces for i in f])
    if scheme:
        mesh.CreateSubdivisionSchemeAttr(scheme)
    return mesh


def as_2f(values: NDArray) -> list[Gf.Vec2f]:
    return [Gf.Vec2f(float(u), float(v)) for u, v in values]


def shader_of(b: StageBuilder, material: str = "floor") -> UsdShade.Shader:
    return UsdShade.Shader(b.stage.GetPrimAtPath(f"/World/mtl/{material}/surface"))


def floor_of(b: StageBuilder) -> UsdGeom.Mesh:
    return UsdGeom.Mesh(b.stage.GetPrimAtPath("/World/floor"))


# ---- what comes of it ---------------------------------------------------------------------------------------
def painted(after: dict[str, Any] = AFTER) -> Stroke:
    """Dabs of the radiance that the floor would have."""
    return dabs(places(), seen(places(), after["diffuse"], after["specular"], after["roughness"]))


def solved(stage: Any, after: dict[str, Any] = AFTER, **options: Any) -> Session:
    """Opens a stage, paints the changed floor on it, and checks that the change is found."""
    session = usdslf.open(stage if isinstance(stage, Usd.Stage) else str(stage), elements=150, **options)
    session.add_stroke(painted(after))
    session.solve()
    (stroke,) = session.report()["strokes"]
    assert stroke["inferred"] == "diffuse", stroke["alternatives"][:3]
    np.testing.assert_allclose(stroke["after"]["diffuse"], after["diffuse"], atol=0.02)
    return session


def authored(session: Session, folder: Path, mode: str = "") -> list[AuthoredEdit]:
    """Writes the look, and checks that it wins and that the floor then is what was painted."""
    edits = session.author(folder / "look.usda", review_root=folder / "review.usda", mode=mode)
    assert edits and all(e.wins for e in edits), edits
    review = usdslf.open(str(folder / "review.usda"), device=session.device)
    at = evaluate_at(review.scene, places())
    np.testing.assert_allclose(at.base_color, np.tile(AFTER["diffuse"], (len(places()), 1)), atol=0.02)
    return edits


def solves_and_shows(path: Path) -> Session:
    """The whole way from a stage to a look that shows what was painted."""
    session = solved(path)
    authored(session, path.parent)
    return session


def evaluate_at(scene: Scene, points: NDArray) -> SurfacePoints:
    """What the surfaces are at the places nearest to points (n, 3), which must lie on them."""
    found = nearest_on_triangles(scene.triangles.positions, np.asarray(points, np.float32))
    assert found.distance.max() < 1e-5
    return evaluate_surface(scene, found.triangle, found.barycentric)


def picture(path: Path, camera: str | None = CAMERA, **options: Any) -> NDArray:
    """A small picture (18, 24, 3)."""
    session = usdslf.open(str(path), elements=200, bounces=2, **options)
    return session.render(camera, size=(24, 18), samples=4)["color"]


def shown_alike(odd: Path, plain: Path) -> None:
    """Two stages of the same triangles give the same picture, to the bit."""
    np.testing.assert_array_equal(picture(odd), picture(plain))


def warnings_of(path: Path, run: Callable[..., tuple[int, str, str]], *names: str) -> None:
    """`info` and `render` end well, without a traceback, and one of their warnings holds all names."""
    code, out, err = run("info", path)
    assert (code, err) == (0, "")
    assert any(all(n in line for n in names) for line in out.splitlines()), out
    arguments = ("--size", "16x12", "--samples", "1", "--elements", "200", "--bounces", "1")
    code, _, err = run("render", path, "-o", path.parent / "picture.exr", *arguments)
    assert code == 0 and all(line.startswith("warning: ") for line in err.splitlines()), err
    assert any(all(n in line for n in names) for line in err.splitlines()), err


def corners(mesh: Mesh) -> NDArray:
    """Corners (T, 3, 3) of the triangles of a mesh."""
    return mesh.positions[mesh.triangles].astype(np.float64)


def area_vectors(mesh: Mesh) -> NDArray:
    """Normals (T, 3) as long as the triangles' areas."""
    p = corners(mesh)
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2


def same_triangles(a: Scene, b: Scene) -> None:
    """Two scenes have the same triangles, corner by corner, with the same normals."""
    np.testing.assert_array_equal(a.triangles.positions, b.triangles.positions)
    np.testing.assert_allclose(a.triangles.normals, b.triangles.normals, atol=1e-6)


def as_asset(b: StageBuilder, root: str = "/asset") -> Sdf.Layer:
    """The shot's floor and material as an asset beside it, saved; lamp and camera are the shot's own."""
    asset = Sdf.Layer.CreateNew(str(b.folder / "asset.usda"))
    Sdf.CopySpec(b.stage.GetRootLayer(), "/World", asset, root)
    asset.defaultPrim = root[1:]
    for name in ("lamp", "camera"):
        del asset.GetPrimAtPath(root).nameChildren[name]
    asset.Save()
    return asset


# ---- texture coordinates ------------------------------------------------------------------------------------
def textured(b: StageBuilder, file: str = "./floor.exr", uv_set: str | None = "st") -> UsdShade.Shader:
    """Drives the floor's diffuse colour by a texture; without a uv set its st has no connection."""
    texture = UsdShade.Shader.Define(b.stage, "/World/mtl/floor/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", F.Asset).Set(file)
    for wrap in ("wrapS", "wrapT"):
        texture.CreateInput(wrap, F.Token).Set("clamp")
    if uv_set is not None:
        reader = UsdShade.Shader.Define(b.stage, "/World/mtl/floor/reader")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", F.String).Set(uv_set)
        texture.CreateInput("st", F.Float2).ConnectToSource(reader.CreateOutput("result", F.Float2))
    shader_of(b).GetInput("diffuseColor").ConnectToSource(texture.CreateOutput("rgb", F.Float3))
    return texture
