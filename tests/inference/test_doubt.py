"""What renderers do not agree on: light from below a surface and normals that face away, told apart in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.dull_tables import N, dull_tables
from kit.light_field_scenes import lit, material
from kit.scene_records import quad
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.doubt import doubtful_radiance
from usdslf.inference.evidence import mean_by, sent_radiance
from usdslf.inference.paint_errors import refit_as_painted
from usdslf.inference.residuals import relative_scale
from usdslf.inference.samples import gather_samples
from usdslf.inference.solve import refit, refit_problem
from usdslf.inference.uncertainty import interval
from usdslf.inference.unchanged import may_be_unchanged
from usdslf.inference.weights import Options
from usdslf.lights.sources import LightSet
from usdslf.scene.records import Light
from usdslf.strokes.stroke import Stroke

O = Options()
TRUE = np.array([0.12, -0.05, 0.2])  # change of the diffuse colour


def share_in_doubt(device: Device, tilt: float) -> float:
    """Share of what one dab on a matt floor sends up, whose shading normal is tilted by [deg], under an even sky."""
    floor = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    normal = np.array([np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt))])
    floor = replace(floor, corner_normals=np.broadcast_to(normal, (2, 3, 3)).astype(np.float32))
    dome = Light("/dome", "dome", (1.0, 1.0, 1.0), np.eye(4))
    made = lit(device, [floor], [material(0.5, roughness=1.0)], (dome,), 60, "preview_surface", 2)
    eye = np.float32([[-10 * np.sin(np.radians(35)), 0, 10 * np.cos(np.radians(35))]])
    painted = Stroke("s", np.zeros((1, 3), np.float32), np.float32([0.1]), np.float32([[0.5, 0.5, 0.5]]), eye)
    lights = LightSet(made.scene, made.scene.lights)
    samples, _ = gather_samples(painted, made.scene, made.tracer, made.field, lights, [])
    seen = mean_by(sent_radiance(samples, made.field), samples.dab)[0]
    doubtful = mean_by(doubtful_radiance(samples, made.field).sum(1), samples.dab)[0]
    return float(doubtful.mean() / seen.mean())


@pytest.mark.parametrize("tilt", [0.0, 40.0])
def test_light_from_below_is_what_a_cosine_sends_there(device: Device, tilt: float) -> None:
    assert share_in_doubt(device, tilt) == pytest.approx(0.5 * (1 - np.cos(np.radians(tilt))), abs=0.02)


def test_all_of_what_a_normal_that_faces_away_shows_is_in_doubt(device: Device) -> None:
    assert share_in_doubt(device, 65.0) == pytest.approx(1.0, abs=1e-6)


def of_another_renderer(share: float, each: int) -> tuple[Tables, NDArray]:
    """Tables of which each n-th dab is in doubt by up to a half, and what a renderer leaves out: a share of that."""
    t = dull_tables(np.random.default_rng(6))
    size = np.where(np.arange(N) % each, 0.0, np.random.default_rng(1).uniform(0.1, 0.5, N))
    doubt = size[:, None, None] * np.stack([t.before - 0.05, 0.05 + 0 * t.before, 0 * t.before], 1)
    return replace(t, doubt=doubt), share * doubt.sum(1)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_what_a_renderer_leaves_out_is_no_change_of_the_colour(share: float) -> None:
    t, left_out = of_another_renderer(share, 4)
    wanted = (t.before + TRUE * t.dabs.u[:, 0]) * (1 - left_out / t.before)
    t = replace(t, target=wanted, scale=relative_scale(wanted))
    first = Candidate(("diffuse",), level=0, freedoms=3)
    found, deaf = (
        refit_as_painted(x, O, refit(refit_problem(x, O), first)) for x in (t, replace(t, doubt=0 * t.doubt))
    )
    off, without = (float(np.abs(c.delta_diffuse - TRUE).max()) for c in (found, deaf))
    assert off < 0.012
    assert not share or off < 0.5 * without, (off, without)
    low, high = interval(t, O, found).diffuse
    assert ((low <= t.diffuse + TRUE) & (t.diffuse + TRUE <= high)).all(), (low, high)


def test_what_a_renderer_leaves_out_is_no_change_at_all() -> None:
    t, left_out = of_another_renderer(1.0, 1)
    t = replace(t, target=t.before - left_out)
    t = replace(t, scale=relative_scale(t.target))
    assert not may_be_unchanged(replace(t, doubt=0 * t.doubt))
    assert may_be_unchanged(t)
    brighter = replace(t, target=t.before + left_out, scale=relative_scale(t.before + left_out))
    assert not may_be_unchanged(brighter)
