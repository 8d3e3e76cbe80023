"""Triangles to Embree's tree, which is built while other threads use Python.

This is the only module that imports embreex.  embreex builds the tree in the first `EmbreeScene.run`, and holds
Python's lock over it: .4 s for a million triangles, in which a window stands still.  A call through ctypes gives the
lock away, so the same function of the same library, `rtcCommitScene`, is called here that way, and the scene is marked
as built.

It needs the address of Embree's scene, which embreex has no function for.  embreex ships what other Cython modules
would get it by, the declaration of its classes (`.pxd`): three words after the head of the object, the scene, an int
that Python can write, and the device.  Nothing is called before all of this holds (`_handles`):

* the declarations are those, word by word, and the objects have as many bytes as they say;
* the int lies where it is declared: it is written through Python and read there;
* the device is the one that the scene was made with, and of the third word nothing else is left than the scene;
* the library's version, asked for the device, is the one that embreex was compiled for;
* the library names that device as the one the scene was made on.

Where one of them fails, embreex builds the tree itself, and the log and `usdslf doctor` say so, and why.

embreex prints Embree's errors by a function that must hold Python's lock.  It is taken off before the call, and an
error is raised here.
"""

from __future__ import annotations

import ctypes
import logging
import re
import sys
from collections.abc import Iterator
from functools import cache
from importlib.metadata import files
from pathlib import Path

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from usdslf.errors import MemoryError_, UsdslfError
from usdslf.progress import in_blocks

BLOCK = 256  # triangles that are handed to Embree in one call, which holds the GIL for less than 1 ms
DECLARED = {
    "rtcore": ("EmbreeDevice", ("RTCDevice device",)),
    "rtcore_scene": ("EmbreeScene", ("RTCScene scene_i", "public int is_committed", "rtc.EmbreeDevice device")),
}
"""The attributes of embreex's classes, by the file that declares them."""
WORD = ctypes.sizeof(ctypes.c_void_p)
HEAD = object.__basicsize__  # bytes of an object before its attributes
MARKS = (0x5A5AA5A5, 0x25DB3C6E, 0)  # values that are written to find the int, the last of them the one it had
VERSION = 0  # RTC_DEVICE_PROPERTY_VERSION
OUT_OF_MEMORY = 4  # RTC_ERROR_OUT_OF_MEMORY

_log = logging.getLogger(__name__)
_said: set[str] = set()  # reasons that were spoken of


class Unlike(Exception):
    """embreex is not as this module knows it; the sentence says in what."""


def build_tree(corners: NDArray[np.float32]) -> tuple[EmbreeScene, list[int]]:
    """Builds the tree of triangles, telling between blocks of them.

    Args:
        corners: (T, 3, 3), finite.

    Returns: embreex's scene, to be asked by `run`, and the first triangle of each of its meshes.

    Raises: MemoryError_ where they are too many for the memory.
    """
    device = EmbreeDevice()
    scene = EmbreeScene(device)
    starts = [rows.start for rows in _hand_over(scene, corners)]
    _build(scene, device)
    return scene, starts


def _build(scene: EmbreeScene, device: EmbreeDevice) -> None:
    """Builds the tree of what was handed over, as embreex does where it is not as known."""
    try:
        library = _library()
        handles = _handles(library, scene, device)
    except Unlike as why:
        if str(why) not in _said:
            _said.add(str(why))
            _log.warning("a window stands still while Embree builds its tree: %s", why)
        scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    else:
        _commit(library, *handles)
        scene.is_committed = 1


def how_built() -> str:
    """Says whether trees are built beside other threads, and if not, why."""
    device = EmbreeDevice()
    try:
        _handles(_library(), EmbreeScene(device), device)
    except Unlike as why:
        return f"built while all of Python waits: {why}"
    return "built while the rest of Python goes on"


def _hand_over(scene: EmbreeScene, corners: NDArray[np.float32]) -> Iterator[slice]:
    """Makes Embree's meshes of triangles (T, 3, 3), yields the rows of each, and tells after it."""
    for rows in in_blocks(len(corners), BLOCK):
        TriangleMesh(scene, corners[rows])  # of corners, not of points: it holds the GIL, for less long that way
        yield rows


def _commit(library: ctypes.CDLL, scene: int, device: int) -> None:
    """Builds the tree of a scene.  Each of these calls gives Python's lock away."""
    library.rtcSetDeviceErrorFunction(ctypes.c_void_p(device), None, None)
    library.rtcGetDeviceError(ctypes.c_void_p(device))  # forgets an earlier one
    library.rtcCommitScene(ctypes.c_void_p(scene))
    error = library.rtcGetDeviceError(ctypes.c_void_p(device))
    if error == OUT_OF_MEMORY:
        raise MemoryError_("the triangles are too many for Embree's tree in this machine's memory")
    if error:
        raise UsdslfError(f"the tree of rays cannot be built: Embree gives error {error} (RTCError)")


@cache
def _library() -> ctypes.CDLL:
    """The library that embreex calls.

    Raises: Unlike where it is not found.
    """
    # Linux and macOS look a name up in a module and in all that it was linked with.
    try:
        linked = ctypes.CDLL(rtcore_scene.__file__)
    except OSError as why:
        raise Unlike(f"embreex's module is no library that can be asked: {why}") from why
    if hasattr(linked, "rtcCommitScene"):
        return linked
    if sys.platform == "win32":
        loaded = ctypes.WinDLL("kernel32").GetModuleHandleW
        loaded.restype, loaded.argtypes = ctypes.c_void_p, [ctypes.c_wchar_p]
        for file in files("embreex") or ():
            path = str(file.locate())
            if re.fullmatch(r"embree\d.*\.dll", file.name) and (handle := loaded(path)):
                return ctypes.CDLL(path, handle=handle)
    raise Unlike("Embree's library is not found in what embreex loaded")


def _handles(library: ctypes.CDLL, scene: EmbreeScene, device: EmbreeDevice) -> tuple[int, int]:
    """Returns the addresses of Embree's scene and device.

    Args:
        library: that they are of.
        scene: not built yet, nor known to another thread.
        device: that it was made with.

    Raises: Unlike where one of the checks above fails.
    """
    if reason := _other_declaration():
        raise Unlike(reason)
    for each, words in ((scene, 3), (device, 1)):
        if type(each).__basicsize__ != HEAD + words * WORD or type(each).__itemsize__:
            raise Unlike(f"embreex's {type(each).__name__} has {type(each).__basicsize__} bytes")
    scene_i, committed, its_device = (ctypes.c_void_p.from_address(id(scene) + HEAD + k * WORD) for k in range(3))
    for mark in MARKS:
        scene.is_committed = mark
        if ctypes.c_int.from_buffer(committed).value != mark:
            scene.is_committed = 0
            raise Unlike("embreex's EmbreeScene.is_committed lies elsewhere")
    handle = ctypes.c_void_p.from_address(id(device) + HEAD).value
    if its_device.value != id(device) or not handle or not scene_i.value:
        raise Unlike("embreex's EmbreeScene holds no device and scene where it is declared to")
    known = re.search(r"(\d+)\.(\d+)\.(\d+)", repr(device))
    version = _asked(library, "rtcGetDeviceProperty", ctypes.c_ssize_t, handle, VERSION)
    if not known or version != sum(int(n) * place for n, place in zip(known.groups(), (10000, 100, 1))):
        raise Unlike(f"Embree's library says that it is version {version}, embreex: {device!r}")
    owner = _asked(library, "rtcGetSceneDevice", ctypes.c_void_p, scene_i.value)
    if owner:
        library.rtcReleaseDevice(ctypes.c_void_p(owner))  # to name it counts as holding it
    if owner != handle:
        raise Unlike("Embree's library does not know the scene")
    return scene_i.value, handle


def _asked(library: ctypes.CDLL, name: str, returned: type, handle: int, *more: int) -> int | None:
    function = getattr(library, name)
    function.restype = returned
    found: int | None = function(ctypes.c_void_p(handle), *more)
    return found


@cache
def _other_declaration() -> str:
    """Says what embreex declares otherwise than this module knows it; "" where it is as known."""
    if sys.implementation.name != "cpython":
        return f"of {sys.implementation.name} it is not known where objects lie"
    folder = Path(rtcore_scene.__file__).parent
    for file, (name, known) in DECLARED.items():
        try:
            text = (folder / f"{file}.pxd").read_text("utf-8")
        except OSError:
            return f"embreex brings no {file}.pxd"
        if declared_attributes(text, name) != known:
            return f"embreex's {file}.pxd declares {name} otherwise"
    return ""


def declared_attributes(text: str, name: str) -> tuple[str, ...]:
    """Returns what a .pxd, `text`, declares within a `cdef class`, `name`, without comments and `cdef`."""
    body = re.search(rf"^cdef class {name}:\n((?:[ \t]+.*\n|[ \t]*\n)*)", text + "\n", re.MULTILINE)
    lines = [" ".join(line.partition("#")[0].split()) for line in (body[1] if body else "").splitlines()]
    return tuple(line.removeprefix("cdef ") for line in lines if line)
