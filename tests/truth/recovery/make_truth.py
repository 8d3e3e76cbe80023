"""Renders the truth of the recovery suite with the path tracer and picks the painter's dabs.

    python tests/truth/recovery/make_truth.py [NAME ...] [--pictures DIR] [--again]

For each case: the picture before and after its change; 24 dabs on the subject where the picture changed
visibly; for each dab the mean radiance over its footprint after the change, from rays of its own, until the
noise of nine means in ten is below 1 %.  What is saved, as truth/NAME.json, is the true parameters and what
three painters would have said (exact, uneven, flat; the others follow from the exact colours, see painters.py).

Half of the cases spread their dabs evenly over the changed area, half draw them by how much changed.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdShade
from reference.pathtracer import Tracer, camera_rays
from scipy.ndimage import uniform_filter
from truth.recovery.cases import CASES
from truth.recovery.painters import uneven
from truth.recovery.stages import CAMERA, SIZE, SUBJECT, Case, TextureInput, build_stage

TRUTH = Path(__file__).parent / "truth"
DABS = 24
RADIUS = 0.01  # of the picture's height
PICTURE_SAMPLES = 64
RAYS_A_ROUND = 4096  # for each dab
MOST_ROUNDS = 48
WANTED_NOISE = 0.01  # of nine dabs in ten
MOST_NOISE = 0.02  # of the worst
FAINT_CHANGE = 0.3  # needs pictures of less noise to choose the dabs by
MAX_DEPTH = 12
ASPECT = SIZE[0] / SIZE[1]


def make_truth(case: Case, pictures: Path | None = None) -> dict[str, Any]:
    """Renders one case and returns what is to be saved."""
    start = time.perf_counter()
    rng = np.random.default_rng(1000 + case.seed)
    with tempfile.TemporaryDirectory() as folder:
        tracers = [
            Tracer(build_stage(case, Path(folder) / str(changed), changed), max_depth=MAX_DEPTH)
            for changed in (False, True)
        ]
        assert not tracers[0].warnings, tracers[0].warnings
        subjects = subject_prims(tracers[0])
        before, after = (t.render(CAMERA, *SIZE, PICTURE_SAMPLES, seed=1) for t in tracers)
        candidates = changed_places(tracers[0], subjects, before, after)
        if np.percentile(candidates[1], 95) < FAINT_CHANGE:
            before, after = (t.render(CAMERA, *SIZE, 6 * PICTURE_SAMPLES, seed=1) for t in tracers)
            candidates = changed_places(tracers[0], subjects, before, after)
        xy = pick_dabs(*candidates, case.seed % 2 == 0, rng)
        colors, noise = dab_radiance(tracers[1], xy, MOST_ROUNDS, seed=2)
        colors_before, noise_before = dab_radiance(tracers[0], xy, MOST_ROUNDS // 8, seed=3)
        surfaces = [true_surface(case, Path(folder), xy, changed) for changed in (False, True)]
    if pictures:
        save_pictures(pictures / f"{case.name}.png", before, after, xy)
    scale = np.maximum(colors, colors_before).max(1) + 0.05 * colors.mean()
    change = np.abs(colors - colors_before).max(1) / scale
    return {
        "name": case.name,
        "parameter": case.parameter,
        "material": SUBJECT,
        "prims": subjects,
        "radius": RADIUS,
        "xy": np.round(xy, 5).tolist(),
        "colors": {
            "exact": rounded(colors),
            "uneven": rounded(uneven(colors, xy, rng)),
            "flat": rounded(np.broadcast_to(colors.mean(0), colors.shape)),
        },
        "colors_before": rounded(colors_before),
        "before": surfaces[0],
        "after": surfaces[1],
        "change": {"median": float(np.round(np.median(change), 4)), "most": float(np.round(change.max(), 4))},
        "noise": {
            "median": float(np.round(np.median(noise), 4)),
            "most": float(np.round(noise.max(), 4)),
            "before": float(np.round(np.median(noise_before), 4)),
        },
        "seconds": round(time.perf_counter() - start, 1),
    }


def subject_prims(tracer: Tracer) -> list[str]:
    """Returns the gprims that are bound to the subject's material."""
    found = []
    for prim in tracer.stage.Traverse():
        if prim.IsA(UsdGeom.Gprim):
            material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
            if material and str(material.GetPath()) == SUBJECT:
                found.append(str(prim.GetPath()))
    return found


def disc_offsets(count: int, rng: np.random.Generator) -> NDArray:
    """Returns (count, 2) points in a dab's footprint, in 0..1 of the picture."""
    r, a = RADIUS * np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    return np.stack([r * np.cos(a) / ASPECT, r * np.sin(a)], -1)


def changed_places(
    tracer: Tracer, subjects: list[str], before: NDArray, after: NDArray
) -> tuple[NDArray, NDArray]:
    """Returns places xy (n, 2) on the subject where the picture changed, and by how much (n,), relative."""
    width, height = SIZE
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    xy = np.stack([x.ravel(), y.ravel()], -1)
    names = tracer.first_hits(*camera_rays(tracer.stage, CAMERA, xy, ASPECT))[0]
    is_subject = np.isin(names, subjects)
    xy, visible = changed_where(xy, is_subject, before, after)
    # The whole footprint lies on the subject.
    ring = 1.25 * RADIUS * np.exp(2j * np.pi * np.arange(12) / 12)
    around = xy[:, None] + np.stack([ring.real / ASPECT, ring.imag], -1)
    names = tracer.first_hits(*camera_rays(tracer.stage, CAMERA, around.reshape(-1, 2), ASPECT))[0]
    inside = np.isin(names, subjects).reshape(-1, 12).all(1) & ((around > 0) & (around < 1)).all((1, 2))
    return xy[inside], visible[inside]


def changed_where(xy: NDArray, is_subject: NDArray, before: NDArray, after: NDArray) -> tuple[NDArray, NDArray]:
    """Returns those places xy (n, 2), of all pixels, that changed among the subject's, and by how much."""
    if not is_subject.any():
        return xy[:0], np.zeros(0)
    smooth = [uniform_filter(p, (3, 3, 0)).reshape(-1, 3) for p in (before, after)]
    level = 0.1 * smooth[1][is_subject].mean()
    visible = (np.abs(smooth[1] - smooth[0]).max(1)) / (np.maximum(*smooth).max(1) + level)
    xy, visible = xy[is_subject], visible[is_subject]
    changed = visible >= 0.3 * np.percentile(visible, 95)
    return xy[changed], visible[changed]


def pick_dabs(xy: NDArray, visible: NDArray, spreads: bool, rng: np.random.Generator) -> NDArray:
    """Returns centres (n, 2) in 0..1 of the picture, in the order of a hand that goes to the nearest.

    Either spread evenly over the places, or drawn by how much changed.
    """
    place = xy * [ASPECT, 1]
    chosen = [int(np.argmax(visible))] if spreads else []
    distance = np.full(len(xy), np.inf)
    while len(chosen) < min(DABS, len(xy)):
        if chosen:
            distance = np.minimum(distance, np.linalg.norm(place - place[chosen[-1]], axis=1))
        if distance.max() < RADIUS:
            break
        if spreads:
            chosen.append(int(np.argmax(distance)))
        else:
            weight = np.where(distance > 2 * RADIUS, visible**2, 0) + 1e-12 * (distance > RADIUS)
            chosen.append(int(rng.choice(len(xy), p=weight / weight.sum())))
    return in_order(xy[chosen])


def in_order(xy: NDArray) -> NDArray:
    """Returns the points, each followed by its nearest that is left."""
    left, order = list(range(1, len(xy))), [0]
    while left:
        nearest = min(left, key=lambda i: float(np.linalg.norm((xy[i] - xy[order[-1]]) * [ASPECT, 1])))
        order.append(nearest)
        left.remove(nearest)
    return xy[order]


def dab_radiance(
    tracer: Tracer, xy: NDArray, most_rounds: int, seed: int, camera: str = CAMERA
) -> tuple[NDArray, NDArray]:
    """Returns mean radiances (n, 3) over the dabs and their relative standard errors (n,)."""
    rng = np.random.default_rng(seed)
    means: list[NDArray] = []
    while True:
        offsets = disc_offsets(RAYS_A_ROUND * len(xy), rng).reshape(len(xy), RAYS_A_ROUND, 2)
        rays = camera_rays(tracer.stage, camera, (xy[:, None] + offsets).reshape(-1, 2), ASPECT)
        values = tracer.radiance(*rays, seed=seed * 100003 + len(means))
        means.append(values.reshape(len(xy), RAYS_A_ROUND, 3).mean(1))
        rounds = np.stack(means)
        total = rounds.mean(0)
        if len(means) < 4:
            continue
        spread = rounds.mean(2).std(0, ddof=1) / np.sqrt(len(means))
        noise = spread / (total.mean(1) + 0.1 * total.mean())
        is_quiet = np.percentile(noise, 90) < WANTED_NOISE and noise.max() < MOST_NOISE
        if is_quiet or len(means) >= most_rounds:
            return total, noise


def true_surface(case: Case, folder: Path, xy: NDArray, changed: bool) -> dict[str, Any]:
    """Returns diffuse, specular (F0) and roughness, the mean over the dabs, by the formulas of the shader."""
    inputs = {**case.inputs, **(case.changed if changed else {})}
    color = inputs["diffuseColor"]
    if isinstance(color, TextureInput):
        # The base colour is the diffuse reflectance of the same material as a dielectric.
        probe = replace(case, inputs={**inputs, "metallic": 0.0}, changed={})
        tracer = Tracer(build_stage(probe, folder / f"probe{changed}"), max_depth=2)
        rng = np.random.default_rng(5)
        spread = (xy[:, None] + disc_offsets(200, rng)).reshape(-1, 2)
        base = tracer.first_hits(*camera_rays(tracer.stage, CAMERA, spread, ASPECT))[2].mean(0)
    else:
        base = np.array(color)
    metallic = float(inputs.get("metallic", 0.0))
    if inputs.get("useSpecularWorkflow"):
        diffuse, f0 = base, np.array(inputs["specularColor"])
    else:
        s = 1 + metallic * (base - 1)
        r = (1 - inputs["ior"]) / (1 + inputs["ior"])
        f0 = (1 - metallic) * r * r * s + metallic * s
        diffuse = base * (1 - metallic)
    return {"diffuse": rounded(diffuse), "specular": rounded(f0), "roughness": inputs["roughness"]}


def rounded(values: NDArray) -> list:
    """Five significant digits, as lists."""
    return json.loads(
        json.dumps(np.asarray(values, float).tolist()), parse_float=lambda t: float(f"{float(t):.5g}")
    )


def save_pictures(path: Path, before: NDArray, after: NDArray, xy: NDArray) -> None:
    """Writes before and after side by side, the dabs marked on the right one, for looking at."""
    from kit.stage_parts import write_image

    marked = after.copy()
    place = (xy * SIZE).astype(int)
    marked[place[:, 1], place[:, 0]] = [1, 0, 1]
    path.parent.mkdir(parents=True, exist_ok=True)
    both = np.concatenate([before, after, marked], axis=1)
    write_image(path, np.clip(both, 0, 1) ** (1 / 2.2))


def main() -> None:
    """Renders the cases that are named, or all that have no truth yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of names; none: all")
    parser.add_argument("--pictures", type=Path, help="folder for pictures to look at")
    parser.add_argument("--again", action="store_true", help="also those that are there")
    a = parser.parse_args()
    TRUTH.mkdir(exist_ok=True)
    for case in CASES:
        path = TRUTH / f"{case.name}.json"
        if (a.names and not any(n in case.name for n in a.names)) or (path.exists() and not a.again):
            continue
        truth = make_truth(case, a.pictures)
        text = json.dumps(truth, indent=1)
        path.write_text(compact(text) + "\n")
        print(
            f"{case.name:45s} dabs {len(truth['xy']):2d}  change {truth['change']['median']:.3f}"
            f"  noise {truth['noise']['median']:.4f} most {truth['noise']['most']:.4f}"
            f"  {truth['seconds']:.0f} s",
            flush=True,
        )


def compact(text: str) -> str:
    """Puts innermost lists on one line."""
    import re

    return re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda m: "[" + re.sub(r"\s+", " ", m[1]) + "]", text)


if __name__ == "__main__":
    main()
