"""Upsampling a change from elements to texels: with a term in appearance it stays within a texture's edges.

A floor with a checker of two colours; a change is known at the elements, all of it on those of the ochre squares
and none on the others, and is upsampled to texels.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.color import color_of
from usdslf.gallery.records import Entry, PlayLike
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import ball, panel
from usdslf.scene.records import F32, F64
from usdslf.similarity.similarity import places_at
from usdslf.similarity.upsample import upsample
from usdslf.textures.images import write_image
from usdslf.textures.rasterize import texel_points

SQUARES, TEXELS, GRID = 6, 192, 32  # GRID: texels of the file in a square
OCHRE, GREY = (0.78, 0.62, 0.30), (0.42, 0.45, 0.50)  # sRGB encoded
DELTA = np.array([-0.30, -0.02, 0.28])  # of the ochre squares' diffuse colour
MATERIALS: dict[str, Inputs] = {
    "tiles": {"diffuseColor": "checker.png", "roughness": 0.7},
    "glaze": {"diffuseColor": (0.6, 0.58, 0.55), "roughness": 0.3},
}


def is_ochre(st: F64) -> F64:
    """Whether points (n, 2) of the checker lie on squares that change."""
    return np.floor(st * SQUARES).astype(int).sum(-1) % 2 == 0


def checker() -> F32:
    """Returns the texture (h, w, 3), sRGB encoded."""
    n = SQUARES * GRID
    t = (np.arange(n) + 0.5) / n
    s, v = np.meshgrid(t, 1 - t)
    return np.where(is_ochre(np.stack([s, v], -1))[..., None], OCHRE, GREY).astype(np.float32)


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its texture written."""
    write_image(folder / "checker.png", checker())
    parts = (
        Part("floor", panel((-0.9, 0, 0.9), (1.8, 0, 0), (0, 0, -1.8)), "tiles"),
        Part("ball", ball(0.22).moved((0.25, 0.22, -0.35)), "glaze"),
    )
    lamps = (
        Lamp("lamp", "rect", (12.0, 11.5, 10.5), (-0.8, 1.9, 1.0), (0.0, 0.0, 0.0), size=(0.8, 0.8)),
        Lamp("sky", "dome", (0.45, 0.48, 0.52)),
    )
    view = View("camera", (0.0, 1.35, 1.95), (0.0, 0.03, 0.0), 42.0)
    return BuiltShot("upsampling", MATERIALS, parts, lamps, (view,))


def run(play: PlayLike) -> None:
    """No solve: a change that is known at elements goes to texels in two ways."""
    scene, elements = play.session.scene, play.session.elements
    table = scene.triangles
    floor = next(i for i, m in enumerate(scene.materials) if m.path.endswith("/tiles"))
    triangles = np.flatnonzero(table.material == floor)
    uv = scene.corner_uvs("st")[triangles].astype(np.float64)
    mine = np.flatnonzero((elements.material == floor) & (elements.side > 0))
    known = places_at(scene, elements.triangle[mine], elements.barycentric[mine])
    corner = {t: uv[i] for i, t in enumerate(triangles)}
    bary = elements.barycentric[mine].astype(np.float64)
    weight = np.stack([1 - bary.sum(1), bary[:, 0], bary[:, 1]], 1)
    st = np.einsum("nk,nkc->nc", weight, np.array([corner[t] for t in elements.triangle[mine]]))
    values = np.where(is_ochre(st)[:, None], DELTA, 0.0)
    spacing = float(np.sqrt(elements.area[mine].mean()))

    (points,) = texel_points(uv, TEXELS, TEXELS, "clamp", "clamp")
    texels = places_at(scene, triangles[points.triangle], points.barycentric)
    at = np.stack([(points.x + 0.5) / TEXELS, 1 - (points.y + 0.5) / TEXELS], -1)
    true = is_ochre(at).astype(float)
    pictures, leaks = [], {}
    for appearance in (False, True):
        change = upsample(texels, known, values, spacing, appearance)
        share = change @ DELTA / (DELTA @ DELTA)
        leaks[appearance] = float(share[true == 0].mean()), float((1 - share[true == 1]).mean())
        texture = np.zeros((TEXELS, TEXELS, 3), np.float32)
        texture[points.y, points.x] = np.clip(texels.reflectance[:, :3] + change, 0, 1)
        pictures.append(texture)
    said = [f"{leaks[a][0]:.4f} of the change with{'' if a else 'out'} appearance" for a in (False, True)]
    play.shows("Without appearance the change leaks over the edges", leaks[False][0] > 0.05, said[0])
    play.shows("With it next to nothing leaks", leaks[True][0] < 0.005, said[1])
    play.shows(
        "What changes, changes fully", leaks[True][1] < 0.005,
        f"{leaks[True][1]:.4f} of it is missing with appearance, {leaks[False][1]:.4f} without",
    )  # fmt: skip
    if play.has_pictures:
        play.look_at(play.session, "shot", "the shot as it is")
        color = color_of(scene.ocio or None, scene.working_space)
        before = np.zeros_like(pictures[0])
        before[points.y, points.x] = texels.reflectance[:, :3]
        row = np.concatenate([before, *pictures], 1)
        play.picture(
            "texels", color.display(row, 0.0),
            f"the floor's texture, and changed from {len(mine)} elements: by position and normal; with appearance",
        )  # fmt: skip


ENTRY = Entry(
    "upsampling",
    "13",
    "From elements to texels",
    "A change that is known at elements is upsampled to texels within the edges of the texture.",
    build,
    run,
    elements=2500,
)
