"""A path tracer for USD stages, independent of usdslf, on Mitsuba 3 (CPU).

    python tests/reference/pathtracer.py STAGE CAMERA OUT.exr [--width W] [--height H] [--spp N]

Pictures are scene-linear float32 RGB on the UsdLux scale, without view transform or exposure.  Not in it:
light shaping, creases, UDIM, depth of field; emissive meshes shine from their front sides only.  What it
meets and cannot honour is in `Tracer.warnings`.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdLux
from reference.mitsuba_setup import set_variant

set_variant()

import mitsuba as mi  # noqa: E402
from reference.pathtracer_lights import LightReader  # noqa: E402
from reference.pathtracer_shapes import ShapeReader  # noqa: E402

PATHS_AT_ONCE = 1 << 21
SKIPPED_PURPOSES = ("guide", "proxy")


class Tracer:
    """A stage at one time, ready to be rendered.

    Args:
      stage: an open stage or the path of one.
      model: masking of the BSDF, see preview_surface_bsdf.
      max_depth: longest path; 2 is direct light only.
      hide_lights: lights are not seen by camera rays.
    """

    def __init__(
        self,
        stage: Usd.Stage | str | Path,
        model: str = "ggx",
        max_depth: int = 16,
        hide_lights: bool = False,
        time: float | None = None,
    ) -> None:
        self.stage = stage if isinstance(stage, Usd.Stage) else Usd.Stage.Open(str(stage))
        self.time = Usd.TimeCode.EarliestTime() if time is None else Usd.TimeCode(time)
        self.warnings: list[str] = []
        shapes = ShapeReader(self.time, model, self.warnings)
        lights = LightReader(self.stage, self.time, self.warnings)
        transforms = UsdGeom.XformCache(self.time)
        for prim in stage_prims(self.stage):
            if not is_shown(prim, self.time):
                continue
            world = np.array(transforms.GetLocalToWorldTransform(prim), np.float64).T
            if prim.IsA(UsdGeom.PointInstancer):
                for part, placed in instanced_prims(UsdGeom.PointInstancer(prim), world, self.time):
                    if part.IsA(UsdGeom.Gprim) and is_shown(part, self.time):
                        shapes.read(part, placed)
            elif prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdGeom.Gprim):
                lights.read(prim, world)
            elif prim.IsA(UsdGeom.Gprim):
                shapes.read(prim, world)
        description: dict[str, Any] = {"type": "scene"}
        self.prims: dict[str, str] = {}  # id of a shape -> prim path
        for i, (shape, prim) in enumerate(zip(shapes.shapes, shapes.prims)):
            description[f"shape{i:05d}"] = shape
            self.prims[f"shape{i:05d}"] = prim
        self.materials = {f"shape{i:05d}": material for i, material in enumerate(shapes.materials)}
        for i, emitter in enumerate(lights.emitters(*shapes.bounding_sphere())):
            description[f"light{i:05d}"] = emitter
        self.scene = mi.load_dict(description)
        self.integrator = mi.load_dict(
            {"type": "path", "max_depth": max_depth, "rr_depth": 1000, "hide_emitters": hide_lights}
        )
        self.warnings = list(dict.fromkeys(self.warnings))

    def render(self, camera: str, width: int, height: int, spp: int, seed: int = 0) -> NDArray:
        """Returns the picture (height, width, 3), box-filtered."""
        sensor = mi.load_dict(camera_description(self.stage, camera, width, height, self.time))
        at_once = max(1, min(spp, PATHS_AT_ONCE // (width * height)))
        total, done = np.zeros((height, width, 3)), 0
        while done < spp:
            count = min(at_once, spp - done)
            part = mi.render(
                self.scene, sensor=sensor, integrator=self.integrator, spp=count, seed=seed + done
            )
            total += np.array(part, np.float64) * count
            done += count
        return (total / spp).astype(np.float32)

    def radiance(self, origins: NDArray, directions: NDArray, seed: int = 0) -> NDArray:
        """Returns one path's radiance estimate (n, 3) along each ray."""
        parts = []
        for first in range(0, len(origins), PATHS_AT_ONCE):
            part = slice(first, first + PATHS_AT_ONCE)
            ray = mi.RayDifferential3f(_ray(origins[part], directions[part]))
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(seed + first, len(origins[part]))
            value, _, _ = self.integrator.sample(self.scene, sampler, ray)
            parts.append(np.array(value).T)
        return np.concatenate(parts)

    def first_surfaces(self, origins: NDArray, directions: NDArray) -> Surfaces:
        """Returns what rays (n, 3) meet first, textures read; cut-out surfaces are met too."""
        si = self.scene.ray_intersect(_ray(origins, directions))
        n = len(origins)
        names = np.full(n, "", object), np.full(n, "", object)
        numbers = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n), np.zeros(n)
        for shape in self.scene.shapes():
            is_met = np.array(si.shape == mi.ShapePtr(shape))
            if not is_met.any() or shape.id() not in self.prims:
                continue
            d, f0, _, roughness, opacity = shape.bsdf().surface(si, mi.Bool(is_met))
            names[0][is_met], names[1][is_met] = self.prims[shape.id()], self.materials[shape.id()]
            for whole, part in zip(numbers, (d, f0, roughness, opacity), strict=True):
                rows = np.array(part).T if whole.ndim == 2 else np.array(part)
                whole[is_met] = np.broadcast_to(rows, whole.shape)[is_met]
        return Surfaces(*names, *numbers)

    def first_hits(self, origins: NDArray, directions: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Returns prim paths (n,) of str ("" for none), positions and diffuse reflectances (n, 3)."""
        si = self.scene.ray_intersect(_ray(origins, directions))
        bsdf = si.bsdf()
        diffuse = np.array(bsdf.eval_diffuse_reflectance(si, si.is_valid())).T
        names = np.full(len(origins), "", object)
        for shape in self.scene.shapes():
            names[np.array(si.shape == mi.ShapePtr(shape))] = self.prims.get(shape.id(), "")
        return names, np.array(si.p).T, diffuse


@dataclass(frozen=True)
class Surfaces:
    """What rays meet first, (n, ...) each; where they meet nothing, names are empty and numbers 0."""

    prim: NDArray  # paths, str
    material: NDArray  # paths, str
    diffuse: NDArray  # (n, 3) as the BSDF uses it
    f0: NDArray  # (n, 3)
    roughness: NDArray
    opacity: NDArray


def is_shown(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Whether a prim is drawn: visible, and of purpose default or render."""
    imageable = UsdGeom.Imageable(prim)
    return bool(
        imageable
        and imageable.ComputeVisibility(time) != "invisible"
        and imageable.ComputePurpose() not in SKIPPED_PURPOSES
    )


def stage_prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Yields the prims of a stage, into instances, and not into point instancers."""
    walk = iter(
        Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    )
    for prim in walk:
        if prim.IsA(UsdGeom.PointInstancer):
            walk.PruneChildren()
        yield prim


def instanced_prims(
    instancer: UsdGeom.PointInstancer, world: NDArray, time: Usd.TimeCode
) -> Iterator[tuple[Usd.Prim, NDArray]]:
    """Yields the prims below each instance's prototype with their transforms (4, 4), world from prim."""
    which = instancer.GetProtoIndicesAttr().Get(time) or []
    prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
    mask = instancer.ComputeMaskAtTime(time)
    placed = instancer.ComputeInstanceTransformsAtTime(
        time, time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    )
    cache = UsdGeom.XformCache(time)
    for i, (index, matrix) in enumerate(zip(which, placed, strict=True)):
        if len(mask) and not mask[i]:
            continue
        root = instancer.GetPrim().GetStage().GetPrimAtPath(prototypes[index])
        from_parent = cache.GetLocalTransformation(root)[0].GetInverse() * Gf.Matrix4d(matrix)
        above = cache.GetParentToWorldTransform(root).GetInverse()
        for prim in Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
            in_parent = cache.GetLocalToWorldTransform(prim) * above
            yield prim, world @ np.array(in_parent * from_parent, np.float64).T


def _ray(origins: NDArray, directions: NDArray) -> Any:
    return mi.Ray3f(mi.Point3f(origins.T.astype(np.float32)), mi.Vector3f(directions.T.astype(np.float32)))


def camera_frame(stage: Usd.Stage, path: str, time: Usd.TimeCode) -> tuple[NDArray, NDArray]:
    """Returns the eye (3,) and the axes (3, 3) of a camera in columns: right, up, backwards."""
    prim = stage.GetPrimAtPath(path)
    if not prim or not prim.IsA(UsdGeom.Camera):
        raise ValueError(f"no camera at {path}")
    world = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(prim), np.float64).T
    return world[:3, 3], world[:3, :3] / np.linalg.norm(world[:3, :3], axis=0)


def camera_aperture(stage: Usd.Stage, path: str, aspect: float, time: Usd.TimeCode) -> tuple[float, ...]:
    """Returns width and height of the aperture and its offsets, all over the focal length.

    The aperture grows to the picture's aspect ratio (UsdRender's expandAperture).
    """
    camera = UsdGeom.Camera(stage.GetPrimAtPath(path))
    focal = camera.GetFocalLengthAttr().Get(time)
    width = max(
        camera.GetHorizontalApertureAttr().Get(time), camera.GetVerticalApertureAttr().Get(time) * aspect
    )
    x = camera.GetHorizontalApertureOffsetAttr().Get(time)
    y = camera.GetVerticalApertureOffsetAttr().Get(time)
    return width / focal, width / aspect / focal, x / focal, y / focal


def camera_rays(
    stage: Usd.Stage, path: str, xy: NDArray, aspect: float, time: float | None = None
) -> tuple[NDArray, NDArray]:
    """Returns origins and unit directions (n, 3) through places xy (n, 2), in 0..1 from the top left."""
    code = Usd.TimeCode.EarliestTime() if time is None else Usd.TimeCode(time)
    eye, axes = camera_frame(stage, path, code)
    width, height, x0, y0 = camera_aperture(stage, path, aspect, code)
    local = np.stack(
        [(xy[:, 0] - 0.5) * width + x0, (0.5 - xy[:, 1]) * height + y0, -np.ones(len(xy))], axis=1
    )
    directions = local @ axes.T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.broadcast_to(eye, directions.shape), directions


def camera_description(stage: Usd.Stage, path: str, width: int, height: int, time: Usd.TimeCode) -> dict:
    """A USD camera as Mitsuba's perspective sensor."""
    eye, axes = camera_frame(stage, path, time)
    x, y, x0, y0 = camera_aperture(stage, path, width / height, time)
    near, far = UsdGeom.Camera(stage.GetPrimAtPath(path)).GetClippingRangeAttr().Get(time)
    look = mi.ScalarTransform4f().look_at(eye.tolist(), (eye - axes[:, 2]).tolist(), axes[:, 1].tolist())
    return {
        "type": "perspective",
        "fov": 2 * math.degrees(math.atan(x / 2)),
        "fov_axis": "x",
        "near_clip": float(max(near, 1e-4)),
        "far_clip": float(far),
        "principal_point_offset_x": x0 / x,
        "principal_point_offset_y": -y0 / y,
        "to_world": look,
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "independent"},
    }


def write_picture(path: str | Path, picture: NDArray) -> None:
    """Writes (h, w, 3) as EXR."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(picture.shape[1], picture.shape[0], 3, oiio.FLOAT)
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    output = oiio.ImageOutput.create(str(path))
    output.open(str(path), spec)
    output.write_image(np.ascontiguousarray(picture, np.float32))
    output.close()


def main() -> None:
    """Renders one picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("stage")
    parser.add_argument("camera")
    parser.add_argument("out")
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--height", type=int, default=256)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--max-depth", type=int, default=16)
    parser.add_argument("--model", default="ggx", choices=["ggx", "smith", "schlick", "storm"])
    parser.add_argument("--hide-lights", action="store_true")
    parser.add_argument("--time", type=float)
    parser.add_argument("--seed", type=int, default=0)
    a = parser.parse_args()
    tracer = Tracer(a.stage, a.model, a.max_depth, a.hide_lights, a.time)
    for warning in tracer.warnings:
        print("unsupported:", warning, file=sys.stderr)
    picture = tracer.render(a.camera, a.width, a.height, a.spp, a.seed)
    write_picture(a.out, picture)
    print(f"{a.out}: {a.width}x{a.height}, {a.spp} samples, mean {picture.mean():.5f}")


if __name__ == "__main__":
    main()
