"""The picture of a light enters by the shot's own colours: against plain OpenColorIO."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import PyOpenColorIO as ocio
import pytest

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import InputError
from usdslf.gallery.environment import put_environment
from usdslf.lights.dome import Dome
from usdslf.lights.sampling import intersect_light
from usdslf.session import Session
from usdslf.textures.images import write_image
from usdslf.usd.read.read import read_scene

ORANGE = (1.0, 0.2, 0.05)  # Rec. 709

CONFIG = """ocio_profile_version: 2.1
roles: {{scene_linear: work, aces_interchange: aces, default: work}}
displays: {{sRGB: [!<View> {{name: Raw, colorspace: work}}]}}
colorspaces:
  - !<ColorSpace> {{name: aces}}
  - !<ColorSpace>
    name: work
    to_scene_reference: !<BuiltinTransform> {{style: ACEScg_to_ACES2065-1}}
  - !<ColorSpace>
    name: {name}
    to_scene_reference: !<MatrixTransform> {{matrix: [0.5, 0.25, 0, 0, 0, 2, 0, 0, 0.125, 0, 4, 0, 0, 0, 0, 1]}}
"""

STAGE = """#usda 1.0
( renderSettingsPrimPath = "/Render"
  upAxis = "Y" )
def RenderSettings "Render" {{ uniform token renderingColorSpace = "{space}"
}}
def Camera "cam" {{ double3 xformOp:translate = (0, 0, 5)
  uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def {light}Light "light" {{ asset inputs:texture:file = @{file}@ ( {tag} )
  double3 xformOp:translate = (0, 0, 9)
  uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Sphere "ball" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{ rel material:binding = </m>
}}
def Material "m" {{ token outputs:surface.connect = </m/s.outputs:surface>
  def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
    color3f inputs:diffuseColor = (1, 1, 1)
    int inputs:useSpecularWorkflow = 1
    token outputs:surface
  }}
}}
"""


def picture(path: Path, color: tuple[float, ...], count: int = 3) -> Path:
    """Writes an even EXR that says nothing of its colour space."""
    spec = oiio.ImageSpec(8, 4, count, "float")
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    output.write_image(np.broadcast_to(np.array(color, np.float32), (4, 8, count)).copy())
    output.close()
    return path


def stage(folder: Path, light: str, space: str, tag: str = "") -> Path:
    file = folder / f"{light}.usda"
    file.write_text(STAGE.format(light=light, space=space, tag=tag, file=picture(folder / "sky.exr", ORANGE).name))
    return file


def radiance(path: Path, config: str | None) -> np.ndarray:
    """What the light of a stage sends along one ray."""
    (light,) = read_scene(path, ocio=config).lights
    if light.kind == "dome":
        return Dome.from_light(light).radiance(np.array([[0.0, 0, 1]]))[0]
    return intersect_light(light, np.zeros((1, 3)), np.array([[0.0, 0, 1]])).radiance[0]


def converted(config: str, source: str, target: str) -> list[float]:
    processor = ocio.Config.CreateFromFile(config).getProcessor(source, target).getDefaultCPUProcessor()
    return list(processor.applyRGB(list(ORANGE)))


@pytest.mark.parametrize("light", ["Dome", "Rect"])
def test_pixels_of_a_light_are_in_the_rendering_space(tmp_path: Path, light: str) -> None:
    wanted = converted("ocio://default", "lin_rec709_scene", "lin_ap1_scene")
    assert wanted == pytest.approx([0.691, 0.257, 0.087], rel=0.02)
    assert radiance(stage(tmp_path, light, "lin_ap1_scene"), None) == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("light", ["Dome", "Rect"])
def test_the_asked_config_reads_them_and_each_config_its_own(tmp_path: Path, light: str) -> None:
    config = tmp_path / "config.ocio"
    config.write_text(CONFIG.format(name="odd"))
    path = stage(tmp_path, light, "work", 'colorSpace = "odd"')
    wanted = converted(str(config), "odd", "work")
    assert radiance(path, str(config)) == pytest.approx(wanted, rel=1e-4)
    # The config's file has changed: what was read by the old one is not kept.
    config.write_text(CONFIG.format(name="odd").replace("0.5, 0.25", "1.0, 0.00"))
    changed = converted(str(config), "odd", "work")
    assert abs(np.subtract(changed, wanted)).max() > 0.1
    assert radiance(path, str(config)) == pytest.approx(changed, rel=1e-4)


def test_a_config_that_nothing_ties_to_other_spaces_is_said(tmp_path: Path) -> None:
    config = tmp_path / "config.ocio"
    config.write_text(
        "ocio_profile_version: 2.1\nroles: {scene_linear: work, default: work}\n"
        "displays: {screen: [!<View> {name: plain, colorspace: work}]}\n"
        "colorspaces: [!<ColorSpace> {name: work}]\n"
    )
    with pytest.raises(InputError, match="cannot convert"):
        color_of(str(config), "work").to_working(np.ones((1, 3)), "sRGB")


@pytest.mark.parametrize("light", ["Dome", "Rect"])
def test_a_picture_that_was_painted_over_is_read_again(tmp_path: Path, light: str) -> None:
    path = stage(tmp_path, light, USD_DEFAULT_SPACE)
    assert radiance(path, None) == pytest.approx(ORANGE, rel=1e-4)
    picture(tmp_path / "sky.exr", (0.1, 0.3, 0.5))
    assert radiance(path, None) == pytest.approx((0.1, 0.3, 0.5), rel=1e-4)


def test_a_white_ball_under_a_textured_dome(tmp_path: Path) -> None:
    session = Session(stage(tmp_path, "Dome", "lin_ap1_scene"), elements=300)
    shown = session.render(session.camera(None), (32, 32), samples=16)["color"][12:20, 12:20, :3].mean((0, 1))
    assert shown == pytest.approx([0.691, 0.257, 0.087], rel=0.02)


def test_validate_knows_the_colour_spaces_of_the_asked_config(tmp_path: Path, run: Callable) -> None:
    config, shot = tmp_path / "config.ocio", stage(tmp_path, "Dome", "work")
    config.write_text(CONFIG.format(name="odd"))
    (tmp_path / "look.usda").write_text(
        '#usda 1.0\n( customLayerData = { dictionary usdslf = { string workingSpace = "work"\n}\n} )\n'
        'over "m" { over "s" { color3f inputs:diffuseColor = (1, 0, 0) ( colorSpace = "odd" )\n }\n }\n'
    )
    code, out, _ = run("--ocio", config, "review", shot, tmp_path / "look.usda")
    assert code == 0 and "UnknownColorSpace" not in out
    code, out, _ = run("review", shot, tmp_path / "look.usda")
    assert code == 1 and "odd" in out


def test_an_environment_is_taken_whatever_its_colour_space_is_called(tmp_path: Path) -> None:
    write_image(tmp_path / "studio.exr", np.ones((4, 8, 3)), color_space="a space of the studio")
    (tmp_path / "shot").mkdir()
    assert put_environment(tmp_path / "shot", str(tmp_path / "studio.exr")) == "studio.exr"
    (tmp_path / "broken.exr").write_bytes(b"nothing")
    with pytest.raises(InputError):
        put_environment(tmp_path / "shot", str(tmp_path / "broken.exr"))
