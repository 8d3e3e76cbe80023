"""Lights and cameras read from small stages against closed forms of UsdLux and UsdGeom."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.scene.records import Camera, Light, LightTexture
from usdslf.textures.images import write_image
from usdslf.usd.notes import Notes
from usdslf.usd.read.cameras import read_cameras
from usdslf.usd.read.lights import read_lights, size_factor


def stage_of(text: str, up: str = "Y") -> Usd.Stage:
    text = text.replace("}", "\n}\n")  # the parser wants one property a line
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(f'#usda 1.0\n( upAxis = "{up}" )\n{text}')
    return stage


def lights(text: str, up: str = "Y", notes: Notes | None = None) -> list[Light]:
    color = color_of(None, USD_DEFAULT_SPACE)
    return read_lights(stage_of(text, up), Usd.TimeCode.EarliestTime(), color, notes or Notes())


def light(text: str, up: str = "Y", notes: Notes | None = None) -> Light:
    (found,) = lights(text, up, notes)
    return found


SCALED = 'double3 xformOp:scale = (2, 3, 5)\n uniform token[] xformOpOrder = ["xformOp:scale"]\n'


def test_default_distant_light_gives_its_irradiance() -> None:
    found = light('def DistantLight "l" {}')
    solid = math.pi * math.sin(found.angle / 2) ** 2
    assert found.radiance[0] * solid == pytest.approx(3.36, abs=0.005)
    assert found.angle == pytest.approx(math.radians(0.53))


@pytest.mark.parametrize("angle", [0.0, 0.53, 10.0, 180.0, 270.0])
def test_normalized_distant_light_gives_intensity_as_irradiance(angle: float) -> None:
    found = light(
        f'def DistantLight "l" {{ float inputs:angle = {angle}\n float inputs:intensity = 7\n'
        "bool inputs:normalize = 1 }"
    )
    t = math.radians(angle) / 2
    factor = 1 if t == 0 else math.pi * (math.sin(t) ** 2 if t <= math.pi / 2 else 2 - math.sin(t) ** 2)
    assert found.radiance[0] * factor == pytest.approx(7)


def test_intensity_exposure_and_colour_multiply() -> None:
    found = light(
        'def RectLight "l" { float inputs:intensity = 3\n float inputs:exposure = 2\n'
        "color3f inputs:color = (1, 0.5, 0.25) }"
    )
    assert found.radiance == pytest.approx((12, 6, 3))


def test_colour_temperature_counts_only_where_enabled() -> None:
    warm = "float inputs:colorTemperature = 6500\n float inputs:intensity = 2\n"
    off = light(f'def RectLight "l" {{ {warm} }}')
    on = light(f'def RectLight "l" {{ {warm} bool inputs:enableColorTemperature = 1 }}')
    assert off.radiance == pytest.approx((2, 2, 2))
    assert on.radiance == pytest.approx((2 * 1.043, 2 * 0.984, 2 * 1.035), abs=2e-3)


@pytest.mark.parametrize(
    ("type_name", "sizes", "area"),
    [
        ("RectLight", "float inputs:width = 4\n float inputs:height = 7\n", 4 * 2 * 7 * 3),
        ("DiskLight", "float inputs:radius = 2\n", math.pi * 4 * 6),
    ],
)
def test_normalize_divides_by_the_world_area(type_name: str, sizes: str, area: float) -> None:
    found = light(f'def {type_name} "l" {{ {sizes} {SCALED} bool inputs:normalize = 1 }}')
    assert found.radiance[0] == pytest.approx(1 / area)


def test_areas_of_spheres_and_cylinders() -> None:
    sizes = {"width": 1.0, "height": 1.0, "radius": 0.5, "length": 3.0, "angle": 0.0}
    assert size_factor("sphere", np.diag([4, 4, 4, 1.0]), **sizes) == pytest.approx(4 * math.pi * 4)
    assert size_factor("cylinder", np.diag([2, 4, 4, 1.0]), **sizes) == pytest.approx(2 * math.pi * 2 * 6)
    assert size_factor("dome", np.eye(4), **sizes) == 1
    # Ellipsoid and elliptic cylinder against quadrature of their parametrisation.
    a = np.array([1.0, 1.5, 2.5])
    u, v = np.meshgrid((np.arange(400) + 0.5) * np.pi / 400, (np.arange(800) + 0.5) * np.pi / 400)
    su, cu, sv, cv = np.sin(u), np.cos(u), np.sin(v), np.cos(v)
    du = np.stack([cu * cv, cu * sv, -su], -1) * a
    dv = np.stack([-su * sv, su * cv, 0 * u], -1) * a
    area = np.linalg.norm(np.cross(du, dv), axis=-1).sum() * (np.pi / 400) ** 2
    assert size_factor("sphere", np.diag([2, 3, 5, 1.0]), **sizes) == pytest.approx(area, rel=0.012)
    t = (np.arange(4000) + 0.5) * 2 * np.pi / 4000
    around = np.hypot(1.5 * np.sin(t), 2.5 * np.cos(t)).sum() * 2 * np.pi / 4000
    assert size_factor("cylinder", np.diag([2, 3, 5, 1.0]), **sizes) == pytest.approx(6 * around, rel=1e-4)


def test_shapes_factors_and_shaping_are_kept() -> None:
    found = light(
        'def SphereLight "l" ( prepend apiSchemas = ["ShapingAPI"] ) { float inputs:radius = 0.2\n'
        "bool treatAsPoint = 1\n float inputs:diffuse = 0.5\n float inputs:specular = 0.25\n"
        "float inputs:shaping:cone:angle = 40\n float inputs:shaping:cone:softness = 0.1\n"
        "float inputs:shaping:focus = 2\n color3f inputs:shaping:focusTint = (0.1, 0.2, 0.3) }"
    )
    assert (found.kind, found.treat_as_point) == ("sphere", True)
    assert found.radius == pytest.approx(0.2)
    assert (found.diffuse, found.specular) == (0.5, 0.25)
    assert (found.cone_angle, found.focus) == (40, 2)
    assert found.cone_softness == pytest.approx(0.1)
    assert found.focus_tint == pytest.approx((0.1, 0.2, 0.3))


def test_lights_are_placed_and_hidden_like_everything_else() -> None:
    text = """def Xform "x" { double3 xformOp:translate = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def DiskLight "on" {}
        def DiskLight "off" { token visibility = "invisible" }
        def DiskLight "guide" { uniform token purpose = "guide" } }"""
    found = light(text)
    assert found.path == "/x/on"
    assert found.world_from_light[:3, 3] == pytest.approx([1, 2, 3])


@pytest.mark.parametrize(
    ("type_name", "pole", "up", "world_pole", "longitude_0"),
    [
        ("DomeLight", "", "Z", (0, 1, 0), (0, 0, 1)),
        ("DomeLight_1", "", "Y", (0, 1, 0), (0, 0, 1)),
        ("DomeLight_1", "", "Z", (0, 0, 1), (0, -1, 0)),
        ("DomeLight_1", "Z", "Y", (0, 0, 1), (0, -1, 0)),
        ("DomeLight_1", "Y", "Z", (0, 1, 0), (0, 0, 1)),
    ],
)
def test_domes_have_their_pole(
    type_name: str, pole: str, up: str, world_pole: tuple, longitude_0: tuple
) -> None:
    body = f'uniform token poleAxis = "{pole}"' if pole else ""
    matrix = light(f'def {type_name} "l" {{ {body} }}', up).world_from_light[:3, :3]
    assert matrix @ [0, 1, 0] == pytest.approx(world_pole)
    assert matrix @ [0, 0, 1] == pytest.approx(longitude_0)
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_dome_textures_and_missing_ones(tmp_path: Path) -> None:
    path = write_image(tmp_path / "sky.exr", np.ones((4, 8, 3)))
    found = light(f'def DomeLight "l" {{ asset inputs:texture:file = @{path}@ }}')
    assert found.texture == LightTexture(str(path), "automatic", "auto", "", USD_DEFAULT_SPACE)
    notes = Notes()
    found = light('def DomeLight "l" { asset inputs:texture:file = @none.hdr@ }', notes=notes)
    assert found.texture is None
    assert any("/l" in s and "none.hdr" in s for s in notes.sentences())


def test_what_is_not_supported_is_named() -> None:
    notes = Notes()
    found = lights(
        """
        def RectLight "link" { uniform bool collection:lightLink:includeRoot = 0
            rel collection:lightLink:includes = </x> }
        def RectLight "filter" { rel light:filters = </f> }
        def RectLight "ies" ( prepend apiSchemas = ["ShapingAPI"] ) {
            asset inputs:shaping:ies:file = @a.ies@ }
        def RectLight "shadow" ( prepend apiSchemas = ["ShadowAPI"] ) { bool inputs:shadow:enable = 0 }
        def GeometryLight "geo" {}
        def Mesh "glow" ( prepend apiSchemas = ["MeshLightAPI"] ) {}
        def PointInstancer "many" { def SphereLight "bulb" {} }
        """,
        notes=notes,
    )
    assert [x.path for x in found] == ["/link", "/filter", "/ies", "/shadow"]
    for prim in ("/link", "/filter", "/ies", "/shadow", "/geo", "/glow", "/many/bulb"):
        assert sum(prim in s for s in notes.sentences()) == 1, prim


# ---- cameras -------------------------------------------------------------------------------------
def camera(body: str) -> Camera:
    (found,) = read_cameras(stage_of(f'def Camera "c" {{ {body} }}'), Usd.TimeCode(1), Notes())
    return found


def test_cameras_keep_apertures_and_offsets_and_lose_scale() -> None:
    found = camera(
        "float horizontalAperture = 20\n float verticalAperture = 10\n float horizontalApertureOffset = 2\n"
        "float focalLength.timeSamples = { 0: 20, 2: 40 }\n float2 clippingRange = (0.5, 9)\n"
        "double3 xformOp:translate = (1, 2, 3)\n double3 xformOp:scale = (2, 3, 4)\n"
        "float xformOp:rotateY = 90\n"
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY", "xformOp:scale"]'
    )
    assert (found.horizontal_aperture, found.vertical_aperture, found.horizontal_offset) == (20, 10, 2)
    assert (found.focal_length, found.near, found.far) == (30, 0.5, 9)
    rotation = found.world_from_camera[:3, :3]
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert rotation @ [0, 0, -1] == pytest.approx([-1, 0, 0])  # looks along -Z, turned by 90 degrees about Y
    assert found.world_from_camera[:3, 3] == pytest.approx([1, 2, 3])


def test_orthographic_cameras_keep_their_aperture() -> None:
    found = camera('token projection = "orthographic"\n float horizontalAperture = 50')
    assert not found.perspective
    assert found.horizontal_aperture == 50
