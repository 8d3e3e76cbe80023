"""Storage: which input of a UsdPreviewSurface says a change that varies over a surface, and what it is stored in.

    storage_of(scene, material, targets, varying) -> Storage      its input, texture or points, or why there is none
    store(scene, storage, varying, ...) -> Baked | ByVertex       the texture written, or the values at points

Which input: diffuseColor for the diffuse colour of what is no metal and for the specular colour of a metal; roughness;
specularColor in the specular workflow, into which a dielectric goes over for a specular colour; its ior for a grey one
that a dielectric can have.  A texture where the surface has coordinates that lie flat; else, for a constant input of
meshes whose points are close enough, a value at each of their points.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol
from weakref import ReferenceType, ref

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color
from usdslf.edits.baked_texture import Baked, bake_texture, plain_texture
from usdslf.edits.edits import ByVertex
from usdslf.geometry.closest_point import Nearest, nearest_on_triangles
from usdslf.geometry.uv_layout import common_sets, lies_flat
from usdslf.progress import tell_during
from usdslf.scene.records import F64, Material, Scene, Texture
from usdslf.similarity.similarity import Places, places_at
from usdslf.surfaces.preview_surface import NATURAL_IOR, ior_for, normal_reflectance
from usdslf.textures.images import files_of, load_texture, why_unreadable

METAL, DIELECTRIC = 0.999, 0.001
MOSTLY = 0.1  # metallic of a texture below which what was painted counts as a dielectric
FEW_TEXELS, ENOUGH_TEXELS = 64, 256  # on a side, to hold what varies
BETWEEN_POINTS = 0.2  # of the range of a change, that it may be off between points
TOO_COARSE = "its points are too far apart to hold the change"
FIELDS = {
    "diffuseColor": "diffuse_color", "specularColor": "specular_color", "ior": "ior", "roughness": "roughness",
}  # fmt: skip


class Varies(Protocol):
    """A change of one parameter that varies over a surface, known at n places: of strokes or of a style.

    Grey: a specular change with one value for all channels.  Noisy: it is worth having where it is met on the whole.
    Even: the same change, or factor, everywhere.
    """

    @property
    def parameter(self) -> str: ...
    @property
    def places(self) -> Places: ...
    @property
    def is_grey(self) -> bool: ...
    @property
    def is_noisy(self) -> bool: ...
    @property
    def is_even(self) -> bool: ...
    def at(self, x: Places) -> F64: ...
    def of_dabs(self) -> F64: ...


@dataclass(frozen=True)
class Storage:
    """What stores a varying change of a material."""

    material: int  # into scene.materials
    input: str = ""
    uv_set: str = ""  # of a texture; "" where points store it
    triangles: NDArray | None = None  # (k,) that show the change
    why_not: str = ""  # reason why nothing can
    is_too_coarse: bool = False  # the reason is that points are too far apart: they could store a smoother change

    @property
    def by_points(self) -> bool:
        """Whether the points of meshes store it."""
        return not self.why_not and not self.uv_set


def storage_of(scene: Scene, material: int, targets: Sequence[str], varying: Varies) -> Storage:
    """Finds what stores a varying change.

    Args:
        material: into scene.materials.
        targets: paths of the gprims that show the change; none: all that show the material.
    """
    m, table = scene.materials[material], scene.triangles
    shown = table.material == material
    if targets:
        shown &= np.array([mesh.path in targets for mesh in scene.meshes])[table.mesh]
    triangles = np.flatnonzero(shown)
    name, why = _input_of(m, varying, _metallic(scene, m, triangles, varying))
    if why:
        return Storage(material, why_not=why)
    value = getattr(m, FIELDS[name])
    if not _is_used(m, name) and isinstance(value, Texture):
        return Storage(material, why_not=f"its {name} is driven by {value.prim} without being seen")
    if not isinstance(value, (Texture, np.ndarray)):
        return Storage(material, why_not=f"a primvar drives its {name}")
    uv_set = value.uv_set if isinstance(value, Texture) else next(iter(common_sets(scene, triangles)), "")
    texture = value if isinstance(value, Texture) else None
    if texture and len(texture.channels) == 1 and name in ("diffuseColor", "specularColor"):
        return Storage(material, why_not=f"one channel of {texture.prim} drives all of its {name}")
    if texture and (why := _why_not_baked(texture)):
        return Storage(material, why_not=why)
    if uv_set and (varying.is_even or lies_flat(scene, triangles, uv_set, texture)):
        return Storage(material, name, uv_set, triangles)
    flat = f"its texture coordinates {uv_set} lie upon each other or outside of 0..1"
    flat = flat if uv_set else "it has no texture coordinates"
    why = _why_not_points(scene, triangles, varying)
    if isinstance(value, Texture):
        why = f"a texture drives its {name}"
    return Storage(material, name, "", triangles, f"{flat}, and {why}" if why else "", why == TOO_COARSE)


def store(
    scene: Scene, storage: Storage, varying: Varies, folder: Path, color: Color, warnings: list[str],
    size: tuple[int, int] | None = None, at_points: dict[str, Places] | None = None,
) -> Baked | ByVertex:  # fmt: skip
    """Writes the texture of a varying change, or says what its values are at points.

    Args:
        size: (width, height) of a texture for an input that had none.
        at_points: the surface at the points of each gprim, filled as they are asked for; several parameters of a
            material share it.

    Raises: AuthorError where a texture cannot be read or written.
    """
    assert storage.triangles is not None and not storage.why_not, storage
    material, name = storage.material, storage.input
    m = scene.materials[material]
    if storage.by_points:
        return _by_vertex(scene, material, name, varying, {} if at_points is None else at_points)
    value = getattr(m, FIELDS[name])
    base = None if isinstance(value, Texture) else _base(m, name)
    texture = value if isinstance(value, Texture) else plain_texture(_base(m, name), storage.uv_set)

    def delta(triangle: NDArray, barycentric: NDArray) -> F64:
        before, after = input_values(m, name, varying, places_at(scene, triangle, barycentric))
        return after - (before if base is None else base)

    stem = f"{m.path.rsplit('/', 1)[-1]}_{name}"
    size = _room(value, color, varying) if isinstance(value, Texture) else size
    return bake_texture(
        scene, texture, storage.triangles, delta, folder / stem, color, size=size, warnings=warnings
    )


def _metallic(scene: Scene, m: Material, triangles: NDArray, v: Varies) -> tuple[float, float]:
    """Least and greatest metallic of where a change is known; what drives it is looked at."""
    if isinstance(m.metallic, np.ndarray):
        return float(m.metallic[0]), float(m.metallic[0])
    if m.use_specular_workflow or v.is_even or not len(triangles):
        return 0.0, 1.0
    near = _nearest(scene, triangles, v.places.position)
    seen = places_at(scene, triangles[near.triangle].astype(np.int32), near.barycentric.astype(np.float32)).metallic
    assert seen is not None
    low, high = float(seen.min()), float(seen.max())
    return (0.0 if high < MOSTLY else low), (1.0 if low > 1 - MOSTLY else high)  # dust in a texture is no metal


def _input_of(m: Material, v: Varies, metallic_range: tuple[float, float]) -> tuple[str, str]:
    """The input that says the change alone, or the reason why there is none."""
    low, high = metallic_range
    is_driven = not isinstance(m.metallic, np.ndarray)
    metallic = 0.0 if low <= DIELECTRIC and high < MOSTLY else 1.0 if high >= METAL and low > 1 - MOSTLY else None
    metallic = metallic if is_driven else low
    is_dielectric = m.use_specular_workflow or (metallic is not None and metallic <= DIELECTRIC)
    if v.parameter == "glossiness":
        return "roughness", ""
    if v.parameter == "diffuse":
        if not isinstance(m.opacity, np.ndarray):
            return "", "its opacity, which its diffuse colour is seen through, varies too"
        if is_dielectric:
            return "diffuseColor", ""
    elif m.use_specular_workflow:
        return "specularColor", ""
    elif metallic is not None and metallic >= METAL:
        return "diffuseColor", ""
    elif is_dielectric:
        highest = (v.places.reflectance[:, 3:6] + v.of_dabs()).max()
        is_coated = not isinstance(m.clearcoat, np.ndarray) or float(m.clearcoat[0]) > 0
        is_natural = highest <= normal_reflectance(NATURAL_IOR) and not is_coated
        if is_driven and not (v.is_grey and is_natural and isinstance(m.ior, np.ndarray)):
            return "", "a texture drives its metallic: the specular workflow would not show that"
        return ("ior" if v.is_grey and is_natural else "specularColor"), ""
    return "", f"its metallic is {f'{low:g} to {high:g}' if low < high else f'{low:g}'}: no one input says it"


def _why_not_baked(t: Texture) -> str:
    """Why no texture can take the place of one that is there; "" where it can."""
    if any(abs(t.scale["rgba".index(c)]) < 1e-6 for c in t.channels):
        return f"{t.prim} scales its texels by zero"
    if t.path and all(why_unreadable(file) for file in files_of(t)):
        return f"{t.path} cannot be read"
    return ""


def _room(t: Texture, color: Color, v: Varies) -> tuple[int, int] | None:
    """Size of the texture that takes the place of one whose few texels cannot hold what varies; None: its own."""
    shapes = [image.shape for image in load_texture(t, color).values()]
    longest = max((max(s[:2]) for s in shapes), default=FEW_TEXELS)
    if v.is_even or longest >= FEW_TEXELS:
        return None
    times = -(-ENOUGH_TEXELS // longest)
    return shapes[0][1] * times, shapes[0][0] * times


def _is_used(m: Material, name: str) -> bool:
    return name != "specularColor" or m.use_specular_workflow


def _base(m: Material, name: str) -> F64:
    """The value that a new texture starts from where the change is not: what an input without texture shows."""
    if _is_used(m, name):
        return np.asarray(getattr(m, FIELDS[name]), np.float64)
    ior = float(m.ior[0]) if isinstance(m.ior, np.ndarray) else 1.5
    return np.full(3, normal_reflectance(ior))


def input_values(m: Material, name: str, v: Varies, x: Places) -> tuple[F64, F64]:
    """Returns the values (k, C) of an input at places, before and after a change."""
    change = v.at(x)
    if not isinstance(m.metallic, np.ndarray) and name in ("diffuseColor", "ior") and not m.use_specular_workflow:
        return _beside_driven_metallic(m, name, v, x, change)
    if name == "roughness":
        rough = np.asarray(x.reflectance[:, 6:7], np.float64)
        return rough, rough + change
    if v.parameter == "diffuse":
        through = float(m.opacity[0]) if isinstance(m.opacity, np.ndarray) else 1.0
        is_seen_through = m.opacity_threshold == 0 and m.opacity_mode == "transparent" and through > 0
        d = np.asarray(x.reflectance[:, :3], np.float64)
        scale = 1 / through if is_seen_through else 1.0
        return d * scale, np.clip((d + change) * scale, 0, 1)
    f0 = np.asarray(x.reflectance[:, 3:6], np.float64)
    if name == "ior":
        return ior_for(f0[:, :1]), ior_for((f0 + change)[:, :1])
    return f0, f0 + change


def _beside_driven_metallic(m: Material, name: str, v: Varies, x: Places, change: F64) -> tuple[F64, F64]:
    """The values where a texture says what is metal: a colour changes for its own kind of surface only."""
    assert x.base_color is not None and x.metallic is not None
    if name == "ior":
        assert isinstance(m.ior, np.ndarray)
        before = np.full((len(x), 1), float(m.ior[0]))
        return before, ior_for(normal_reflectance(float(m.ior[0])) + change[:, :1])
    share = x.metallic[:, None].astype(np.float64)
    before = x.base_color.astype(np.float64)
    return before, np.clip(before + change * (1 - share if v.parameter == "diffuse" else share), 0, 1)


def _nearest(scene: Scene, triangles: NDArray, position: NDArray) -> Nearest:
    """The nearest points of triangles to places (n, 3), found once for all changes that are known at them."""
    corners, at = _corners_of(scene, triangles), position.tobytes()
    for known, known_at, near in tuple(_NEAREST):
        if known is corners and known_at == at:
            return near
    near = nearest_on_triangles(corners, position)
    _NEAREST.append((corners, at, near))
    return near


def _corners_of(scene: Scene, triangles: NDArray) -> NDArray:
    """Corners (k, 3, 3) of triangles; the same array for the same ones, which are searched again and again."""
    of, rows = scene.triangles.positions, triangles.tobytes()
    for known, known_rows, corners in tuple(_CORNERS):
        if known() is of and known_rows == rows:
            return corners
    corners = of[triangles]
    _CORNERS.append((ref(of), rows, corners))
    return corners


_CORNERS: deque[tuple[ReferenceType[NDArray], bytes, NDArray]] = deque(maxlen=2)
"""What was asked last: the triangles of a material, for each change of it that is weighed."""
_NEAREST: deque[tuple[NDArray, bytes, Nearest]] = deque(maxlen=1)
"""The same: what is nearest to the dabs on them."""


# ---- points ------------------------------------------------------------------------------------
def _why_not_points(scene: Scene, triangles: NDArray, v: Varies) -> str:
    """Why the points of meshes cannot carry a change; "" where they can."""
    table = scene.triangles
    for i in np.unique(table.mesh[triangles]):
        mesh = scene.meshes[i]
        if "[" in mesh.path:
            return f"{mesh.path} is a copy of an instancer, which all have the same points"
        if not mesh.has_points:
            return f"{mesh.path} has no points of its own that stay in place"
    near = _nearest(scene, triangles, v.places.position)
    corners = np.broadcast_to(np.eye(3)[:, 1:], (len(v.places), 3, 2)).reshape(-1, 2).astype(np.float32)
    at_corners = v.at(places_at(scene, np.repeat(triangles[near.triangle], 3).astype(np.int32), corners))
    share = np.concatenate([1 - near.barycentric.sum(1, keepdims=True), near.barycentric], 1)
    between = np.einsum("nk,nkc->nc", share, at_corners.reshape(len(v.places), 3, -1))
    own = v.at(v.places)
    off = np.abs(between - own).max() > BETWEEN_POINTS * np.ptp(own, axis=0).max()
    if v.is_noisy:  # points that say less than half of it leave what the mean leaves, or more
        off = np.square(between - own).sum() > 0.5 * np.square(own - own.mean(0)).sum()
    if off:
        return TOO_COARSE
    return ""


def _by_vertex(scene: Scene, material: int, name: str, v: Varies, at_points: dict[str, Places]) -> ByVertex:
    """The input's values at any points of a gprim: those of the nearest place of its surface."""
    table, m = scene.triangles, scene.materials[material]

    def at(gprim: str, points: F64) -> F64:
        if gprim not in at_points:
            mesh = next(i for i, one in enumerate(scene.meshes) if one.path == gprim)
            own = np.flatnonzero((table.mesh == mesh) & (table.material == material))
            near = tell_during(lambda: nearest_on_triangles(table.positions[own], points))
            triangle, barycentric = own[near.triangle].astype(np.int32), near.barycentric.astype(np.float32)
            at_points[gprim] = places_at(scene, triangle, barycentric)
        return input_values(m, name, v, at_points[gprim])[1]

    before, after = (x.mean(0) for x in input_values(m, name, v, v.places))
    return ByVertex(tuple(float(x) for x in before), tuple(float(x) for x in after), at, scene.frame)

