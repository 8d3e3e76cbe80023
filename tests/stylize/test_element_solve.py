"""Element solve: the paper's solver element by element against equations 2 to 6, and laws of its norms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from kit.level_matrices import dense
from kit.light_field_scenes import lone_elements
from numpy.typing import NDArray
from reference import phong_solver as ref
from reference.preconvolution import exact_row

from usdslf.gpu.device import Device
from usdslf.light_field.blocks import levels_of
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import ESCAPES
from usdslf.light_field.preconvolution import build_level
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.stylize.element_solve import (
    FACTORS,
    OWN,
    ElementCandidates,
    ElementChange,
    choose_candidates,
    enumerate_elements,
    freed_of_candidates,
    joined,
)
from usdslf.surfaces.reflectance import LEVEL_COUNT, gloss_levels, roughness_levels

N = 37  # no multiple of a block
SIGMA = 40.0


def solve_elements(
    field: LightField, element: NDArray, wanted_d: Any, weight: NDArray | None = None, norm: str = "mixed"
) -> ElementChange:
    """Solves elements one by one as in the paper: `enumerate_elements`, then `choose_candidates`."""
    parts = [choose_candidates(c, FACTORS[norm]) for c in enumerate_elements(field, element, wanted_d, weight)]
    return joined(parts)


def _light(rng: np.random.Generator, n: int) -> np.ndarray:
    """A sky, a window and a small lamp over each element (n, D, 3)."""
    z = bin_directions()
    light = np.full((n, D, 3), 0.2) * rng.uniform(0.5, 1.0, (n, 1, 3))
    for width in (3.0, 12.0, 80.0):
        towards = rng.normal(size=(n, 3)) + np.array([0, 0, 1.5])
        towards[:, 2] = np.abs(towards[:, 2])
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        lobe = np.exp(width * (np.einsum("dk,nk->nd", z, towards) - 1))
        light += lobe[..., None] * rng.uniform(0.2, 1.0, (n, 1, 3)) * np.sqrt(width)
    return light.astype(np.float32)


def _field(device: Device, model: str, light: np.ndarray, **reflectance: np.ndarray | float) -> LightField:
    n = len(light)
    elements = lone_elements(n, **reflectance)
    visibility = SimpleNamespace(hit=np.full((n, D), ESCAPES, np.uint32))
    field = LightField(device, elements, None, visibility, light, model)
    field.bounce()
    return field


@pytest.fixture(scope="module")
def scene(device: Device) -> SimpleNamespace:
    """Phong elements under lamps, the textbook's matrices of all levels, and a way to reflect with them."""
    rng = np.random.default_rng(3)
    light = _light(rng, N)
    d, f0 = rng.uniform(0.1, 0.5, (N, 3)), rng.uniform(0.05, 0.4, (N, 3))
    field = _field(device, "phong", light, diffuse=d, f0=f0, f90=1.0, roughness=rng.uniform(0.12, 0.9, N))
    matrices = np.stack([dense(build_level(device, "phong", r))[0] for r in gloss_levels("phong")])
    grid = np.stack([dense(build_level(device, "phong", r))[0] for r in roughness_levels()])
    k_d = ref.diffuse_matrix(bin_directions())

    def own_matrix(i: int, roughness: float | None = None) -> np.ndarray:
        low, share = levels_of(np.array([field.surface.roughness[i] if roughness is None else roughness]))
        return (1 - share[0]) * grid[low[0]] + share[0] * grid[low[0] + 1]

    def sent(i: int, d: np.ndarray, f0: np.ndarray, roughness: float) -> np.ndarray:
        l = light[i].astype(float)
        return d * (k_d @ l) + f0 * (own_matrix(i, roughness) @ l)

    s = field.surface
    return SimpleNamespace(
        field=field, light=light, matrices=matrices, k_d=k_d, own_matrix=own_matrix, sent=sent,
        d=s.diffuse.astype(float), f0=s.f0.astype(float), roughness=s.roughness.astype(float),
    )  # fmt: skip


def _enumerated(field: LightField, wanted: np.ndarray, weight: np.ndarray | None = None) -> ElementCandidates:
    (found,) = enumerate_elements(field, np.arange(len(wanted)), _on_device(field, wanted), weight)
    return found


def _on_device(field: LightField, wanted: np.ndarray) -> Any:
    return field.device.upload(wanted.astype(np.float32))


def _painted(rng: np.random.Generator) -> np.ndarray:
    """W (N, D) of strokes that cover some directions."""
    towards = bin_directions()[rng.integers(0, D, N)]
    return ref.stroke_weight((bin_directions() @ towards.T).T > 0.9, SIGMA)


def test_every_candidate_is_that_of_equations_3_5_and_6(scene: SimpleNamespace) -> None:
    """Wanted light that no reflectance has: brighter than the lamps here, black there, under a stroke's weights."""
    rng = np.random.default_rng(8)
    weight = _painted(rng)
    wanted = np.stack([scene.sent(i, 2.5 * scene.d[i], scene.f0[i], 0.3) for i in range(N)])
    wanted *= rng.choice([0.0, 0.5, 1.0, 3.0], (N, 1, 3))
    wanted += 0.3 * (weight[..., None] > 1)
    found = _enumerated(scene.field, wanted, weight)
    for i in range(0, N, 3):
        for j in (0, 3, 6, 8, 12, 19, OWN):
            k_s = scene.own_matrix(i) if j == OWN else scene.matrices[j]
            x, residual = ref.candidates_of_level(
                scene.light[i].astype(float), scene.k_d, k_s, wanted[i], weight[i], scene.d[i], scene.f0[i]
            )
            assert np.isinf(found.residual[i, j, 3]) == np.isinf(residual[3]), (i, j)
            ours = np.stack([found.diffuse[i, j], found.f0[i, j]], -1)
            np.testing.assert_allclose(ours, x, atol=2e-3, err_msg=f"element {i}, level {j}")
            known = np.isfinite(residual)
            np.testing.assert_allclose(
                found.residual[i, j][known], residual[known], rtol=1e-3, atol=1e-7 * found.wanted[i]
            )


def test_the_choice_is_that_of_equation_4(scene: SimpleNamespace) -> None:
    rng = np.random.default_rng(9)
    wanted = np.stack([scene.sent(i, scene.d[i], scene.f0[i], scene.roughness[i]) for i in range(N)])
    wanted *= 1 + 0.3 * rng.normal(size=(N, D, 1)) + 0.5 * rng.uniform(-1, 1, (N, 1, 3))
    found = _enumerated(scene.field, wanted)
    chosen = {norm: choose_candidates(found, FACTORS[norm]) for norm in ("l2", "l0", "mixed")}
    for i in range(0, N, 3):
        x, residual = np.zeros((OWN + 1, 4, 3, 2)), np.zeros((OWN + 1, 4))
        for j in range(OWN + 1):
            k_s = scene.own_matrix(i) if j == OWN else scene.matrices[j]
            x[j], residual[j] = ref.candidates_of_level(
                scene.light[i].astype(float), scene.k_d, k_s, wanted[i], np.ones(D), scene.d[i], scene.f0[i]
            )
        for norm, change in chosen.items():
            level, kind = ref.alpha(residual, norm)
            assert change.changed[i].tolist() == freed_of_candidates()[level, kind].tolist(), (norm, i, level)
            np.testing.assert_allclose(change.roughness[i], [*gloss_levels("phong"), scene.roughness[i]][level])
            np.testing.assert_allclose(np.stack([change.diffuse[i], change.f0[i]], -1), x[level, kind], atol=2e-3)
            np.testing.assert_allclose(change.residual_after[i], residual[level, kind], rtol=1e-3)


def test_a_change_under_the_exact_operator_is_found_again(scene: SimpleNamespace) -> None:
    """What is wanted comes from quadrature over the lobe itself, not from the program's matrices."""
    rows = np.arange(0, D, 5)
    true = gloss_levels("phong")[6]
    k_s = np.stack([exact_row("phong", true, int(row))[0] for row in rows])
    weight = np.zeros((N, D))
    weight[:, rows] = 1
    f0 = scene.f0[:, ::-1] + 0.05
    for new_d, new_f0 in ((scene.d, f0), (0.6 * scene.d, f0)):
        wanted = np.zeros((N, D, 3))
        light = scene.light.astype(float)
        wanted[:, rows] = new_d[:, None] * (scene.k_d[0] @ light)[:, None] + new_f0[:, None] * (k_s @ light)
        change = solve_elements(scene.field, np.arange(N), _on_device(scene.field, wanted), weight, "l2")
        off = np.abs(change.roughness - true)
        assert off.max() < 0.11 and (off < 0.01).mean() > 0.9
        assert np.sqrt(np.mean((change.diffuse - new_d) ** 2)) < 0.01
        assert np.sqrt(np.mean((change.f0 - new_f0) ** 2)) < 0.03


@pytest.mark.parametrize("model", ["phong", "preview_surface"])
@pytest.mark.parametrize("parameter", [0, 1, 2])
def test_one_true_change_l2_moves_all_l0_and_mixed_move_one(device: Device, model: str, parameter: int) -> None:
    rng = np.random.default_rng(5)
    light = _light(rng, N)
    before = {"diffuse": rng.uniform(0.1, 0.4, (N, 3)), "f0": rng.uniform(0.1, 0.3, (N, 3)), "f90": 1.0}
    rough = np.full(N, 0.3)
    other = {"phong": 0.05, "preview_surface": 0.55}[model]  # levels that the light field has too
    after = dict(before)
    if parameter == 0:
        after["diffuse"] = before["diffuse"][:, ::-1] + 0.1
    elif parameter == 1:
        after["f0"] = before["f0"][:, ::-1] + 0.2
    wanted = device.download(
        _field(device, model, light, roughness=np.full(N, other if parameter == 2 else 0.3), **after).outgoing_d
    )
    field = _field(device, model, light, roughness=rough, **before)
    number = {}
    for norm in ("l2", "l0", "mixed"):
        change = solve_elements(field, np.arange(N), _on_device(field, wanted), norm=norm)
        number[norm] = change.changed.sum(1)
        if norm != "l2":
            assert change.changed[:, parameter].all()
            np.testing.assert_allclose(change.diffuse, after["diffuse"], atol=2e-3)
            np.testing.assert_allclose(change.f0, after["f0"], atol=5e-3)
            np.testing.assert_allclose(change.roughness, other if parameter == 2 else 0.3, atol=1e-6)
        # 0.3 is no level of phong: l2, which leaves the own roughness, takes the one beside it
        beside = norm == "l2" and model == "phong" and parameter != 2
        assert (change.residual_after < (2e-2 if beside else 1e-6) * change.residual_before).all()
    assert (number["l2"] == 3).all() and (number["l0"] == 1).all() and (number["mixed"] == 1).all()


def test_mixed_is_between_and_its_weights_decide(scene: SimpleNamespace) -> None:
    """Two parameters change: l0 cannot say it, mixed does, and dearer weights make it say less."""
    wanted = np.stack([scene.sent(i, 0.5 * scene.d[i], scene.f0[i, ::-1], scene.roughness[i]) for i in range(N)])
    found = _enumerated(scene.field, wanted)
    l2, l0, mixed = (choose_candidates(found, FACTORS[norm]) for norm in ("l2", "l0", "mixed"))
    assert (mixed.changed.sum(1) == 2).all() and (l0.changed.sum(1) == 1).all() and (l2.changed.sum(1) == 3).all()
    assert (l0.residual_after > 10 * mixed.residual_after).all()
    dear = choose_candidates(found, (1.0, 1.0, 1e12, 1e12))
    np.testing.assert_array_equal(dear.changed, l0.changed)


@pytest.mark.parametrize("model", ["phong", "preview_surface"])
def test_no_candidate_reflects_more_than_arrives(device: Device, model: str) -> None:
    rng = np.random.default_rng(6)
    light = _light(rng, N)
    metal = np.arange(N) % 2 == 0
    d = np.where(metal[:, None], 0, rng.uniform(0.1, 0.9, (N, 3)))
    f0 = rng.uniform(0.1, 0.9, (N, 3))
    field = _field(
        device, model, light, diffuse=d, f0=f0, f90=np.where(metal[:, None], f0, 1), roughness=0.31, clearcoat=0.5
    )
    for scale in (-1.0, 0.0, 8.0):
        found = _enumerated(field, scale * device.download(field.outgoing_d))
        d, f0 = found.diffuse, found.f0
        assert min(d.min(), f0.min()) >= 0 and max(d.max(), f0.max()) <= 1
        most = d + f0 if model == "phong" else d * (1 - f0) + f0
        assert most.max() <= 1 + 1e-6
        for norm in ("l2", "l0", "mixed"):
            change = choose_candidates(found, FACTORS[norm])
            assert np.isfinite(change.residual_after).all()


def test_the_light_as_it_is_and_no_light_leave_all_as_it_is(device: Device) -> None:
    rng = np.random.default_rng(7)
    light = _light(rng, N)
    light[::2] = 0
    field = _field(
        device, "preview_surface", light, diffuse=rng.uniform(0.1, 0.8, (N, 3)), f0=0.04, f90=1.0,
        roughness=rng.uniform(0.1, 0.9, N), clearcoat=1.0, emission=0.3,
    )  # fmt: skip
    found = _enumerated(field, device.download(field.outgoing_d) - np.float32(0.3))
    assert (found.residual_before <= 1e-9 * found.wanted + 1e-9).all()
    change = choose_candidates(found)
    np.testing.assert_allclose(change.diffuse, field.surface.diffuse, atol=1e-3)
    dark = choose_candidates(found, FACTORS["l2"])
    assert not dark.changed[::2].any()
    np.testing.assert_array_equal(dark.roughness[::2], field.surface.roughness[::2])


def test_chunks_and_weights_are_of_their_elements(device: Device) -> None:
    n = 400  # more than a chunk
    rng = np.random.default_rng(2)
    light = _light(rng, n)
    field = _field(device, "phong", light, diffuse=rng.uniform(0.1, 0.5, (n, 3)), f0=0.2, f90=1.0, roughness=0.4)
    wanted = rng.uniform(0, 1, (n, D, 3)).astype(np.float32)
    weight = rng.uniform(0.5, 2, (n, D)).astype(np.float32)
    some = np.array([399, 5, 390, 17])
    all_of_them = solve_elements(field, np.arange(n), _on_device(field, wanted), weight)
    few = solve_elements(field, some, _on_device(field, wanted), weight[some])
    np.testing.assert_allclose(few.diffuse, all_of_them.diffuse[some], atol=1e-6)
    np.testing.assert_array_equal(few.changed, all_of_them.changed[some])
    assert len(all_of_them.element) == n and LEVEL_COUNT == OWN
