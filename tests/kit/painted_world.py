"""A float64 model of painted surfaces under many suns: evidence of strokes whose change is known."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from reference import solve as ref
from reference.reflectance import frame_about

from usdslf.inference.evidence import Evidence
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.reflectance import roughness_levels
from usdslf.surfaces.surface_points import SurfacePoints

DABS, ELSEWHERE, DIRECTIONS = 20, 12, 4
LEVELS = roughness_levels()


@dataclass(frozen=True)
class Look:
    """Parameters of a surface, or what became of them."""

    diffuse: tuple[float, float, float] = (0.4, 0.3, 0.2)
    f0: tuple[float, float, float] = (0.04, 0.04, 0.04)
    roughness: float = 0.3
    is_metal: bool = False

    @property
    def f90(self) -> tuple[float, float, float]:
        return self.f0 if self.is_metal else (1.0, 1.0, 1.0)


PLASTIC = Look()
METAL = Look((0.0, 0.0, 0.0), (0.7, 0.5, 0.3), 0.3, True)


class World:
    """Points of a curved surface under a window and a sky, both of many suns; one eye."""

    def __init__(self) -> None:
        rng = np.random.default_rng(4)
        window = np.array([-0.6, 0.2, 0.77]) + rng.uniform(-0.16, 0.16, (100, 3))
        sky = rng.normal(size=(100, 3))
        sky[:, 2] = np.abs(sky[:, 2])
        self.towards = np.concatenate([window, sky])
        self.towards /= np.linalg.norm(self.towards, axis=1, keepdims=True)
        self.light = np.concatenate(
            [np.full((100, 3), 0.03) * [1, 0.95, 0.85], np.full((100, 3), 0.013) * [0.8, 0.9, 1]]
        )
        n = DABS + ELSEWHERE
        eye = np.array([0.6, -0.2, 0.77])  # mirrored by the mean normal: the middle of the window
        normal = np.array([0, 0, 1]) + rng.normal(size=(n, 3)) * np.where(np.arange(n) < DABS, 0.14, 0.35)[:, None]
        self.frame = np.array([frame_about(v / np.linalg.norm(v)) for v in normal])
        self.eye = np.tile(eye / np.linalg.norm(eye), (n, 1))
        self.position = rng.normal(size=(n, 3))
        self.row = np.repeat(np.arange(DABS), DIRECTIONS)  # of unpainted directions
        local = rng.normal(size=(len(self.row), 3))
        local[:, 2] = 0.3 + np.abs(local[:, 2])
        self.away = np.einsum("nij,ni->nj", self.frame[self.row], local / np.linalg.norm(local, axis=1, keepdims=True))

    def columns(self, model: str, roughness: float) -> np.ndarray:
        """(n, 4, 3) for the eye."""
        return ref.columns_of_suns(model, roughness, self.frame, self.eye, self.towards, self.light)

    def background(self, model: str, roughness: float) -> np.ndarray:
        """(B, 4, 3) for the unpainted directions."""
        return ref.columns_of_suns(model, roughness, self.frame[self.row], self.away, self.towards, self.light)


def surface_points(n: int, look: Look, position: np.ndarray) -> SurfacePoints:
    """n points of one look; what the solve does not read is zero."""
    values = {
        "position": position,
        "diffuse": look.diffuse,
        "f0": look.f0,
        "f90": look.f90,
        "roughness": look.roughness,
        "opacity": 1.0,
    }
    vectors = {
        "position",
        "geometric_normal",
        "normal",
        "diffuse",
        "f0",
        "f90",
        "emission",
        "base_color",
        "specular_color",
    }
    integers = {"mesh", "material", "triangle"}
    arrays = {}
    for f in fields(SurfacePoints):
        shape = (n, 3) if f.name in vectors else (n, 2) if f.name == "barycentric" else (n,)
        value = np.broadcast_to(np.asarray(values.get(f.name, 0), float), shape)
        arrays[f.name] = value.astype(np.int32 if f.name in integers else np.float32)
    return SurfacePoints(**arrays)


def painted(
    world: World, levels: dict, before: Look, after: Look, model: str = "preview_surface", gain: float = 1.0
) -> Evidence:
    """Evidence of a stroke that has the radiance of `after` on a surface that is `before`."""
    n = DABS + ELSEWHERE
    on_levels, back = levels[model]
    own, back_own = world.columns(model, before.roughness), world.background(model, before.roughness)
    target = ref.radiance(model, world.columns(model, after.roughness)[:DABS], after.diffuse, after.f0, after.f90)
    stroke = Stroke(
        "s", np.zeros((DABS, 3), np.float32), np.ones(DABS, np.float32), target.astype(np.float32),
        np.zeros((DABS, 3), np.float32),
    )  # fmt: skip
    return Evidence(
        stroke=stroke,
        target=gain * target,
        material=np.zeros(DABS, np.int64),
        dab_of_sample=np.arange(n),
        surface=surface_points(n, before, world.position),
        levels=np.tile([*LEVELS, before.roughness], (n, 1)),
        columns=gain * np.concatenate([on_levels, own[:, None]], 1),
        unchanging=np.zeros((n, 3)),
        background_sample=world.row,
        background=gain * np.concatenate([back, back_own[:, None]], 1),
    )


CHANGES = {
    "diffuse": (PLASTIC, replace(PLASTIC, diffuse=(0.7, 0.1, 0.1))),
    "darker diffuse": (PLASTIC, replace(PLASTIC, diffuse=(0.1, 0.08, 0.05))),
    "specular": (PLASTIC, replace(PLASTIC, f0=(0.25, 0.25, 0.25))),
    "coloured specular": (METAL, replace(METAL, f0=(0.3, 0.5, 0.8))),
    "glossiness": (PLASTIC, replace(PLASTIC, roughness=0.6)),
    "sharper glossiness": (METAL, replace(METAL, roughness=0.15)),
    "none": (PLASTIC, PLASTIC),
}
