"""Engine: a stage, drawn by one of the installed render delegates into the framebuffer that is bound.

Pictures are scene-linear and without lights' own shapes; the display pass comes after.  UsdImagingGL takes its OpenGL
state from the thread's current context, so an Engine is made, used and released on one thread.

Imports pxr, as UsdImagingGL has no other door; beside it only usdview's plugin does.  `usdslf.choose_pxr` is to be
asked before, it says whether there is any.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from pxr import CameraUtil, Gf, Tf, Usd, UsdImagingGL, UsdUtils

from usdslf import Camera, LiveStage, Scene, view_and_projection

STORM = "HdStormRendererPlugin"
LEAST_NEAR = 1e-3  # of the far plane, where the camera's own near plane is nearer: depth has 24 bits


@dataclass(frozen=True)
class Delegate:
    """An installed render delegate.

    Attributes:
        id: of its plugin.
        name: for people.
    """

    id: str
    name: str


def delegates() -> list[Delegate]:
    """Returns the installed render delegates, Storm first."""
    found = [
        Delegate(str(i), str(UsdImagingGL.Engine.GetRendererDisplayName(i)))
        for i in UsdImagingGL.Engine.GetRendererPlugins()
    ]
    return sorted(found, key=lambda d: (d.id != STORM, d.name))


class Engine:
    """A stage that is drawn by one render delegate."""

    def __init__(self, live: LiveStage, delegate: str = "") -> None:
        """Begins with nothing drawn; a GL context is current.

        Args:
            live: what is drawn; only changed on this thread.
            delegate: id of one; "": the default, Storm unless the environment says otherwise.
        """
        self.live, self.problem = live, ""
        self._engine = UsdImagingGL.Engine()
        if delegate and not self._engine.SetRendererPlugin(delegate):
            self.problem = f"the render delegate {delegate} cannot be used here; another one is"
        self.delegate = str(self._engine.GetCurrentRendererId())
        # Without an AOV Storm draws no dome; on software OpenGL it comes a little soft (an anisotropic sampler).
        self._engine.SetRendererAov("color")

    def draw(
        self, scene: Scene, camera: Camera, size: tuple[int, int], refine: int = 1,
        shift: tuple[float, float] = (0.0, 0.0),
    ) -> bool:  # fmt: skip
        """Draws a picture, or goes on with it; returns whether it gets no better.

        What USD raises is kept in `problem`: in some contexts Storm posts errors of OpenGL and is right all the same.

        Args:
            scene: the stage as it was read: its frame, bounds and origin.
            camera: relative to the scene's origin.
            size: width and height [pixels].
            refine: levels of subdivision.
            shift: of the picture to the right and up, in widths and heights of it.
        """
        width, height = size
        near, far = depth_range(scene, camera)
        view, projection = view_and_projection(_in_world(camera, scene), width / height, near, far, shift)
        e = self._engine
        e.SetRenderBufferSize(Gf.Vec2i(width, height))
        e.SetFraming(CameraUtil.Framing(Gf.Rect2i(Gf.Vec2i(0, 0), Gf.Vec2i(width - 1, height - 1))))
        e.SetCameraState(Gf.Matrix4d(view.T.tolist()), Gf.Matrix4d(projection.T.tolist()))
        unsaid = UsdUtils.CoalescingDiagnosticDelegate()  # oddities of a stage; `usdslf info` says what matters of them
        try:
            e.Render(self.live.stage.GetPseudoRoot(), _parameters(scene, refine))
        except Tf.ErrorException as error:
            self.problem = next((line.strip() for line in str(error).splitlines() if line.strip()), "an error of USD")
        finally:
            unsaid.TakeUncoalescedDiagnostics()
            del unsaid
        return bool(e.IsConverged())

    def release(self) -> None:
        """Gives back what it holds of OpenGL; its context is current, and nothing is called afterwards."""
        del self._engine
        self.live.close()


def depth_range(scene: Scene, camera: Camera) -> tuple[float, float]:
    """Returns depths of the near and the far plane [stage units] between which all of a scene can be seen.

    Args:
        scene: its bounds are looked at.
        camera: its own clipping planes hold.
    """
    low, high = scene.bounds
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    depth = (camera.world_from_camera[:3, 3] - corners) @ camera.world_from_camera[:3, 2]
    margin = 0.01 * max(scene.diagonal, 1e-9)
    far = min(camera.far, max(float(depth.max()) + margin, margin))
    nearest = max(float(depth.min()) - margin, LEAST_NEAR * far) if camera.perspective else float(depth.min()) - margin
    near = max(nearest, camera.near) if camera.perspective or camera.near > 0 else nearest
    return near, max(far, near + margin)


def _in_world(camera: Camera, scene: Scene) -> Camera:
    """The camera where the stage has it: positions of records are relative to the scene's origin."""
    world = np.array(camera.world_from_camera, np.float64)
    world[:3, 3] += scene.origin
    return replace(camera, world_from_camera=world)


def _parameters(scene: Scene, refine: int) -> UsdImagingGL.RenderParams:
    p = UsdImagingGL.RenderParams()
    p.frame = Usd.TimeCode.EarliestTime() if math.isnan(scene.frame) else Usd.TimeCode(scene.frame)
    p.complexity = 1.0 + 0.1 * refine
    p.drawMode = UsdImagingGL.DrawMode.DRAW_SHADED_SMOOTH
    p.cullStyle = UsdImagingGL.CullStyle.CULL_STYLE_NOTHING
    p.showProxy, p.showGuides, p.showRender = False, False, True
    p.enableLighting = p.enableSceneLights = p.enableSceneMaterials = True
    p.colorCorrectionMode = "disabled"
    p.clearColor = Gf.Vec4f(0, 0, 0, 0)
    return p
