"""Which pxr: of the OpenUSD builds that are installed, the one that a process uses.

    find_pxr() -> PxrChoice       which it would be; imports nothing, changes nothing
    choose_pxr() -> PxrChoice     makes `import pxr` give that one; in time only before anything imported pxr

A Hydra viewport needs a pxr with UsdImagingGL.  A studio's own OpenUSD has it, usd-core has not.  The package bpy
carries one, with Storm, in a folder of its own beside Blender's other modules.  A process can hold one pxr alone: the
installed one where it has imaging, else bpy's where that is installed, else the installed one without imaging.  Of
bpy's folder the package pxr alone is taken: its OpenImageIO and OpenColorIO must not stand in for those that this
program uses.  `import bpy` itself is never needed.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

INSTALL = "pip install 'usdslf[hydra]' on Python 3.13 brings one (bpy, GPL-3), a studio's own OpenUSD has one"
# Read by USD when it is loaded.  Software OpenGL pays for each sample of a pixel in full.
QUIET, SAMPLES = "TF_ENV_SETTING_ALERTS_ENABLED", "HDX_MSAA_SAMPLE_COUNT"


@dataclass(frozen=True)
class PxrChoice:
    """The pxr of this process.

    Attributes:
        origin: installed | bpy | none, where there is no pxr at all.
        has_imaging: whether it can draw a Hydra viewport.
        sentence: what it is, or why there is no Hydra viewport and what brings one.
        folder: that holds the package; None where there is none.
    """

    origin: str
    has_imaging: bool
    sentence: str
    folder: Path | None = None


class _PxrOf:
    """Finds the package pxr in one folder, and nothing else there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns where pxr is; None of any other module."""
        return PathFinder.find_spec(name, [str(self.folder)]) if name == "pxr" else None


def find_pxr() -> PxrChoice:
    """Returns the pxr that `choose_pxr` would choose; the one in use where there is one."""
    used = _pxr_in_use()
    if used:
        here = _with_imaging(used)
        if here is not None:
            return _imaging(here)
        why = "the pxr of this process, which was imported before a viewport was asked for, has no UsdImagingGL"
        return PxrChoice("installed", False, f"{why}: the built-in viewport is used; {INSTALL}", used[0].parent)
    installed = _folders("pxr")
    here = _with_imaging(installed) or _with_imaging(_of_bpy())
    if here is not None:
        return _imaging(here)
    why = "the installed pxr has no UsdImagingGL" if installed else "there is no pxr"
    if _folders("bpy"):
        why += ", and the pxr of the installed bpy was not found or is not for this Python"
    sentence = f"{why}: the built-in viewport is used; {INSTALL}"
    return PxrChoice("installed" if installed else "none", False, sentence, installed[0].parent if installed else None)


def choose_pxr() -> PxrChoice:
    """Makes `import pxr` give the pxr that has imaging, if one has; returns which it is.

    Calls after the first change nothing.
    """
    found = find_pxr()
    if not found.has_imaging:
        return found
    if "pxr" not in sys.modules:
        os.environ.setdefault(QUIET, "0")
        if _draws_in_software():
            os.environ.setdefault(SAMPLES, "1")
    if found.origin == "bpy" and found.folder and not any(isinstance(f, _PxrOf) for f in sys.meta_path):
        sys.meta_path.insert(0, _PxrOf(found.folder))
    return found


def _imaging(here: Path) -> PxrChoice:
    """A package pxr that has imaging."""
    is_bpy = any(folder in here.parents for folder in _folders("bpy"))
    whose = "the bpy package, GPL-3" if is_bpy else "the installed OpenUSD"
    sentence = f"Hydra by the UsdImagingGL of {whose}"
    return PxrChoice("bpy" if is_bpy else "installed", True, sentence, here.parent)


def _pxr_in_use() -> list[Path]:
    pxr = sys.modules.get("pxr")
    return [Path(p) for p in pxr.__path__] if pxr is not None else []


def _with_imaging(folders: Iterable[Path]) -> Path | None:
    """The first folder of a package pxr that holds UsdImagingGL."""
    return next((f for f in folders if (f / "UsdImagingGL").is_dir()), None)


def _folders(package: str) -> list[Path]:
    """The folders of an installed package, which is not imported."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        return []
    return [Path(p) for p in (spec.submodule_search_locations or ())] if spec else []


def _of_bpy() -> list[Path]:
    """The folders of pxr within the package bpy that are for this version of Python, the newest first."""
    python = f"python{sys.version_info.major}.{sys.version_info.minor}"
    found = [p for f in _folders("bpy") for p in f.glob("*/python/lib/*/site-packages/pxr")]
    windows = [p for f in _folders("bpy") for p in f.glob("*/python/lib/site-packages/pxr")]
    return sorted([p for p in found if python in p.parts] + windows, reverse=True)


def _draws_in_software() -> bool:
    """Whether this machine has no graphics processor that OpenGL could use, as far as can be seen from outside."""
    if os.environ.get("LIBGL_ALWAYS_SOFTWARE", "") not in ("", "0", "false"):
        return True
    has_any = any(True for pattern in ("dri/render*", "dri/card*", "nvidia[0-9]*") for _ in Path("/dev").glob(pattern))
    return sys.platform == "linux" and not has_any
