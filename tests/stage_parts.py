"""Parts of test stages: meshes with smooth normals, small textures, and a builder that writes USD.

Lengths are metres before the builder's `units_per_meter`; shapes stand on y = 0 around the y axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class MeshData:
    """A polygon mesh.  V vertices."""

    positions: NDArray  # (V, 3)
    counts: NDArray  # (faces,)
    indices: NDArray  # (sum of counts,)
    normals: NDArray | None = None  # (V, 3); none: flat
    uvs: NDArray | None = None  # (V, 2)

    def moved(self, offset: Triple) -> MeshData:
        """The same mesh elsewhere."""
        return MeshData(self.positions + np.array(offset), self.counts, self.indices, self.normals, self.uvs)


def joined(*parts: MeshData) -> MeshData:
    """One mesh of several smooth ones."""
    first = np.cumsum([0, *[len(p.positions) for p in parts]])
    return MeshData(
        np.concatenate([p.positions for p in parts]),
        np.concatenate([p.counts for p in parts]),
        np.concatenate([p.indices + f for p, f in zip(parts, first)]),
        np.concatenate([p.normals for p in parts if p.normals is not None]),
        np.concatenate([p.uvs for p in parts if p.uvs is not None]),
    )


def grid(positions: NDArray, closes: bool = False) -> MeshData:
    """A smooth mesh over a (rows, columns, 3) grid; normals follow from differences.

    Columns run around, the last one repeats the first where `closes`.  With rows running up and columns
    counter-clockwise seen from above, faces look outwards.
    """
    rows, columns = positions.shape[:2]
    if closes:
        around = np.concatenate([positions[:, -2:-1], positions, positions[:, 1:2]], axis=1)
        along_u = around[:, 2:] - around[:, :-2]
    else:
        along_u = np.gradient(positions, axis=1)
    along_v = np.gradient(positions, axis=0)
    normals = np.cross(along_v, along_u)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    # A pole has no tangent around: take the mean of the neighbouring ring.
    for pole, ring in ((0, 1), (-1, -2)):
        if length[pole].min() < 1e-9:
            normals[pole] = normals[ring].mean(0)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    quads = np.stack([a, d, c, b], -1).reshape(-1, 4)
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    flat = positions.reshape(-1, 3)
    faces = [_without_repeats(flat, quad) for quad in quads]
    counts = np.array([len(f) for f in faces])
    keep = counts >= 3
    return MeshData(
        flat,
        counts[keep],
        np.concatenate([f for f, k in zip(faces, keep) if k]),
        normals.reshape(-1, 3),
        np.stack([u, v], -1).reshape(-1, 2),
    )


def _without_repeats(positions: NDArray, quad: NDArray) -> NDArray:
    corners = positions[quad]
    same = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) < 1e-9
    return quad[~same]


def lathe(profile: NDArray, segments: int = 48) -> MeshData:
    """Revolves a profile (k, 2) of (radius, height), running upwards outside, about the y axis."""
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    r, y = profile[:, 0:1], profile[:, 1:2]
    return grid(np.stack([r * np.sin(angle), y + 0 * angle, r * np.cos(angle)], -1), closes=True)


def _spline(points: list[tuple[float, float]], count: int) -> NDArray:
    """A Catmull-Rom curve through (radius, height) points."""
    p = np.array(points)
    p = np.concatenate([[2 * p[0] - p[1]], p, [2 * p[-1] - p[-2]]])
    t = np.linspace(0, len(points) - 1 - 1e-9, count)
    i, f = t.astype(int), (t % 1)[:, None]
    a, b, c, d = p[i], p[i + 1], p[i + 2], p[i + 3]
    return 0.5 * (2 * b + (c - a) * f + (2 * a - 5 * b + 4 * c - d) * f**2 + (3 * b - a - 3 * c + d) * f**3)


def ball(radius: float = 0.5, segments: int = 48) -> MeshData:
    """A sphere as a mesh with texture coordinates, standing on y = 0."""
    t = np.linspace(0, np.pi, segments // 2 + 1)
    profile = np.stack([np.abs(radius * np.sin(t)), radius * (1 - np.cos(t))], -1)
    profile[[0, -1], 0] = 0
    return lathe(profile, segments)


def vase(height: float = 1.0, width: float = 0.32) -> MeshData:
    """A vase with a lip and the upper part of its inside."""
    outer = [(0.55, 0), (0.8, 0.08), (1, 0.3), (0.92, 0.5), (0.5, 0.78), (0.45, 0.88), (0.6, 0.98)]
    inner = [(0.57, 1.0), (0.5, 0.96), (0.36, 0.86), (0.4, 0.75), (0.7, 0.5)]
    curve = _spline(outer + inner, 56) * np.array([width, height])
    return lathe(np.concatenate([[[0.0, 0.0]], np.maximum(curve, [[1e-4, 0]])]))


def bottle(height: float = 1.0, width: float = 0.26) -> MeshData:
    """A closed bottle with a straight body and a narrow neck."""
    body = [(0.0, 0.0), (0.85, 0.0), (0.97, 0.02), (1.0, 0.06), (1.0, 0.3), (0.98, 0.5), (0.7, 0.64)]
    neck = [(0.4, 0.72), (0.36, 0.85), (0.42, 0.88), (0.42, 0.97), (0.3, 1.0), (0.0, 1.0)]
    curve = np.maximum(_spline([*body[1:], *neck[:-1]], 60), 0) * np.array([width, height])
    return lathe(np.concatenate([[[0, 0]], curve, [[0, height]]]))


def capsule(length: float = 0.6, radius: float = 0.3) -> MeshData:
    """A cylinder with round ends, standing."""
    t = np.linspace(0, np.pi / 2, 13)
    low = np.stack([radius * np.sin(t), radius * (1 - np.cos(t))], -1)
    middle = np.stack([np.full(8, radius), radius + length * np.arange(1, 9) / 9], -1)
    high = np.stack([radius * np.cos(t), radius + length + radius * np.sin(t)], -1)
    profile = np.concatenate([low, middle, high])
    profile[[0, -1], 0] = 0
    return lathe(profile)


def torus(radius: float = 0.42, tube: float = 0.16, lying: bool = True) -> MeshData:
    """A ring, lying on y = 0 or standing on it in the x-y plane."""
    around = np.linspace(0, 2 * np.pi, 65)
    across = np.linspace(0, 2 * np.pi, 33)
    r = radius + tube * np.cos(across)[:, None]
    y = tube * np.sin(across)[:, None] + 0 * around
    positions = np.stack([r * np.sin(around), y, r * np.cos(around)], -1)
    # The grid's ends across the tube meet: differences there are taken over the seam.
    mesh = grid(positions, closes=True)
    normals = np.stack(
        [
            np.cos(across)[:, None] * np.sin(around),
            np.sin(across)[:, None] + 0 * around,
            np.cos(across)[:, None] * np.cos(around),
        ],
        -1,
    ).reshape(-1, 3)
    if lying:
        return MeshData(mesh.positions + np.array([0, tube, 0]), mesh.counts, mesh.indices, normals, mesh.uvs)
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
    stood = mesh.positions @ turn.T + np.array([0, radius + tube, 0])
    return MeshData(stood, mesh.counts, mesh.indices, normals @ turn.T, mesh.uvs)


def tube(path: NDArray, radii: NDArray, segments: int = 20) -> MeshData:
    """A tube about a planar path (k, 3) in the x-y plane."""
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.array([0, 0, 1.0])
    up = np.cross(across, tangent)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.cos(angle)[None, :, None] * up[:, None] - np.sin(angle)[None, :, None] * across
    mesh = grid(path[:, None] + radii[:, None, None] * ring, closes=True)
    outward = ring.reshape(-1, 3)
    flipped = (np.sum(mesh.normals * outward, axis=1) < 0).mean() > 0.5
    indices = mesh.indices
    if flipped:  # quads only: turn each face around
        indices = indices.reshape(-1, 4)[:, ::-1].ravel()
    return MeshData(mesh.positions, mesh.counts, indices, outward, mesh.uvs)


def teapot(size: float = 1.0) -> MeshData:
    """A pot with lid, spout and handle, in one mesh whose parts pass through each other."""
    body = [(0.28, 0), (0.42, 0.06), (0.5, 0.25), (0.44, 0.45), (0.3, 0.55), (0.28, 0.57)]
    lid = [(0.2, 0.62), (0.06, 0.66), (0.05, 0.7), (0.08, 0.75), (0.04, 0.8)]
    curve = np.concatenate([[[0, 0]], np.maximum(_spline(body + lid, 48), 1e-3), [[0, 0.805]]])
    t = np.linspace(0, 1, 16)[:, None]
    a, b, c, d = [np.array(p) for p in ([0.38, 0.2, 0], [0.66, 0.2, 0], [0.6, 0.48, 0], [0.82, 0.56, 0])]
    spout = a * (1 - t) ** 3 + 3 * b * t * (1 - t) ** 2 + 3 * c * t**2 * (1 - t) + d * t**3
    s = np.linspace(-0.5, 0.5, 20) * 1.15 * np.pi
    handle = np.stack([-0.48 - 0.26 * np.cos(s), 0.3 + 0.17 * np.sin(s), 0 * s], -1)
    parts = joined(
        lathe(curve), tube(spout, np.linspace(0.11, 0.05, 16)), tube(handle, np.full(len(s), 0.045))
    )
    return MeshData(parts.positions * size, parts.counts, parts.indices, parts.normals, parts.uvs)


def blob(radius: float = 0.45, bumps: float = 0.16, seed: int = 0) -> MeshData:
    """A smooth lumpy ball."""
    rng = np.random.default_rng(seed)
    t, p = np.meshgrid(np.linspace(0, np.pi, 41), np.linspace(0, 2 * np.pi, 73), indexing="ij")
    d = np.stack([np.sin(t) * np.sin(p), -np.cos(t), np.sin(t) * np.cos(p)], -1)
    wave = sum(np.cos(d @ rng.normal(0, 2.6, 3) + rng.uniform(0, 6)) for _ in range(5)) / 5
    wave[[0, -1]] = wave[[0, -1]].mean(1, keepdims=True)
    wave[:, -1] = wave[:, 0]
    positions = d * (radius * (1 + bumps * 2 * wave[..., None]))
    positions[[0, -1], :, 0] = 0
    positions[[0, -1], :, 2] = 0
    mesh = grid(positions, closes=True)
    return mesh.moved((0, -float(positions[..., 1].min()), 0))


def box(x: float, y: float, z: float) -> MeshData:
    """A box standing on y = 0 with flat faces and texture coordinates on each."""
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = np.zeros((4, 3))
            corners[:, axis] = side
            corners[:, u] = [-1, 1, 1, -1]
            corners[:, v] = [-1, -1, 1, 1]
            faces.append(corners if side > 0 else corners[::-1])
    positions = np.concatenate(faces) * [x / 2, y / 2, z / 2] + np.array([0, y / 2, 0])
    uvs = np.tile([[0, 0], [1, 0], [1, 1], [0, 1.0]], (6, 1))
    return MeshData(positions, np.full(6, 4), np.arange(24), None, uvs)


def rectangle(corner: Triple, u: Triple, v: Triple, repeat: float = 1.0) -> MeshData:
    """One quad from a corner and two edges; its normal is u x v."""
    c, du, dv = np.array(corner, float), np.array(u, float), np.array(v, float)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]) * repeat
    return MeshData(np.stack([c, c + du, c + du + dv, c + dv]), np.array([4]), np.arange(4), None, uvs)


# Textures.


def checker(a: Triple, b: Triple, squares: int = 8, size: int = 64) -> NDArray:
    """A checker board (size, size, 3), sRGB-encoded values in 0..1."""
    i = np.arange(size) * squares // size
    mask = ((i[:, None] + i[None]) % 2)[..., None]
    return np.where(mask == 1, np.array(a), np.array(b)).astype(np.float32)


def noise(a: Triple, b: Triple, seed: int = 0, size: int = 96) -> NDArray:
    """Smooth noise that tiles, between two colours (size, size, 3)."""
    rng = np.random.default_rng(seed)
    f = np.fft.fftfreq(size) * size
    falloff = np.exp(-((np.hypot(f[:, None], f[None]) / 5.0) ** 2))
    field = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) * falloff).real
    field = np.clip(0.5 + 0.28 * field / field.std(), 0, 1)[..., None]
    return (np.array(a) * (1 - field) + np.array(b) * field).astype(np.float32)


def sky(seed: int = 0, height: int = 64, sun: float = 60.0) -> NDArray:
    """An outdoor environment (height, 2 height, 3): a gradient, a soft sun, bright windows, ground."""
    rng = np.random.default_rng(seed)
    latitude = np.radians(90 - (np.arange(height) + 0.5) * 180 / height)[:, None, None]
    longitude = np.radians(180 - (np.arange(2 * height) + 0.5) * 180 / height)[None, :, None]
    up = np.maximum(np.sin(latitude), 0) ** 0.5
    image = (1 - up) * np.array([0.9, 0.85, 0.8]) + up * np.array([0.25, 0.45, 0.9])
    image = np.where(latitude < 0, np.array([0.22, 0.18, 0.13]) * (1 + 0.3 * np.cos(3 * longitude)), image)

    def direction(lat: NDArray | float, lon: NDArray | float) -> NDArray:
        parts = np.broadcast_arrays(np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon))
        return np.stack([np.squeeze(p) for p in parts], -1)

    d = direction(latitude, longitude)
    azimuth = rng.uniform(-2.4, 0.6)
    sun_direction = direction(rng.uniform(0.5, 0.9), azimuth)
    image = image + np.exp((d @ sun_direction - 1) * 180)[..., None] * sun * np.array([1, 0.9, 0.75])
    for _ in range(4):
        center, strength = direction(rng.uniform(-0.1, 0.8), rng.uniform(-3.1, 3.1)), rng.uniform(1.5, 5)
        side = np.cross(center, [0, 1, 0])
        side /= np.linalg.norm(side)
        inside = np.maximum(np.abs(d @ side) / 0.25, np.abs(d @ np.cross(side, center)) / 0.35)
        window = ((inside < 1) & (d @ center > 0))[..., None]
        image = image + window * strength * rng.uniform(0.6, 1.0, 3)
    return image.astype(np.float32)


def write_image(path: Path, pixels: NDArray) -> None:
    """Writes (h, w, 3): 8 bit for .png, half float for .exr."""
    import OpenImageIO as oiio

    kind = oiio.UINT8 if path.suffix == ".png" else oiio.HALF
    output = oiio.ImageOutput.create(str(path))
    output.open(str(path), oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, kind))
    output.write_image(np.ascontiguousarray(pixels, np.float32))
    output.close()


# The builder.


@dataclass(frozen=True)
class TextureInput:
    """A texture that drives an input, `texel * scale`."""

    file: str
    scale: Triple = (1.0, 1.0, 1.0)


InputValue = float | Triple | TextureInput

INPUT_TYPES = {
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "specularColor": Sdf.ValueTypeNames.Color3f,
    "emissiveColor": Sdf.ValueTypeNames.Color3f,
    "useSpecularWorkflow": Sdf.ValueTypeNames.Int,
}


class StageBuilder:
    """Writes one stage, `folder/stage.usda`, with everything below /World.

    Args:
      up: "Y" or "Z"; the world is turned, so that builders always think Y-up.
      units_per_meter: 1 or, say, 100 for a stage in centimetres.
    """

    def __init__(self, folder: Path, up: str = "Y", units_per_meter: float = 1.0) -> None:
        self.folder = folder
        self.path = folder / "stage.usda"
        self.stage = Usd.Stage.CreateNew(str(self.path))
        UsdGeom.SetStageUpAxis(self.stage, up)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1.0 / units_per_meter)
        world = UsdGeom.Xform.Define(self.stage, "/World")
        self.stage.SetDefaultPrim(world.GetPrim())
        if up == "Z":
            world.AddRotateXOp().Set(90.0)
        if units_per_meter != 1:
            world.AddScaleOp().Set(Gf.Vec3f(units_per_meter))
        self._units = units_per_meter

    def save(self) -> Path:
        """Writes the stage and returns its path."""
        self.stage.GetRootLayer().Save()
        return self.path

    def image(self, name: str, pixels: NDArray) -> str:
        """Writes an image beside the stage and returns its name."""
        if not (self.folder / name).exists():
            write_image(self.folder / name, pixels)
        return name

    def material(self, name: str, **inputs: InputValue) -> str:
        """Makes a UsdPreviewSurface and returns the path of its Material."""
        path = f"/World/mtl/{name}"
        material = UsdShade.Material.Define(self.stage, path)
        shader = UsdShade.Shader.Define(self.stage, path + "/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        for key, value in inputs.items():
            shade_input = shader.CreateInput(key, INPUT_TYPES.get(key, Sdf.ValueTypeNames.Float))
            if isinstance(value, TextureInput):
                shade_input.ConnectToSource(self._texture(path, key, value))
            elif isinstance(value, tuple):
                shade_input.Set(Gf.Vec3f(*value))
            else:
                shade_input.Set(int(value) if key == "useSpecularWorkflow" else value)
        shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        return path

    def _texture(self, material: str, key: str, value: TextureInput) -> UsdShade.Output:
        reader = UsdShade.Shader.Define(self.stage, material + "/st")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        texture = UsdShade.Shader.Define(self.stage, f"{material}/{key}_texture")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./" + value.file)
        texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        for wrap in ("wrapS", "wrapT"):
            texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("repeat")
        if value.scale != (1.0, 1.0, 1.0):
            texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*value.scale, 1.0))
        coordinates = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(coordinates)
        return texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)

    def mesh(
        self, name: str, data: MeshData, material: str, at: Triple = (0, 0, 0), turn: float = 0.0
    ) -> str:
        """Adds a Mesh without subdivision, turned about y by degrees."""
        mesh = UsdGeom.Mesh.Define(self.stage, f"/World/{name}")
        mesh.CreatePointsAttr(data.positions.astype(np.float32))
        mesh.CreateFaceVertexCountsAttr(data.counts.astype(np.int32))
        mesh.CreateFaceVertexIndicesAttr(data.indices.astype(np.int32))
        mesh.CreateSubdivisionSchemeAttr("none")
        if data.normals is not None:
            mesh.CreateNormalsAttr(data.normals.astype(np.float32))
            mesh.SetNormalsInterpolation("vertex")
        if data.uvs is not None:
            api = UsdGeom.PrimvarsAPI(mesh)
            st = api.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
            st.Set(data.uvs.astype(np.float32))
        return self._place(mesh, material, at, turn)

    def sphere(self, name: str, radius: float, material: str, at: Triple) -> str:
        """Adds a Sphere about `at`."""
        gprim = UsdGeom.Sphere.Define(self.stage, f"/World/{name}")
        gprim.CreateRadiusAttr(radius)
        gprim.CreateExtentAttr([Gf.Vec3f(-radius), Gf.Vec3f(radius)])
        return self._place(gprim, material, at, 0.0)

    def cube(self, name: str, sides: Triple, material: str, at: Triple, turn: float = 0.0) -> str:
        """Adds a scaled Cube standing at `at`."""
        gprim = UsdGeom.Cube.Define(self.stage, f"/World/{name}")
        gprim.CreateSizeAttr(1.0)
        gprim.CreateExtentAttr([Gf.Vec3f(-0.5), Gf.Vec3f(0.5)])
        path = self._place(gprim, material, (at[0], at[1] + sides[1] / 2, at[2]), turn)
        gprim.AddScaleOp().Set(Gf.Vec3f(*sides))
        return path

    def plane(self, name: str, width: float, length: float, material: str, y: float = 0.0) -> str:
        """Adds a horizontal Plane about the origin."""
        gprim = UsdGeom.Plane.Define(self.stage, f"/World/{name}")
        gprim.CreateAxisAttr("Y")
        gprim.CreateWidthAttr(width)
        gprim.CreateLengthAttr(length)
        return self._place(gprim, material, (0, y, 0), 0.0)

    def _place(self, gprim: UsdGeom.Gprim, material: str, at: Triple, turn: float) -> str:
        gprim.AddTranslateOp().Set(Gf.Vec3d(*at))
        if turn:
            gprim.AddRotateYOp().Set(turn)
        UsdShade.MaterialBindingAPI.Apply(gprim.GetPrim()).Bind(
            UsdShade.Material(self.stage.GetPrimAtPath(material))
        )
        return str(gprim.GetPath())

    def rect_light(
        self, name: str, eye: Triple, target: Triple, width: float, height: float, radiance: Triple
    ) -> None:
        """Adds a RectLight at `eye` shining at `target`."""
        light = UsdLux.RectLight.Define(self.stage, f"/World/{name}")
        light.CreateWidthAttr(width)
        light.CreateHeightAttr(height)
        light.CreateIntensityAttr(max(radiance))
        light.CreateColorAttr(Gf.Vec3f(*radiance) / max(radiance))
        light.AddTransformOp().Set(_look_at(eye, target))

    def sphere_light(self, name: str, at: Triple, radius: float, power: Triple) -> None:
        """Adds a normalized SphereLight."""
        light = UsdLux.SphereLight.Define(self.stage, f"/World/{name}")
        light.CreateRadiusAttr(radius)
        light.CreateNormalizeAttr(True)
        # Normalization divides by the world-space area, which grows with the stage's units.
        light.CreateIntensityAttr(max(power) * self._units**2)
        light.CreateColorAttr(Gf.Vec3f(*power) / max(power))
        light.AddTranslateOp().Set(Gf.Vec3d(*at))

    def distant_light(self, name: str, direction: Triple, angle: float, irradiance: float) -> None:
        """Adds a DistantLight shining along `direction` with an irradiance at normal incidence."""
        light = UsdLux.DistantLight.Define(self.stage, f"/World/{name}")
        light.CreateAngleAttr(angle)
        light.CreateNormalizeAttr(True)
        light.CreateIntensityAttr(irradiance)
        light.AddTransformOp().Set(_look_at((0, 0, 0), direction))

    def dome_light(
        self, name: str, radiance: float, color: Triple = (1, 1, 1), texture: str = "", turn: float = 0.0
    ) -> None:
        """Adds a DomeLight, constant or with a latlong texture."""
        light = UsdLux.DomeLight.Define(self.stage, f"/World/{name}")
        light.CreateIntensityAttr(radiance)
        light.CreateColorAttr(Gf.Vec3f(*color))
        if texture:
            light.CreateTextureFileAttr("./" + texture)
            light.CreateTextureFormatAttr("latlong")
        if turn:
            light.AddRotateYOp().Set(turn)

    def camera(self, eye: Triple, target: Triple, fov_deg: float = 40.0, aspect: float = 4 / 3) -> str:
        """Adds /World/camera with a vertical field of view; returns its path."""
        camera = UsdGeom.Camera.Define(self.stage, "/World/camera")
        camera.CreateFocalLengthAttr(35.0)
        vertical = 2 * 35.0 * math.tan(math.radians(fov_deg) / 2)
        camera.CreateVerticalApertureAttr(vertical)
        camera.CreateHorizontalApertureAttr(vertical * aspect)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1e5))
        camera.AddTransformOp().Set(_look_at(eye, target))
        return "/World/camera"


def _look_at(eye: Triple, target: Triple) -> Gf.Matrix4d:
    """A transform at `eye` whose -Z axis points at `target`."""
    e, t = Gf.Vec3d(*eye), Gf.Vec3d(*target)
    up = Gf.Vec3d(0, 1, 0) if abs((t - e).GetNormalized()[1]) < 0.99 else Gf.Vec3d(0, 0, -1)
    return Gf.Matrix4d().SetLookAt(e, t, up).GetInverse()
