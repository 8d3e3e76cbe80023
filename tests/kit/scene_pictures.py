"""Pictures of scenes of a few records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from kit.scene_records import quad
from numpy.typing import NDArray
from pxr import Gf

from usdslf.gpu.device import Device
from usdslf.rays import RayTracer
from usdslf.render.picture import LitScene, PictureOptions, render
from usdslf.scene.records import Camera, Light, Material, Scene, constant

SIZE = (36, 28)


def camera_at(eye: Sequence[float], target: Sequence[float] = (0, 0, 0), **changes: Any) -> Camera:
    """A camera with a field of view of 36 degrees, up along y (-z when it looks along y)."""
    e, t = Gf.Vec3d(*map(float, eye)), Gf.Vec3d(*map(float, target))
    up = Gf.Vec3d(0, 0, -1) if abs((t - e).GetNormalized()[1]) > 0.99 else Gf.Vec3d(0, 1, 0)
    m = np.array(Gf.Matrix4d().SetLookAt(e, t, up).GetInverse()).T
    return Camera(**{**dict(path="/c", world_from_camera=m, horizontal_aperture=36.0, vertical_aperture=24.0,
                            focal_length=55.0), **changes})  # fmt: skip


def matte(color: Sequence[float] = (0.5, 0.5, 0.5), **inputs: Any) -> Material:
    """As Lambertian as UsdPreviewSurface gets: F0 = 0, but F90 = 1."""
    return Material("/matte", diffuse_color=constant(*color), roughness=constant(1.0), ior=constant(1.0), **inputs)


def ground(half: float = 1.0, **kw: Any) -> Any:
    """A square in y = 0 facing up."""
    return quad((-half, 0, half), (2 * half, 0, 0), (0, 0, -2 * half), **kw)


def white_dome(radiance: float = 1.0) -> Light:
    return Light("/dome", "dome", (radiance,) * 3, np.eye(4))


def looking_down(at: Sequence[float]) -> NDArray:
    """The frame of a light at a point, shining along -y."""
    m = np.eye(4)
    m[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    m[:3, 3] = at
    return m


def picture(scene: Scene, camera: Camera, device: Device, **options: Any) -> dict:
    """Layers by name, of a scene without a light field."""
    names = options.pop("aovs", ("color",))
    size = options.pop("size", SIZE)
    lit = LitScene(scene, RayTracer(scene), None, scene.lights, device)
    return render(lit, camera, size, names, PictureOptions(**options))
