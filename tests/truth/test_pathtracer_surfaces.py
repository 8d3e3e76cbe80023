"""Normal maps, opacity and borders of the reference path tracer, against closed forms and equivalents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from reference.mitsuba_setup import why_no_pathtracer

if why_no_pathtracer():
    pytest.skip(why_no_pathtracer(), allow_module_level=True)

from kit.closed_radiance import MATERIAL, at, brdf, mean_radiance
from kit.stage_parts import MeshData, StageBuilder, TextureInput, rectangle, write_image
from numpy.typing import NDArray
from pxr import Gf, Sdf, UsdShade
from reference.pathtracer import Tracer

SQUARE = rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4))  # u along +X, v along -Z, normal +Y
MIRRORED = MeshData(SQUARE.positions, SQUARE.counts, SQUARE.indices, SQUARE.normals, SQUARE.uvs * [-1, 1] + [1, 0])
BLACK = {"useSpecularWorkflow": 1.0, "diffuseColor": (0.0, 0.0, 0.0), "roughness": 1.0}


@pytest.fixture
def builder(tmp_path: Path) -> StageBuilder:
    return StageBuilder(tmp_path)


def texture(builder: StageBuilder, material: str, name: str, output: str, **inputs: object) -> UsdShade.Shader:
    """Connects a texture without wrap modes to an input; `inputs` are those of the texture."""
    kinds = {"file": Sdf.ValueTypeNames.Asset, "scale": Sdf.ValueTypeNames.Float4, "bias": Sdf.ValueTypeNames.Float4}
    reader = UsdShade.Shader.Define(builder.stage, f"{material}/{name}_st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    shader = UsdShade.Shader.Define(builder.stage, f"{material}/{name}_map")
    shader.CreateIdAttr("UsdUVTexture")
    for key, value in inputs.items():
        shader.CreateInput(key, kinds.get(key, Sdf.ValueTypeNames.Token)).Set(value)
    shader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(
        reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    )
    surface = UsdShade.Shader(builder.stage.GetPrimAtPath(material + "/surface"))
    kind = {"normal": Sdf.ValueTypeNames.Normal3f, "opacity": Sdf.ValueTypeNames.Float}
    target = surface.CreateInput(name, kind.get(name, Sdf.ValueTypeNames.Color3f))
    target.ConnectToSource(shader.CreateOutput(output, Sdf.ValueTypeNames.Float3))
    return shader


def bumped_floor(builder: StageBuilder, texel: NDArray, mesh: MeshData = SQUARE) -> None:
    """Adds a floor whose normal map has one vector."""
    write_image(builder.folder / "n.exr", np.broadcast_to(0.5 + 0.5 * texel, (4, 4, 3)))
    material = builder.material("grey", **MATERIAL)
    twos, ones = Gf.Vec4f(2, 2, 2, 2), Gf.Vec4f(-1, -1, -1, -1)
    texture(builder, material, "normal", "rgb", file="./n.exr", scale=twos, bias=ones, sourceColorSpace="raw")
    builder.mesh("floor", mesh, material)


def tilted(x_deg: float, z_deg: float) -> NDArray:
    """A unit vector tilted from +Z towards +X and +Y of tangent space."""
    t = np.tan(np.radians([x_deg, z_deg]))
    return np.array([*t, 1]) / np.linalg.norm([*t, 1])


@pytest.mark.parametrize(("mesh", "turn"), [(SQUARE, 1), (MIRRORED, -1)])
def test_constant_normal_map_is_a_tilted_plane(builder: StageBuilder, mesh: MeshData, turn: int) -> None:
    texel = tilted(25.0, -15.0)
    bumped_floor(builder, texel, mesh)
    builder.distant_light("sun", (-1.0, -1.0, 0.0), 0.5, 2.5)
    tracer = Tracer(builder.save(), max_depth=2)
    assert not tracer.warnings
    n = np.array([turn * texel[0], texel[2], -texel[1]])  # tangent +X, bitangent -Z
    light = at(45.0)
    for eye in at(-30.0, 10.0, 60.0):
        expected = 2.5 * float(light[0] @ n) * brdf(n, eye, light)[0]
        np.testing.assert_allclose(mean_radiance(tracer, (0.3, 0, 0.2), eye, 50_000), expected, rtol=0.008)


def test_bumps_in_a_furnace_lose_what_comes_from_below(builder: StageBuilder) -> None:
    texel = tilted(35.0, 0.0)
    bumped_floor(builder, texel)
    builder.dome_light("dome", 1.0)
    tracer = Tracer(builder.save())
    n = np.array([texel[0], texel[2], 0])
    cos = (np.arange(800) + 0.5) / 800
    phi = 2 * np.pi * (np.arange(800) + 0.5) / 800
    c, p = (x.ravel() for x in np.meshgrid(cos, phi))
    s = np.sqrt(1 - c * c)
    l = np.stack([s * np.cos(p), c, s * np.sin(p)], -1)  # above the floor; the cosine is by the mapped normal
    for eye in at(-20.0, 50.0):
        lit = l[l @ n > 0]
        albedo = 2 * np.pi * (brdf(n, eye, lit) * (lit @ n)[:, None]).sum(0) / len(l)
        np.testing.assert_allclose(mean_radiance(tracer, (0, 0, 0), eye), albedo, rtol=0.008)


def test_cut_out_is_a_smaller_quad(tmp_path: Path) -> None:
    pictures = []
    for name in ("cut", "small"):
        (tmp_path / name).mkdir()
        builder = StageBuilder(tmp_path / name)
        builder.plane("floor", 6, 6, builder.material("grey", diffuseColor=(0.6, 0.5, 0.4), roughness=0.8))
        lid = builder.material("lid", diffuseColor=(0.5, 0.1, 0.1), roughness=0.4, opacityThreshold=0.5)
        builder.dome_light("dome", 1.0, (1.0, 0.9, 0.8))
        size = 2.0 if name == "small" else 4.0
        if name == "cut":
            mask = np.zeros((64, 64, 3), np.float32)
            mask[16:48, 16:48] = 1
            write_image(builder.folder / "mask.exr", mask)
            texture(builder, lid, "opacity", "r", file="./mask.exr", sourceColorSpace="raw")
        builder.mesh("lid", rectangle((-size / 2, 1, size / 2), (size, 0, 0), (0, 0, -size)), lid)
        camera = builder.camera((0.5, 3, 4), (0, 0.4, 0))
        pictures.append(Tracer(builder.save()).render(camera, 24, 18, 512))
    cut, small = pictures
    error = np.abs(cut - small) / small
    assert error.mean() < 0.02
    assert np.quantile(error, 0.95) < 0.06  # pixels at the rim differ by the corners of the mask


@pytest.mark.parametrize("mode", ["presence", "transparent"])
def test_half_opacity_is_a_mean(builder: StageBuilder, mode: str) -> None:
    """Presence: the mean of all and nothing; transparent: half of the diffuse light, all of the specular."""
    pane = builder.material("pane", **MATERIAL, opacity=0.5)
    shader = UsdShade.Shader(builder.stage.GetPrimAtPath(pane + "/surface"))
    shader.CreateInput("opacityMode", Sdf.ValueTypeNames.Token).Set(mode)
    builder.mesh("pane", SQUARE, pane)
    glow = builder.material("glow", **BLACK, emissiveColor=(0.3, 0.2, 0.1))
    builder.mesh("glow", rectangle((-2, -1, 2), (4, 0, 0), (0, 0, -4)), glow)
    builder.distant_light("sun", (-1.0, -1.0, 0.0), 0.5, 2.5)
    tracer = Tracer(builder.save(), max_depth=3)
    n, eye, light = np.array([0, 1.0, 0]), at(-30.0)[0], at(45.0)
    whole = brdf(n, eye, light)[0]
    fresnel = (1 - float((eye + light[0]) @ eye / np.linalg.norm(eye + light[0]))) ** 5
    f0 = np.array(MATERIAL["specularColor"])
    diffuse = np.array(MATERIAL["diffuseColor"]) / np.pi * (1 - f0 - (1 - f0) * fresnel)
    shown = whole / 2 if mode == "presence" else whole - diffuse / 2
    expected = 2.5 * np.cos(np.pi / 4) * shown + 0.5 * np.array([0.3, 0.2, 0.1])
    np.testing.assert_allclose(mean_radiance(tracer, (0, 0, 0), eye), expected, rtol=0.01)


def test_a_texture_without_a_wrap_mode_ends_in_black(builder: StageBuilder) -> None:
    write_image(builder.folder / "t.exr", np.full((4, 4, 3), 1, np.float32))
    material = builder.material("m", diffuseColor=(1, 1, 1))
    texture(builder, material, "diffuseColor", "rgb", file="./t.exr", sourceColorSpace="raw")
    data = rectangle((0, 0, 0), (2, 0, 0), (0, 2, 0))
    wide = MeshData(data.positions, data.counts, data.indices, data.normals, data.uvs * 2)
    builder.mesh("quad", wide, material)
    repeated = builder.material("r", diffuseColor=TextureInput("t.exr"))
    builder.mesh("other", wide, repeated, (5, 0, 0))
    tracer = Tracer(builder.save())
    origins = np.array([[0.3, 0.4, 1], [1.3, 0.4, 1], [0.3, 1.6, 1], [6.3, 0.4, 1]])
    _, _, diffuse = tracer.first_hits(origins, np.broadcast_to([0, 0, -1.0], (4, 3)))
    np.testing.assert_allclose(diffuse[:, 0], [1, 0, 0, 1], atol=1e-6)
