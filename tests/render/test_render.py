"""The renderer keeps the laws of light: albedo under a white dome, exact blending, no bands or specks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from kit.light_field_scenes import material as specular_workflow
from kit.light_field_scenes import of_elements
from kit.live_pictures import lit_scene
from kit.scene_pictures import SIZE, camera_at, ground, looking_down, matte, picture, white_dome
from kit.scene_records import band, make_scene, quad, sphere
from numpy.typing import NDArray
from reference.reflectance import albedo, integrate_columns

import usdslf.render.picture as render_module
from usdslf.elements.elements import sample_elements
from usdslf.errors import InputError
from usdslf.gpu.device import Device
from usdslf.rays import RayTracer
from usdslf.render.picture import AOVS, LitScene, PictureOptions, render
from usdslf.scene.records import Light, Material, Texture, constant
from usdslf.surfaces.reflectance import directional_albedo, lobe_parameter
from usdslf.surfaces.surface_points import evaluate_surface


def albedo_of(material: dict, cosine: NDArray) -> NDArray:
    """Directional albedo (n, 3) of a material by quadrature."""
    d, f0, f90, roughness = (material[k] for k in ("d", "f0", "f90", "roughness"))
    grid = np.linspace(0.05, 1, 39)
    x, y, a, b = (np.interp(cosine, grid, c)[..., None] for c in albedo("preview_surface", roughness, grid, 96).T)
    return d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b


def test_clipping_planes_cut_what_is_nearer_and_farther(device: Device) -> None:
    scene = make_scene(quad((-9, -9, 0), (18, 0, 0), (0, 18, 0)), lights=[white_dome()])
    for near, far, seen in ((0.0, np.inf, 1), (4.9, 9.0, 1), (5.5, 9.0, 0), (0.1, 4.9, 0)):
        aovs = picture(scene, camera_at((0, 0, 5), near=near, far=far), device, aovs=("alpha", "depth"), size=(4, 4))
        np.testing.assert_allclose(aovs["alpha"], seen)
        np.testing.assert_allclose(aovs["depth"], 5 if seen else np.inf, rtol=1e-5)


@pytest.mark.parametrize("model", ["preview_surface", "phong"])
@pytest.mark.parametrize("roughness", [0.08, 0.3, 1.0])
def test_a_floor_seen_at_a_grazing_angle_shows_the_integrals_of_its_lobes(
    device: Device, roughness: float, model: str
) -> None:
    """In a white dome, where Fresnel's ramp counts: each channel another mixture of the integrals X, Y, A and B."""
    cosine = 0.15
    eye = np.array([np.sqrt(1 - cosine**2), cosine, 0])
    x, y, a, b = integrate_columns(model, roughness, eye[[0, 2, 1]])
    materials = [specular_workflow((0.5, 0.0, 0.0), (0.0, 0.0, 1.0), roughness)]
    if model == "preview_surface":  # half a metal: F90 is not 1
        half = constant(0.5)
        materials.append(Material("/m", constant(0.8, 0.0, 1.0), metallic=half, roughness=constant(roughness)))
    for material in materials:
        scene = make_scene(ground(5.0), materials=[material], lights=[white_dome()])
        surface = evaluate_surface(scene, [0], [(0.3, 0.3)])
        d, f0, f90 = (v[0].astype(float) for v in (surface.diffuse, surface.f0, surface.f90))
        expected = d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b
        if model == "phong":
            expected = d * x + f0 * a
        lit = LitScene(scene, RayTracer(scene), None, scene.lights, device)
        if model == "phong":  # which the light field says
            lit = lit_scene(scene, device, 20, model)
        shown = render(lit, camera_at(40 * eye, focal_length=5000.0), (8, 8), options=PictureOptions(samples=64))
        np.testing.assert_allclose(shown["color"].mean((0, 1)), expected, rtol=0.01, atol=2e-4)


# ── furnaces ─────────────────────────────────────────────────────────────────────────────────────

DIELECTRIC = dict(d=np.array([0.5, 0.3, 0.2]), f0=0.04, f90=1.0)
METAL = dict(d=np.zeros(3), f0=np.array([0.9, 0.6, 0.3]), f90=np.array([0.9, 0.6, 0.3]))


@pytest.mark.parametrize(("d", "f0"), [(0.5, 0.3), (0.7, 0.9)])
def test_a_ball_of_phong_shows_k_d_and_k_s_of_no_more_than_arrives(device: Device, d: float, f0: float) -> None:
    material = Material(
        "", diffuse_color=constant(d, d, d), use_specular_workflow=True, specular_color=constant(f0, f0, f0),
        roughness=constant(0.4), clearcoat=constant(1.0),
    )  # fmt: skip
    scene = make_scene(sphere(1.0, rows=64), materials=[material], lights=[white_dome()])
    camera = camera_at((0, 1, 5))
    lit = lit_scene(scene, device, 20, "phong")
    aovs = render(lit, camera, (72, 56), ("color", "alpha", "position", "normal"))
    to_eye = camera.world_from_camera[:3, 3] - aovs["position"]
    cosine = (aovs["normal"] * to_eye).sum(-1) / np.linalg.norm(to_eye, axis=-1)
    inside = (aovs["alpha"][..., 0] > 0.999) & (cosine > 0.35)
    lobe = directional_albedo("phong", float(lobe_parameter("phong", 0.4)), cosine[inside])[:, 2]
    expected = d + min(f0, 1 - d) * lobe
    ratio = aovs["color"][inside].mean(-1) / expected
    assert abs(ratio.mean() - 1) < 0.005 and ratio.std() < 0.02
    assert aovs["color"].max() < 1.05


@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.8])
@pytest.mark.parametrize("is_metal", [False, True])
def test_a_ball_in_a_white_dome_shows_its_albedo(device: Device, roughness: float, is_metal: bool) -> None:
    color = (0.9, 0.6, 0.3) if is_metal else (0.5, 0.3, 0.2)
    material = Material(
        "", diffuse_color=constant(*color), metallic=constant(float(is_metal)), roughness=constant(roughness)
    )
    scene = make_scene(sphere(1.0, rows=64), materials=[material], lights=[white_dome()])
    camera = camera_at((0, 1, 5))
    aovs = picture(scene, camera, device, aovs=("color", "alpha", "position", "normal"), size=(72, 56))
    to_eye = camera.world_from_camera[:3, 3] - aovs["position"]
    cosine = (aovs["normal"] * to_eye).sum(-1) / np.linalg.norm(to_eye, axis=-1)
    inside = (aovs["alpha"][..., 0] > 0.999) & (cosine > 0.35)
    expected = albedo_of({**(METAL if is_metal else DIELECTRIC), "roughness": roughness}, cosine[inside])
    ratio = aovs["color"][inside] / expected
    assert abs(ratio.mean() - 1) < 0.005
    assert np.abs(ratio - 1).mean() < 0.01
    background = aovs["alpha"][..., 0] == 0
    np.testing.assert_allclose(aovs["color"][background], 1, rtol=1e-5)


def test_between_even_walls_a_ball_shows_its_albedo(device: Device) -> None:
    """The same with surfaces around it instead of a dome: walls that shine .6 and send back .4 of what arrives.

    All radiance is 1 then, .6 of it met as light and the rest gathered from surfaces, after any number of bounces.
    Samples of one picture share their numbers and what these are wrong by: the mean of four is asked, little of one.
    """
    ball = specular_workflow((0.5, 0.3, 0.2), 0.1, 0.6)
    walls = sphere(40.0, rows=12, material=1)
    scene = make_scene(sphere(1.0, rows=64), walls, materials=[ball, specular_workflow(0.4, emission=0.6)])
    lit = lit_scene(scene, device, 200, "phong", 12)
    camera, names = camera_at((0, 0, 5), focal_length=550.0), ("color", "indirect", "direct")
    each = [render(lit, camera, (4, 4), names, PictureOptions(samples=64, seed=seed)) for seed in range(4)]
    color, indirect, direct = (np.mean([p[name] for p in each], (0, 1, 2)) for name in names)
    level = np.array([p["indirect"].mean() for p in each]) / indirect.mean()
    assert np.abs(level - 1).max() < 0.006
    lobe = directional_albedo("phong", float(lobe_parameter("phong", 0.6)), np.ones(1))[0, 2]
    expected = np.array([0.5, 0.3, 0.2]) + 0.1 * lobe
    np.testing.assert_allclose(color, expected, rtol=0.01)
    np.testing.assert_allclose(indirect, 0.4 * expected, rtol=0.01)
    np.testing.assert_allclose(direct, 0.6 * expected, rtol=0.01)


@pytest.mark.parametrize("has_moved", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_where_a_hollow_body_stands_on_the_ground_all_white_is_as_bright_as_its_sky(
    device: Device, seed: int, has_moved: bool
) -> None:
    """Surfaces that absorb nothing reflect as much as the dome sends; half of it reaches the foot by the wall.

    `has_moved`: elements were laid before the body came, which is black inside: so are those below it.
    """
    body, white = band(0.5, 0.44, 0.12), [specular_workflow(1.0)]
    scene = make_scene(ground(), body, materials=white, lights=[white_dome()])
    shrunk = replace(body, positions=body.positions * 0)
    before = make_scene(ground(), shrunk, materials=white) if has_moved else scene
    elements = sample_elements(scene, RayTracer(before), 500, np.random.default_rng(seed))
    inside = (elements.mesh == 1) & (elements.side < 0)
    elements = replace(elements, diffuse=np.where(inside[:, None], np.float32(0), elements.diffuse))
    made = of_elements(device, scene, RayTracer(scene), elements, "phong")
    lit = LitScene(made.scene, made.tracer, made.field, made.scene.lights, device)
    names = ("color", "position", "mesh")
    aovs = render(lit, camera_at((0, 2.6, 1.2)), (120, 90), names, PictureOptions(elements=500))
    radius = np.linalg.norm(aovs["position"][..., ::2], axis=-1)
    foot = (aovs["mesh"][..., 0] == 0) & (radius > 0.38) & (radius < 0.56)
    light = aovs["color"][foot].mean(-1)
    assert foot.sum() > 500
    assert abs(light.mean() - 1) < 0.015
    assert light.min() > 0.93 and light.max() < 1.1


def test_a_texture_appears_upright(device: Device, tmp_path: Any) -> None:
    """st (0, 0) is the lower left of the picture: the file's last row is at t = 0."""
    import OpenImageIO as oiio

    pixels = np.zeros((2, 2, 3), np.float32)
    pixels[0, 0], pixels[0, 1], pixels[1, 0] = (1, 0, 0), (0, 1, 0), (0, 0, 1)  # red upper left, blue lower left
    oiio.ImageBuf(np.kron(pixels, np.ones((8, 8, 1), np.float32))).write(str(tmp_path / "t.exr"), "float")
    texture = Texture("/t", str(tmp_path / "t.exr"), color_space="raw")
    mesh = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)[mesh.triangles]
    mesh = type(mesh)(**{**vars(mesh), "uvs": {"st": uv}})
    scene = make_scene(mesh, materials=[Material("", diffuse_color=texture)], lights=[white_dome()])
    out = picture(scene, camera_at((0, 0, 5)), device, aovs=("albedo",), size=(30, 20))["albedo"]
    np.testing.assert_allclose(out[8, 13], [1, 0, 0], atol=1e-4)
    np.testing.assert_allclose(out[8, 16], [0, 1, 0], atol=1e-4)
    np.testing.assert_allclose(out[11, 13], [0, 0, 1], atol=1e-4)
    np.testing.assert_allclose(out[11, 16], [0, 0, 0], atol=1e-4)


@pytest.mark.parametrize("mode", ["transparent", "presence"])
def test_veils_blend_exactly(device: Device, mode: str) -> None:
    """seen = presence (E + d L) + (1 - opacity) behind, here under no light but emission."""
    glow = constant(0.8, 0.4, 0.2)
    veil = Material("", diffuse_color=constant(0, 0, 0), emissive_color=glow, opacity=constant(0.25), opacity_mode=mode)
    wall = Material("", diffuse_color=constant(0, 0, 0), specular_color=constant(0, 0, 0), use_specular_workflow=True,
                    emissive_color=constant(1.0, 2.0, 3.0))  # fmt: skip
    black = dict(use_specular_workflow=True, specular_color=constant(0, 0, 0))
    veil = Material(**{**vars(veil), **black})
    meshes = [quad((-9, -9, z), (18, 0, 0), (0, 18, 0), material=m) for z, m in ((0, 1), (1, 0), (2, 0))]
    scene = make_scene(*meshes, materials=[veil, wall])
    aovs = picture(scene, camera_at((0, 0, 5)), device, aovs=("emission", "alpha", "depth"), size=(4, 4))
    presence = 0.25 if mode == "presence" else 1.0
    expected = np.array([1.0, 2.0, 3.0])
    for _ in range(2):
        expected = presence * np.asarray(glow) + 0.75 * expected
    np.testing.assert_allclose(aovs["emission"], np.broadcast_to(expected, (4, 4, 3)), rtol=1e-4)
    np.testing.assert_allclose(aovs["alpha"], 1, rtol=1e-5)
    np.testing.assert_allclose(aovs["depth"], 3, rtol=1e-5)


def test_flat_surfaces_come_out_free_of_noise_and_edges_sharp(device: Device) -> None:
    """Red paint beside blue metal under a lamp and a dome: no speckle, and nothing of one on the other."""
    left = quad((-9, 0, 9), (9, 0, 0), (0, 0, -18), material=0)
    right = quad((0, 0, 9), (9, 0, 0), (0, 0, -18), material=1)
    light = Light("/l", "disk", (1.0,) * 3, looking_down((0, 6, 0)), radius=1.0)
    metal = Material("", diffuse_color=constant(0, 0, 0.8), metallic=constant(1.0), roughness=constant(0.1))
    scene = make_scene(left, right, materials=[matte((0.8, 0, 0)), metal], lights=[light, white_dome(0.3)])
    out = picture(scene, camera_at((0, 5, 0)), device, size=(40, 30), hide_lights=True)["color"].astype(float)
    red, blue = out[:, :20, 0], out[:, 20:, 2]
    assert out[:, :19, 2].max() < 0.06 * blue.mean() and out[:, 21:, 0].max() < 0.06 * red.mean()  # Fresnel only
    beside = out[6:-6, 18:20, 0].mean(1) / out[6:-6, 12:15, 0].mean(1)
    np.testing.assert_allclose(beside, 1, atol=0.05)  # paint at the edge is as bright as the rest
    inside = out[6:-6, 6:14, 0]
    ripple = inside[1:-1, 1:-1] - (inside[:-2, 1:-1] + inside[2:, 1:-1] + inside[1:-1, :-2] + inside[1:-1, 2:]) / 4
    assert np.abs(ripple).max() < 0.01 * inside.mean()


def test_bands_do_not_show(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("usdslf.render.live.noise.NOISE", 1e9)  # what gets more samples may depend on the band
    light = Light("/l", "disk", (1.0,) * 3, looking_down((0, 3, 0)), radius=0.5)
    scene = make_scene(ground(3.0), sphere(0.5, (0, 0.5, 0)), materials=[matte()], lights=[light])
    camera = camera_at((0, 2, 4))
    whole = picture(scene, camera, device)["color"]
    monkeypatch.setattr(render_module, "BAND", 1)
    np.testing.assert_allclose(picture(scene, camera, device)["color"], whole, rtol=1e-4, atol=1e-5)


def test_every_aov_has_its_shape_and_says_where_nothing_is(device: Device) -> None:
    scene = make_scene(sphere(0.5), materials=[matte()], lights=[white_dome()])
    aovs = picture(scene, camera_at((0, 0, 5)), device, aovs=tuple(AOVS))
    for name, channels in AOVS.items():
        assert aovs[name].shape == (SIZE[1], SIZE[0], channels) and aovs[name].dtype == np.float32, name
    assert aovs["mesh"][0, 0] == aovs["material"][0, 0] == -1 and aovs["depth"][0, 0] == np.inf
    assert aovs["alpha"][0, 0] == 0 and aovs["mesh"][14, 18] == 0
    np.testing.assert_allclose(aovs["position"][14, 18], [0, 0, 0.5], atol=0.05)
    total = aovs["direct"] + aovs["indirect"] + aovs["emission"]
    inside = aovs["alpha"][..., 0] == 1
    np.testing.assert_allclose(aovs["color"][inside], total[inside], rtol=1e-4)


def test_coarse_spheres_have_neither_black_nor_bright_rims(device: Device) -> None:
    """Smooth normals that look away from the viewer at the rim of a coarse mesh are still lit."""
    for roughness in (0.1, 0.9):
        material = Material("", diffuse_color=constant(0.6, 0.6, 0.6), roughness=constant(roughness))
        scene = make_scene(sphere(1.0, rows=8), materials=[material], lights=[white_dome()])
        aovs = picture(scene, camera_at((0, 0, 5)), device, aovs=("color", "alpha"), size=(60, 44))
        inside = aovs["alpha"][..., 0] == 1
        assert np.isfinite(aovs["color"]).all()
        assert aovs["color"][inside].min() > 0.3 and aovs["color"].max() < 1.3


def test_a_small_light_just_over_the_horizon_leaves_no_specks(device: Device) -> None:
    """Shading normals that lean towards a low sun send rays below the surface, where no light was sampled."""
    towards = np.array([1, 0.06, 0]) / np.hypot(1, 0.06)
    world_from_light = np.eye(4)
    world_from_light[:3, :3] = np.stack([[0, 0, 1], np.cross(towards, [0, 0, 1]), towards], 1)
    sun = Light("/sun", "distant", (400.0,) * 3, world_from_light, angle=np.radians(4.0))
    leaning = np.float32([0.33, 0.944, 0])
    floor = replace(ground(), corner_normals=np.tile(leaning, (2, 3, 1)))
    color = picture(make_scene(floor, lights=[sun]), camera_at((0, 4, 0)), device)["color"]
    inside = color[5:-5, 5:-5]
    assert inside.min() > 0.03
    assert inside.max() < 1.5 * np.median(inside)


def test_the_same_call_gives_the_same_picture(device: Device) -> None:
    scene = make_scene(ground(), sphere(0.4, (0, 0.4, 0)), materials=[matte()], lights=[white_dome()])
    lit = lit_scene(scene, device, 60)
    a, b = (render(lit, camera_at((0, 2, 3)), SIZE)["color"] for _ in range(2))
    np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    "options, word",
    [(dict(size=(0, 10)), "0 x 10"), (dict(aovs=("colour",)), "colour"), (dict(samples=0), "samples")],
)
def test_bad_input_is_named(device: Device, options: dict, word: str) -> None:
    scene = make_scene(ground(), lights=[white_dome()])
    with pytest.raises(InputError, match="sample" if word == "samples" else word):
        picture(scene, camera_at((0, 2, 3)), device, **options)


def test_nothing_in_view_is_the_background(device: Device) -> None:
    scene = make_scene(ground(), lights=[white_dome(0.5)])
    away = camera_at((0, 2, 3), (0, 9, 9))
    np.testing.assert_allclose(picture(scene, away, device, size=(5, 3))["color"], 0.5, rtol=1e-6)
    assert picture(scene, away, device, size=(1, 1))["color"].shape == (1, 1, 3)


def test_without_surfaces_there_are_lights_and_the_background(device: Device) -> None:
    lamp = Light("/l", "disk", (7.0, 5.0, 3.0), looking_down((0, 2, 0)), radius=0.5)
    aovs = picture(make_scene(lights=[lamp, white_dome(0.5)]), camera_at((0, 0, 0), (0, 2, 0)), device,
                   aovs=("color", "mesh", "depth"))  # fmt: skip
    np.testing.assert_allclose(aovs["color"][SIZE[1] // 2, SIZE[0] // 2], [7, 5, 3], rtol=1e-5)
    np.testing.assert_allclose(aovs["color"][0, 0], 0.5, rtol=1e-5)
    assert aovs["mesh"].max() == -1 and np.isinf(aovs["depth"]).all()
