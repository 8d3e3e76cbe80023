"""All that shines on the device, for kernels/live_sources.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.lights.sampling import is_delta, light_frame, light_picture, shaping_of
from usdslf.lights.sources import DomeSource, LightSet, LightSource
from usdslf.progress import in_blocks
from usdslf.render.live import records as r
from usdslf.sampling.low_discrepancy import scrambled_points
from usdslf.scene.records import F32

KINDS = {"rect": 0, "disk": 1, "sphere": 2, "cylinder": 3, "distant": 4, "point": 5, "dome": 6, "glowing": 7}
EACH = 4  # sources up to this number get a ray each; of more, STREAMS are chosen by what they bring
STREAMS = 2
MIRRORED_ANGLE = 0.2  # [sr] of a dome that a ray sees which only the shading normal sent out
PIXELS_AT_ONCE = 1 << 20  # of a picture that are copied to the device


@dataclass(frozen=True)
class SourceTable:
    """Sources on the device, in the order of `LightSet.sources`."""

    drawn_by: tuple[str, ...]  # for each ray towards sources of a row, the kernel of live_draw.cl that draws it
    has_even_dome: bool  # only rays of the lobes find it
    arrays: tuple[Any, ...]  # as SCENE_PARAMETERS takes them from `source_count` on

    @property
    def streams(self) -> int:
        """Rays towards sources of each row."""
        return len(self.drawn_by)

    @staticmethod
    def of(device: Device, lights: LightSet, each: int = EACH) -> SourceTable:
        """Uploads what shines; of more than `each` sources, STREAMS are chosen for each row."""
        rows = np.zeros((max(len(lights.sources), 1), r.SOURCE), np.float32)
        rows[:, r.SRC_KIND], rows[:, r.SRC_ALONE] = KINDS["point"], 1
        store = _Store([], [], [])
        for row, source in zip(rows, lights.sources):
            row[r.SRC_DIFFUSE], row[r.SRC_SPECULAR] = source.diffuse, source.specular
            row[r.SRC_ALONE] = source.is_delta or source.is_split
            row[r.SRC_SAMPLED] = not source.is_met_only
            row[r.SRC_PICTURE], row[r.SRC_WIDE] = -1, -1
            if isinstance(source, LightSource):
                _fill_light(row, source, store)
            elif isinstance(source, DomeSource):
                _fill_dome(row, source, store)
        glow = lights.emissive
        if len(glow.triangle):
            rows[-1, r.SRC_KIND] = KINDS["glowing"]
            rows[-1, r.SRC_CENTER : r.SRC_CENTER + 3] = glow.center
            rows[-1, r.SRC_POWER : r.SRC_POWER + 2] = glow.flux, glow.size2
        join = lambda parts, empty: np.concatenate(parts) if parts else empty  # noqa: E731
        up = device.upload
        count = len(lights.sources)
        drawn_by = tuple(map(_kernel_of, rows[:count])) if count <= each else ("draw_any_source",) * STREAMS
        return SourceTable(
            drawn_by, any(d.is_met_only for d in lights.domes),
            (
                np.int32(count), np.int32(len(drawn_by)), up(rows), _pictures(device, store.pictures),
                up(join(store.tables, np.zeros(1, np.float32))), up(join(store.drawn, np.zeros((1, 8), np.float32))),
                np.int32(len(glow.triangle)), up(glow.triangle), up(glow.cumulative.astype(np.float32)),
                up(glow.pdf_area),
            ),
        )  # fmt: skip


def _kernel_of(row: NDArray) -> str:
    """Names the kernel that draws directions towards a source, of a ray of its own."""
    kind, is_sampled = row[r.SRC_KIND], row[r.SRC_SAMPLED] > 0
    if is_sampled and kind == KINDS["dome"]:
        return "draw_dome"
    is_even = row[r.SRC_SHAPING] <= 0 and row[r.SRC_PICTURE] < 0
    is_flat = kind in (KINDS["rect"], KINDS["disk"])
    return "draw_flat_light" if is_sampled and is_even and is_flat else "draw_any_source"


@dataclass
class _Store:
    pictures: list[F32]  # (n, 3)
    tables: list[F32]
    drawn: list[F32]  # (DRAWN, 8)

    def picture(self, pixels: NDArray) -> int:
        """Keeps pixels (n, 3); returns the number of the first."""
        first = sum(len(p) for p in self.pictures)
        self.pictures.append(np.asarray(pixels, np.float32))
        return first


def _pictures(device: Device, pictures: list[F32]) -> Any:
    """Uploads pixels (n, 3) one after another as rows of four: a large picture is not copied on the host."""
    out_d = device.empty((max(sum(map(len, pictures)), 1), 4), np.float32)
    first = 0
    for pixels in pictures:
        for rows in in_blocks(len(pixels), PIXELS_AT_ONCE):
            part = np.ones((rows.stop - rows.start, 4), np.float32)
            part[:, :3] = pixels[rows]
            device.put(out_d, first, part)
            first += len(part)
    return out_d


def _fill_light(row: NDArray, source: LightSource, store: _Store) -> None:
    light = source.light
    delta = is_delta(light)
    kind = "point" if delta and light.kind == "sphere" else light.kind
    row[r.SRC_KIND] = KINDS[kind]
    row[r.SRC_RADIANCE : r.SRC_RADIANCE + 3] = light.radiance
    row[r.SRC_POWER], row[r.SRC_POWER + 1] = source.guess
    row[r.SRC_REACH] = source.reach
    axis, cone, focus = shaping_of(light)
    row[r.SRC_AXIS : r.SRC_AXIS + 3] = axis
    row[r.SRC_CONE : r.SRC_CONE + 2] = cone or (-1, -1)
    row[r.SRC_FOCUS], row[r.SRC_TINT : r.SRC_TINT + 3] = focus, light.focus_tint
    row[r.SRC_SHAPING] = cone is not None or focus > 0
    if kind == "distant":
        row[r.SRC_SIZE] = 0 if delta else 2 * np.sin(min(light.angle, 2 * np.pi) / 4) ** 2
        if delta and light.angle > 0:
            row[r.SRC_RADIANCE : r.SRC_RADIANCE + 3] *= np.pi * np.sin(light.angle / 2) ** 2
        return
    row[r.SRC_CENTER : r.SRC_CENTER + 3] = light.world_from_light[:3, 3]
    if kind == "point":
        m = np.asarray(light.world_from_light, np.float64)[:3, :3]
        volume = abs(float(np.linalg.det(m)))
        row[r.SRC_VOLUME], row[r.SRC_SIZE] = volume, light.radius
        if volume > 0:
            row[r.SRC_INVERSE : r.SRC_INVERSE + 9] = np.linalg.inv(m).ravel()
        return
    frame = light_frame(light)
    if frame is None:  # without area
        row[r.SRC_SAMPLED], row[r.SRC_KIND], row[r.SRC_ALONE] = 0, KINDS["point"], 1
        return
    row[r.SRC_LINEAR : r.SRC_LINEAR + 9], row[r.SRC_INVERSE : r.SRC_INVERSE + 9] = (
        frame.linear.ravel(),
        frame.inverse.ravel(),
    )
    row[r.SRC_SIZE : r.SRC_SIZE + len(frame.size)] = frame.size
    row[r.SRC_VOLUME] = frame.volume
    if light.kind == "rect" and light.texture:
        pixels = light_picture(light.texture)
        row[r.SRC_PICTURE] = store.picture(pixels.reshape(-1, 3))
        row[r.SRC_PICTURE + 1 : r.SRC_PICTURE + 3] = pixels.shape[1], pixels.shape[0]


def _fill_dome(row: NDArray, source: DomeSource, store: _Store) -> None:
    dome = source.dome
    row[r.SRC_KIND] = KINDS["dome"]
    row[r.SRC_INVERSE : r.SRC_INVERSE + 9] = dome.world_from_light.T.ravel()
    row[r.SRC_POWER], row[r.SRC_POWER + 1] = source.irradiance, -1
    height, width = dome.pixels.shape[:2]
    row[r.SRC_PICTURE] = store.picture(dome.pixels.reshape(-1, 3))
    row[r.SRC_PICTURE + 1 : r.SRC_PICTURE + 3] = width, height
    if height * width > 1:
        row[r.SRC_WIDE] = store.picture(dome.table(MIRRORED_ANGLE, r.WIDE_SIDE))
    rows, columns, density = dome.density_table()
    row[r.SRC_TABLE], row[r.SRC_TABLE + 1] = sum(len(t) for t in store.tables), density.shape[1]
    store.tables.append(np.concatenate([rows, columns, density.ravel()]).astype(np.float32))
    u = scrambled_points(r.DRAWN, np.array([7], np.uint32))[0]
    direction, radiance, pdf = dome.sample(u)
    row[r.SRC_DRAWN] = len(store.drawn)
    store.drawn.append(np.concatenate([direction, pdf[:, None], radiance, 0 * pdf[:, None]], 1).astype(np.float32))
