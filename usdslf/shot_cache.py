"""Shot cache: the slow parts of a Shot, kept in the user's cache folder, so that a second start is quick.

    ShotCache(scene, lights, device, count) .elements(compute) .lookup .visibility .fixed_light .radiance .sums

Each part is named by all that it is computed from: by values and never by a file's name or time, by the text of this
program's modules and kernels, by the versions of the libraries beneath, and where the device computes it by the device.
So nothing has to be invalidated, and what is read is byte for byte what would be computed.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf import cache
from usdslf.array_file import Room, new_room
from usdslf.color import color_of
from usdslf.elements.elements import Elements
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import Device
from usdslf.gpu.source import kernel_folder
from usdslf.light_field.visibility import Visibility
from usdslf.scene.fingerprint import appearance_of, digest, geometry_of
from usdslf.scene.records import Light, Scene
from usdslf.textures.files import file_of, stamp_of

VERSION = 2  # raise it when entries hold something else
KINDS = ("elements", "lookup", "visibility", "light", "field", "sums", "near")  # of entries of shots, a word each
BENEATH = ("numpy", "scipy", "embreex", "pyopencl")

Arrays = Mapping[str, NDArray]


@dataclass(frozen=True)
class Kind:
    """Of a light field.

    Attributes:
        model: of reflectance.
        bounces: at most.
        stored: name of the dtype of its light on the device.
    """

    model: str
    bounces: int
    stored: str


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
    _names: dict[str, Any] = field(default_factory=dict, repr=False)

    def name_all(self) -> None:
        """Reads what names parts: many small reads, each of which may wait 5 ms for Python's lock beside a thread."""
        program_code()
        self._appearance  # noqa: B018

    def elements(self, compute: Callable[[], Elements]) -> Elements:
        """Returns the elements of the shot."""
        found = self._kept("elements", lambda: _arrays_of(compute()), self._appearance, self.count)
        return Elements(**found)

    def lookup(self, elements: Elements, compute: Callable[[], ElementLookup]) -> ElementLookup:
        """Returns the tables of near elements."""
        made: list[ElementLookup] = []

        def tables() -> Arrays:
            made.append(compute())
            return made[0].tables

        found = self._kept("lookup", tables, self._laid(elements))
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

    def radiance(self, elements: Elements, kind: Kind, compute: Callable[[], NDArray]) -> Any:
        """Returns the outgoing radiance (N, D, 3) of a light field after its bounces from the dark, on the device.

        Args:
            elements, kind: whose it is.
            compute: gives it as the light field stores it.

        Returns: None where it was computed now, so that the light field has it.
        """
        read: list[Any] = []
        was_computed = []

        def computed() -> Arrays:
            was_computed.append(True)
            return {"radiance": compute()}

        with ExitStack() as written:

            def room(_: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
                read.append(self.device.empty(shape, dtype))
                return written.enter_context(self.device.written(read[0]))

            self._kept("field", computed, *self._sent(elements, kind), room=room)
        return None if was_computed else read[0]

    def has_radiance(self, elements: Elements, kind: Kind) -> bool:
        """Tells whether that was kept, be it whole or not."""
        return cache.has(self._name("field", *self._sent(elements, kind)))

    def sums(self, elements: Elements, kind: Kind, compute: Callable[[], Arrays]) -> Arrays:
        """Returns what that radiance is summed up to for pictures."""
        return self._kept("sums", compute, *self._sent(elements, kind))

    def _sent(self, elements: Elements, kind: Kind) -> tuple[str | int, ...]:
        """Names the light that elements send out."""
        whole = self._once("whole", elements, lambda: elements)
        return self._appearance, whole, self._device, kind.model, kind.bounces, kind.stored

    def _kept(
        self, kind: str, compute: Callable[[], Arrays], *parts: str | int, room: Room = new_room
    ) -> dict[str, NDArray]:  # fmt: skip
        return cache.arrays(self._name(kind, *parts), compute, True, room)

    def _name(self, kind: str, *parts: str | int) -> str:
        assert kind in KINDS
        return cache.address(kind, VERSION, program_code(), *parts)

    @cached_property
    def _appearance(self) -> str:
        """Names all that light depends on."""
        color = color_of(self.scene.ocio or None, self.scene.working_space)
        return digest((self._geometry, appearance_of(self.scene), self.lights, color.cache_id), contents)

    @cached_property
    def _geometry(self) -> str:
        return digest(geometry_of(self.scene), contents)

    @cached_property
    def _device(self) -> str:
        return self.device.name + " " + self.device.driver

    def _laid(self, elements: Elements) -> str:
        """Names what rays of the elements meet."""
        names = ("position", "geometric_normal", "normal", "frame", "area", "triangle", "barycentric", "part", "side")
        values = lambda: [getattr(elements, n) for n in ("part_of_triangle", *names)]  # noqa: E731
        return self._once("laid", elements, lambda: [self._geometry, *values()])

    def _once(self, what: str, elements: Elements, values: Callable[[], Any]) -> str:
        """Names something of elements, whose values are read once."""
        if self._names.get("of") is not elements:
            self._names.clear()
            self._names["of"] = elements
        if what not in self._names:
            self._names[what] = digest(values(), contents)
        return str(self._names[what])


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
    files = [*_files_in(os.path.dirname(__file__), ".py"), *_files_in(str(kernel_folder()), ".cl")]
    for path in sorted(files):
        with open(path, "rb", buffering=0) as file:
            code.update(os.path.basename(path).encode() + file.read())
    code.update(repr([(name, version(name)) for name in BENEATH]).encode())
    return code.hexdigest()


def _files_in(folder: str, suffix: str) -> list[str]:
    """All files below a folder with a suffix."""
    return [os.path.join(at, n) for at, _, names in os.walk(folder) for n in names if n.endswith(suffix)]
