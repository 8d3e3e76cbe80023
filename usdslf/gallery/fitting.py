"""How the solver decides: one element's fit over all levels of glossiness, and one stroke under three norms.

FITTING takes the shot of sketch_specular by the phong model.  What is wanted is the light that the ball's elements
would send out with another diffuse, specular and glossiness; each element finds them by itself (element_solve.py).
SPARSE paints the yellow glints of sketch_specular as unevenly as a hand does, and solves them with l2, l0 and mixed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gallery import sketch_specular
from usdslf.gallery.plots import Axis, bars, lines
from usdslf.gallery.records import Dabs, Entry, PlayLike, Step, on_picture
from usdslf.light_field.light_field import LightField
from usdslf.procedural.built_shot import Inputs
from usdslf.sampling.hemisphere import bin_of
from usdslf.scene.records import F64
from usdslf.session import Session
from usdslf.stylize.element_solve import FITTED, enumerate_elements
from usdslf.surfaces.reflectance import column_weights, distinctness_of_gloss, gloss_levels

WANTED: Inputs = {"diffuse": (0.30, 0.06, 0.10), "specular": (0.30, 0.26, 0.20), "roughness": 0.42}
BOTH = FITTED.index("diffuse+specular")
UNEVEN = ((1.0, 1.0, 1.0), (1.25, 1.2, 1.1), (0.82, 0.87, 0.9), (1.2, 1.16, 1.2),
          (0.78, 0.82, 0.85), (0.85, 0.82, 0.9), (1.3, 1.2, 1.2))  # fmt: skip
"""Factors of a painter's error on the colours of the glints: about 20 % of brightness, 8 % of tint."""
SEEN = 0.005  # change of a parameter that counts
DISK = 44  # pixels across a picture of a hemisphere


def fit_levels(play: PlayLike) -> None:
    """Wanted light of a known reflectance; each element of the ball is asked for it."""
    base = play.session
    session = Session(base.source, device=base.device, elements=base.element_count, model="phong")
    field = session.light_field
    material = next(i for i, m in enumerate(session.scene.materials) if m.path.endswith("/red"))
    ball = np.flatnonzero(field.elements.material == material)
    wanted_d = _wanted(field, ball)
    wanted = np.asarray(field.device.download(wanted_d)[ball])
    lit = wanted.max((1, 2)) > 0.05 * wanted.max()
    ball, wanted = ball[lit], wanted[lit]
    parts = list(enumerate_elements(field, ball, wanted_d))
    levels = gloss_levels("phong")
    residual = np.concatenate([c.residual[:, :-1, BOTH] / c.wanted[:, None] for c in parts])
    diffuse, specular = (np.concatenate([getattr(c, k)[:, :-1, BOTH] for c in parts]) for k in ("diffuse", "f0"))
    best = residual.argmin(1)
    nearest = int(np.abs(distinctness_of_gloss(levels) - distinctness_of_gloss(WANTED["roughness"])).argmin())
    hit = float((np.abs(best - nearest) <= 1).mean())
    play.shows(
        "The least residual over all levels is at the wanted glossiness, or the level beside it", hit > 0.9,
        f"of {len(ball)} elements {100 * hit:.0f} %",
    )  # fmt: skip
    at = np.arange(len(ball))
    off_d = np.median(np.abs(diffuse[at, best] - WANTED["diffuse"]).max(1))
    off_s = np.median(np.abs(specular[at, best] - WANTED["specular"]).max(1))
    play.shows(
        "The linear solution there is the wanted diffuse and specular", off_d < 0.02 and off_s < 0.04,
        f"off by {off_d:.3f} and {off_s:.3f}, half of the elements by less",
    )  # fmt: skip
    gain = np.median(np.sqrt(np.delete(residual, [nearest - 1, nearest, nearest + 1], 1).min(1) / residual.min(1)))
    play.shows("All other levels fit worse", gain > 2, f"at best {gain:.1f} times the relative error")
    one = int(wanted.max((1, 2)).argmax())
    d = distinctness_of_gloss(levels)
    error = np.sqrt(residual[one])
    curves = {
        "relative error": error / error[np.isfinite(error)].max(),
        "diffuse": diffuse[one].mean(1),
        "specular": specular[one].mean(1),
    }
    points = {k: [(a, b) for a, b in zip(d, v) if np.isfinite(b)] for k, v in curves.items()}
    play.drawing(
        "levels",
        lines(
            f"One element: the fit at each level (worst error {error[np.isfinite(error)].max():.2f})",
            Axis("distinctness of gloss", 0, 1, (0, 0.25, 0.5, 0.75, 1)), Axis("", 0, 1, (0, 0.25, 0.5, 0.75, 1)),
            points, float(distinctness_of_gloss(WANTED["roughness"])),
        ),
        "linear solution and its error over glossiness; dashed: what was wanted",
    )  # fmt: skip
    if play.has_pictures:
        fits = [
            _sent(field, ball[one], diffuse[one, j], specular[one, j], float(levels[j]))
            for j in range(0, len(levels), 2)
        ]
        strip = [field.incident(ball[one : one + 1])[0], wanted[one], *fits]
        caption = "light that arrives, what is wanted, and the best fit from sharp to dull"
        play.picture("hemispheres", _disks(strip, float(wanted[one].max())), caption)


def _wanted(field: LightField, rows: NDArray) -> Any:
    """Light, a device array (N, D, 3), that elements would send out with the reflectance WANTED."""
    like = lambda v: np.tile(np.float32(v), (len(rows), 1))  # noqa: E731
    weights = column_weights("phong", like(WANTED["diffuse"]), like(WANTED["specular"]), like((1.0, 1.0, 1.0)))
    return field.respond(rows, weights.astype(np.float32), np.full(len(rows), WANTED["roughness"]))


def _sent(field: LightField, row: int, d: F64, f0: F64, roughness: float) -> NDArray[np.float32]:
    """Light (D, 3) that one element sends out with a reflectance."""
    weights = column_weights("phong", d[None], f0[None], np.ones((1, 3))).astype(np.float32)
    sent_d = field.respond(np.array([row]), weights, np.array([roughness]))
    return np.asarray(field.device.download(sent_d)[row])


def _disks(lights: list[NDArray], white: float) -> NDArray[np.float32]:
    """Hemispheres side by side, seen from above; display values."""
    side = (np.arange(DISK) + 0.5) * 2 / DISK - 1
    x, y = np.meshgrid(side, side)
    inside = x * x + y * y < 1
    local = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], -1)
    at = bin_of(local)
    shown = [np.where(inside[..., None], np.clip(light[at] / white, 0, 1) ** (1 / 2.2), 0.08) for light in lights]
    gap = np.full((DISK, 4, 3), 0.08)
    return np.concatenate([part for s in shown for part in (s, gap)], 1).astype(np.float32)


def compare_norms(play: PlayLike) -> None:
    """The same stroke with each norm, each time on the shot as it was."""
    changed, found = {}, {}
    glints: Dabs = [
        ((r * a, g * b, b_ * c), places)
        for ((r, g, b_), places), (a, b, c) in zip(sketch_specular.YELLOW_ON_BALL, UNEVEN, strict=True)
    ]
    for norm in ("l2", "l0", "mixed"):
        play.paint(on_picture(glints), sketch_specular.RADIUS)
        (found[norm],) = _report(play.step(f"the same yellow glints, norm {norm}", norm=norm, goes_on=False))
        before, after = found[norm]["before"], found[norm]["after"]
        changed[norm] = {
            name: float(np.max(np.abs(np.subtract(after[key], before[key]))))
            for name, key in (("diffuse", "diffuse"), ("specular", "specular"), ("glossiness", "roughness"))
        }
    number = {norm: sum(v > SEEN for v in c.values()) for norm, c in changed.items()}
    in_words = lambda norm: f"{found[norm]['inferred']}, residual {found[norm]['residual_after']:.3f}"  # noqa: E731
    play.shows("l2 changes all three parameters", number["l2"] == 3, in_words("l2"))
    play.shows(
        "l0 changes one, the specular reflectance", number["l0"] == 1 and changed["l0"]["specular"] > 0,
        in_words("l0"),
    )  # fmt: skip
    play.shows(
        "mixed, which may change any number, changes that one too",
        number["mixed"] == 1 and changed["mixed"]["specular"] > 0, in_words("mixed"),
    )  # fmt: skip
    play.drawing(
        "norms",
        bars("Largest change of each parameter", Axis("", 0, 0.5, (0, 0.1, 0.2, 0.3, 0.4, 0.5)), changed),
        "what each norm changes for the same stroke",
    )


def _report(step: Step) -> list[dict]:
    return list(step.report["strokes"])


FITTING = Entry(
    "fitting",
    "9",
    "Fitting over levels of glossiness",
    "The best reflectance of an element is found by enumerating levels of glossiness, with a linear solution for "
    "diffuse and specular at each.",
    sketch_specular.build,
    fit_levels,
)
SPARSE = Entry(
    "sparse",
    "10",
    "Sparse fitting: three norms, one stroke",
    "Least squares change every parameter for a stroke that asks for one; the sparse norms change only that one.",
    sketch_specular.build,
    compare_norms,
)
