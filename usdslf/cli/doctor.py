"""Says what this installation has: versions, devices, colour, Hydra, and the limits that follow."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version

import usdslf
from usdslf.errors import UsdslfError
from usdslf.sampling.hemisphere import D
from usdslf.usd.schema import schema_folder
from usdslf.usd.which_pxr import find_pxr

PACKAGES = (
    "usd-core",
    "embreex",
    "pyopencl",
    "pocl-binary-distribution",
    "OpenImageIO",
    "opencolorio",
    "numpy",
    "scipy",
    "PySide6-Essentials",
    "bpy",
)
OPTIONAL = {"pocl-binary-distribution", "PySide6-Essentials", "bpy"}

Row = tuple[str, str, str]
"""(section, name, value)"""


def diagnose(device: str | None = None, ocio: str | None = None) -> Iterator[Row]:
    """Yields what was found, row by row; a part that fails says so and is raised after the rest.

    Raises: DeviceError without an OpenCL device, InputError for an OpenColorIO config that cannot be used.
    """
    failed: list[UsdslfError] = []
    yield "versions", "usdslf", usdslf.__version__
    yield "versions", "Python", f"{platform.python_version()} on {platform.platform()}"
    for package in PACKAGES:
        yield "versions", package, _version(package)
    yield from _opencl(device, failed)
    yield "rays", "Embree's tree", _tree()
    yield from _color(ocio, failed)
    hydra = find_pxr()
    yield "hydra", "viewport", ("present: " if hydra.has_imaging else "not present: ") + hydra.sentence
    yield from _folders()
    for error in failed:
        raise error


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed" + (" (optional)" if package in OPTIONAL else "; install it with pip")


def _opencl(name: str | None, failed: list[UsdslfError]) -> Iterator[Row]:
    try:
        from usdslf.gpu.device import compiled_for, list_devices, open_device

        for i, ((label, memory), processor) in enumerate(zip(list_devices(), compiled_for())):
            note = f"; compiles for {processor}, as its compiler does not know this processor" if processor else ""
            yield "opencl", f"device {i}", f"{label}, {memory / 2**30:.1f} GiB{note}"
        device = open_device(name)
    except UsdslfError as error:
        yield "opencl", "in use", f"none: {error}"
        failed.append(error)
        return
    yield "opencl", "in use", f"{device.name}, chosen by {_chooser(name)}"
    # The largest array is a radiance field, three floats a direction and element; there are three, and links.
    largest = min(device.largest_array // (12 * D), device.memory // (40 * D))
    yield "limits", "largest array", f"{device.largest_array / 2**30:.1f} GiB"
    yield "limits", "elements", f"at most {largest} with {D} directions each"


def _tree() -> str:
    from usdslf.embree import how_built

    return how_built()


def _chooser(name: str | None) -> str:
    if name is not None:
        return "--device"
    return "PYOPENCL_CTX" if os.environ.get("PYOPENCL_CTX") else "default (a GPU before a CPU)"


def _color(ocio: str | None, failed: list[UsdslfError]) -> Iterator[Row]:
    try:
        from usdslf.color import USD_DEFAULT_SPACE, Color

        yield "colour", "OpenColorIO config", Color(ocio, USD_DEFAULT_SPACE).config_name
    except UsdslfError as error:
        yield "colour", "OpenColorIO config", f"none: {error}"
        failed.append(error)


def _folders() -> Iterator[Row]:
    yield "installation", "Python executable", sys.executable
    try:
        from usdslf.gpu.source import kernel_folder

        yield "installation", "kernels", str(kernel_folder())
    except UsdslfError as error:
        yield "installation", "kernels", str(error)
    yield "installation", "schemas", str(schema_folder() or "missing; reinstall usdslf")
