"""Surface points against the formulas of UsdPreviewSurface and hand-made triangles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from usdslf.scene.records import Material, Mesh, PrimvarInput, Scene, Texture, constant
from usdslf.surfaces.surface_points import evaluate_opacity, evaluate_surface
from usdslf.textures.images import write_image

CENTRE = [[1 / 3, 1 / 3]]


def triangle(material: int = 0, corners: object = None, **more: object) -> Mesh:
    """A triangle in the xy plane, facing +Z, with st = xy."""
    p = np.asarray(corners if corners is not None else [[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    n = np.cross(p[1] - p[0], p[2] - p[0])
    values: dict = {
        "path": "/mesh",
        "positions": p,
        "triangles": np.array([[0, 1, 2]], np.int32),
        "corner_normals": np.tile((n / np.linalg.norm(n)).astype(np.float32), (1, 3, 1)),
        "face_of_triangle": np.zeros(1, np.int32),
        "triangle_in_face": np.zeros(1, np.int32),
        "material_of_triangle": np.full(1, material, np.int32),
        "uvs": {"st": p[None, :, :2].copy()},
    }
    return Mesh(**{**values, **more})


def scene(*materials: Material, meshes: tuple[Mesh, ...] | None = None, **more: object) -> Scene:
    """One triangle for each material, unless meshes are given."""
    meshes = meshes or tuple(triangle(i) for i in range(len(materials)))
    return Scene("test", float("nan"), meshes, materials, (), (), **more)


def one(material: Material, **mesh: object) -> dict[str, np.ndarray]:
    found = evaluate_surface(scene(material, meshes=(triangle(**mesh),)), [0], CENTRE)
    return {k: v[0] for k, v in vars(found).items()}


def test_position_is_the_barycentric_mean() -> None:
    corners = np.array([[1, 2, 3], [4, 5, 7], [2, 9, 1]], np.float32)
    found = evaluate_surface(scene(Material("/m"), meshes=(triangle(corners=corners),)), [0], [[0.2, 0.5]])
    assert found.position[0] == pytest.approx(0.3 * corners[0] + 0.2 * corners[1] + 0.5 * corners[2])


@pytest.mark.parametrize("metallic", [0.0, 0.3, 1.0])
def test_metal_workflow(metallic: float) -> None:
    color = np.array([0.8, 0.4, 0.1])
    found = one(Material("/m", constant(*color), metallic=constant(metallic), ior=constant(1.8)))
    r2 = ((1 - 1.8) / (1 + 1.8)) ** 2
    s = (1 - metallic) + metallic * color
    assert found["f0"] == pytest.approx((1 - metallic) * r2 * s + metallic * s)
    assert found["f90"] == pytest.approx(s)
    assert found["diffuse"] == pytest.approx(color * (1 - metallic))
    assert found["coat_f0"] == pytest.approx(r2)


def test_specular_workflow_ignores_metallic() -> None:
    material = Material(
        "/m",
        constant(0.2, 0.3, 0.4),
        use_specular_workflow=True,
        specular_color=constant(0.5, 0.6, 0.7),
        metallic=constant(1.0),
    )
    found = one(material)
    assert found["f0"] == pytest.approx([0.5, 0.6, 0.7])
    assert found["f90"] == pytest.approx([1, 1, 1])
    assert found["diffuse"] == pytest.approx([0.2, 0.3, 0.4])


def test_fallbacks_are_those_of_the_specification() -> None:
    found = one(Material("/m"))
    assert found["diffuse"] == pytest.approx([0.18] * 3)
    assert found["f0"] == pytest.approx([0.04] * 3)
    assert (found["roughness"], found["opacity"], found["clearcoat"]) == (0.5, 1, 0)
    assert found["clearcoat_roughness"] == pytest.approx(0.01)
    assert found["emission"] == pytest.approx([0, 0, 0])


def test_roughness_has_a_floor() -> None:
    assert one(Material("/m", roughness=constant(0.0)))["roughness"] == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("mode", "threshold", "opacity", "expected"),
    [  # opacity, presence, factor on diffuse
        ("transparent", 0.0, 0.25, (0.25, 1.0, 0.25)),
        ("presence", 0.0, 0.25, (0.25, 0.25, 1.0)),
        ("transparent", 0.5, 0.25, (0.0, 0.0, 1.0)),
        ("transparent", 0.5, 0.5, (1.0, 1.0, 1.0)),
        ("presence", 0.5, 0.75, (1.0, 1.0, 1.0)),
    ],
)
def test_opacity(mode: str, threshold: float, opacity: float, expected: tuple[float, float, float]) -> None:
    material = Material(
        "/m", opacity=constant(opacity), opacity_mode=mode, opacity_threshold=threshold, roughness=constant(1)
    )
    found = one(material)
    assert (found["opacity"], found["presence"]) == expected[:2]
    assert found["diffuse"] == pytest.approx(np.full(3, 0.18) * expected[2])
    assert found["f0"] == pytest.approx([0.04] * 3)
    quick = evaluate_opacity(scene(material), [0], CENTRE)
    assert (quick[0][0], quick[1][0]) == expected[:2]
    assert not material.is_opaque
    assert Material("/m").is_opaque


@pytest.fixture
def gradient(tmp_path: Path) -> Texture:
    """r = s and g = t at texel centres, b = 0.5."""
    y, x = np.indices((16, 16))
    pixels = np.stack([(x + 0.5) / 16, 1 - (y + 0.5) / 16, 0.5 + 0 * x], -1)
    path = write_image(tmp_path / "st.exr", pixels, half=False)
    return Texture("/tex", str(path), color_space="raw", wrap_s="clamp", wrap_t="clamp")


def test_textures_follow_st_and_channels(gradient: Texture) -> None:
    material = Material(
        "/m",
        gradient,
        roughness=replace(gradient, channels="g"),
        metallic=replace(gradient, channels="r", scale=(0.5, 1, 1, 1), bias=(0.1, 0, 0, 0)),
        opacity=replace(gradient, channels="a"),
    )
    found = evaluate_surface(scene(material), [0, 0], [[0.5, 0.25], [0.1, 0.7]])
    assert found.base_color == pytest.approx(np.array([[0.5, 0.25, 0.5], [0.1, 0.7, 0.5]]), abs=1e-3)
    assert found.roughness == pytest.approx(np.array([0.25, 0.7]), abs=1e-3)
    assert found.metallic == pytest.approx(np.array([0.35, 0.15]), abs=1e-3)
    assert found.opacity == pytest.approx(np.ones(2))


def test_transform_2d_moves_the_coordinates(gradient: Texture) -> None:
    turned = replace(gradient, st_from_uv=((0, -0.5, 0.9), (0.5, 0, 0.2), (0, 0, 1)))
    found = evaluate_surface(scene(Material("/m", turned)), [0], [[0.4, 0.2]])
    assert found.base_color[0, :2] == pytest.approx([0.8, 0.4], abs=1e-3)


def test_without_texture_coordinates_the_reader_has_its_fallback(gradient: Texture) -> None:
    texture = replace(gradient, uv_set="none", st_fallback=(0.75, 0.25))
    assert one(Material("/m", texture))["base_color"][:2] == pytest.approx([0.75, 0.25], abs=1e-3)


def test_primvars_are_interpolated_and_have_fallbacks() -> None:
    colors = np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1]]], np.float32)
    material = Material(
        "/m", PrimvarInput("displayColor", (0.2, 0.3, 0.4)), roughness=PrimvarInput("r", (0.7,))
    )
    rough = np.array([[[0.2], [0.4], [0.6]]], np.float32)
    meshes = (triangle(primvars={"displayColor": colors, "r": rough}), triangle())
    found = evaluate_surface(scene(material, meshes=meshes), [0, 1], [[0.2, 0.5], [0.2, 0.5]])
    assert found.base_color == pytest.approx(np.array([[0.3, 0.2, 0.5], [0.2, 0.3, 0.4]]))
    assert found.roughness == pytest.approx(np.array([0.3 * 0.2 + 0.2 * 0.4 + 0.5 * 0.6, 0.7]))


def test_points_keep_their_order_across_materials() -> None:
    materials = [Material(f"/m{i}", constant(i / 10, 0, 0)) for i in range(7)]
    pick = np.random.default_rng(0).integers(0, 7, 1001)
    found = evaluate_surface(scene(*materials), pick, np.full((1001, 2), 0.3))
    assert found.base_color[:, 0] == pytest.approx(pick / 10)
    np.testing.assert_array_equal(found.material, pick)
    np.testing.assert_array_equal(found.mesh, pick)


def test_no_points() -> None:
    found = evaluate_surface(scene(Material("/m")), np.zeros(0, int), np.zeros((0, 2)))
    assert found.f0.shape == (0, 3)


def test_shading_normals_are_unit_and_on_the_side_of_the_face() -> None:
    normals = np.array([[[0.6, 0, 0.8], [0, 0, -1], [0, 0.6, 0.8]]], np.float32)
    normals[0, 1] = [0, 0, 1]
    found = one(Material("/m"), corner_normals=normals)
    mean = normals[0].mean(0)
    assert found["normal"] == pytest.approx(mean / np.linalg.norm(mean))
    turned = one(Material("/m"), corner_normals=-normals)
    assert turned["normal"] == pytest.approx(found["normal"])


def bump(tmp_path: Path, direction: list[float]) -> Texture:
    path = write_image(tmp_path / "n.exr", np.full((2, 2, 3), direction), half=False)
    return Texture("/n", str(path), color_space="raw", wrap_s="repeat", wrap_t="repeat")


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_normal_maps_lean_along_dp_ds_and_dp_dt(tmp_path: Path, mirrored: bool, turn: float) -> None:
    c, s = np.cos(turn), np.sin(turn)
    xy = np.array([[0, 0], [1, 0], [0, 1]], np.float64)
    frame = np.array([[c, -s], [s, c]]) @ np.diag([-1.0 if mirrored else 1.0, 1.0])
    st = (xy @ frame).astype(np.float32)  # st = frame^T xy, so dP/ds and dP/dt are the columns of frame
    wanted = np.array([0.48, 0.36, 0.8])
    found = one(Material("/m", normal=bump(tmp_path, list(wanted))), uvs={"st": st[None]})
    expected = np.array([*(frame @ wanted[:2]), 0.8])
    assert found["normal"] == pytest.approx(expected, abs=5e-4)  # texels are half floats


def test_flat_normal_maps_change_nothing_and_can_be_left_out(tmp_path: Path) -> None:
    normals = np.tile(np.array([0.6, 0, 0.8], np.float32), (1, 3, 1))
    flat = one(Material("/m", normal=bump(tmp_path, [0, 0, 1])), corner_normals=normals)
    assert flat["normal"] == pytest.approx([0.6, 0, 0.8])
    bumpy = Material("/m", normal=bump(tmp_path, [0.6, 0, 0.8]))
    plain = evaluate_surface(scene(bumpy), [0], CENTRE, normal_maps=False)
    assert plain.normal[0] == pytest.approx([0, 0, 1])


def test_normal_maps_without_area_in_st_keep_the_normal(tmp_path: Path) -> None:
    material = Material("/m", normal=bump(tmp_path, [0.6, 0, 0.8]))
    for uvs in ({}, {"st": np.zeros((1, 3, 2), np.float32)}):
        assert one(material, uvs=uvs)["normal"] == pytest.approx([0, 0, 1])


def test_textures_come_into_the_working_space_of_the_scene(tmp_path: Path) -> None:
    path = write_image(tmp_path / "red.exr", np.full((2, 2, 3), (1, 0, 0)), half=False)
    material = Material("/m", Texture("/t", str(path), color_space="lin_rec709_scene"))
    found = evaluate_surface(scene(material, working_space="lin_ap1_scene"), [0], CENTRE)
    assert found.base_color[0] == pytest.approx([0.6131, 0.0702, 0.0206], abs=1e-3)
