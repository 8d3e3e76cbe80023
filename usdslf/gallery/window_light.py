"""Editing under an environment map: a white stroke on a teapot is understood as a highlight.

The stroke is laid where the teapot would mirror the brightest part of the environment, whatever that is, in one
white, a tenth as bright as what would be mirrored there.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.gallery.environment import put_environment
from usdslf.gallery.records import Entry, PlayLike, Point
from usdslf.gallery.still_life import teapot
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import QuadMesh, curve, join, lathe, panel, tube
from usdslf.procedural.textures import planks
from usdslf.scene.cameras import camera_rays
from usdslf.session import Session
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.textures.images import write_image

RADIUS = 0.012
SHARE = 0.1  # of the environment's light that the stroke asks for
LOBE = 0.02  # solid angle [sr] of the highlight that is painted
MATERIALS: dict[str, Inputs] = {
    "table": {"diffuseColor": "planks.png", "roughness": 0.6},
    "glaze": {"useSpecularWorkflow": 1, "diffuseColor": (0.09, 0.20, 0.19), "specularColor": (0.015, 0.015, 0.015),
              "roughness": 0.22},
    "china": {"diffuseColor": (0.72, 0.70, 0.65), "roughness": 0.35},
}  # fmt: skip


def cup() -> QuadMesh:
    """A cup on a saucer that stands on the origin."""
    saucer = [(0, 0.0), (0.05, 0.0), (0.055, 0.006), (0.10, 0.022), (0.115, 0.032), (0.112, 0.036), (0.095, 0.028),
              (0.05, 0.014), (0, 0.013)]  # fmt: skip
    bowl = [(0, 0.016), (0.036, 0.016), (0.04, 0.024), (0.062, 0.06), (0.074, 0.11), (0.077, 0.115), (0.071, 0.112),
            (0.058, 0.062), (0.034, 0.03), (0, 0.028)]  # fmt: skip
    handle = curve([(0.066, 0.09, 0), (0.105, 0.095, 0), (0.105, 0.055, 0), (0.057, 0.045, 0)], 30)
    return join(lathe(curve(saucer, 80), 80), lathe(curve(bowl, 100), 80), tube(handle, 0.007))


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its textures and environment written."""
    write_image(folder / "planks.png", planks())
    parts = (
        Part("table", panel((-1.1, 0, 1.0), (2.2, 0, 0), (0, 0, -1.9)), "table"),
        Part("teapot", teapot().moved((-0.08, 0, -0.05)), "glaze"),
        Part("cup_left", cup().moved((-0.42, 0, 0.22)), "china"),
        Part("cup_right", cup().moved((0.34, 0, 0.26)), "china"),
    )
    lamps = (Lamp("environment", "dome", (1.0, 1.0, 1.0), file=put_environment(folder, hdri)),)
    views = (
        View("camera", (0.10, 0.62, 1.45), (-0.03, 0.15, 0.0), 46.0),
        View("from_the_left", (-0.95, 0.50, 1.05), (-0.05, 0.15, 0.0), 42.0),
    )
    return BuiltShot("window_light", MATERIALS, parts, lamps, views)


def run(play: PlayLike) -> None:
    """One white stroke on the teapot."""
    places, bright = glint(play.session, play.shot.view_path(), "/window_light/teapot")
    white = (SHARE * bright,) * 3
    play.paint([(white, places)], RADIUS)
    (pot,) = play.step("a white stroke on the teapot").report["strokes"]
    more = float(np.mean(pot["after"]["specular"])) / float(np.mean(pot["before"]["specular"]))
    play.shows(
        "The white stroke is understood as a highlight", pot["inferred"] == "specular" and more > 2,
        f"{pot['inferred']}, {more:.1f} times as strong",
    )  # fmt: skip
    same = pot["after"]["diffuse"] == pot["before"]["diffuse"]
    play.shows("The teapot's own colour stays", same)


def glint(session: Session, camera: str, gprim: str) -> tuple[list[Point], float]:
    """Returns up to three near places on a picture where a gprim mirrors the brightest part of the dome, and how
    bright that is."""
    x, y = np.meshgrid((np.arange(128) + 0.5) / 128, (np.arange(72) + 0.5) / 72)
    at = np.stack([x.ravel(), y.ravel()], 1)
    rays = camera_rays(session.camera(camera), at, 16 / 9)
    hits = session.tracer.intersect(rays.origin, rays.direction)
    wanted = [i for i, m in enumerate(session.scene.meshes) if m.path == gprim]
    on = np.flatnonzero((hits.triangle >= 0) & np.isin(session.scene.triangles.mesh[hits.triangle], wanted))
    points = evaluate_surface(session.scene, hits.triangle[on], hits.barycentric[on])
    facing = np.einsum("ij,ij->i", points.normal, -rays.direction[on])
    mirrored = rays.direction[on] + 2 * facing[:, None] * points.normal
    start = session.tracer.offset_points(points.position, points.geometric_normal, points.triangle)
    light = sum(d.dome.radiance(mirrored, LOBE).mean(1) for d in session.light_set.domes)
    light = np.where(session.tracer.occluded(start, mirrored) | (facing < 0.35), 0, light)
    best = int(np.argmax(light))
    near = np.linalg.norm(points.position - points.position[best], axis=1) < 0.03
    chosen = np.flatnonzero(near & (light > 0.5 * light[best]))
    chosen = chosen[np.argsort(-light[chosen])][:3]
    return [(float(u), float(v)) for u, v in at[on[chosen]]], float(light[chosen].mean())


ENTRY = Entry(
    "window_light",
    "20",
    "Editing under an environment map",
    "No type of lighting is assumed: under a captured environment a white stroke onto the teapot is interpreted as a "
    "highlight.",
    build,
    run,
    has_environment=True,
)
