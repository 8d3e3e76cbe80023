"""How much elements matter to who sees along rays: by what their light does there."""

from __future__ import annotations

import numpy as np
import pytest
from kit.light_field_scenes import lit, material
from kit.scene_records import box, lamp, quad

from usdslf.gpu.device import Device
from usdslf.light_field import importance
from usdslf.light_field.importance import met_along, seen_from
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import BLOCKED, ESCAPES
from usdslf.light_field.surface import albedo
from usdslf.sampling.hemisphere import D

FLOOR, BOX = 0, 1


@pytest.fixture(scope="module")
def room(device: Device) -> LightField:
    """A floor with a box on it, both dull."""
    scene = [
        quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), material=FLOOR, path="/floor"),
        box((-0.5, -0.5, 0.01), (0.5, 0.5, 1.0), material=BOX, path="/box"),
    ]
    materials = [material(0.6), material((0.2, 0.5, 0.7))]
    return lit(device, scene, materials, (lamp(2.5, (1, 0.5), 0.8),), 240, "phong", 1).field


def rays(room: LightField) -> tuple[np.ndarray, np.ndarray]:
    """Rays from above that end on the floor beside the box, between two elements each; some escape, or are blocked."""
    e = room.elements
    floor = np.flatnonzero((e.material == FLOOR) & (np.abs(e.position[:, :2]).max(1) < 1.2))[:24]
    links = np.stack([floor, np.roll(floor, 1), floor, floor], 1).astype(np.uint32) * np.uint32(D) + np.uint32(500)
    weights = np.tile(np.float32([0.75, 0.25, 0, 0]), (len(floor), 1))
    links[:3, 1], links[3:5, 0] = ESCAPES, BLOCKED
    return links, weights


def test_elements_matter_by_what_their_light_does_where_rays_end(room: LightField) -> None:
    """Those of a material shine: what is seen of it along the rays, with all bounces, against their importance."""
    links, weights = rays(room)
    e, rng = room.elements, np.random.default_rng(3)
    matters = seen_from(room, met_along(len(e), links, weights))
    links_d, weights_d = (room.device.upload(x) for x in (links, weights))
    seen, foreseen = [], []
    for shining in (FLOOR, BOX):
        emission = np.where(e.material == shining, rng.uniform(0.5, 1.5, len(e)), 0).astype(np.float32)
        lights = [room.with_emission(np.repeat(x[:, None], 3, 1)).settle(30) for x in (emission, 0 * emission)]
        told = [field.follow_links(links_d, weights_d)[:, 0].sum() for field in lights]
        seen.append(float(told[0] - told[1]))
        foreseen.append(float(matters @ emission))
    for is_so, told_before in zip(seen, foreseen, strict=True):
        assert 0.95 * is_so < told_before < 1.6 * is_so, (seen, foreseen)


def test_importance_is_reflected_by_what_elements_see(room: LightField, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against the links, one by one, and what is not followed is shared by all."""
    monkeypatch.setattr(importance, "REFLECTIONS", 1)
    links, weights = rays(room)
    n, hit, area = len(room.elements), room.device.download(room.hit_d), room.elements.area.astype(float)
    reflects = albedo(room.surface).astype(float)
    share = np.bincount(links[links < BLOCKED] // D, weights[links < BLOCKED], minlength=n)
    cosine = room.device.download(room.cosine_d).astype(float)
    once = np.zeros(n)
    for i in range(n):
        bins = np.flatnonzero(hit[i] < BLOCKED)
        who = hit[i, bins] // D
        once[i] = area[i] * (cosine[bins] * (reflects * share / area)[who]).sum()
    further = (once @ reflects) / max(1 - reflects.mean(), 0.1) / n
    np.testing.assert_allclose(seen_from(room, met_along(n, links, weights)), share + once + further, rtol=1e-4)
