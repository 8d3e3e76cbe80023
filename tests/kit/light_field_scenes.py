"""Light fields of scenes of a few records, by the whole chain, and of elements without a scene."""

from __future__ import annotations

from dataclasses import dataclass, fields
from types import SimpleNamespace

import numpy as np
from kit.scene_records import make_scene

from usdslf.elements.elements import Elements, sample_elements
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import Device
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import ESCAPES
from usdslf.light_field.static_light import static_light
from usdslf.light_field.visibility import Visibility, trace_visibility
from usdslf.rays import RayTracer
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.scene.records import Light, Material, Mesh, Scene, constant


@dataclass(frozen=True)
class Lit:
    """All steps from a scene to its light field."""

    scene: Scene
    tracer: RayTracer
    elements: Elements
    lookup: ElementLookup
    visibility: Visibility
    fixed: np.ndarray
    field: LightField

    @property
    def outgoing(self) -> np.ndarray:
        """Radiance (N, D, 3)."""
        return self.field.device.download(self.field.outgoing_d)


def material(
    diffuse: float | tuple = 0.5, specular: float = 0.0, roughness: float = 0.5, emission: float = 0.0, **other: float
) -> Material:
    """A UsdPreviewSurface of the specular workflow."""
    color = lambda v: constant(*np.broadcast_to(v, 3))  # noqa: E731
    return Material(
        "",
        diffuse_color=color(diffuse),
        use_specular_workflow=True,
        specular_color=color(specular),
        roughness=constant(roughness),
        emissive_color=color(emission),
        **{k: constant(v) for k, v in other.items()},
    )


def lit(
    device: Device,
    meshes: list[Mesh],
    materials: list[Material],
    lights: tuple[Light, ...] = (),
    count: int = 300,
    model: str = "phong",
    bounces: int = 40,
    tolerance: float = 1e-5,
    seed: int = 0,
) -> Lit:
    """Scene, rays, elements, visibility, fixed light, bounces."""
    scene = make_scene(*meshes, materials=materials, lights=lights)
    tracer = RayTracer(scene)
    elements = sample_elements(scene, tracer, count, np.random.default_rng(seed))
    return of_elements(device, scene, tracer, elements, model, bounces, tolerance)


def of_elements(
    device: Device, scene: Scene, tracer: RayTracer, elements: Elements, model: str, bounces: int = 40,
    tolerance: float = 1e-5,
) -> Lit:  # fmt: skip
    """The steps after the elements."""
    lookup = ElementLookup(scene, tracer, elements)
    visibility = trace_visibility(elements, lookup, tracer, device)
    fixed = static_light(elements, tracer, scene.lights, visibility).diffuse
    field = LightField(device, elements, lookup, visibility, fixed, model)
    for _ in field.converge(bounces, tolerance):
        pass
    return Lit(scene, tracer, elements, lookup, visibility, fixed, field)


def lone_elements(n: int, seed: int = 0, **reflectance: np.ndarray | float) -> Elements:
    """n elements at the origin that see nothing but the sky, their frames turned at random."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.normal(size=(n, 3, 3)))
    q *= np.sign(np.linalg.det(q))[:, None, None]
    values = {
        "frame": q, "normal": q[:, 2], "geometric_normal": q[:, 2], "area": 1.0, "side": 1, "opacity": 1.0,
        "presence": 1.0, "roughness": 0.5, "clearcoat_roughness": 0.01, "coat_f0": 0.04, **reflectance,
    }  # fmt: skip
    vectors = {"position", "diffuse", "f0", "f90", "emission", "base_color", "specular_color", "normal"}
    shapes = {"frame": (n, 3, 3), "geometric_normal": (n, 3), "barycentric": (n, 2), "part_of_triangle": (1,)}
    integers = {"mesh", "triangle", "material", "side", "part", "part_of_triangle"}
    arrays = {}
    for field in fields(Elements):
        name = field.name
        shape = shapes.get(name, (n, 3) if name in vectors else (n,))
        value = np.asarray(values.get(name, 0.0))
        if value.ndim == 1 and len(shape) == 2:
            value = value[:, None]
        arrays[name] = np.broadcast_to(value, shape).astype(np.int32 if name in integers else np.float32).copy()
    return Elements(**arrays)


def under_sky(
    device: Device, elements: Elements, fixed: np.ndarray | float = 1.0, model: str = "preview_surface"
) -> np.ndarray:
    """Outgoing radiance (n, D, 3) of lone elements after one bounce of fixed light (n, D, 3)."""
    n = len(elements)
    hit = np.full((n, D), ESCAPES, np.uint32)
    fixed = np.broadcast_to(np.float32(fixed), (n, D, 3))
    visibility = SimpleNamespace(hit=hit)
    field = LightField(device, elements, None, visibility, fixed, model)
    field.bounce()
    return device.download(field.outgoing_d)


def world_bins(elements: Elements) -> np.ndarray:
    """World directions (n, D, 3) of all bins."""
    return bin_directions() @ elements.frame.astype(np.float64)
