"""Lights of every kind, placed and turned, and their irradiance: sampled, and in closed form."""

import numpy as np
from reference import lights as ref

from usdslf.lights.sampling import sample_light
from usdslf.sampling.low_discrepancy import random_shifts, sobol_points
from usdslf.scene.records import Camera, Light, Material, Mesh, Scene

SPHERE, _ = ref.fibonacci_cone(20_000)


def rotation(seed: int) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def placed(linear: np.ndarray | None = None, at: tuple = (0.0, 0.0, 0.0)) -> np.ndarray:
    m = np.eye(4)
    m[:3, :3] = np.eye(3) if linear is None else linear
    m[:3, 3] = at
    return m


def light_of(kind: str, linear: np.ndarray | None = None, at: tuple = (0.3, 0.2, 0.1)) -> Light:
    return Light(
        "/light", kind, (1.0, 2.0, 3.0), placed(linear, at),
        width=1.3, height=0.6, radius=0.4, length=1.7, angle=np.radians(50),
    )  # fmt: skip


def world(light: Light, local: tuple) -> np.ndarray:
    return (light.world_from_light @ [*local, 1])[:3]


def corners_of(light: Light) -> np.ndarray:
    x, y = light.width / 2, light.height / 2
    return np.array([world(light, c) for c in ((-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0))])


def estimate(light: Light, point: np.ndarray, normal: np.ndarray) -> tuple[float, float]:
    """Irradiance of the first channel for radiance 1, and the noise of 64 samples relative to it."""
    sets = 64
    u = sobol_points(0, 64, random_shifts(sets, np.random.default_rng(1))).reshape(-1, 2)
    s = sample_light(light, np.broadcast_to(point, (len(u), 3)), u)
    value = np.where(s.pdf > 0, s.radiance[:, 0] * np.maximum(s.direction @ normal, 0), 0)
    value = (value / np.where(s.pdf > 0, s.pdf, 1)).reshape(sets, -1).mean(1)
    return float(value.mean()), float(value.std() / value.mean())


def expected_irradiance(light: Light, point: np.ndarray, normal: np.ndarray) -> float:
    if light.kind == "rect":
        return ref.polygon_irradiance(corners_of(light), point, normal)
    local = np.linalg.inv(light.world_from_light)
    p, n = local[:3, :3] @ point + local[:3, 3], local[:3, :3] @ normal
    if light.kind == "cylinder":
        return ref.cylinder_irradiance(light.radius, light.length, p, n)
    if light.kind == "sphere":
        return ref.sphere_irradiance(light.radius, np.linalg.norm(p), -(p @ n) / np.linalg.norm(p))
    if light.kind == "distant":
        return ref.cone_irradiance(light.angle / 2, n[2])
    polygon = light.radius * np.stack([f(2 * np.pi * np.arange(720) / 720) for f in (np.cos, np.sin)], 1)
    polygon = np.concatenate([polygon, np.zeros((720, 1))], 1)
    return ref.polygon_irradiance(polygon, p, n)


def scene_of(meshes: tuple[Mesh, ...] = (), cameras: tuple[Camera, ...] = (), up_axis: str = "Y") -> Scene:
    return Scene("", np.nan, meshes, (Material(""),), (), cameras, up_axis)
