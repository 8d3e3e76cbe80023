"""Editing keeps detail: a bumpy, textured vase whose glaze is painted another colour.

Bluish dabs beside the vase's highlight change its diffuse colour; the speckles of its texture and the bumps of its
normal map stay.  The colours are what a path tracer shows of the glaze with TRUTH_DELTA, rounded; it knows no normal
maps, so the painted vase is smooth, as a hand that paints over bumps would have it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from usdslf.gallery.records import Dabs, Entry, PlayLike, on_picture
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import curve, lathe, panel
from usdslf.scene.records import F32
from usdslf.session import Session
from usdslf.textures.images import write_image

RADIUS = 0.012
SMALL = (320, 180)  # of the pictures that detail is compared in
BLUR = 2.0  # of them [pixels]; detail is what this takes away
GLAZE: Inputs = {
    "useSpecularWorkflow": 1, "diffuseColor": "speckles.png", "specularColor": (0.03, 0.03, 0.03), "roughness": 0.35,
    "normal": "bumps.png",
}  # fmt: skip
MATERIALS: dict[str, Inputs] = {
    "table": {"diffuseColor": (0.36, 0.34, 0.32), "roughness": 0.8},
    "wall": {"diffuseColor": (0.55, 0.53, 0.50), "roughness": 0.9},
    "glaze": GLAZE,
}
TRUTH_DELTA = (-0.16, -0.02, 0.14)
"""Of the glaze's diffuse colour; its texture is then speckles(shift=TRUTH_DELTA)."""


def noise(shape: tuple[int, int], size: float, seed: int) -> NDArray[np.float64]:
    """Smooth noise that repeats, of a mean of 0 and a deviation of 1; size [pixels]."""
    field = gaussian_filter(np.random.default_rng(seed).normal(size=shape), size, mode="wrap")
    return (field - field.mean()) / field.std()


def speckles(size: int = 256, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> F32:
    """Returns the glaze (h, w, 3), sRGB encoded: ochre with dark and pale speckles, its linear values shifted."""
    fine, broad = noise((size, 2 * size), 1.6, 1), noise((size, 2 * size), 14.0, 2)
    tone = 1 + 0.10 * broad - 0.45 * np.clip(fine - 1.1, 0, 1) + 0.25 * np.clip(-fine - 1.3, 0, 1)
    linear = np.clip(np.array([0.42, 0.30, 0.17]) * tone[..., None], 0.02, 0.9) + np.asarray(shift)
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055).astype(np.float32)


def bumps(size: int = 256, height: float = 2.2) -> F32:
    """Returns a tangent-space normal map (h, w, 3) of dents, 0..1."""
    field = height * noise((size, 2 * size), 5.0, 3)
    dx = 0.5 * (np.roll(field, -1, 1) - np.roll(field, 1, 1))
    dy = -0.5 * (np.roll(field, -1, 0) - np.roll(field, 1, 0))
    n = np.stack([-dx, -dy, np.ones_like(dx) * 2.0], -1)
    return (0.5 + 0.5 * n / np.linalg.norm(n, axis=-1, keepdims=True)).astype(np.float32)


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its textures written."""
    write_image(folder / "speckles.png", speckles())
    write_image(folder / "bumps.png", bumps())
    profile = [(0.0, 0.0), (0.17, 0.0), (0.19, 0.02), (0.27, 0.18), (0.30, 0.34), (0.25, 0.50), (0.13, 0.60),
               (0.11, 0.68), (0.15, 0.74), (0.13, 0.74), (0.0, 0.70)]  # fmt: skip
    parts = (
        Part("table", panel((-1.5, 0, 1.3), (3.0, 0, 0), (0, 0, -2.2)), "table"),
        Part("wall", panel((-1.5, 0, -0.9), (3.0, 0, 0), (0, 1.7, 0)), "wall"),
        Part("vase", lathe(curve(profile, 60), 72), "glaze"),
    )
    lamps = (
        Lamp("lamp", "rect", (22.0, 21.0, 19.0), (-0.9, 1.5, 1.3), (0.0, 0.35, 0.0), size=(0.6, 0.6)),
        Lamp("sky", "dome", (0.40, 0.43, 0.48)),
    )
    views = (
        View("camera", (0.1, 0.75, 2.1), (0.0, 0.36, 0.0), 46.0),
        View("from_the_left", (-1.5, 0.85, 1.5), (0.0, 0.36, 0.0), 46.0),
    )
    return BuiltShot("detail", MATERIALS, parts, lamps, views)


BLUISH: Dabs = (
    ((0.238, 0.25, 0.265), ((235, 230),)),
    ((0.167, 0.173, 0.183), ((270, 285),)),
    ((0.145, 0.16, 0.18), ((330, 250),)),
    ((0.126, 0.146, 0.177), ((380, 200),)),
    ((0.0848, 0.0981, 0.116), ((340, 290),)),
    ((0.0947, 0.104, 0.121), ((395, 240),)),
    ((0.193, 0.21, 0.236), ((355, 190),)),
    ((0.248, 0.279, 0.315), ((250, 190),)),
)


def detail(session: Session, camera: str) -> dict[str, NDArray[np.float64]]:
    """High-frequency content (n, 3) of the diffuse colour and the normals that a view shows of the vase."""
    seen = session.render(camera, SMALL, ("albedo", "normal", "material"), samples=1)
    names = [m.path.rsplit("/", 1)[-1] for m in session.scene.materials]
    on_vase = gaussian_filter((seen["material"][..., 0] == names.index("glaze")).astype(float), BLUR) > 0.999
    pictures = {name: seen[name].astype(np.float64) for name in ("albedo", "normal")}
    return {name: (p - gaussian_filter(p, (BLUR, BLUR, 0)))[on_vase] for name, p in pictures.items()}


def run(play: PlayLike) -> None:
    """Another colour; the detail is compared with the original's."""
    play.paint(on_picture(BLUISH), RADIUS)
    step = play.step("bluish dabs on the speckled vase")
    (vase,) = step.report["strokes"]
    moved = np.subtract(vase["after"]["diffuse"], vase["before"]["diffuse"])
    error = float(np.abs(moved - TRUTH_DELTA).max())
    play.shows(
        "The change of the diffuse colour is found", vase["inferred"] == "diffuse" and error < 0.03,
        f"{vase['inferred']}, off by {error:.3f} at most",
    )  # fmt: skip
    for view in range(2):
        path = play.shot.view_path(view)
        one, two = detail(step.before, path), detail(step.after, path)
        for name, what in (("albedo", "texture"), ("normal", "normal map")):
            same = min(float(np.corrcoef(one[name][:, c], two[name][:, c])[0, 1]) for c in range(3))
            size = float(two[name].std() / one[name].std())
            play.shows(
                f"The detail of the {what} is kept, {play.shot.views[view].name}", same > 0.99 and size > 0.5,
                f"correlation {same:.4f} of the channel that keeps least, {size:.2f} times as strong",
            )  # fmt: skip


ENTRY = Entry(
    "detail",
    "21",
    "Edits keep detail",
    "An edit of a textured and bump-mapped surface keeps the detail of both, from other views too.",
    build,
    run,
)
