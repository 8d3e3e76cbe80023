"""A light rig that nobody painted under: whether a change that fits the shot's light also holds in another.

    held_out_rig(shot, camera) -> (lights, words)

Out of doors and round objects: a key over the right shoulder, where the default key of a stage is over the left one,
and a dim dome. Inside of a room, with windows or without, the key does not get in: a lamp beside the camera.
"""

from __future__ import annotations

import numpy as np

from usdslf.render.overview_camera import find_room
from usdslf.sampling.frames import tangents
from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import F64, Camera, Light
from usdslf.shot import Shot

KEY_IRRADIANCE = 2.5  # of the key on a surface that faces it
KEY_ANGLE = np.radians(8.0)
DOME_RADIANCE = 0.2
LIT = 0.1  # of what a camera sees, that the key has to reach
PROBES = 48, 27  # rays of a camera that ask whether it does
LAMP_SIZE = 0.02  # radius, of the scene's diagonal
LAMP_OFFSET = 0.08  # up and to the right of the camera, of the scene's diagonal


def held_out_rig(shot: Shot, camera: Camera) -> tuple[tuple[Light, ...], str]:
    """Returns lights for a shot, and words for them.

    Args:
        camera: that looks.
    """
    matrix = np.asarray(camera.world_from_camera, np.float64)
    right, up, back, eye = (matrix[:3, i] for i in range(4))
    turn, lift = np.radians(55.0), np.radians(40.0)
    towards = np.cos(lift) * (np.cos(turn) * back + np.sin(turn) * right) + np.sin(lift) * up
    if find_room(shot.scene, shot.tracer) is not None or _share_lit(shot, camera, towards) < LIT:
        size, reach = LAMP_SIZE * shot.scene.diagonal, LAMP_OFFSET * shot.scene.diagonal
        frame = np.eye(4)
        frame[:3, 3] = eye + reach * (0.5 * up + 0.5 * right)
        away = 0.3 * shot.scene.diagonal  # where its irradiance is that of the key
        level = KEY_IRRADIANCE * away**2 / (np.pi * size**2)
        return (Light("", "sphere", (level,) * 3, frame, radius=size),), "a lamp beside the camera"
    level = KEY_IRRADIANCE / (np.pi * np.sin(KEY_ANGLE / 2) ** 2)
    key = Light("", "distant", (level,) * 3, _facing(towards), angle=float(KEY_ANGLE))
    dome = Light("", "dome", (DOME_RADIANCE,) * 3, np.eye(4))
    return (key, dome), "a key over the right shoulder and a dim dome"


def _share_lit(shot: Shot, camera: Camera, towards: F64) -> float:
    """The share of what a camera sees that light from a direction reaches; 1 where it sees nothing."""
    x, y = ((np.arange(n) + 0.5) / n for n in PROBES)
    rays = camera_rays(camera, np.stack(np.meshgrid(x, y), -1).reshape(-1, 2), PROBES[0] / PROBES[1])
    met = shot.tracer.intersect(rays.origin, rays.direction)
    hit = met.triangle >= 0
    if not hit.any():
        return 1.0
    at = rays.origin[hit] + 0.999 * met.distance[hit, None] * rays.direction[hit]  # just before what is met
    way = np.broadcast_to((towards / np.linalg.norm(towards)).astype(np.float32), at.shape)
    return float((~shot.tracer.occluded(at.astype(np.float32), np.ascontiguousarray(way))).mean())


def _facing(towards: F64) -> F64:
    frame = np.eye(4)
    frame[:3, 2] = towards / np.linalg.norm(towards)
    s, t = tangents(frame[:3, 2][:, None])
    frame[:3, 0], frame[:3, 1] = s[:, 0], t[:, 0]
    return frame
