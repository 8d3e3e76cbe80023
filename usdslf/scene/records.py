"""Scene: what a shot holds at one frame, as validated numpy records without USD.

Everything is in world space, stage units and the scene-linear working space; positions are relative to
`Scene.origin`, which is the world's but for shots that lie far off.  Matrices act on column vectors.  One `Mesh` stands
for one renderable gprim (an instance is a mesh of its own), already triangulated, refined and skinned;
`Scene.triangles` is all of them in one table, the one that rays are traced against.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from usdslf.runs import owners
from usdslf.scene.arrays import cross

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True)
class Texture:
    """A UsdUVTexture with what leads to it.

    The value is `texel * scale + bias`, of which `channels` are taken.
    """

    prim: str  # path of the UsdUVTexture shader
    path: str  # resolved file; holds <UDIM> for a tiled set; "" where it could not be resolved
    tiles: tuple[tuple[int, str], ...] = ()  # (1001 + u + 10 v, file) of a UDIM set
    color_space: str = "auto"  # auto | raw | sRGB | a name that OpenColorIO knows
    wrap_s: str = "repeat"  # black | clamp | repeat | mirror
    wrap_t: str = "repeat"
    scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    bias: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    fallback: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    channels: str = "rgb"  # rgb | r | g | b | a
    uv_set: str = "st"  # primvar that the coordinates come from
    st_from_uv: tuple[tuple[float, float, float], ...] = (
        (1.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0),
    )  # UsdTransform2d
    st_fallback: tuple[float, float] = (0.0, 0.0)  # coordinates on a gprim without that primvar


@dataclass(frozen=True)
class PrimvarInput:
    """An input that reads a primvar of the gprim."""

    name: str
    fallback: tuple[float, ...]


Input = F32 | Texture | PrimvarInput
"""A material input: a constant (1,) or (3,), a texture, or a primvar."""


def constant(*values: float) -> F32:
    """Returns a constant input of one or three values."""
    return np.asarray(values, np.float32)


@dataclass(frozen=True)
class Material:
    """A UsdPreviewSurface, input by input, with the fallbacks of its specification.

    `why_not_editable` is empty for a material whose inputs can be overridden, else a sentence.
    """

    path: str  # of the Material prim; "" for the stand-in of a gprim without one
    diffuse_color: Input = field(default_factory=lambda: constant(0.18, 0.18, 0.18))
    emissive_color: Input = field(default_factory=lambda: constant(0.0, 0.0, 0.0))
    use_specular_workflow: bool = False
    specular_color: Input = field(default_factory=lambda: constant(0.0, 0.0, 0.0))
    metallic: Input = field(default_factory=lambda: constant(0.0))
    roughness: Input = field(default_factory=lambda: constant(0.5))
    clearcoat: Input = field(default_factory=lambda: constant(0.0))
    clearcoat_roughness: Input = field(default_factory=lambda: constant(0.01))
    ior: Input = field(default_factory=lambda: constant(1.5))
    opacity: Input = field(default_factory=lambda: constant(1.0))
    opacity_threshold: float = 0.0
    opacity_mode: str = "transparent"  # transparent | presence
    normal: Texture | None = None
    shader: str = ""  # path of the UsdPreviewSurface shader
    why_not_editable: str = ""

    @property
    def is_opaque(self) -> bool:
        """Whether nothing can be seen through it anywhere."""
        value = self.opacity
        return isinstance(value, np.ndarray) and float(value[0]) >= max(1.0, self.opacity_threshold)


@dataclass(frozen=True)
class Mesh:
    """One gprim at one frame, triangulated, in world space.  V vertices, T triangles, F faces."""

    path: str  # prim; of an instance proxy where instanced; "prim[i]" below a PointInstancer
    positions: F32  # (V, 3)
    triangles: I32  # (T, 3) into positions; counter-clockwise seen from outside
    corner_normals: F32  # (T, 3, 3) unit shading normals; the face normal where flat
    face_of_triangle: I32  # (T,) face of the gprim as authored (before refinement)
    triangle_in_face: I32  # (T,) which of its face's triangles: anchors store (u + this, v)
    material_of_triangle: I32  # (T,) into Scene.materials
    uvs: dict[str, F32] = field(default_factory=dict)  # primvar name -> (T, 3, 2)
    primvars: dict[str, F32] = field(default_factory=dict)  # name -> (T, 3, C)
    subset_of_triangle: I32 | None = None  # (T,) into subsets, -1 for none
    subsets: tuple[str, ...] = ()  # paths of GeomSubsets that bind materials
    double_sided: bool = False
    prototype: str = ""  # path of the prim that an opinion has to be written on, "" if path itself
    has_points: bool = True  # authored ones, that stay where they are: no skin, no implicit shape
    is_animated: bool = False  # it may be elsewhere, or of another shape, at another frame

    def coordinates(self, name: str) -> F32 | None:
        """Returns texture coordinates (T, 3, 2), the first two of more floats; None where there are none.

        Args:
            name: of the primvar that holds them.
        """
        wide = self.primvars.get(name)
        return self.uvs.get(name) if wide is None or wide.shape[2] < 2 else wide[..., :2]


@dataclass(frozen=True)
class LightTexture:
    """The picture of a dome or rect light, and the colours that its pixels become: all of it has to be told."""

    path: str  # resolved file
    format: str  # of a dome: automatic | latlong | mirroredBall | angular | cubeMapVerticalCross
    color_space: str  # auto | raw | sRGB | a name that OpenColorIO knows
    ocio: str  # OpenColorIO config as asked for; "" is $OCIO, else the built-in one
    working_space: str  # of the scene that the light is in


@dataclass(frozen=True)
class Light:
    """A UsdLux light.  Rect, disk and distant lights shine along -Z of `world_from_light`."""

    path: str
    kind: str  # rect | disk | sphere | cylinder | distant | dome
    radiance: tuple[float, float, float]  # emitted, after intensity, exposure, normalize, temperature
    world_from_light: F64  # (4, 4)
    width: float = 1.0  # rect
    height: float = 1.0  # rect
    radius: float = 0.5  # disk, sphere, cylinder
    length: float = 1.0  # cylinder, along X
    angle: float = 0.0  # distant: full angle [rad]
    treat_as_point: bool = False
    diffuse: float = 1.0  # factor on what diffuse reflection receives
    specular: float = 1.0
    texture: LightTexture | None = None  # of a dome or rect light; multiplies `radiance`
    unread: str = ""  # file of its texture, where that cannot be read
    cone_angle: float = 90.0  # shaping, half angle [deg] as authored; 90 and above: none
    cone_softness: float = 0.0
    focus: float = 0.0
    focus_tint: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class MissingTexture:
    """A texture that the shot names and that cannot be read, with what stands for it."""

    prim: str  # path of the texture's shader, or of the light
    file: str  # as the shot names it
    why: str
    stands_for_it: str  # in words
    materials: tuple[str, ...] = ()  # paths of those that read it; none: a light does

    @property
    def sentence(self) -> str:
        """What, where, and what is seen in its place."""
        return f"texture {self.file} of {self.prim} cannot be read ({self.why}): {self.stands_for_it}"


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.  Looks along -Z of `world_from_camera`, +Y up; apertures and focal length share a unit.

    Attributes:
        path: of its prim, or of what made it.
        world_from_camera: (4, 4), rigid, relative to `Scene.origin` [stage units].
        horizontal_aperture, vertical_aperture: of the film; of an orthographic camera tenths of a stage unit.
        focal_length: distance of the film.
        horizontal_offset, vertical_offset: of the film's middle from the axis.
        perspective: False: orthographic.
        near, far: clipping planes [stage units]; inf: none.
    """

    path: str
    world_from_camera: F64
    horizontal_aperture: float
    vertical_aperture: float
    focal_length: float
    horizontal_offset: float = 0.0
    vertical_offset: float = 0.0
    perspective: bool = True
    near: float = 0.0
    far: float = np.inf


@dataclass(frozen=True)
class Triangles:
    """All triangles of a scene in one table.  T triangles."""

    positions: F32  # (T, 3, 3) corners
    normals: F32  # (T, 3, 3) shading normals of the corners
    mesh: I32  # (T,) into Scene.meshes
    material: I32  # (T,) into Scene.materials
    face: I32  # (T,) face of the gprim
    first_of_mesh: I32  # (meshes + 1,)

    @cached_property
    def face_normals(self) -> F32:
        """Unit geometric normals (T, 3); zero for degenerate triangles."""
        p = self.positions.astype(np.float64)
        n = cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        length = np.linalg.norm(n, axis=1, keepdims=True)
        return (n / np.where(length > 0, length, 1)).astype(np.float32)

    @cached_property
    def areas(self) -> F64:
        """Areas (T,) [stage units squared]."""
        p = self.positions.astype(np.float64)
        areas: F64 = 0.5 * np.linalg.norm(cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
        return areas


@dataclass(frozen=True)
class Scene:
    """A shot at one frame, without USD: world space, stage units, scene-linear working space.

    Attributes:
        stage: file of the root layer, or its identifier where it is in memory alone.
        frame: time code; nan: default time.
        meshes: of M renderable gprims, triangulated; an instance is one of its own.
        materials: UsdPreviewSurfaces that meshes show, by the index that these hold.
        lights: what shines of itself, dome lights too.
        cameras: of the shot, in the order of its prims.
        up_axis: Y | Z.
        meters_per_unit: metres that a stage unit is long, above 0.
        warnings: a sentence for each thing that could not be read as it was meant.
        ocio: OpenColorIO config as asked for; "": $OCIO, else the built-in one.
        working_space: name of the colour space, scene-linear, that all colours are in.
        missing: textures that cannot be read: what is seen or solved stands on something else there.
        origin: (3,) of the world that all positions are relative to; not 0 where the shot is small and far off.
    """

    stage: str
    frame: float
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    lights: tuple[Light, ...]
    cameras: tuple[Camera, ...]
    up_axis: str = "Y"
    meters_per_unit: float = 0.01
    warnings: tuple[str, ...] = ()
    missing: tuple[MissingTexture, ...] = ()
    ocio: str = ""
    working_space: str = "lin_rec709_scene"
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @cached_property
    def triangles(self) -> Triangles:
        """All triangles of all meshes, in the order of `meshes`."""
        ms = self.meshes
        count = [len(m.triangles) for m in ms]

        def cat(rows: list, shape: tuple[int, ...], dtype: type) -> NDArray:
            return np.concatenate(rows).astype(dtype) if rows else np.zeros(shape, dtype)

        return Triangles(
            positions=cat([m.positions[m.triangles] for m in ms], (0, 3, 3), np.float32),
            normals=cat([m.corner_normals for m in ms], (0, 3, 3), np.float32),
            mesh=owners(np.asarray(count)).astype(np.int32),
            material=cat([m.material_of_triangle for m in ms], (0,), np.int32),
            face=cat([m.face_of_triangle for m in ms], (0,), np.int32),
            first_of_mesh=np.concatenate([[0], np.cumsum(count)]).astype(np.int32),
        )

    def with_materials(self, materials: Sequence[Material]) -> Scene:
        """Returns the scene with others in the place of its materials, as many; its triangles are shared."""
        assert len(materials) == len(self.materials)
        other = replace(self, materials=tuple(materials))
        vars(other)["triangles"] = self.triangles
        return other

    @property
    def up(self) -> F64:
        """The unit vector (3,) that points up."""
        return np.array([0.0, 0.0, 1.0]) if self.up_axis == "Z" else np.array([0.0, 1.0, 0.0])

    def shown_on(self, material: int) -> tuple[str, ...]:
        """Returns the paths of the gprims that show a material, by its index."""
        table = self.triangles
        return tuple(self.meshes[m].path for m in np.unique(table.mesh[table.material == material]))

    def corner_uvs(self, name: str) -> F32:
        """Returns texture coordinates (T, 3, 2) of all triangles; nan where a mesh has no such set.

        Args:
            name: of the primvar that holds them.
        """
        return self._corner_values(Mesh.coordinates, name, 2)

    def corner_primvar(self, name: str, size: int) -> F32:
        """Returns the values (T, 3, size) of a primvar at the corners of all triangles; nan where a mesh has none.

        Args:
            name: of the primvar, without `primvars:`.
            size: components of a value; 1 to 4.
        """
        return self._corner_values(lambda mesh, name: mesh.primvars.get(name), name, size)

    def _corner_values(self, of: Callable[[Mesh, str], F32 | None], name: str, size: int) -> F32:
        key = (of is Mesh.coordinates, name, size)
        if key not in self._corner_cache:
            out = np.full((len(self.triangles.mesh), 3, size), np.nan, np.float32)
            first = self.triangles.first_of_mesh
            for i, m in enumerate(self.meshes):
                value = of(m, name)
                if value is not None:
                    out[first[i] : first[i + 1]] = value[..., :size]
            self._corner_cache[key] = out
        return self._corner_cache[key]

    @cached_property
    def _corner_cache(self) -> dict[tuple[bool, str, int], F32]:
        return {}

    @cached_property
    def bounds(self) -> tuple[F64, F64]:
        """Lower and upper corner (3,), (3,) of all triangles [stage units]."""
        p = self.triangles.positions.reshape(-1, 3)
        ends = (p.min(0), p.max(0)) if len(p) else (np.zeros(3), np.zeros(3))
        return ends[0].astype(np.float64), ends[1].astype(np.float64)

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounds [stage units]."""
        low, high = self.bounds
        return float(np.linalg.norm(high - low))
