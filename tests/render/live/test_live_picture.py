"""A live picture keeps the laws of light, shows at once what an edit changes, and is the same however it is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.live_pictures import SIZE, after, changed, lit_scene, live
from kit.picture_errors import relative_error
from kit.scene_pictures import camera_at, ground, matte
from kit.scene_records import make_scene, quad, sphere
from numpy.typing import NDArray
from reference import lights as closed
from reference.reflectance import albedo, preview_surface

import usdslf.render.live.gather as gather_module
import usdslf.render.live.picture as picture_module
from usdslf.errors import InputError
from usdslf.gpu.device import Device, Kernel
from usdslf.progress import Cancelled, hearing
from usdslf.rays import RayTracer
from usdslf.render.picture import LitScene, PictureOptions, render
from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import Camera, Light, Material, Texture, constant
from usdslf.textures.images import write_image


def white_dome() -> Light:
    return Light("/dome", "dome", (1.0,) * 3, np.eye(4))


def above(height: float) -> np.ndarray:
    """The frame of a light above the origin that shines down."""
    m = np.eye(4)
    m[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    m[1, 3] = height
    return m


@pytest.fixture(scope="module")
def table(device: Device) -> LitScene:
    """A glossy ball and a matte one on a dull ground, under a lamp and a dome."""
    materials = [
        Material("/ground", diffuse_color=constant(0.5, 0.45, 0.4), roughness=constant(0.8)),
        Material("/ball", diffuse_color=constant(0.1, 0.2, 0.6), roughness=constant(0.3)),
        Material("/metal", diffuse_color=constant(0.9, 0.7, 0.3), roughness=constant(0.25), metallic=constant(1.0)),
    ]
    lamp = Light("/lamp", "rect", (6.0, 5.0, 4.0), above(2.2), width=0.8, height=0.6)
    dome = replace(white_dome(), radiance=(0.2, 0.25, 0.3))
    scene = make_scene(
        ground(3.0), sphere(0.5, (-0.6, 0.5, 0), material=1), sphere(0.4, (0.5, 0.4, 0.2), material=2),
        materials=materials, lights=[lamp, dome],
    )  # fmt: skip
    return lit_scene(scene, device, 400)


CAMERA = camera_at((0, 1.4, 4.2), (0, 0.4, 0))


# ── light ────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(("roughness", "metallic"), [(0.1, 0.0), (0.6, 0.0), (0.3, 1.0)])
def test_a_ball_in_a_white_dome_shows_its_albedo(device: Device, roughness: float, metallic: float) -> None:
    color = np.array([0.8, 0.6, 0.3])
    material = Material("", diffuse_color=constant(*color), roughness=constant(roughness), metallic=constant(metallic))
    scene = make_scene(sphere(1.0, rows=32), materials=[material], lights=[white_dome()])
    picture = live(lit_scene(scene, device, 60), camera_at((0, 0, 5)))
    shown = after(picture, 64)
    grid = np.linspace(0.05, 1, 39)
    x, y, a, b = albedo("preview_surface", roughness, grid, 96).T
    d, f0, f90 = (0 * color, color, color) if metallic else (color, np.full(3, 0.04), np.ones(3))
    columns = d[:, None] * ((1 - f0[:, None]) * x + (1 - f90[:, None]) * y) + f0[:, None] * a + f90[:, None] * b
    middle = shown[SIZE[1] // 2 - 4 : SIZE[1] // 2 + 4, SIZE[0] // 2 - 4 : SIZE[0] // 2 + 4].reshape(-1, 3)
    np.testing.assert_allclose(middle.mean(0), columns[:, -1], rtol=0.01)
    np.testing.assert_allclose(shown[0, 0], 1, rtol=1e-5)  # the dome itself


@pytest.mark.parametrize("kind", ["disk", "sphere", "distant"])
def test_ground_below_a_light_is_as_bright_as_the_closed_form(device: Device, kind: str) -> None:
    """On a surface whose BRDF is d / pi head-on but for Fresnel, which does not matter straight below."""
    light = Light("/l", kind, (1.0,) * 3, above(30.0), radius=3.0, angle=0.2)
    expected = {
        "disk": closed.disk_irradiance(3.0, 30.0, 0.0), "sphere": closed.sphere_irradiance(3.0, 30.0, 1.0),
        "distant": closed.cone_irradiance(0.1, 1.0),
    }[kind]  # fmt: skip
    scene = make_scene(ground(1.0), materials=[matte()], lights=[light])
    picture = live(lit_scene(scene, device, 60), camera_at((0, 3, 0), focal_length=3000.0), (8, 8))
    np.testing.assert_allclose(after(picture, 32).mean(), 0.5 / np.pi * expected, rtol=5e-3)


LIGHTS = {
    "rect": dict(kind="rect", width=1.2, height=0.8), "disk": dict(kind="disk", radius=0.5),
    "sphere": dict(kind="sphere", radius=0.4), "cylinder": dict(kind="cylinder", radius=0.2, length=1.5),
    "distant": dict(kind="distant", angle=0.5), "parallel": dict(kind="distant"),
    "point": dict(kind="sphere", radius=0.3, treat_as_point=True),
    "spot": dict(kind="disk", radius=0.3, cone_angle=30.0, cone_softness=0.5),
    "focus": dict(kind="rect", width=0.5, height=0.5, focus=8.0, focus_tint=(0.2, 0.0, 0.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", LIGHTS)
def test_every_light_lights_as_in_closed_form_or_the_final_picture(device: Device, name: str) -> None:
    """Turned, and stretched unevenly: ellipses, ellipsoids, sheared rects."""
    frame = above(1.6)
    frame[:3, 0] *= 1.5
    frame[:3, 1] += 0.3 * frame[:3, 0]
    light = Light("/l", radiance=(3.0, 2.0, 1.0), world_from_light=frame, **LIGHTS[name])
    glossy = Material("", diffuse_color=constant(0.5, 0.5, 0.5), roughness=constant(0.4))
    lit = lit_scene(make_scene(ground(2.0), materials=[glossy], lights=[light]), device, 60)
    camera, size = camera_at((0.6, 3, 2.5)), (24, 16)
    final = render(lit, camera, size, options=PictureOptions(samples=256))["color"]
    shown = after(live(lit, camera, size), 64)
    assert np.abs(shown - final).mean() < 0.08 * final.mean()  # the final picture blurs the edge of a spot
    has_shape = name in ("rect", "disk", "sphere", "cylinder")
    expected = mean_of_ground(light, camera, size) if has_shape else final.mean((0, 1))
    np.testing.assert_allclose(shown.mean((0, 1)), expected, rtol=6e-3)


def mean_of_ground(light: Light, camera: Camera, size: tuple[int, int], fine: int = 4) -> NDArray[np.float64]:
    """Mean colour (3,) of a picture that a ground in y = 0 of d = .5, F0 = .04, roughness .4 fills, in float64."""
    width, height = size[0] * fine, size[1] * fine
    at = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    rays = camera_rays(camera, np.stack(at, -1).reshape(-1, 2), width / height)
    origin, direction = np.broadcast_to(rays.origin, rays.direction.shape).astype(float), rays.direction.astype(float)
    place = origin - direction * (origin[:, 1] / direction[:, 1])[:, None]
    points, normals = closed.shape_points(light)
    upright = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # y becomes the normal
    total = 0.0
    for p, eye in zip(np.array_split(place, 64), np.array_split(-direction, 64), strict=True):
        to = points - p[:, None]
        squared = (to**2).sum(-1)
        to /= np.sqrt(squared)[..., None]
        sent = np.maximum(-(to * normals).sum(-1), 0) / squared  # solid angle of each piece that shines here
        e, l = (w @ upright.T for w in (np.broadcast_to(eye[:, None], to.shape), to))
        total += float((preview_surface(0.5, 0.04, 1.0, 0.4, e, l)[..., 0] * sent * np.maximum(to[..., 1], 0)).sum())
    return np.array(light.radiance) * total / len(place)


def test_many_lights_are_chosen_by_what_they_bring(device: Device) -> None:
    lights = [Light(f"/l{i}", "disk", (i % 3 + 1.0, 2.0, i % 2 + 1.0), above(1.5), radius=0.2) for i in range(7)]
    for i, light in enumerate(lights):
        light.world_from_light[0, 3], light.world_from_light[2, 3] = i - 3, (i % 3) - 1
    scene = make_scene(ground(4.0), materials=[matte()], lights=[*lights, replace(white_dome(), radiance=(0.1,) * 3)])
    lit, camera = lit_scene(scene, device, 60), camera_at((0, 5, 5))
    final = render(lit, camera, SIZE, options=PictureOptions(samples=64))["color"]
    assert relative_error(after(live(lit, camera), 64), final) < 0.03


def test_what_is_seen_through_is_blended_as_in_the_final_picture(device: Device) -> None:
    pane = Material(
        "/pane", diffuse_color=constant(0.7, 0.2, 0.1), opacity=constant(0.4), opacity_mode="presence",
        roughness=constant(0.5),
    )  # fmt: skip
    scene = make_scene(
        ground(3.0), quad((-0.7, 0, 1), (1.2, 0, 0), (0, 1.2, 0), material=1), sphere(0.5, (0, 0.5, 0), material=2),
        materials=[matte(), pane, matte((0.1, 0.5, 0.2))], lights=[white_dome()],
    )  # fmt: skip
    lit = lit_scene(scene, device)
    final = render(lit, CAMERA, SIZE, options=PictureOptions(samples=64, elements=200))["color"]
    picture = live(lit, CAMERA)
    assert relative_error(after(picture, 64), final) < 0.02
    assert relative_error(after(live(lit, CAMERA), 1), final) > 0.05  # what is behind comes with the second frame


# ── edits ────────────────────────────────────────────────────────────────────────────────────────


@pytest.fixture
def checker(tmp_path: Path) -> Texture:
    y, x = np.indices((16, 16)) // 4
    write_image(
        tmp_path / "checker.exr", np.where(((x + y) % 2)[..., None], [0.8, 0.3, 0.1], [0.1, 0.2, 0.5]), half=False
    )
    return Texture("/t", str(tmp_path / "checker.exr"), color_space="raw")


@pytest.mark.parametrize("inputs", [
    {"diffuse_color": constant(0.7, 0.1, 0.05)},
    {"use_specular_workflow": True, "specular_color": constant(0.3, 0.3, 0.2)},
    {"metallic": constant(1.0)},
    {"roughness": constant(0.6)},
    {"clearcoat": constant(1.0), "clearcoat_roughness": constant(0.1)},
])  # fmt: skip
def test_an_edit_shows_what_a_picture_of_the_edited_scene_does(table: LitScene, inputs: dict[str, Any]) -> None:
    """In the first frame no ray is followed, so that other surfaces' colours do not matter."""
    materials = changed(table, 1, **inputs)
    picture = live(table, CAMERA)
    before = after(picture, 1)
    edited = picture.with_materials(materials)
    edited.gather_frame(1)
    shown = edited.now().picture
    anew = after(live(replace(table, scene=replace(table.scene, materials=materials)), CAMERA), 1)
    np.testing.assert_allclose(shown, anew, rtol=2e-4, atol=1e-5)
    assert np.abs(shown - before).max() > 0.02
    np.testing.assert_array_equal(picture.now().picture, before)  # which does not change


def test_another_light_field_replaces_the_first_without_a_flash(table: LitScene) -> None:
    """What was shown stays until frames are there, but for diffuse light, which is at once that of the elements."""
    picture = live(table, CAMERA)
    before = after(picture, 16)
    same = picture.with_materials(table.scene.materials, table.light_field)
    np.testing.assert_allclose(same.now().picture, before, rtol=1e-4, atol=1e-5)
    assert same.now().number == 0
    materials = changed(table, 0, diffuse_color=constant(0.9, 0.1, 0.1))
    elements = table.light_field.elements
    red = table.light_field.surface.with_rows(elements.material == 0, diffuse=np.array([0.9, 0.1, 0.1], np.float32))
    light = table.light_field.with_surface(red)
    list(light.converge(8))
    edited = picture.with_materials(materials, light)
    anew = live(replace(table, scene=replace(table.scene, materials=materials), light_field=light), CAMERA)
    soon, truth = after(anew, 16), after(anew, 64)
    unlit = picture.with_materials(materials).now().picture
    at_once = relative_error(edited.now().picture, truth)
    assert at_once < 0.85 * relative_error(unlit, truth)
    assert relative_error(after(edited, 16), soon) < 0.01
    np.testing.assert_array_equal(picture.now().picture, before)


@pytest.mark.parametrize("inputs", [
    {"opacity": constant(0.4), "opacity_mode": "presence"},
    {"emissive_color": constant(3.0, 1.5, 0.5)},
])  # fmt: skip
def test_an_edit_of_what_is_seen_through_or_shines_begins_anew(table: LitScene, inputs: dict[str, Any]) -> None:
    """And shows what a final picture of the edited scene does, whose surfaces send the light that they sent."""
    edited = live(table, CAMERA).with_materials(changed(table, 1, **inputs))
    assert edited.is_begun_anew
    shown = after(edited, 64)
    scene = replace(table.scene, materials=changed(table, 1, **inputs))
    field = edited.scene.light.field
    lit = replace(table, scene=scene, tracer=RayTracer(scene), light_field=field)
    final = render(lit, CAMERA, SIZE, options=PictureOptions(samples=64, elements=400))["color"]
    assert relative_error(shown, final) < 0.03
    back = edited.with_materials(table.scene.materials)
    assert relative_error(after(back, 16), after(live(table, CAMERA), 16)) < 1e-3


def test_a_change_of_colour_gathers_nothing(table: LitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = live(table, CAMERA)
    after(picture, 3)

    def fail(*_: object) -> None:
        raise AssertionError("light is gathered")

    monkeypatch.setattr(picture_module, "gather_batch", fail)
    edited = picture.with_materials(changed(table, 0, diffuse_color=constant(0.1, 0.6, 0.2)))
    assert edited.gather_frame(3)
    frame = edited.now()
    assert frame.number == 3 and frame.picture[-4:].mean((0, 1)).argmax() == 1


def test_a_change_of_roughness_gathers_the_rows_of_its_material_alone(table: LitScene) -> None:
    picture = live(table, CAMERA)
    after(picture, 2)
    edited = picture.with_materials(changed(table, 1, roughness=constant(0.6)))
    ball = picture.seen()["material"] == 1
    assert edited.now().number == 0 and picture.now().number == 2
    counts = {m: [(len(g.rows), g.frames) for g in s.groups if not g.part] for m, s in edited._shares.items()}
    assert counts[1] == [(int(ball.sum()), 0)]
    assert {g[0][1] for m, g in counts.items() if m != 1} == {2}
    before = picture.now().picture
    after(edited, 2)
    np.testing.assert_array_equal(picture.now().picture, before)  # whose columns were kept aside


MAPPED: dict[str, Callable[[Texture], dict[str, Any]]] = {
    "colour": lambda t: {"diffuse_color": t, "roughness": replace(t, channels="g")},
    "bumps and coat": lambda t: {
        "normal": replace(t, scale=(1.0,) * 4, bias=(-0.4, -0.2, 0.5, 0.0)), "clearcoat": constant(1.0),
        "clearcoat_roughness": replace(t, channels="b"),
    },
}  # fmt: skip


@pytest.mark.parametrize("what", MAPPED)
def test_textures_on_the_device_show_as_those_on_the_host_and_in_the_final_picture(
    table: LitScene, checker: Texture, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a transform and a scale; meshes without coordinates read its fallback place."""
    texture = replace(
        checker, st_from_uv=((2.0, 0.5, 0.1), (-0.3, 1.5, 0.2), (0.0, 0.0, 1.0)), scale=(0.9, 1.1, 0.8, 1.0),
        st_fallback=(0.3, 0.6), wrap_s="mirror",
    )  # fmt: skip
    mesh = table.scene.meshes[0]
    textured = replace(mesh, uvs={"st": (mesh.positions[mesh.triangles][..., ::2] / 3).astype(np.float32)})
    scene = replace(
        table.scene, meshes=(textured, *table.scene.meshes[1:]),
        materials=changed(table, 0, **MAPPED[what](texture)),
    )  # fmt: skip
    here = replace(table, scene=scene)
    picture = live(here, CAMERA)
    on_device = after(picture, 1)
    final = render(here, CAMERA, SIZE, options=PictureOptions(samples=64, elements=400))["color"]
    assert relative_error(after(picture, 64), final) < 0.02
    monkeypatch.setattr("usdslf.render.live.materials.TEXEL_BYTES", 0)
    on_host = after(live(here, CAMERA), 1)
    np.testing.assert_allclose(on_device, on_host, rtol=1e-3, atol=1e-4)
    assert np.ptp(on_device[-8:].mean(-1)) > 0.05  # the checker is seen


# ── frames ───────────────────────────────────────────────────────────────────────────────────────


def test_a_frame_that_is_cancelled_goes_on_where_it_was(table: LitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (gather_module, picture_module):
        monkeypatch.setattr(module, "BATCH", 256)
    whole, broken = live(table, CAMERA), live(table, CAMERA)
    expected = after(whole, 3)
    told = 0

    def cancel(_: object) -> None:
        nonlocal told
        told += 1
        if told % 5 == 0:
            raise Cancelled

    frames = 0
    while frames < 3:
        with hearing(cancel):
            try:
                broken.gather_frame(frames + 1)
                frames += 1
            except Cancelled:
                broken.now()  # is there at any time
    assert told > 15
    np.testing.assert_allclose(broken.now().picture, expected, rtol=1e-5, atol=1e-7)


REGION = (17, 9, 37, 22)


@pytest.mark.parametrize("frames", [1, 3])
def test_a_part_shows_the_pixels_of_the_whole(table: LitScene, frames: int) -> None:
    """Bit by bit: edges, rays that are followed and the filter at its border included."""
    left, top, right, bottom = REGION
    whole = after(live(table, CAMERA), frames)
    part = live(table, CAMERA, region=REGION)
    np.testing.assert_array_equal(after(part, frames), whole[top:bottom, left:right])
    assert part.seen()["material"].shape == (bottom - top, right - left)


def test_what_is_visible_comes_first(table: LitScene) -> None:
    left, top, right, bottom = REGION
    whole, picture = live(table, CAMERA), live(table, CAMERA)
    expected = after(whole, 3)
    *_, last = picture.frames(3, REGION)
    assert last.number == 3 and picture.now().number == 0
    np.testing.assert_array_equal(last.picture[top:bottom, left:right], expected[top:bottom, left:right])
    np.testing.assert_array_equal(after(picture, 3), expected)


@pytest.mark.parametrize("region", [(0, 0, 49, 32), (5, 5, 5, 9), (-1, 0, 4, 4)])
def test_a_region_outside_the_picture_is_refused(table: LitScene, region: tuple[int, int, int, int]) -> None:
    with pytest.raises(InputError, match="give left, top, right, bottom"):
        live(table, CAMERA, region=region)


def test_pictures_do_not_depend_on_the_size_of_work_groups(table: LitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = after(live(table, CAMERA), 3)
    call = Kernel.__call__

    def in_groups_of_16(kernel: Kernel, size: tuple, local: tuple | None, *args: Any) -> None:
        call(kernel, size, (16,) if local == (64,) else local, *args)

    monkeypatch.setattr(Kernel, "__call__", in_groups_of_16)
    np.testing.assert_array_equal(after(live(table, CAMERA), 3), expected)


def test_frames_get_better_and_say_so(table: LitScene) -> None:
    frames = list(live(table, CAMERA).frames(16))
    assert [f.number for f in frames] == list(range(1, 17))
    errors = [f.error for f in frames[1:]]
    assert errors[-1] < 0.5 * errors[0]
    assert np.isinf(frames[0].error)
    rest = live(table, CAMERA)
    assert next(rest.frames(16)).number == 1
    assert next(rest.frames(16)).number == 2  # what was gathered stays


def test_another_camera_and_size_share_the_scene(table: LitScene) -> None:
    picture = live(table, CAMERA)
    half = picture.seen_by(CAMERA, (24, 16))
    shown = after(half, 8)
    assert shown.shape == (16, 24, 3)
    whole = after(picture, 8).reshape(16, 2, 24, 2, 3).mean((1, 3))
    assert relative_error(shown, whole, 3) < 0.06
    seen = picture.seen()
    assert set(np.unique(seen["material"])) == {-1, 0, 1, 2}
    assert np.isinf(seen["distance"][seen["material"] < 0]).all()
