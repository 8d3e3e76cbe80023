"""Stylization of a whole scene: unsharp masking of its light field, as another but valid reflectance.

The still life, before and after from two views, and its diffuse, specular and glossiness components.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from usdslf.color import color_of
from usdslf.gallery.records import Entry, PlayLike
from usdslf.gallery.still_life import build
from usdslf.outputs import write_json
from usdslf.scene.records import F32

SMALL, SAMPLES = (160, 90), 4  # of the pictures that contrast is measured in
BLUR = 8.0  # of them [pixels]
COMPONENTS = ("color", "albedo", "specular", "roughness")


def contrast(picture: F32) -> float:
    """Mean difference of a picture's logarithm from its blur."""
    light = np.log(picture.mean(-1) + 0.02)
    return float(np.abs(light - gaussian_filter(light, BLUR)).mean())


def run(play: PlayLike) -> None:
    """No stroke: the whole scene, once."""
    before = play.session
    found = before.stylize()
    before.author(play.folder / "look.usda", review_root=play.folder / "review.usda")
    write_json(play.folder / "report.json", before.report())
    after = before.edited(play.folder / "look.usda")
    for view in range(2):
        path = play.shot.view_path(view)
        one, two = (contrast(s.render(path, SMALL, samples=SAMPLES)["color"]) for s in (before, after))
        play.shows(
            f"local contrast of the picture grows, {play.shot.views[view].name}", two > 1.02 * one,
            f"{one:.4f} to {two:.4f}",
        )  # fmt: skip
    freed = sorted({name for style in found.styles for name in style.freed})
    play.shows("diffuse, specular and glossiness change", len(freed) == 3, ", ".join(freed))
    values = np.concatenate([found.after.diffuse.ravel(), found.after.f0.ravel(), found.after.roughness])
    play.shows(
        "the result is a valid reflectance", values.min() >= 0 and values.max() <= 1,
        f"{values.min():.3f} .. {values.max():.3f}",
    )  # fmt: skip
    if not play.has_pictures:
        return
    color = color_of(before.scene.ocio or None, before.scene.working_space)
    for view in range(2):
        rows = []
        for session in (before, after):
            seen = play.see(session, view)
            parts = [seen[name] if name != "roughness" else np.repeat(1 - seen[name], 3, 2) for name in COMPONENTS]
            rows.append(np.concatenate([color.display(p.astype(np.float32), 0.0) for p in parts], 1))
        caption = f"before and after: color, diffuse, specular, glossiness; {play.shot.views[view].name}"
        play.picture(f"components_{view + 1}", np.concatenate(rows, 0), caption)


ENTRY = Entry(
    "stylize",
    "22",
    "Stylization by unsharp masking",
    "Unsharp masking the light field of a whole scene gives a valid reflectance with an unsharp-masked look.",
    build,
    run,
)
