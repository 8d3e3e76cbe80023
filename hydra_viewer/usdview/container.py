"""Container: a command in usdview's menu that opens the painting window on usdview's stage, frame and camera.

usdview runs in one process with one pxr, its own.  The window reads a stage of its own over the same layers, with a
copy of the session layer: what is done in usdview meanwhile does not reach it, and nothing is written to either.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd
from pxr.Usdviewq.plugin import PluginContainer

from hydra_viewer.ui import words
from usdslf import Camera, Shot

_open_windows: dict[int, Any] = {}  # Qt keeps no Python object


class UsdslfContainer(PluginContainer):
    """What usdview finds by plugInfo.json."""

    def registerPlugins(self, plugRegistry: Any, usdviewApi: Any) -> None:
        """Adds the command."""
        self._paint = plugRegistry.registerCommandPlugin(
            "UsdslfContainer.paint", words.USDVIEW_PAINT[0], paint, words.USDVIEW_PAINT[1]
        )

    def configureView(self, plugRegistry: Any, plugUIBuilder: Any) -> None:
        """Adds the menu."""
        plugUIBuilder.findOrCreateMenu(words.TITLE).addItem(self._paint)


Tf.Type.Define(UsdslfContainer)


def paint(usdview: Any) -> Any:
    """Opens the painting window; returns it, None where that cannot be.

    Args:
        usdview: UsdviewApi: its stage, frame and camera are looked at, and its status line is written to.
    """
    try:
        from PySide6.QtCore import Qt
        from PySide6.QtWidgets import QApplication

        from hydra_viewer.ui.window import Window
    except ImportError as error:
        usdview.PrintStatus(words.usdview_without_qt(error))
        return None
    if QApplication.instance() is None:  # this usdview runs on another binding of Qt
        usdview.PrintStatus(words.USDVIEW_OTHER_QT)
        return None
    frame, seen_by = usdview.frame, usdview.currentGfCamera
    shot = Shot.open(own_stage(usdview.stage), None if frame.IsDefault() else frame.GetValue())
    window = Window()
    window.filing.open_shot(shot, camera=None if seen_by is None else lambda shot: camera_of(seen_by, shot))
    window.show()
    window.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)  # usdview goes on, and ends with nothing of it left
    _open_windows[id(window)] = window
    window.destroyed.connect(partial(_forget, id(window)))
    return window


def _forget(key: int) -> None:
    """A window is closed; with the last one Python frees cycles by itself again."""
    from PySide6.QtCore import QTimer

    from hydra_viewer.ui.collector import collect_anywhere

    _open_windows.pop(key, None)
    if not _open_windows:
        QTimer.singleShot(0, collect_anywhere)


def own_stage(stage: Usd.Stage) -> Usd.Stage:
    """Returns another stage of the same layers, with a copy of the session layer as it is now."""
    session = Sdf.Layer.CreateAnonymous("session.usda")
    session.TransferContent(stage.GetSessionLayer())
    found = Usd.Stage.OpenMasked(
        stage.GetRootLayer(), session, stage.GetPathResolverContext(), stage.GetPopulationMask(), Usd.Stage.LoadNone
    )
    found.MuteAndUnmuteLayers(stage.GetMutedLayers(), [])
    found.SetLoadRules(stage.GetLoadRules())
    return found


def camera_of(seen_by: Gf.Camera, shot: Shot) -> Camera:
    """Returns a camera of USD's as the program's own, relative to the origin of the shot's scene."""
    world = np.array(seen_by.transform, np.float64).T
    world[:3, 3] -= shot.scene.origin
    clipped = seen_by.clippingRange
    return Camera(
        "",
        world,
        seen_by.horizontalAperture,
        seen_by.verticalAperture,
        seen_by.focalLength,
        seen_by.horizontalApertureOffset,
        seen_by.verticalApertureOffset,
        seen_by.projection == Gf.Camera.Perspective,
        clipped.min,
        clipped.max,
    )
