"""The light of a stage that has none, and that of a picture of surroundings."""

from __future__ import annotations

import numpy as np

from usdslf.lights.sources import EmissiveSurfaces, SurfaceEmission
from usdslf.sampling.frames import tangents
from usdslf.scene.records import Light, LightTexture, Scene

KEY_IRRADIANCE = 2.0  # of the default key light on a surface that faces it
KEY_ANGLE = np.radians(4.0)
DOME_RADIANCE = 0.35


def default_lights(scene: Scene) -> tuple[tuple[Light, ...], str]:
    """Returns the light of a stage that has none, and a sentence that says so.

    A distant key from over the left shoulder of the first camera, 35 degrees above its view, and a white
    dome: together a white diffuse surface that faces the key has a radiance of about 1.
    """
    up = scene.up
    back = np.array([0.0, -1, 0]) if scene.up_axis == "Z" else np.array([0.0, 0, 1])
    seen_from = "a viewer in front"
    if scene.cameras:
        camera = np.asarray(scene.cameras[0].world_from_camera, np.float64)
        up, back = camera[:3, 1], camera[:3, 2]
        seen_from = scene.cameras[0].path or "the camera"
    left = np.cross(back, up)
    lift, turn = np.radians(35.0), np.radians(30.0)
    towards = np.cos(lift) * (np.cos(turn) * back + np.sin(turn) * left) + np.sin(lift) * up
    towards /= np.linalg.norm(towards)
    key_frame = np.eye(4)
    key_frame[:3, 2] = towards
    s, t = tangents(towards[:, None])
    key_frame[:3, 0], key_frame[:3, 1] = s[:, 0], t[:, 0]
    level = KEY_IRRADIANCE / (np.pi * np.sin(KEY_ANGLE / 2) ** 2)
    key = Light("", "distant", (level,) * 3, key_frame, angle=KEY_ANGLE)
    dome = Light("", "dome", (DOME_RADIANCE,) * 3, np.eye(4))
    return (key, dome), (
        f"the stage has no light: it is lit by a distant key of irradiance {KEY_IRRADIANCE:g} over the left "
        f"shoulder of {seen_from} and a white dome of radiance {DOME_RADIANCE:g}"
    )


def dome_of_picture(picture: str, scene: Scene) -> Light:
    """Returns a dome of radiance 1 that a latlong picture, a file, colours, upright in a scene."""
    upright = np.eye(4)
    if scene.up_axis == "Z":
        upright[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    texture = LightTexture(picture, "latlong", "auto", scene.ocio, scene.working_space)
    return Light("", "dome", (1.0, 1.0, 1.0), upright, texture=texture)


def lights_or_default(scene: Scene) -> tuple[tuple[Light, ...], str]:
    """Returns the lights of a scene and no words; where nothing shines, the default ones and a sentence about them.

    A surface shines if something of it does: an emission texture that is black, or missing, is no light.
    """
    if scene.lights or len(EmissiveSurfaces(scene, SurfaceEmission(scene)).triangle):
        return scene.lights, ""
    return default_lights(scene)
