"""Shot cache: the slow parts of a Shot, kept in the user's cache folder, so that a second start is quick.

    ShotCache(scene, lights, device, count) .elements(compute) .lookup .visibility .fixed_light .radiance

Each part is named by all that it is computed from: by values and never by a file's name or time, by the text of this
program's modules and kernels, by the versions of the libraries beneath, and where the device computes it by the device.
So nothing has to be invalidated, and what is read is byte for byte what would be computed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf import cache
from usdslf.color import color_of
from usdslf.elements.elements import Elements
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import Device
from usdslf.gpu.source import kernel_folder
from usdslf.light_field.visibility import Visibility
from usdslf.rays import RayTracer
from usdslf.scene.fingerprint import appearance_of, digest, geometry_of
from usdslf.scene.records import Light, Scene
from usdslf.textures.files import file_of, stamp_of

VERSION = 1  # raise it when entries hold something else
KINDS = ("elements", "lookup", "visibility", "light", "field", "near")  # of entries of shots, a word each
BENEATH = ("numpy", "scipy", "embreex", "pyopencl")

Arrays = Mapping[str, NDArray]


@dataclass(frozen=True)
class ShotCache:
    """What is kept of one Shot.

    Attributes:
        scene: as it was read.
        lights: that shine, the stated default too.
        device: that computes.
        count: elements that are asked for.
    """

    scene: Scene
    lights: tuple[Light, ...]
    device: Device
    count: int

    def elements(self, compute: Callable[[], Elements]) -> Elements:
        """Returns the elements of the shot."""
        found = self._kept("elements", lambda: _arrays_of(compute()), self._appearance, self.count)
        return Elements(**found)

    def lookup(self, elements: Elements, tracer: RayTracer) -> ElementLookup:
        """Returns the tables of near elements."""
        made: list[ElementLookup] = []

        def compute() -> Arrays:
            made.append(ElementLookup(self.scene, tracer, elements))
            return made[0].tables

        found = self._kept("lookup", compute, self._laid(elements))
        return made[0] if made else ElementLookup.of_tables(self.scene, elements, found)

    def visibility(self, elements: Elements, compute: Callable[[], Visibility]) -> Visibility:
        """Returns what the elements see."""

        def arrays() -> Arrays:
            found = compute()
            return {"hit": found.hit, "rays": np.array(found.rays), "seconds": np.array(found.seconds)}

        found = self._kept("visibility", arrays, self._laid(elements), self._device)
        return Visibility(found["hit"], int(found["rays"]), float(found["seconds"]))

    def fixed_light(self, elements: Elements, compute: Callable[[], NDArray]) -> NDArray[np.float32]:
        """Returns the light (N, D, 3) that no edit changes."""
        parts = (self._appearance, self._laid(elements), self._device)
        return self._kept("light", lambda: {"light": compute()}, *parts)["light"]

    def radiance(
        self, elements: Elements, model: str, bounces: int, stored: str, compute: Callable[[], NDArray]
    ) -> NDArray[np.float32]:
        """Returns the outgoing radiance (N, D, 3) of a light field after its bounces from the dark."""
        parts = (self._appearance, digest(elements, contents), self._device, model, bounces, stored)
        return self._kept("field", lambda: {"radiance": compute()}, *parts)["radiance"]

    def _kept(self, kind: str, compute: Callable[[], Arrays], *parts: str | int) -> dict[str, NDArray]:
        assert kind in KINDS
        return cache.arrays(cache.address(kind, VERSION, program_code(), *parts), compute, of_shot=True)

    @cached_property
    def _appearance(self) -> str:
        """Names all that light depends on."""
        color = color_of(self.scene.ocio or None, self.scene.working_space)
        return digest((appearance_of(self.scene), self.lights, color.cache_id), contents)

    @cached_property
    def _geometry(self) -> str:
        return digest(geometry_of(self.scene), contents)

    @cached_property
    def _device(self) -> str:
        return self.device.name + " " + self.device.driver

    def _laid(self, elements: Elements) -> str:
        """Names what rays of the elements meet."""
        names = ("position", "geometric_normal", "normal", "frame", "area", "triangle", "barycentric", "part", "side")
        return digest([self._geometry, elements.part_of_triangle, *(getattr(elements, n) for n in names)], contents)


def _arrays_of(elements: Elements) -> Arrays:
    return {f.name: getattr(elements, f.name) for f in fields(elements)}


def contents(path: str) -> bytes:
    """Names the contents of a file, also of one within a package; all that are not there have one name."""
    return _contents(path, stamp_of(path))


@lru_cache(4096)
def _contents(path: str, stamp: tuple[int, int]) -> bytes:
    code = hashlib.blake2b(digest_size=20)
    try:
        with open(file_of(path), "rb") as file:
            while block := file.read(1 << 22):
                code.update(block)
    except (OSError, ValueError):
        return b"missing"
    return code.digest()


@lru_cache(1)
def program_code() -> str:
    """Names what computes: the text of all modules and kernels, and the libraries beneath."""
    code = hashlib.blake2b(digest_size=20)
    here = Path(__file__).parent
    for file in sorted([*here.rglob("*.py"), *kernel_folder().rglob("*.cl")]):
        code.update(file.name.encode() + file.read_bytes())
    code.update(repr([(name, version(name)) for name in BENEATH]).encode())
    return code.hexdigest()


