"""Element solve as stylize asks it, by least squares of the light: what is recovered, held in bounds, or left alone."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kit.light_field_scenes import lone_elements
from reference.element_least import fit_freely, model

from usdslf.gpu.device import Device
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import ESCAPES
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.stylize.element_solve import FITTED, OWN, enumerate_elements, follows_f0
from usdslf.stylize.unsharp_mask import ask_elements, choose_surface

N = 37  # no multiple of a block
Fit = namedtuple("Fit", "diffuse f0 roughness changed")


def _light(rng: np.random.Generator) -> np.ndarray:
    """A few soft lobes and a small lamp over each element (N, D, 3)."""
    z = bin_directions()
    light = np.full((N, D, 3), 0.2)
    for width in (2.0, 8.0, 60.0):
        towards = rng.normal(size=(N, 3)) + np.array([0, 0, 1.5])
        towards[:, 2] = np.abs(towards[:, 2])
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        lobe = np.exp(width * (np.einsum("dk,nk->nd", z, towards) - 1))
        light += lobe[..., None] * rng.uniform(0.2, 1.0, (N, 1, 3)) * np.sqrt(width)
    return light.astype(np.float32)


@pytest.fixture(scope="module")
def scene(device: Device) -> SimpleNamespace:
    """Elements under lamps, with a way to say what they send out with other parameters."""
    rng = np.random.default_rng(3)
    f0 = np.repeat(rng.uniform(0.03, 0.3, (N, 1)), 3, 1)
    elements = lone_elements(
        N, diffuse=rng.uniform(0.1, 0.7, (N, 3)), f0=f0, f90=np.ones(N), roughness=rng.uniform(0.1, 0.9, N)
    )
    visibility = SimpleNamespace(hit=np.full((N, D), ESCAPES, np.uint32))
    field = LightField(device, elements, None, visibility, _light(rng))
    field.bounce()

    def columns(roughness: np.ndarray) -> np.ndarray:
        """X, Y, A, B (4, N, D, 3), one by one through the light field's own kernels."""
        out = []
        for k in range(4):
            weights = np.zeros((N, 4, 3), np.float32)
            weights[:, k] = 1
            out.append(device.download(field.respond(np.arange(N), weights, roughness)).astype(np.float64))
        return np.stack(out)

    def sent(d: np.ndarray, f0: np.ndarray, f90: np.ndarray, roughness: np.ndarray) -> np.ndarray:
        return model(columns(roughness), d[:, None], f0[:, None], f90[:, None])

    return SimpleNamespace(field=field, elements=elements, columns=columns, sent=sent, device=device)


def _fit(scene: SimpleNamespace, wanted: np.ndarray, norm: str = "mixed", free: np.ndarray | None = None) -> Fit:
    """What is chosen for each element, and which parameters that changed."""
    may = np.ones((N, 3), bool) if free is None else free
    wanted_d = scene.device.upload(np.ascontiguousarray(wanted, np.float32))
    after = choose_surface(scene.field, *ask_elements(scene.field, wanted_d, may), may, norm)
    before = scene.field.surface
    moved = (after.diffuse != before.diffuse).any(1), (after.f0 != before.f0).any(1)
    return Fit(after.diffuse, after.f0, after.roughness, np.stack([*moved, after.roughness != before.roughness], 1))


def _own(scene: SimpleNamespace) -> dict[str, np.ndarray]:
    s = scene.field.surface
    return {
        "d": s.diffuse.astype(float), "f0": s.f0.astype(float), "f90": s.f90.astype(float),
        "roughness": s.roughness.astype(float),
    }  # fmt: skip


def test_the_light_as_it_is_asks_for_nothing(scene: SimpleNamespace) -> None:
    fit = _fit(scene, scene.device.download(scene.field.outgoing_d))
    assert not fit.changed.any()
    np.testing.assert_array_equal(fit.diffuse, _own(scene)["d"])
    np.testing.assert_array_equal(fit.roughness, _own(scene)["roughness"])


def test_one_changed_parameter_is_found(scene: SimpleNamespace) -> None:
    p = _own(scene)
    d = np.clip(p["d"] * [1.3, 0.6, 1.0] + 0.05, 0, 1)
    fit = _fit(scene, scene.sent(d, p["f0"], p["f90"], p["roughness"]))
    assert fit.changed[:, 0].all() and not fit.changed[:, 1:].any()
    np.testing.assert_allclose(fit.diffuse, d, atol=0.004)
    f0 = np.clip(p["f0"] * 2 + 0.1, 0, 1)
    fit = _fit(scene, scene.sent(p["d"], f0, p["f90"], p["roughness"]))
    found = fit.changed[:, 1] & ~fit.changed[:, [0, 2]].any(1)
    assert found.mean() > 0.75
    np.testing.assert_allclose(fit.f0[found], f0[found], atol=0.06)  # what light hardly shows is held back


def test_glossiness_is_found_on_its_levels(scene: SimpleNamespace) -> None:
    p = _own(scene)
    roughness = np.where(p["roughness"] > 0.5, 0.2, 0.7)
    fit = _fit(scene, scene.sent(p["d"], p["f0"], p["f90"], roughness))
    shiny = p["f0"][:, 0] > 0.1
    assert fit.changed[shiny, 2].mean() > 0.9
    found = fit.changed[:, 2] & ~fit.changed[:, :2].any(1)
    assert found[shiny].mean() > 0.8
    np.testing.assert_allclose(fit.roughness[found], roughness[found], atol=0.06)


@pytest.mark.parametrize("what", [("diffuse",), ("specular",), ("diffuse", "specular")])
def test_closed_forms_are_as_good_as_trust_regions(scene: SimpleNamespace, what: tuple[str, ...]) -> None:
    p = _own(scene)
    wanted = scene.sent(np.clip(p["d"] * 0.7, 0, 1), np.clip(p["f0"] + 0.2, 0, 1), p["f90"], p["roughness"] * 0.8)
    wanted = np.float32(wanted * np.random.default_rng(2).uniform(0.8, 1.2, (N, 1, 3)))
    (found,) = enumerate_elements(scene.field, np.arange(N), scene.device.upload(wanted), hold=np.zeros((N, 2)))
    kind = FITTED.index("+".join(what))
    columns = scene.columns(p["roughness"])
    for i in range(0, N, 6):
        best = fit_freely(columns[:, i], wanted[i], p["d"][i], p["f0"][i], p["f90"][i], what, is_grey=True)
        error = lambda d, f0, i=i: ((model(columns[:, i], d, f0, p["f90"][i]) - wanted[i]) ** 2).sum()  # noqa: E731
        ours, least = error(found.diffuse[i, OWN, kind], found.f0[i, OWN, kind]), error(best[:3], best[3:])
        is_inside = best.min() > 0.01 and best.max() < 0.99  # at a bound, all channels are scaled alike
        assert ours <= least * (1.001 if is_inside else 1.1) + 1e-6, i
        np.testing.assert_allclose(found.residual[i, OWN, kind], ours, rtol=1e-3)


def test_results_are_valid_and_keep_their_hue(scene: SimpleNamespace) -> None:
    p = _own(scene)
    bright = 5 * scene.sent(p["d"], p["f0"], p["f90"], p["roughness"])
    for norm in ("l0", "mixed", "l2"):
        for wanted in (bright, -bright, 0 * bright):
            fit = _fit(scene, wanted, norm)
            for value in (fit.diffuse, fit.f0, fit.roughness):
                assert np.isfinite(value).all() and value.min() >= 0 and value.max() <= 1
    fit = _fit(scene, scene.sent(3 * p["d"], p["f0"], p["f90"], p["roughness"]), "l0")
    rows = fit.changed[:, 0] & (p["d"].max(1) > 0.4)
    assert rows.sum() > N / 3
    ratio = fit.diffuse[rows] / p["d"][rows]
    np.testing.assert_allclose(fit.diffuse[rows].max(1), 1, atol=1e-6)
    np.testing.assert_allclose(ratio, np.repeat(ratio[:, :1], 3, 1), rtol=0.01)


def test_no_light_and_no_freedom_change_nothing(scene: SimpleNamespace, device: Device) -> None:
    p = _own(scene)
    other = scene.sent(0.5 * p["d"], p["f0"], p["f90"], p["roughness"])
    free = np.ones((N, 3), bool)
    free[1::2] = False
    free[4:, 0] = False
    fit = _fit(scene, other, free=free)
    assert fit.changed[:4:2, 0].all() and not fit.changed[1::2].any() and not fit.changed[4:, 0].any()
    assert fit.changed[4:, 1:].any()
    visibility = SimpleNamespace(hit=np.full((N, D), ESCAPES, np.uint32))
    dark = LightField(device, scene.elements, None, visibility, np.zeros((N, D, 3), np.float32))
    nothing = _fit(SimpleNamespace(field=dark, device=device), np.zeros((N, D, 3)))
    assert not nothing.changed.any() and np.isfinite(nothing.diffuse).all()


def test_a_lamp_is_left_alone(scene: SimpleNamespace) -> None:
    """Its own light drowns whatever it reflects."""
    p = _own(scene)
    wanted = scene.sent(0.5 * p["d"], p["f0"], p["f90"], p["roughness"])
    assert _fit(scene, wanted).changed.any(1).all()
    field = scene.field
    dark = field.surface
    try:
        field.set_surface(replace(dark, emission=np.full((N, 3), 200.0, np.float32)))
        field.bounce()
        assert not _fit(scene, wanted).changed.any()
    finally:
        field.set_surface(dark)
        field.bounce()


def test_a_metal_stays_one(device: Device) -> None:
    rng = np.random.default_rng(5)
    color = rng.uniform(0.3, 0.8, (N, 3))
    elements = lone_elements(N, diffuse=np.zeros(N), f0=color, f90=color, roughness=np.full(N, 0.3))
    visibility = SimpleNamespace(hit=np.full((N, D), ESCAPES, np.uint32))
    field = LightField(device, elements, None, visibility, _light(rng))
    field.bounce()
    may = np.ones((N, 3), bool)
    may[follows_f0(field), 0] = False
    wanted_d = device.upload(1.1 * device.download(field.outgoing_d))
    after = choose_surface(field, *ask_elements(field, wanted_d, may), may, "l2")
    assert not after.diffuse.any()
    np.testing.assert_array_equal(after.f0, after.f90)
    np.testing.assert_allclose(after.f0, 1.1 * color, rtol=0.02)
