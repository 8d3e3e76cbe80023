"""Cameras: UsdGeom.Camera -> Camera records.

Apertures, offsets and focal length stay in their common unit, a tenth of a stage unit: it cancels for a
perspective camera; the picture of an orthographic one is a tenth of its aperture wide.
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Usd, UsdGeom

from usdslf.scene.records import F64, Camera
from usdslf.usd.notes import Notes
from usdslf.usd.read.input_values import floats
from usdslf.usd.read.origin import HERE, Origin


def read_cameras(stage: Usd.Stage, time: Usd.TimeCode, notes: Notes, origin: Origin = HERE) -> list[Camera]:
    """Returns all cameras of a stage, relative to an origin, in the order of prims."""
    transforms = UsdGeom.XformCache(time)
    prims = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    away = Gf.Matrix4d().SetTranslate(-Gf.Vec3d(*origin))
    return [
        read_camera(UsdGeom.Camera(p), transforms.GetLocalToWorldTransform(p) * away, time, notes)
        for p in prims
        if p.IsA(UsdGeom.Camera)
    ]


def read_camera(camera: UsdGeom.Camera, world: Gf.Matrix4d, time: Usd.TimeCode, notes: Notes) -> Camera:
    """Returns one camera; `world` is USD's local-to-world matrix."""
    path = camera.GetPath()
    perspective = camera.GetProjectionAttr().Get(time) != UsdGeom.Tokens.orthographic
    def number(attribute: Usd.Attribute, fallback: float, is_size: bool = False) -> float:
        found = floats(attribute.Get(time))
        if found is not None and len(found) == 1 and (found[0] > 0 or not is_size):
            return found[0]
        notes.add(f"{attribute.GetName()} of camera {{}} has no usable value: {fallback:g} is taken", path)
        return fallback

    clipped = floats(camera.GetClippingRangeAttr().Get(time)) or (0.0, np.inf)
    near, far = clipped if len(clipped) == 2 else (0.0, np.inf)
    if not near < far:
        notes.add("the clipping range of camera {} is empty: nothing is clipped", path)
        near, far = 0.0, np.inf
    focal_length = number(camera.GetFocalLengthAttr(), 50.0)
    if perspective and focal_length <= 0:
        notes.add("camera {} has no focal length: 50 is used", path)
        focal_length = 50.0
    if perspective and (camera.GetFStopAttr().Get(time) or 0) > 0:
        notes.add("depth of field of camera {} is not shown", path)
    exposure = camera.ComputeLinearExposureScale(time)
    if abs(exposure - 1) > 1e-6:
        reason = f"the exposure of camera {{}} (a factor of {exposure:.4g}) is not applied: pictures are radiance"
        notes.add(reason, path)
    return Camera(
        path=str(path),
        world_from_camera=rigid(np.array(world, np.float64).T),
        horizontal_aperture=number(camera.GetHorizontalApertureAttr(), 20.955, is_size=True),
        vertical_aperture=number(camera.GetVerticalApertureAttr(), 15.2908, is_size=True),
        focal_length=focal_length,
        horizontal_offset=number(camera.GetHorizontalApertureOffsetAttr(), 0.0),
        vertical_offset=number(camera.GetVerticalApertureOffsetAttr(), 0.0),
        perspective=perspective,
        near=max(float(near), 0.0),
        far=float(far),
    )


def rigid(world: F64) -> F64:
    """Returns a rotation and translation (4, 4) with the view axis and up direction of `world`."""

    def unit(v: F64, otherwise: tuple[float, float, float]) -> F64:
        length = np.linalg.norm(v)
        return v / length if length > 0 else np.asarray(otherwise)

    back = unit(world[:3, 2], (0.0, 0.0, 1.0))
    up = unit(world[:3, 1] - back * (world[:3, 1] @ back), (0.0, 1.0, 0.0))
    out = np.eye(4)
    out[:3, :3] = np.stack([np.cross(up, back), up, back], 1)
    out[:3, 3] = world[:3, 3]
    return out
