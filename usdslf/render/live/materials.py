"""Materials and their textures on the device, for kernels/live_materials.cl.

Textures that are too large together, tiled sets and primvars are not put there: surfaces of such materials are
evaluated on the host (surfaces/surface_points.py) and written over what the kernel made of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color, color_of
from usdslf.gpu.device import Device
from usdslf.render.live import records as r
from usdslf.scene.records import Input, Material, Scene, Texture
from usdslf.textures.store import load_image
from usdslf.textures.texels import WRAPS

TEXEL_BYTES = 512 << 20  # of all textures on the device, decoded
TEXEL = 16  # bytes of one
BAND = 64  # rows of an image that are brought to the device at a time
_INPUTS = {
    "diffuse_color": (r.IN_DIFFUSE, 3), "specular_color": (r.IN_SPECULAR, 3), "emissive_color": (r.IN_EMISSION, 3),
    "metallic": (r.IN_METALLIC, 1), "roughness": (r.IN_ROUGHNESS, 1), "clearcoat": (r.IN_COAT, 1),
    "clearcoat_roughness": (r.IN_COAT_ROUGHNESS, 1), "ior": (r.IN_IOR, 1), "opacity": (r.IN_OPACITY, 1),
}  # fmt: skip


@dataclass
class TexturePool:
    """Decoded images on the device, and sets of texture coordinates; only grows.  The host keeps no texels."""

    device: Device
    scene: Scene
    color: Color
    images: dict[tuple[str, str], int] = field(default_factory=dict)
    sets: dict[str, int] = field(default_factory=dict)
    shapes: list[tuple[int, int, int]] = field(default_factory=list)  # first texel, width, height
    _count: int = 0  # texels of all images
    _texels_d: Any = None  # (_count and more, 4)
    _uploaded: tuple[int, Any, Any, Any] | None = None

    @staticmethod
    def of(device: Device, scene: Scene) -> TexturePool:
        """Returns an empty one."""
        return TexturePool(device, scene, color_of(scene.ocio, scene.working_space))

    def reserve(self, materials: Sequence[Material]) -> None:
        """Makes room for all textures of some materials at once, as far as they are for the device."""
        inputs = [v for m in materials for v in vars(m).values() if isinstance(v, Texture) and _is_one_image(v)]
        asked, total = {(v.path, v.color_space): v for v in inputs}, self._count
        for key in asked.keys() - self.images.keys():
            try:
                height, width = load_image(*key, self.color).shape[:2]
            except OSError:
                continue
            if TEXEL * (total + height * width) <= TEXEL_BYTES:
                total += height * width
        self._make_room(total)

    def image(self, texture: Texture) -> int | None:
        """Returns the number of a texture's image; -1: it cannot be read; None: it is not for the device."""
        if not _is_one_image(texture):
            return -1 if not (texture.tiles or texture.path) else None
        key = (texture.path, texture.color_space)
        if key not in self.images:
            try:
                image = load_image(texture.path, texture.color_space, self.color)
                height, width = image.shape[:2]
                if TEXEL * (height * width + self._count) > TEXEL_BYTES:
                    return None
                self._make_room(self._count + height * width)
                for top in range(0, height, BAND):
                    values = image.rows(top, min(top + BAND, height)).reshape(-1, 4)
                    self.device.put(self._texels_d, self._count + top * width, np.asarray(values, np.float32))
            except OSError:
                return -1
            self.shapes.append((self._count, width, height))
            self._count += height * width
            self.images[key] = len(self.shapes) - 1
        return self.images[key]

    def _make_room(self, count: int) -> None:
        """Sees that texels have a place on the device; those that are there move with it."""
        before_d = self._texels_d
        if before_d is None or len(before_d) < count:
            self._texels_d = self.device.empty((max(count, 1), 4), np.float32)
            if self._count:
                self.device.copy_rows(self._texels_d, before_d, self._count)

    def coordinates(self, name: str) -> int:
        """Returns the number of a set of texture coordinates."""
        return self.sets.setdefault(name, len(self.sets))

    def arrays(self) -> tuple[Any, Any, Any]:
        """Returns images (I, 3), texels (., 4) and coordinates (sets, T, 3, 2) on the device."""
        size = len(self.images) * 1000 + len(self.sets)
        if self._uploaded is None or self._uploaded[0] != size:
            up = self.device.upload
            self._make_room(1)
            uvs = [self.scene.corner_uvs(name) for name in self.sets] or [np.zeros((1, 3, 2), np.float32)]
            shapes = np.array(self.shapes or [(0, 1, 1)], np.int32)
            self._uploaded = (size, up(shapes), self._texels_d, up(np.stack(uvs)))
        return self._uploaded[1:]


def _is_one_image(texture: Texture) -> bool:
    return bool(texture.path) and not texture.tiles and "<UDIM>" not in texture.path


@dataclass(frozen=True)
class MaterialTable:
    """Materials on the device."""

    materials: tuple[Material, ...]
    rows_d: Any  # (M, MAT)
    refs_d: Any  # (R, REF)
    pool: tuple[Any, Any, Any]  # of TexturePool.arrays
    on_host: NDArray[np.bool_]  # (M,) those that are evaluated on the host
    whole: tuple[object, ...]  # (M,) all that a material says, comparable
    opacity: tuple[object, ...]  # (M,) what is seen through it
    emission: tuple[object, ...]  # (M,) what it emits
    gloss: tuple[object, ...]  # (M,) what of it the light columns of a material's rows depend on

    @staticmethod
    def of(pool: TexturePool, materials: Sequence[Material]) -> MaterialTable:
        """Uploads materials; a scene of another reflectance shares the pool."""
        pool.reserve(materials)
        rows = np.zeros((max(len(materials), 1), r.MAT), np.float32)
        refs: list[NDArray] = []
        on_host = np.zeros(len(materials), bool)
        for m, material in enumerate(materials):
            on_host[m] = not _fill(rows[m], material, pool, refs)
        up = pool.device.upload
        return MaterialTable(
            tuple(materials), up(rows), up(np.array(refs or [np.zeros(r.REF)], np.float32)), pool.arrays(), on_host,
            tuple(_comparable(tuple(vars(m).values())) for m in materials),
            tuple(_comparable((m.opacity, m.opacity_threshold, m.opacity_mode)) for m in materials),
            tuple(_comparable((m.emissive_color,)) for m in materials),
            tuple(_gloss(m) for m in materials),
        )  # fmt: skip


def _gloss(m: Material) -> object:
    """What of a material the light of its rows depends on, comparable: its lobes and its normals."""
    return _comparable(
        (
            m.roughness, m.clearcoat, m.clearcoat_roughness, m.normal, _coat_reflects(m),
        )
    )  # fmt: skip


def _comparable(values: tuple[object, ...]) -> object:
    return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in values)


def _coat_reflects(m: Material) -> Input | None:
    """The ior, where it is the coat's too."""
    coat = m.clearcoat
    return None if isinstance(coat, np.ndarray) and not coat.any() else m.ior


def _fill(row: NDArray, material: Material, pool: TexturePool, refs: list[NDArray]) -> bool:
    """Fills a material's row and adds its references; returns whether all of it is on the device."""
    row[r.MAT_THRESHOLD] = material.opacity_threshold
    row[r.MAT_WORKFLOW] = material.use_specular_workflow
    row[r.MAT_PRESENCE] = material.opacity_mode == "presence"
    row[r.MAT_NORMAL], row[r.MAT_FIRST] = -1, len(refs)
    whole = True
    for name, (place, size) in _INPUTS.items():
        value: Input = getattr(material, name)
        if isinstance(value, np.ndarray):
            row[place : place + size] = value
        elif isinstance(value, Texture):
            whole &= _refer(row, value, (place, size), pool, refs)
        else:
            whole = False
    row[r.MAT_COUNT] = len(refs) - row[r.MAT_FIRST]
    glows = material.emissive_color
    row[r.MAT_GLOWS] = 2.0 if not isinstance(glows, np.ndarray) else float(glows.max() > 0)
    if material.normal is not None:
        image = pool.image(material.normal)
        if image is None:
            whole = False
        elif image >= 0:
            row[r.MAT_NORMAL] = len(refs)
            refs.append(_reference(material.normal, (0, 3), image, pool))
        else:
            whole = False  # its fallback, once
    return whole


def _refer(row: NDArray, texture: Texture, to: tuple[int, int], pool: TexturePool, refs: list[NDArray]) -> bool:
    image = pool.image(texture)
    place, size = to
    if image is None:
        return False
    if image < 0:  # its fallback
        value = np.asarray(texture.fallback, np.float32)
        chosen = value[:3] if texture.channels == "rgb" else value[["rgba".index(texture.channels)]]
        row[place : place + size] = chosen if len(chosen) == size else chosen[0]
    else:
        refs.append(_reference(texture, to, image, pool))
    return True


def _reference(texture: Texture, to: tuple[int, int], image: int, pool: TexturePool) -> NDArray:
    ref = np.zeros(r.REF, np.float32)
    ref[r.REF_INPUT], ref[r.REF_SIZE] = to
    ref[r.REF_CHANNEL] = -1 if texture.channels == "rgb" else "rgba".index(texture.channels)
    ref[r.REF_SET] = pool.coordinates(texture.uv_set)
    ref[r.REF_MATRIX : r.REF_MATRIX + 6] = np.asarray(texture.st_from_uv, np.float64)[:2].ravel()
    ref[r.REF_SCALE : r.REF_SCALE + 4], ref[r.REF_BIAS : r.REF_BIAS + 4] = texture.scale, texture.bias
    ref[r.REF_WRAP], ref[r.REF_WRAP + 1] = (WRAPS.index(w) for w in (texture.wrap_s, texture.wrap_t))
    ref[r.REF_IMAGE] = image
    ref[r.REF_FALLBACK : r.REF_FALLBACK + 2] = texture.st_fallback
    return ref
