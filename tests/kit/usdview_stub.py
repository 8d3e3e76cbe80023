"""A stand-in for usdview, which no package holds: the names of pxr.Usdviewq that a plugin meets, and an api.

`python kit/usdview_stub.py STAGE` loads the plugin as usdview does, by its type from USD's plugin registry, triggers
its menu item, and prints what the window shows as JSON.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import threading
import time
import types
from pathlib import Path
from typing import Any

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from pxr import Gf, Plug, Tf, Usd, UsdGeom
from PySide6.QtWidgets import QApplication, QMainWindow


class PluginContainer:
    """Base of containers."""


package, module = types.ModuleType("pxr.Usdviewq"), types.ModuleType("pxr.Usdviewq.plugin")
module.PluginContainer = PluginContainer  # type: ignore[attr-defined]
PluginContainer.__module__ = module.__name__
sys.modules |= {package.__name__: package, module.__name__: module}
CONTAINER = Tf.Type.Define(PluginContainer)


class Registry:
    """Keeps commands by name."""

    def __init__(self, api: Any) -> None:
        self.api, self.commands = api, {}

    def registerCommandPlugin(self, name: str, display: str, callback: Any, description: str = "") -> Any:
        self.commands[name] = types.SimpleNamespace(displayName=display, run=lambda: callback(self.api))
        return self.commands[name]


class Builder:
    """Adds items to the menus of a window."""

    def __init__(self, window: QMainWindow) -> None:
        self.window = window

    def findOrCreateMenu(self, name: str) -> Any:
        menu = self.window.menuBar().addMenu(name)
        return types.SimpleNamespace(addItem=lambda command: menu.addAction(command.displayName, command.run))


class Api:
    """What a plugin sees of usdview."""

    def __init__(self, stage: Usd.Stage, window: QMainWindow | None) -> None:
        self.stage, self.frame, self.qMainWindow = stage, Usd.TimeCode(3.0), window
        self.currentGfCamera = Gf.Camera()
        self.currentGfCamera.transform = Gf.Matrix4d().SetTranslate((0.25, 0.5, 4.0))
        self.currentGfCamera.focalLength = 42.0
        self.said: list[str] = []

    def PrintStatus(self, message: str) -> None:
        self.said.append(message)


def containers() -> list[type]:
    """Loads the plugins that USD knows, and returns the classes of their containers."""
    found = []
    for kind in Plug.Registry.GetAllDerivedTypes(CONTAINER):
        Plug.Registry().GetPluginForType(kind).Load()
        found.append(kind.pythonClass)
    return found


def main(path: Path) -> None:
    # Another binding of Qt has no application of PySide6.
    stage = Usd.Stage.Open(str(path))
    api = Api(stage, None)
    (container,) = (c() for c in containers())
    registry = Registry(api)
    container.registerPlugins(registry, api)
    (command,) = registry.commands.values()
    assert command.run() is None
    out: dict[str, Any] = {"commands": list(registry.commands), "other Qt": list(api.said)}

    application = QApplication([])
    api.qMainWindow = QMainWindow()
    stage.SetEditTarget(stage.GetSessionLayer())
    UsdGeom.Imageable(stage.GetPrimAtPath("/World/hidden")).MakeInvisible()
    container.configureView(registry, Builder(api.qMainWindow))
    menu = api.qMainWindow.menuBar().actions()[0].menu()
    out["menu"] = [menu.title(), *(a.text() for a in menu.actions())]
    before = stage.GetSessionLayer().ExportToString()
    menu.actions()[0].trigger()
    from hydra_viewer.usdview.container import _open_windows

    (window,) = _open_windows.values()
    end = time.monotonic() + 120
    while (window.document.shot is None or window.easel.view is None) and time.monotonic() < end:
        application.processEvents()
        time.sleep(0.005)
    application.processEvents()
    shot, camera = window.document.shot, window.easel.view.camera
    out |= {
        "meshes": [m.path for m in shot.scene.meshes],
        "frame": shot.scene.frame,
        "eye": camera.world_from_camera[:3, 3].tolist(),
        "focal length": camera.focal_length,
        "session is the same": stage.GetSessionLayer().ExportToString() == before,
        "stage is another": shot.source != stage and shot.source.GetRootLayer() == stage.GetRootLayer(),
        "visible": window.isVisible(),
        "files": window.document.files.stage,
    }
    window.close()
    del window, shot
    end = time.monotonic() + 20
    while (_open_windows or not gc.isenabled() or threading.active_count() > 1) and time.monotonic() < end:
        application.processEvents()
        time.sleep(0.005)
    out["left behind"] = [len(_open_windows), gc.isenabled(), [t.name for t in threading.enumerate()[1:]]]
    print(json.dumps(out), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
