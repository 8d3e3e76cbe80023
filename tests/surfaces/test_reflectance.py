"""Laws of the reflectance models: host and device against textbook forms, reciprocity, energy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from reference import reflectance as ref

from usdslf.errors import InputError
from usdslf.gpu.device import Device
from usdslf.gpu.source import kernel_source
from usdslf.surfaces.reflectance import (
    LEVEL_COUNT,
    MODELS,
    column_weights,
    columns,
    directional_albedo,
    distinctness_of_gloss,
    gloss_levels,
    lobe_parameter,
    phong_exponent,
    roughness_levels,
)

Columns = Callable[[float, np.ndarray, np.ndarray], dict[str, np.ndarray]]
LEVELS = roughness_levels()
COSINES = (1.0, 0.7, 0.35, 0.12, 0.05)

PROBE = """
__kernel void probe(__global const float *p, __global const float *e, __global const float *l, const uint n,
                    __global float4 *preview_surface, __global float4 *phong)
{
    uint i = get_global_id(0);
    if (i >= n) return;
    preview_surface[i] = preview_surface_columns(p[2 * i], load3(e, i), load3(l, i));
    phong[i] = phong_columns(p[2 * i + 1], load3(e, i), load3(l, i));
}
"""


def pairs(roughness: float, count: int = 400, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Eyes and lights (count, 3): anywhere above the horizon, near it, and about the mirror direction."""
    rng = np.random.default_rng(seed)
    e = ref.eye_at(rng.uniform(0.03, 1, count), rng.uniform(0, 2 * np.pi, count))
    l = ref.eye_at(rng.uniform(0.001, 1, count), rng.uniform(0, 2 * np.pi, count))
    near = np.arange(count) % 2 == 0
    h = rng.normal(size=(count, 3)) * roughness**2 + [0, 0, 1]
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    l[near] = (2 * np.sum(e * h, 1, keepdims=True) * h - e)[near]
    up = l[:, 2] > 1e-3
    return e[up], l[up]


@pytest.fixture(scope="module")
def device_columns(device: Device) -> Columns:
    """The kernels' columns (n, 4) of both models at a roughness, for eyes and lights (n, 3)."""
    program: Any = cl.Program(device.context, kernel_source("reflectance") + PROBE).build(["-cl-std=CL1.2"])
    kernel = program.probe

    def evaluate(roughness: float, e: np.ndarray, l: np.ndarray) -> dict[str, np.ndarray]:
        n = len(e)
        p = np.tile([lobe_parameter(m, roughness) for m in ("preview_surface", "phong")], (n, 1))
        args = [device.upload(x.astype(np.float32)).data for x in (p, e, l)]
        out = [device.empty((n, 4), np.float32) for _ in range(2)]
        kernel(device.queue, (-(-n // 64) * 64,), (64,), *args, np.uint32(n), *(o.data for o in out))
        return dict(zip(("preview_surface", "phong"), (device.download(o) for o in out)))

    return evaluate


@pytest.mark.parametrize("model", MODELS)
def test_host_columns_are_the_textbook_forms(model: str) -> None:
    for roughness in LEVELS:
        e, l = pairs(roughness)
        got = columns(model, lobe_parameter(model, roughness), e, l)
        np.testing.assert_allclose(got, ref.columns(model, roughness, e, l), rtol=2e-6, atol=1e-12)


def test_device_columns_are_the_textbook_forms(device_columns: Columns) -> None:
    for roughness in LEVELS:
        e, l = pairs(roughness, 333)
        got = device_columns(roughness, e, l)
        # N.H is rounded to 6e-8, alpha^2 of the sharpest level is 6e-6, D has 1 - (N.H)^2 + alpha^2 squared.
        rtol = 2e-3 + 6e-7 / roughness**4
        for model in MODELS:
            expected = ref.columns(model, roughness, e, l)
            np.testing.assert_allclose(
                got[model][:, :2], expected[:, :2], rtol=1e-4, atol=1e-6, err_msg=f"{model} {roughness}"
            )
            wrong = np.abs(got[model] - expected) / (np.abs(expected) + 1e-4)
            assert wrong.max() < rtol, (model, roughness, wrong.max(0))


def test_light_from_below_is_not_reflected(device_columns: Columns) -> None:
    e, l = pairs(0.3, 64)
    l[:, 2] *= -1
    for model, got in device_columns(0.3, e, l).items():
        assert not got.any(), model
        assert not columns(model, lobe_parameter(model, 0.3), e, l).any(), model


def test_both_models_are_reciprocal(device_columns: Columns) -> None:
    """f(e, l) = f(l, e): the columns less the cosine."""
    for roughness in (0.05, 0.25, 0.6, 1.0):
        e, l = pairs(roughness, 300, seed=4)
        there, back = device_columns(roughness, e, l), device_columns(roughness, l, e)
        for model in MODELS:
            p = lobe_parameter(model, roughness)
            np.testing.assert_allclose(
                columns(model, p, e, l) / l[:, 2:], columns(model, p, l, e) / e[:, 2:], rtol=1e-9, atol=1e-12
            )
            np.testing.assert_allclose(
                there[model] / l[:, 2:], back[model] / e[:, 2:], rtol=2e-5 + 1e-6 / roughness**3, atol=1e-5
            )


@pytest.mark.parametrize("model", MODELS)
def test_directional_albedo_is_the_integral_at_every_level(model: str) -> None:
    for roughness in LEVELS:
        expected = ref.albedo(model, roughness, COSINES)
        got = directional_albedo(model, float(lobe_parameter(model, roughness)), COSINES)
        np.testing.assert_allclose(got, expected, rtol=5e-3, atol=4e-3, err_msg=str(roughness))
        np.testing.assert_allclose(got[:, :2].sum(1), 1, atol=1e-9)


def test_phong_never_gains_energy() -> None:
    """However k_d and k_s are asked for, no more leaves than arrives, at any level and angle."""
    d, f0 = np.meshgrid([0.0, 0.3, 0.8, 1.0, 1.5], [0.0, 0.2, 0.7, 1.0])
    d, f0 = (np.repeat(x.reshape(-1, 1), 3, 1) for x in (d, f0))
    weights = column_weights("phong", d, f0, np.ones_like(d))
    assert (weights >= 0).all() and (weights.sum(1) <= 1).all()
    np.testing.assert_allclose(weights[:, 0], np.minimum(d, 1))
    assert np.allclose(weights[(d + f0 <= 1)[:, 0], 2], f0[(d + f0 <= 1)[:, 0]])
    for roughness in LEVELS:
        parameter = float(lobe_parameter("phong", roughness))
        albedo = directional_albedo("phong", parameter, np.linspace(0.02, 1, 25))
        leaves = np.einsum("nkc,mk->nmc", weights, albedo)
        assert leaves.max() <= 1 + 1e-4, roughness


def test_phong_with_kd_1_returns_all_and_a_lobe_at_normal_incidence_too() -> None:
    for roughness in LEVELS:
        x, y, a, b = directional_albedo("phong", float(lobe_parameter("phong", roughness)), 1.0)[0]
        assert (x, y, b) == (pytest.approx(1, abs=1e-3), 0, 0)
        assert a == pytest.approx(1, abs=1e-3), roughness  # (n + 2) / (2 pi) is the norm of cos^(n + 1)


@pytest.mark.parametrize("model", MODELS)
def test_the_columns_and_their_weights_make_up_the_model(model: str) -> None:
    e, l = pairs(0.35, seed=2)
    d, f0, f90 = np.random.default_rng(1).uniform(0, 0.5, (3, 1, 3))
    got = np.einsum(
        "nk,kc->nc", columns(model, lobe_parameter(model, 0.35), e, l), column_weights(model, d, f0, f90)[0]
    )
    if model == "phong":
        expected = ref.phong(d[0], f0[0], ref.exponent_of(0.35), e, l)
    else:
        expected = ref.preview_surface(d[0], f0[0], f90[0], 0.35, e, l)
    np.testing.assert_allclose(got, expected * l[:, 2:], rtol=1e-6)


def test_levels_are_twenty_even_steps_of_roughness_and_narrow_as_it_falls() -> None:
    assert LEVEL_COUNT == len(LEVELS) == 20
    np.testing.assert_allclose(LEVELS, 0.05 * np.arange(1, 21))
    assert (np.diff(lobe_parameter("preview_surface", LEVELS)) > 0).all()
    assert (np.diff(phong_exponent(LEVELS)) < 0).all() and (phong_exponent(LEVELS) > 0).all()
    with pytest.raises(InputError, match="phong"):
        lobe_parameter("ward", 0.5)


def test_levels_of_phong_are_even_in_perceived_gloss_and_those_of_roughness_are_not() -> None:
    """Pellacini et al. 2000: distance^2 = c^2 + (1.78 d)^2, d = 1 - alpha; c does not depend on the level."""
    levels = gloss_levels("phong")
    assert len(levels) == LEVEL_COUNT and levels[0] == pytest.approx(0.05) and levels[-1] == pytest.approx(1)
    c = ref.contrast_gloss(0.3, 0.2)
    spot = np.stack([np.full(LEVEL_COUNT, c), 1.78 * (1 - levels**2)], 1)
    steps = np.linalg.norm(np.diff(spot, axis=0), axis=1)
    np.testing.assert_allclose(steps, 1.78 * (1 - 0.05**2) / 19, rtol=1e-9)
    np.testing.assert_allclose(distinctness_of_gloss(levels), 1 - levels**2)
    even = -np.diff(distinctness_of_gloss(LEVELS))
    assert even.max() / even.min() > 12  # even steps of roughness are not even steps of gloss
    np.testing.assert_array_equal(gloss_levels("preview_surface"), LEVELS)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.45])
def test_the_lobe_of_phong_is_as_wide_as_that_of_ggx(roughness: float) -> None:
    """Half of the light of either lobe, seen along the normal, lies within about the same angle."""
    e = np.array([0.0, 0.0, 1.0])
    l, weight = ref.polar_grid(e, 0.5 * roughness**2, 400, 40)
    up = l[:, 2] > 1e-6
    l, weight = l[up], weight[up]
    within = []
    for lobe in (
        ref.preview_surface([0], [1], [1], roughness, e, l)[:, 0],
        ref.phong([0], [1], float(phong_exponent(roughness)), e, l)[:, 0],
    ):
        order = np.argsort(-l[:, 2])
        mass = np.cumsum((weight * lobe * l[:, 2])[order])
        within.append(np.arccos(l[order[np.searchsorted(mass, 0.5 * mass[-1])], 2]))
    assert within[1] == pytest.approx(within[0], rel=0.2)
