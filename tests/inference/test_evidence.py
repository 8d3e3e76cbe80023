"""Columns of painted samples against quadrature; what rays are drawn, and from which side a stroke is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.light_field_scenes import Lit, lit, material
from kit.scene_records import box, quad
from reference import evidence as ref
from reference import reflectance as model_ref
from reference.light_field import closed_box
from reference.preconvolution import hemisphere
from reference.visibility import square_cells

from usdslf.errors import StrokeError
from usdslf.gpu.device import Device
from usdslf.inference.evidence import Evidence, build_evidence, single_columns
from usdslf.inference.pictured import Pictured
from usdslf.inference.sample_rays import SHARPEST
from usdslf.inference.samples import gather_samples, trace_samples
from usdslf.lights.sources import LightSet
from usdslf.render.live.records import CONSTANTS
from usdslf.sampling.hemisphere import D
from usdslf.sampling.low_discrepancy import random_shifts, sobol_points
from usdslf.scene.records import Light
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.reflectance import gloss_levels, model_of

LEVELS = gloss_levels("preview_surface")
PHONG_LEVELS = gloss_levels("phong")
EYE = np.array([1.2, 0.4, 1.5])
AT = np.array([-0.9, -0.3, 1.3])  # near where the eye's mirror direction goes
SHAPES = {"rect": (0.8, 0.5), "disk": (0.35,), "sphere": (0.3,), "distant": (np.radians(20),)}


def light_of(kind: str) -> Light:
    m = np.eye(4)
    m[:3, 3] = AT
    if kind == "distant":  # shines along -Z
        m[:3, :3] = model_ref.frame_about(AT / np.linalg.norm(AT)).T
    radius = SHAPES[kind][0] if kind in ("disk", "sphere") else 0.5
    return Light("/l", kind, (1.0, 2.0, 3.0), m, 0.8, 0.5, radius, angle=np.radians(20))


def stroke_at(points: list, eye: np.ndarray = EYE, width: float = 0.05, **other: object) -> Stroke:
    n = len(points)
    colors = np.tile(np.float32([0.2, 0.4, 0.6]), (n, 1))
    return Stroke(
        "s", np.float32(points), np.full(n, width, np.float32), colors, np.tile(np.float32(eye), (n, 1)), **other
    )


DABS = [(0.0, 0.0, 0.0), (0.1, 0.05, 0.0)]


def ground(device: Device, lights: tuple[Light, ...], model: str = "preview_surface", **look: float) -> Lit:
    surface = material(0.5, 0.04, 0.35, **look)
    return lit(device, [quad((-4, -4, 0), (8, 0, 0), (0, 8, 0))], [surface], lights, 60, model, 2)


def evidence_of(made: Lit, stroke: Stroke) -> Evidence:
    samples, rows = gather_samples(
        stroke, made.scene, made.tracer, made.field, LightSet(made.scene, made.scene.lights), []
    )
    return build_evidence(stroke, rows, samples, made.field)


def painted(e: Evidence) -> np.ndarray:
    """Samples of the dabs."""
    return np.flatnonzero(e.dab_of_sample < len(e.target))


def expected_columns(e: Evidence, model: str, roughness: float, kind: str, eye: np.ndarray = EYE) -> np.ndarray:
    """Columns (n, 4) of the middle of each dab for radiance 1."""
    out = []
    normal = np.array([0, 0, np.sign(eye[2])])
    for point in by_dab(e, e.surface.position.astype(float)):
        if kind == "dome":
            out.append(ref.columns_of_dome(model, roughness, normal, eye - point))
        else:
            n = 240 if roughness < 0.08 else 96 if roughness < 0.15 else 36
            l, solid = ref.light_directions(kind, SHAPES[kind], AT, point, n)
            out.append(ref.columns_of_light(model, roughness, normal, eye - point, l, solid))
    return np.array(out)


def by_dab(e: Evidence, values: np.ndarray) -> np.ndarray:
    """Means over the samples of each dab."""
    return np.array([values[e.dab_of_sample == k].mean(0) for k in range(len(e.target))])


@pytest.mark.parametrize(
    ("model", "kind"),
    [
        *(("preview_surface", kind) for kind in ("rect", "disk", "sphere", "distant", "dome")),
        *(("phong", kind) for kind in ("rect", "dome")),
    ],
)
def test_columns_are_the_integrals_of_the_light(device: Device, model: str, kind: str) -> None:
    """Over a stroke of 24 dabs within 1 %, each dab within 6 %; the sharpest level is sharper than its rays."""
    light = Light("/l", "dome", (1.0, 2.0, 3.0), np.eye(4)) if kind == "dome" else light_of(kind)
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(0, 0.15, 6), np.linspace(-0.03, 0.08, 4)))
    e = evidence_of(ground(device, (light,), model), stroke_at(list(zip(u, v, 0 * u))))
    levels = gloss_levels(model)
    assert e.columns.shape[1:] == (len(levels) + 1, 4, 3) and len(e.target) == 24
    for j in (0, 1, 3, 7, 13, 19) if kind in ("rect", "dome") else (1, 3, 7, 19):
        got, expected = by_dab(e, e.columns[:, j]), expected_columns(e, model, levels[j], kind)
        assert (expected[:, 0].mean() > 0.01) and (expected[:, 2].mean() > 0.003)
        np.testing.assert_allclose(got[..., 1], 2 * got[..., 0], rtol=1e-4, atol=1e-7)
        rtol = 0.01 if j else 0.03 if model == "preview_surface" else 0.06
        np.testing.assert_allclose(
            got[..., 0].mean(0), expected.mean(0), rtol=rtol, atol=5e-5, err_msg=f"{levels[j]:.2f}"
        )
        worst = np.abs(got[..., 0] - expected).max(0) / expected.max(0).clip(1e-3)
        assert worst.max() < (0.06 if j else 0.15), (levels[j], worst)


def test_sharp_points_among_rough_ones_have_rays_of_their_own_width(device: Device) -> None:
    """In a sky, where the lights drawn are no help: what one point in twelve reflects, within 2 % in each dab."""
    made = ground(device, (Light("/l", "dome", (1.0, 1.0, 1.0), np.eye(4)),))
    dabs, lights = stroke_at(DABS), LightSet(made.scene, made.scene.lights)
    samples, _ = gather_samples(dabs, made.scene, made.tracer, made.field, lights, [])
    is_sharp = np.arange(len(samples.dab)) % 12 == 0
    surface = replace(samples.surface, roughness=np.where(is_sharp, SHARPEST, 0.6).astype(np.float32))
    eye = np.broadcast_to(EYE, surface.position.shape)
    mixed = trace_samples(samples.dab, surface, eye, Pictured.of(made.tracer, made.field, lights), 12)
    found = single_columns(mixed, made.field, surface.roughness[:, None])[:, 0, 2, 0]
    for dab, at in enumerate(DABS):
        expected = ref.columns_of_dome("preview_surface", SHARPEST, np.array([0, 0, 1]), EYE - at)[2]
        assert found[is_sharp & (samples.dab == dab)].mean() == pytest.approx(expected, rel=0.02)


def test_the_last_level_is_the_sample_s_own_roughness(device: Device) -> None:
    e = evidence_of(ground(device, (light_of("rect"),)), stroke_at(DABS))
    np.testing.assert_allclose(e.levels[:, :-1] - LEVELS, 0, atol=1e-6)
    np.testing.assert_allclose(e.levels[:, -1], 0.35, atol=1e-6)
    at = np.argmin(np.abs(LEVELS - 0.35))
    np.testing.assert_allclose(e.columns[:, -1], e.columns[:, at], rtol=1e-4, atol=1e-6)


def test_what_is_hidden_brings_nothing_and_what_glows_brings_its_light(device: Device) -> None:
    """A board between the plane and a lamp; then the board glows and is the lamp."""
    dabs = stroke_at(DABS)
    plane = quad((-4, -4, 0), (8, 0, 0), (0, 8, 0), path="/plane")
    board = quad((-1.3, -0.55, 1.299), (0, 0.5, 0), (0.8, 0, 0), material=1, path="/board")  # faces down
    wide = quad((-1.4, -0.65, 1.299), (0, 0.7, 0), (1.0, 0, 0), material=1, path="/board")  # nothing peeps past it
    dark = lit(device, [plane, wide], [material(0.5), material(0.0)], (light_of("rect"),), 200)
    hidden = evidence_of(dark, dabs)
    assert np.abs(hidden.columns[painted(hidden)]).max() < 1e-3

    glowing = lit(device, [plane, board], [material(0.0), material(0.0, emission=1.0)], (), 200)
    e = evidence_of(glowing, dabs)
    for j in (3, 7, 13):
        columns = []
        for point in e.surface.position[painted(e)].astype(float):
            l, solid = ref.light_directions("rect", (0.8, 0.5), (-0.9, -0.3, 1.299), point, 64)
            columns.append(ref.columns_of_light("phong", PHONG_LEVELS[j], [0, 0, 1], EYE - point, l, solid))
        expected = np.mean(columns, 0)
        got = e.columns[painted(e), j].mean(0)[:, 0]
        np.testing.assert_allclose(got[[0, 2]], expected[[0, 2]], rtol=0.05)  # rays alone find it


def test_a_stroke_seen_from_behind_has_the_light_of_that_side(device: Device) -> None:
    """Surfaces reflect on both sides; the columns and the unpainted directions are those of the eye's side."""
    made = ground(device, (light_of("rect"),))  # lit from above
    front, behind = evidence_of(made, stroke_at(DABS)), evidence_of(made, stroke_at(DABS, EYE * [1, 1, -1]))
    assert front.columns[:].max() > 0.5 and front.background.max() > 0.05
    assert np.abs(behind.columns[painted(behind)]).max() < 1e-6
    assert np.abs(behind.background).max() < 1e-6

    below = np.eye(4)
    below[:3, :3] = np.diag([1, -1, -1])
    below[2, 3] = -1.3
    made = ground(device, (Light("/l", "rect", (1.0, 1.0, 1.0), below, 0.8, 0.5),))
    e = evidence_of(made, stroke_at(DABS, EYE * [1, 1, -1]))
    mirrored = np.array([1, 1, -1])
    for j in (7, 13):
        columns = []
        for point in e.surface.position[painted(e)].astype(float):
            l, solid = ref.light_directions("rect", (0.8, 0.5), (0, 0, 1.3), point * mirrored, 64)
            eye = EYE - point * mirrored
            columns.append(ref.columns_of_light("preview_surface", LEVELS[j], [0, 0, 1], eye, l, solid))
        np.testing.assert_allclose(e.columns[painted(e), j].mean(0)[:, 0], np.mean(columns, 0), rtol=0.05, atol=1e-4)
    assert e.background.max() > 0.05


def test_unpainted_directions_lie_on_the_albedo_under_a_dome(device: Device) -> None:
    """Each row has the columns of one direction: where Y says, A and B agree on every level but the sharpest."""
    e = evidence_of(ground(device, (Light("/d", "dome", (1.0, 1.0, 1.0), np.eye(4)),)), stroke_at(DABS))
    rows = e.background[..., 0]
    assert len(rows) >= 20 and (np.bincount(e.background_sample)[np.unique(e.background_sample)] >= 10).all()
    np.testing.assert_allclose(rows[:, :, 0] + rows[:, :, 1], 1, atol=0.01)
    cosines = np.linspace(0.08, 1, 60)
    for j in (5, 9, 19):
        curve = model_ref.albedo("preview_surface", LEVELS[j], cosines, rings=48)
        apart = np.abs(rows[:, None, j] - curve[None]).max(2).min(1)
        assert apart.max() < 0.03, (LEVELS[j], apart.max())
        assert np.ptp(rows[:, j, 3]) > 0.3 * np.ptp(curve[:, 3])  # from the normal to near the horizon


def test_coat_and_emission_are_light_that_no_parameter_changes(device: Device) -> None:
    sky = (Light("/d", "dome", (1.0, 1.0, 1.0), np.eye(4)),)
    e = evidence_of(ground(device, sky, clearcoat=0.7, clearcoat_roughness=0.2, emission=0.25), stroke_at(DABS))
    mine = painted(e)
    _, _, a, b = expected_columns(e, "preview_surface", 0.2, "dome").mean(0)
    np.testing.assert_allclose(e.unchanging[mine].mean(0), 0.7 * (0.04 * a + b) + 0.25, rtol=0.02)
    plain = evidence_of(ground(device, sky), stroke_at(DABS))
    np.testing.assert_array_equal(plain.unchanging, 0)


def test_a_perfect_mirror_shows_the_dome(device: Device) -> None:
    """Rays are never as sharp as its lobe: found by chance, a few would count for millions."""
    dome = Light("/l", "dome", (1.0, 2.0, 3.0), np.eye(4))
    floor = [quad((-4, -4, 0), (8, 0, 0), (0, 8, 0))]
    made = lit(device, floor, [material(0.0, 1.0, 0.0)], (dome,), 60, "preview_surface", 2)
    e = evidence_of(made, stroke_at(DABS))
    columns = by_dab(e, e.columns[:, -1])
    np.testing.assert_allclose(columns[:, 2] + columns[:, 3], np.tile([1.0, 2.0, 3.0], (len(DABS), 1)), rtol=0.08)


def test_a_reflectance_is_multiplied_by_the_light_that_falls_there(device: Device) -> None:
    made = ground(device, (Light("/d", "dome", (1.0, 2.0, 0.5), np.eye(4)),))
    e = evidence_of(made, stroke_at(DABS, space="reflectance"))
    np.testing.assert_allclose(e.target, np.float32([[0.2, 0.8, 0.3]] * 2), rtol=0.01)
    np.testing.assert_allclose(evidence_of(made, stroke_at(DABS)).target, [[0.2, 0.4, 0.6]] * 2, rtol=1e-6)


def test_many_dabs_share_the_rays_of_few(device: Device) -> None:
    """And what light brings stays the same, within the noise of the rays that each has."""
    made = ground(device, (Light("/d", "dome", (1.0, 2.0, 0.5), np.eye(4)),))
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 12), np.linspace(-0.5, 0.5, 8))
    many = [(float(a), float(b), 0.0) for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    lights = LightSet(made.scene, made.scene.lights)
    of = lambda points: gather_samples(stroke_at(points), made.scene, made.tracer, made.field, lights, [])  # noqa: E731
    (few, few_rows), (samples, rows) = of(many[:48]), of(many)
    on_dabs = [int((s.dab < n).sum()) * s.light.rays for s, n in ((few, 48), (samples, 96))]
    assert len(rows) == 96 and on_dabs[1] <= on_dabs[0]
    e = build_evidence(stroke_at(many), rows, samples, made.field)
    other = build_evidence(stroke_at(many[:48]), few_rows, few, made.field)
    mean = [x.columns[x.dab_of_sample < len(x.target)].mean(0) for x in (e, other)]
    np.testing.assert_allclose(mean[0][:, :3], mean[1][:, :3], rtol=0.02, atol=2e-3)
    assert len(np.unique(e.dab_of_sample[e.background_sample])) == 32 < len(e.target)


@pytest.mark.parametrize("kind", ["rect", "dome"])
def test_each_of_many_dabs_has_its_light(device: Device, kind: str) -> None:
    """Of 120 dabs, which share the rays of 32: nearer to quadrature than a light field is right, which is 1 %."""
    light = Light("/l", "dome", (1.0, 2.0, 3.0), np.eye(4)) if kind == "dome" else light_of(kind)
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(0, 0.15, 15), np.linspace(-0.03, 0.08, 8)))
    e = evidence_of(ground(device, (light,)), stroke_at(list(zip(u, v, 0 * u)), width=0.02))
    for j in (1, 3, 7, 13):
        expected = expected_columns(e, "preview_surface", LEVELS[j], kind)[:, [0, 2]]
        off = by_dab(e, e.columns[:, j])[:, [0, 2], 0] / expected - 1
        assert np.sqrt((off**2).mean(0)).max() < 0.01 and np.abs(off.mean(0)).max() < 0.005, (LEVELS[j], off)


def test_light_that_is_known_to_arrive_gives_the_same_columns(device: Device) -> None:
    made = ground(device, (light_of("rect"),))
    samples, rows = gather_samples(
        stroke_at(DABS), made.scene, made.tracer, made.field, LightSet(made.scene, made.scene.lights), []
    )
    e = build_evidence(stroke_at(DABS), rows, samples, made.field)
    levels = np.tile(np.array([0.2, 0.5]), (len(samples.eye), 1))
    known = single_columns(samples, made.field, levels, arriving=e.arriving)
    np.testing.assert_array_equal(known, single_columns(samples, made.field, levels))
    assert known.any()


def test_samples_lie_under_the_brush_as_its_painter_saw_it(device: Device) -> None:
    made = ground(device, ())
    e = evidence_of(made, stroke_at(DABS, width=0.2))
    mine = painted(e)
    assert (np.bincount(e.dab_of_sample[mine]) >= 6).all()
    way = np.array(DABS)[e.dab_of_sample[mine]] - EYE
    axis = way / np.linalg.norm(way, axis=1, keepdims=True)
    off = e.surface.position[mine] - EYE
    off = off - np.sum(off * axis, 1, keepdims=True) * axis
    reach = np.linalg.norm(off, axis=1)
    assert reach.max() <= 0.1001 * 1.1 and reach.max() > 0.06  # perspective widens the far side
    np.testing.assert_allclose(e.surface.position[mine][:, 2], 0, atol=1e-6)
    with pytest.raises(StrokeError):
        evidence_of(made, stroke_at([(50.0, 50, 50), (50.0, 50, 51)]))


def test_inside_a_furnace_every_column_is_its_albedo(device: Device) -> None:
    """Rays that hit surfaces bring the light field: in a closed glowing box all of it is the same."""
    made = lit(device, [box((0, 0, 0), (2, 2, 2), inward=True)], [material(0.5, emission=1.0)], bounces=60)
    e = evidence_of(made, stroke_at([(1, 1, 0.0), (1.2, 1, 0.0)], np.array([1.5, 1.2, 1.4])))
    light = closed_box(1, 0.5)
    for j in (3, 9, 19):
        got = e.columns[painted(e), j].mean(0)[:, 0]
        eye = np.array([0.4, 0.2, 1.4])
        expected = light * ref.columns_of_dome("phong", PHONG_LEVELS[j], [0, 0, 1], eye)
        np.testing.assert_allclose(got, expected, rtol=0.02, atol=2e-3)


# ── the rays that are drawn ──────────────────────────────────────────────────────────────────────


def draw(device: Device, alphas: list[float], counts: list[int], eye: np.ndarray, seed: int = 3) -> tuple:
    """Rays of one sample by draw_rays: local directions (K, 3), world (K, 3), densities (K,), its frame."""
    k = sum(counts)
    technique = np.repeat(np.arange(len(counts)), counts).astype(np.int32)
    u = sobol_points(0, k, random_shifts(1, np.random.default_rng(seed)))
    u = u[0, np.random.default_rng(seed).permutation(k)].astype(np.float32)
    frame = model_ref.frame_about(np.array([0.6, -0.48, 0.64])).astype(np.float32)
    row = -(-k // 16) * 16
    local_d, world_d = device.zeros((3, row), np.float32), device.empty((k, 3), np.float32)
    length_d, density_d, origin_d = (device.empty(shape, np.float32) for shape in ((k,), (k,), (k, 3)))
    place_d, normal_d = device.zeros((1, 3), np.float32), device.upload(frame[2])
    constants = {**CONSTANTS, **model_of("preview_surface").constants}
    device.kernel("sample_rays", "draw_rays", **constants)(
        (-(-k // 64) * 64,), (64,), np.uint32(k), np.uint32(0), np.uint32(k), np.uint32(row),
        device.upload(eye.astype(np.float32)), device.upload(frame), place_d, normal_d,
        device.upload(np.float32(alphas[:1])), device.upload(u), device.upload(technique), np.int32(len(alphas)),
        device.upload(np.float32([0, *alphas[1:]])), device.upload(np.float32(counts)), local_d, origin_d, world_d,
        length_d, density_d,
    )  # fmt: skip
    local, world, density, length = (device.download(x) for x in (local_d, world_d, density_d, length_d))
    np.testing.assert_array_equal(length > 0, density != 0)
    return local.T[:k].astype(float), world.astype(float), density.astype(float), frame


@pytest.mark.parametrize("cosine", [0.95, 0.5, 0.1])
@pytest.mark.parametrize("alpha", [0.05, 0.25, 0.6])
def test_visible_normals_are_drawn_by_their_density(device: Device, alpha: float, cosine: float) -> None:
    """Chi-square of the drawn directions over bins, against the textbook's density."""
    k = 40_000
    eye = model_ref.eye_at(cosine, 0.7)
    local, world, density, frame = draw(device, [alpha], [0, k], eye)
    np.testing.assert_allclose(np.linalg.norm(local, axis=1), 1, atol=1e-5)
    np.testing.assert_allclose(world, np.where(local[:, 2:] < 0, local * [1, 1, -1], local) @ frame, atol=1e-5)
    up = local[:, 2] > 1e-3
    exact = model_ref.visible_normal_density(alpha, eye, local[up])
    np.testing.assert_allclose(density[up], k * exact, rtol=2e-3 + 3e-7 / alpha**2)
    assert not density[local[:, 2] < 0].any()

    n = 320  # midpoints, ten to the side of a bin
    t = (np.arange(n) + 0.5) * 2 / n - 1
    l = hemisphere(np.stack([np.tile(t, n), np.repeat(t, n)], 1))
    share = model_ref.visible_normal_density(alpha, eye, l).reshape(32, n // 32, 32, n // 32).sum((1, 3)).ravel()
    share *= 2 * np.pi / n**2
    assert share.sum() == pytest.approx(up.mean(), abs=0.01)  # what lies below the horizon is lost
    counts, expected = np.bincount(square_cells(local[up]), minlength=D), k * share
    enough = expected > 20
    chi2 = ((counts - expected)[enough] ** 2 / expected[enough]).mean()
    assert chi2 < 1.6, chi2  # Sobol points do better than chance


def test_one_set_of_rays_serves_a_mixture(device: Device) -> None:
    """Weighted by one over the density of all techniques, rays integrate what none of them is made for."""
    eye = model_ref.eye_at(0.7, 1.9)
    local, _, density, _ = draw(device, [0.1, 0.4], [4000, 4000, 4000], eye)
    up = density > 0
    l, weight = local[up], 1 / density[up]
    assert (weight @ l[:, 2]) == pytest.approx(np.pi, rel=0.01)
    assert (weight @ l[:, 2] ** 3) == pytest.approx(np.pi / 2, rel=0.01)
    for roughness in (0.3, 0.5, 0.8):
        got = weight @ model_ref.columns("preview_surface", roughness, np.broadcast_to(eye, l.shape), l)
        np.testing.assert_allclose(got, model_ref.integrate_columns("preview_surface", roughness, eye), rtol=0.02)
