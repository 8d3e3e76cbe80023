"""What a dab covers: a colour that was taken from a picture is a mixture at edges and through glass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.light_field_scenes import Lit, lit, material
from kit.scene_records import quad

from usdslf.gpu.device import Device
from usdslf.inference.evidence import Evidence, build_evidence, mean_by
from usdslf.inference.footprint import is_of_picture
from usdslf.inference.samples import SAMPLES, gather_samples
from usdslf.lights.sources import LightSet
from usdslf.scene.records import Light
from usdslf.strokes.stroke import Stroke

RADIUS = 0.05
AWAY = (-0.03, 0.0, 0.02, 0.2)  # of the dabs' centres from the edge, to the painted side


def stroke(x: tuple[float, ...] = AWAY, colors: np.ndarray | None = None, **other: object) -> Stroke:
    """Dabs at (x, 0, 0), seen from far above, by default each of a colour of its own."""
    n = len(x)
    points = np.stack([x, np.zeros(n), np.zeros(n)], -1).astype(np.float32)
    if colors is None:
        colors = np.linspace(0.2, 0.8, 3 * n).reshape(n, 3)
    eye = points + np.float32([0, 0, 50])
    return Stroke("s", points, np.full(n, 2 * RADIUS, np.float32), np.float32(colors), eye, **other)


def evidence_of(made: Lit, painted: Stroke) -> Evidence:
    lights = LightSet(made.scene, made.scene.lights)
    samples, rows = gather_samples(painted, made.scene, made.tracer, made.field, lights, [])
    return build_evidence(painted, rows, samples, made.field)


def unchanged(e: Evidence) -> np.ndarray:
    """Radiance (n, 3) of the dabs that no parameter changes."""
    return mean_by(e.unchanging, e.dab_of_sample)[: len(e.target)]


def part_of_disk(away: np.ndarray) -> np.ndarray:
    """Share of a disk of RADIUS on one side of a line that lies `away` from its centre, towards the other side."""
    t = np.clip(np.asarray(away) / RADIUS, -1, 1)
    return 1 - (np.arccos(t) - t * np.sqrt(1 - t * t)) / np.pi


def glowing(device: Device, other: float = 3.0) -> Lit:
    """A surface that glows with 1 where x > 0, beside one that glows with `other`."""
    floors = [
        quad((0, -2, 0), (4, 0, 0), (0, 4, 0), path="/a"),
        quad((-4, -2, 0), (4, 0, 0), (0, 4, 0), material=1, path="/b"),
    ]
    return lit(
        device, floors, [material(0.5, emission=1.0), material(0.5, emission=other)], (), 60, "preview_surface", 2
    )


def test_at_an_edge_a_dab_shows_both_sides_by_their_area(device: Device) -> None:
    e = evidence_of(glowing(device), stroke(AWAY[1:], scope="material"))
    share = part_of_disk(np.array(AWAY[1:]))
    np.testing.assert_allclose(unchanged(e)[:, 0], share + 3 * (1 - share), rtol=0.02)
    np.testing.assert_array_equal(e.material, [0, 0, 0])


@pytest.mark.parametrize(("film_normal", "longer"), [((0.0, 0.0, 1.0), 1.0), ((0.0, 0.0, 0.0), np.sqrt(2))])
def test_a_dab_is_round_on_the_picture_where_its_film_is_known(
    device: Device, film_normal: tuple[float, float, float], longer: float
) -> None:
    painted = stroke(AWAY[1:], scope="material", film_normal=film_normal)
    aside = replace(painted, eye=painted.points + np.float32([50, 0, 50]))  # 45 degrees off the axis
    e = evidence_of(glowing(device), aside)
    share = part_of_disk(np.array(AWAY[1:]) / longer)  # a disc that faces the eye covers an ellipse of the floor
    np.testing.assert_allclose(unchanged(e)[:, 0], share + 3 * (1 - share), rtol=0.02)


def test_a_bright_rim_counts_by_its_area_also_where_few_points_meet_it(device: Device) -> None:
    away = (0.044, 0.045, 0.0465)  # 1 to 2 % of the dab
    e = evidence_of(glowing(device, 50.0), stroke(away, scope="material"))
    share = part_of_disk(np.array(away))
    np.testing.assert_allclose(unchanged(e)[:, 0], share + 50 * (1 - share), rtol=0.03)


def test_a_thin_thing_has_as_many_points_as_a_wide_one(device: Device) -> None:
    thin = 0.2 * RADIUS
    floors = [
        quad((0, -2, 0), (thin, 0, 0), (0, 4, 0), path="/a"),
        quad((-4, -2, 0), (4, 0, 0), (0, 4, 0), material=1, path="/b"),
        quad((thin, -2, 0), (4, 0, 0), (0, 4, 0), material=1, path="/c"),
    ]
    made = lit(device, floors, [material(0.5, emission=1.0), material(0.5, emission=3.0)], (), 60, "preview_surface", 2)
    e = evidence_of(made, stroke((0.5 * thin,) * 3, scope="material"))
    number = np.bincount(e.dab_of_sample)[:3]
    assert (number >= 0.9 * SAMPLES[1]).all() and (number <= 1.1 * SAMPLES[1]).all(), number
    share = 2 * part_of_disk(np.array([0.5 * thin])) - 1
    np.testing.assert_allclose(unchanged(e)[:, 0], np.repeat(share + 3 * (1 - share), 3), rtol=0.01)


def test_only_the_painted_part_of_a_dab_answers_a_change(device: Device) -> None:
    sun = Light("/sun", "distant", (1.0, 1.0, 1.0), np.eye(4), angle=np.radians(1))
    made = lit(
        device, [quad((0, -2, 0), (4, 0, 0), (0, 4, 0))], [material(0.5)], (sun,), 60, "preview_surface", 2
    )  # fmt: skip
    e = evidence_of(made, stroke(AWAY[1:]))
    x = mean_by(e.columns[:, -1, 0], e.dab_of_sample)[:3, 0]
    np.testing.assert_allclose(x / x[2], part_of_disk(np.array(AWAY[1:])), rtol=0.02)


def test_one_colour_on_many_dabs_is_the_surface_s_own(device: Device) -> None:
    flat = np.tile([0.3, 0.4, 0.5], (3, 1))
    e = evidence_of(glowing(device), stroke(AWAY[1:], flat))
    np.testing.assert_allclose(unchanged(e), 1, rtol=1e-4)


def test_behind_a_gap_the_sky_shows(device: Device) -> None:
    sky = Light("/sky", "dome", (2.0, 1.0, 0.5), np.eye(4))
    floor = [quad((0, -2, 0), (4, 0, 0), (0, 4, 0))]
    made = lit(device, floor, [material(0.0, emission=1.0)], (sky,), 60, "preview_surface", 2)
    e = evidence_of(made, stroke(AWAY[1:]))
    share = part_of_disk(np.array(AWAY[1:]))[:, None]
    np.testing.assert_allclose(unchanged(e), share + (1 - share) * [2.0, 1.0, 0.5], rtol=0.02)


@pytest.mark.parametrize("opacity", [0.25, 0.7])
def test_through_glass_what_lies_behind_it_shows(device: Device, opacity: float) -> None:
    glass = replace(material(0.0, emission=1.0, opacity=opacity), opacity_mode="presence")
    wall = material(0.0, emission=4.0)
    sheets = [
        quad((-4, -2, 0), (8, 0, 0), (0, 4, 0)),
        quad((-4, -2, -1), (8, 0, 0), (0, 4, 0), material=1, path="/wall"),
    ]
    made = lit(device, sheets, [glass, wall], (), 60, "preview_surface", 2)
    e = evidence_of(made, stroke())
    np.testing.assert_allclose(unchanged(e)[:, 0], opacity + (1 - opacity) * 4.0, rtol=0.02)


def test_a_stroke_is_of_a_picture_where_most_dabs_have_a_colour_of_their_own() -> None:
    three = np.repeat([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], 2, 0)
    assert is_of_picture(stroke())
    assert not is_of_picture(stroke(colors=three))
    assert not is_of_picture(stroke(AWAY[:2]))
    assert not is_of_picture(replace(stroke(), tool="blur"))
    assert not is_of_picture(replace(stroke(), space="reflectance"))
