"""What Hydra draws, in a process of its own: `python kit/hydra_pictures.py FOLDER` writes FOLDER/pictures.npz.

A process has one pxr, and the tests' own has the installed one.  This one chooses as the viewer does.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from usdslf import choose_pxr

CHOICE = choose_pxr()

from kit.hydra_colors import GLOW  # noqa: E402
from kit.stage_parts import StageBuilder, ball, box, torus  # noqa: E402
from kit.stage_textures import write_image  # noqa: E402
from kit.variant_pictures import variant_pictures  # noqa: E402
from pxr import Gf, UsdGeom  # noqa: E402
from PySide6.QtGui import QImage, QOffscreenSurface, QOpenGLContext  # noqa: E402
from PySide6.QtWidgets import QWidget  # noqa: E402

from hydra_viewer.hydra.engine import STORM, Engine, delegates  # noqa: E402
from hydra_viewer.ui.application import make_application  # noqa: E402
from hydra_viewer.ui.gl_picture import GlPicture  # noqa: E402
from hydra_viewer.ui.hydra_renderer import surface_format  # noqa: E402
from hydra_viewer.ui.hydra_viewport import HydraViewport, hydra_kinds  # noqa: E402
from hydra_viewer.ui.viewport import Shown  # noqa: E402
from usdslf import CHANNELS, Camera, DisplayPass, DisplaySettings, LiveStage, Shot, camera_rays, color_of  # noqa: E402

SIZE = (320, 180)
LOOK = """#usda 1.0
over "World"
{
    over "mtl"
    {
        over "grey"
        {
            over "surface"
            {
                color3f inputs:diffuseColor = (0.8, 0, 0)
            }
        }
    }
}
"""


def glowing(folder: Path, away: float) -> Path:
    """Shapes that each glow in a colour of their own and reflect nothing, some way off the origin."""
    b = StageBuilder(folder)
    b.stage.GetPrimAtPath("/World").GetAttribute("xformOpOrder").Clear()
    UsdGeom.Xform(b.stage.GetPrimAtPath("/World")).AddTranslateOp().Set(Gf.Vec3d(away, -away, 0))
    shapes = {"ball": ball(0.5), "box": box(0.7, 0.5, 0.6), "ring": torus(), "floor": box(4.0, 0.1, 3.0)}
    places = {"ball": (-0.8, 0.5, 0), "box": (0.5, 0, 0.2), "ring": (0.1, 0.9, -0.6), "floor": (0, -0.2, 0)}
    for name, data in shapes.items():
        material = b.material(
            f"{name}_glow", diffuseColor=(0.0, 0.0, 0.0), specularColor=(0.0, 0.0, 0.0), useSpecularWorkflow=1.0,
            emissiveColor=GLOW[name],
        )  # fmt: skip
        b.mesh(name, data, material, places[name], 25.0)
    b.distant_light("sun", (0, -1, -1), 1.0, 1e-6)
    b.camera((1.2, 1.6, 3.4), (0, 0.3, 0))
    return b.save()


def lit(folder: Path) -> Path:
    """A grey ball under a lamp; the kit's balls are inside out, which Storm minds."""
    b = StageBuilder(folder)
    path = b.mesh("ball", ball(0.6), b.material("grey", diffuseColor=(0.4, 0.4, 0.4), roughness=0.5))
    mesh = UsdGeom.Mesh(b.stage.GetPrimAtPath(path))
    mesh.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    mesh.GetNormalsAttr().Set(-np.array(mesh.GetNormalsAttr().Get()))
    b.rect_light("lamp", (1, 2, 2), (0, 0.6, 0), 1.5, 1.5, (8, 8, 8))
    b.camera((0, 0.9, 2.4), (0, 0.6, 0))
    return b.save()


def dark(folder: Path) -> Path:
    """A white wall without light."""
    b = StageBuilder(folder)
    b.mesh("wall", box(4, 4, 0.1), b.material("white", diffuseColor=(1.0, 1.0, 1.0), roughness=1.0))
    b.camera((0, 2, 3), (0, 2, 0))
    return b.save()


def under_sky(folder: Path) -> Path:
    """A small box below a blue dome."""
    b = StageBuilder(folder)
    b.mesh("box", box(0.2, 0.2, 0.2), b.material("grey", diffuseColor=(0.4, 0.4, 0.4)))
    write_image(folder / "sky.exr", np.full((16, 32, 3), (0.2, 0.4, 0.8), np.float32))
    b.dome_light("sky", 1.0, texture="sky.exr")
    b.camera((0, 0.1, 2), (0, 0.1, 0))
    return b.save()


def shot_of(write: Callable[..., Path], folder: Path, *arguments: float) -> Shot:
    folder.mkdir()
    return Shot.open(str(write(folder, *arguments)))


def cameras_of(camera: Camera) -> dict[str, Camera]:
    """One that is wider than the picture, one that looks past the middle of its film, one without perspective."""
    offset = replace(camera, horizontal_offset=camera.horizontal_aperture / 6, vertical_offset=-2.0)
    flat = replace(camera, perspective=False, horizontal_aperture=40.0, vertical_aperture=30.0)
    return {"plain": camera, "offset": offset, "orthographic": flat}


def traced(shot: Shot, camera: Camera) -> np.ndarray:
    """Which mesh each pixel's middle shows, by the program's own rays: its number, -1 for none."""
    w, h = SIZE
    x, y = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
    rays = camera_rays(camera, np.stack([x.ravel(), y.ravel()], 1), w / h)
    hits = shot.tracer.intersect(rays.origin, rays.direction)
    mesh = np.where(hits.triangle < 0, -1, shot.scene.triangles.mesh[np.maximum(hits.triangle, 0)])
    names = [m.path.rsplit("/", 1)[-1] for m in shot.scene.meshes]
    number = np.array([*(list(GLOW).index(n) for n in names), -1])
    return number[mesh].reshape(h, w)


def geometry(folder: Path) -> dict[str, np.ndarray]:
    """The same cameras by Hydra and by rays."""
    out: dict[str, np.ndarray] = {}
    picture = GlPicture()
    picture.resize(SIZE)
    for place, away in (("near", 0.0), ("far", 3000.0)):
        shot = shot_of(glowing, folder / place, away)
        engine = Engine(LiveStage.of(shot.stage, shot.scene))
        for name, camera in cameras_of(shot.camera()).items():
            with picture.linear():
                engine.draw(shot.scene, camera, SIZE)
            picture.add(1)
            out[f"{place} {name} drawn"], out[f"{place} {name} traced"] = picture.pixels(), traced(shot, camera)
        out[f"{place} origin"] = np.array(shot.scene.origin)
        engine.release()
    for name, write in (("sky", under_sky), ("dark", dark)):
        shot = shot_of(write, folder / name)
        engine = Engine(LiveStage.of(shot.stage, shot.scene))
        with picture.linear():
            engine.draw(shot.scene, shot.camera(), SIZE)
        picture.add(1)
        out[name] = picture.pixels()
        engine.release()
    picture.release()
    return out


def alternatives(folder: Path) -> dict[str, np.ndarray]:
    """Selections of a look that holds alternatives."""
    picture, at = GlPicture(), list[Camera]()
    picture.resize(SIZE)

    def draw(shot: Shot) -> np.ndarray:
        at.append(shot.camera())
        engine = Engine(LiveStage.of(shot.stage, shot.scene))
        with picture.linear():
            engine.draw(shot.scene, at[0], SIZE)
        picture.add(1)
        engine.release()
        return np.array(picture.pixels())

    out = variant_pictures(folder / "alternatives", draw)
    picture.release()
    return out


def display(_: Path) -> dict[str, np.ndarray]:
    """The display pass on the GPU over pixels that the test knows, beside the processor's."""
    rng = np.random.default_rng(5)
    level, hue = 0.18 * 2 ** rng.uniform(-9, 7, (*SIZE[::-1], 1)), rng.dirichlet([1, 1, 1], SIZE[::-1]) * 3
    mixed = rng.uniform(0, 1, (*SIZE[::-1], 1))
    pixels = (level * (mixed * hue + 1 - mixed)).astype(np.float32)
    pixels[0, :3] = np.array([np.nan, np.inf, -np.inf])[:, None]
    pixels[1, 0] = 0.18, np.nan, 0.18
    color, picture = color_of(None, "lin_rec709_scene"), GlPicture()
    picture.put(pixels)
    out = {"pixels": pixels, "pixels back": picture.pixels()}
    settings = {c: DisplaySettings(channel=c) for c in CHANNELS}
    settings |= {"exposed": DisplaySettings(exposure=1.5), "gamma": DisplaySettings(exposure=-1.0, gamma=1.7)}
    for name, s in settings.items():
        image = picture.codes(DisplayPass.of(color, s), s)
        rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)[:, : image.width(), 2::-1]
        out[f"gpu {name}"], out[f"cpu {name}"] = rows.copy(), DisplayPass.of(color, s).codes(pixels, s)
    picture.release()
    return out


class Shows:
    """A viewport in a window, and what it told."""

    def __init__(self, shot: Shot) -> None:
        self.application = make_application()
        self.window = QWidget()
        self.viewport = HydraViewport(self.window)
        self.viewport.widget.resize(*SIZE)
        self.window.resize(*SIZE)
        self.said: list[str] = []
        self.viewport.failed.connect(self.said.append)
        self.window.show()
        self.shot = shot

    def _is_drawn(self, share: float) -> bool:
        drawn, wished = self.viewport._drawn, self.viewport._renderer._wish
        return drawn is not None and drawn.wish is wished and drawn.share >= share

    def wait(self, act: Callable[[], Any], share: float = 0.0) -> np.ndarray:
        """Does something, and waits for the picture after it, as far as asked; returns the code values."""
        act()
        end = time.monotonic() + 120
        while not (self.said or self._is_drawn(share)) and time.monotonic() < end:
            self.application.processEvents()
            time.sleep(0.002)
        image = self.viewport.widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
        rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)
        return rows[:, : image.width(), 2::-1].copy()


def viewport(folder: Path) -> dict[str, np.ndarray]:
    """First picture, orbit, a look, display, another size, an error, the end."""
    shot = shot_of(lit, folder / "lit")
    camera = shot.camera()
    before = shot.source.GetRootLayer().ExportToString()
    moved = camera.world_from_camera.copy()
    moved[0, 3] += 0.4
    look = folder / "look.usda"
    look.write_text(LOOK)
    shows = Shows(shot)
    v, out = shows.viewport, {}

    def begin() -> None:
        v.show_shot(Shown(shot, shot))
        v.set_camera(camera, False)

    out["first"] = shows.wait(begin, 1.0)
    out["first linear"] = v.pixels()
    out["moving"] = shows.wait(lambda: v.set_camera(replace(camera, world_from_camera=moved), True))
    out["moving linear"] = v.pixels()
    out["back"] = shows.wait(lambda: v.set_camera(camera, False), 1.0)
    out["red"] = shows.wait(lambda: v.show_shot(Shown(shot, shot, str(look))))
    out["red linear"] = v.pixels()
    out["without"] = shows.wait(lambda: v.show_shot(Shown(shot, shot)), 1.0)
    out["without linear"] = v.pixels()
    settings = DisplaySettings(exposure=1.0, channel="green")
    out["green"] = shows.wait(lambda: v.set_display(settings))
    color = color_of(None, shot.scene.working_space)
    out["green expected"] = DisplayPass.of(color, settings).codes(v.pixels(), settings)
    out["unchanged"] = np.array(shot.source.GetRootLayer().ExportToString() == before)
    assert not shows.said, shows.said
    shows.wait(lambda: v.set_display(DisplaySettings(view="Sepia")))
    out["error"] = np.array(shows.said)
    shows.said.clear()
    out["after error"] = shows.wait(lambda: v.set_display(DisplaySettings()), 1.0)
    out["end"] = np.array(ended(shows))
    return out


def ended(shows: Shows) -> bool:
    """Stops the viewport as the window does; whether its thread ends."""
    renderer = shows.viewport._renderer
    shows.viewport.stop()
    shows.viewport.widget.deleteLater()
    renderer._thread.join(60)
    shows.application.processEvents()
    return not renderer._thread.is_alive()


def main(folder: Path) -> None:
    application = make_application()
    surface = QOffscreenSurface()
    surface.setFormat(surface_format())
    surface.create()
    context = QOpenGLContext()
    context.setFormat(surface_format())
    assert context.create() and context.makeCurrent(surface)
    kinds = [k.name for k in hydra_kinds()]
    out: dict[str, np.ndarray] = {"kinds": np.array(kinds), "storm": np.array(STORM in [d.id for d in delegates()])}
    out["choice"] = np.array(CHOICE.sentence)
    for part in (geometry, alternatives, display):
        out |= part(folder)
    context.doneCurrent()
    out |= viewport(folder)
    np.savez(folder / "pictures.npz", **out)
    del application


if __name__ == "__main__":
    main(Path(sys.argv[1]))
