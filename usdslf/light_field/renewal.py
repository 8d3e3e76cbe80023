"""Renewal: a light field follows an edit where it changes, and stays as it is where it does not.

    renew(field, bounces, tolerance) -> Renewal
    foreseen(field, surface, matters) -> share of the light that another reflectance would change at once

Elements whose reflectance changed reflect anew, L_o = L_e + K (L_fixed + G L_o); then those that see enough of the
change, and so on.  Where it changed by little, what that does to their light is foreseen (surface.py) and waits too.
What has arrived at an element since it reflected last waits there, as the estimate

    w_e = even_e |sum_d c_d dL(hit_ed)| + (rho_e - even_e) sum_d c_d |dL(hit_ed)|

of how much its mean radiance would change, dL and |dL| as means over BLOCK x BLOCK bins of the sender; c are the
cosines of its D bins, of sum 1, rho its albedo, even EVEN of its diffuse part: that sees the sum of light alone, in
which what is redirected is not lost.  In each bounce those that matter least wait, as long as

    sum_e m_e w_e < tolerance sum_e m_e |L_e|       m: how much an element matters, 1 or as of importance.py

together; what waits is not forgotten, so that small steps add up.  An element that is renewed is exact for the light of
now, whatever waited: nothing drifts.

Source: Nguyen et al. 2013, 5.2; Cohen et al. 1988 (progressive radiosity: shoot what is unshot, the largest first).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.light_field.blocks import blocks_of_surface
from usdslf.light_field.light_field import LightField
from usdslf.light_field.storage import constants_of
from usdslf.light_field.surface import CHANGED, Surface, albedo, changed_rows, diffuse_albedo, relative_changes
from usdslf.progress import tell
from usdslf.sampling.hemisphere import D

TOLERANCE = 1e-3  # of the light field (L1), that may wait
BLOCK = 4  # bins on a side, over which a change is averaged to judge what it brings
EVEN = 0.9  # of diffuse reflection, that Fresnel's laws leave even
KEPT_WAITING = 0.7  # of the tolerance: that a bounce leaves, so that what it sends may be the last


@dataclass(frozen=True)
class Renewal:
    """What was renewed.

    Attributes:
        elements: that reflected anew, by bounce.
        left: light that waits, of all that matters.
    """

    elements: tuple[int, ...]
    left: float


def renew(
    field: LightField, bounces: int, tolerance: float = TOLERANCE, matters: NDArray | None = None
) -> Renewal:
    """Lets a light field follow its reflectance.

    Args:
        field: its `outgoing_d` changes in place.
        bounces: at most; what waits then stays.
        tolerance: of the light that matters, 0 and above, that may wait.
        matters: (N,) how much each element does, of any scale; None: all alike.
    """
    counts: list[int] = []
    weight = np.ones(len(field.elements)) if matters is None else np.asarray(matters, np.float64)
    light = float(weight @ field.sent)
    for _ in range(bounces):
        waits = _weighed(field.waits, weight)
        if waits.sum() <= tolerance * light:
            break
        rows = _due(waits, KEPT_WAITING * tolerance * light)
        _reflect_anew(field, rows)
        counts.append(len(rows))
        tell()
    left = float(np.minimum(_weighed(field.waits, weight), light).sum())
    return Renewal(tuple(counts), left / light if light > 0 else 0.0)


def foreseen(field: LightField, surface: Surface, matters: NDArray) -> float:
    """Returns how much of the light that matters another reflectance would change at once, inf where that is much.

    Args:
        matters: (N,) how much each element does, of any scale.
    """
    rows = np.flatnonzero(changed_rows(field.surface, surface))
    if not len(rows):
        return 0.0
    change = relative_changes(field.surface, surface, rows) * np.float64(1)
    if (change == CHANGED).any():
        return float("inf")
    light = float(matters @ field.sent)
    return float((matters[rows] * change) @ field.sent_by(rows)) / light if light > 0 else 0.0


def _weighed(waits: NDArray, weight: NDArray) -> NDArray[np.float64]:
    """What waits as it matters; where the reflectance changed, it does to everybody."""
    is_changed = waits == CHANGED
    return np.where(is_changed, CHANGED, np.where(is_changed, 0, waits) * weight)


def _due(waits: NDArray, allowed: float) -> NDArray[np.int64]:
    """Elements that reflect now: all but those with the least, as long as together these are below what is allowed."""
    some = np.flatnonzero(waits)
    some = some[np.argsort(waits[some], kind="stable")]
    first = int(np.searchsorted(np.cumsum(waits[some], dtype=np.float64), allowed, side="right"))
    return np.sort(some[first:])


def _reflect_anew(field: LightField, rows: NDArray) -> None:
    """Lets some elements reflect the light of now, and adds what arrives of the change to what waits elsewhere."""
    device, n, count = field.device, len(field.elements), len(rows)
    kernel = lambda name: device.kernel("renewal", name, BLOCK=BLOCK, **constants_of(field.outgoing_d))  # noqa: E731
    rows_d, next_d, blocks = device.upload(rows.astype(np.int32)), field.next_d, D // BLOCK**2
    field.reflect(blocks_of_surface(device, field.surface, field.model, rows))
    change_d, arriving_d = device.zeros((1 + count, blocks, 4), np.float32), device.empty((n, 2), np.float32)
    row_of = np.zeros(n, np.int32)
    row_of[rows] = 1 + np.arange(count)
    kernel("take_rows")(
        groups(count * blocks), (GROUP,), rows_d, np.uint32(count * blocks), next_d, field.outgoing_d, change_d
    )
    kernel("arriving_change")(
        groups(n), (GROUP,), field.hit_d, device.upload(row_of), change_d, field.cosine_d, np.uint32(n), arriving_d
    )
    if field.renewed is not None:
        field.renewed.append(rows)
    field.waits[rows] = 0
    summed, all_of = device.download(arriving_d).T
    even = EVEN * diffuse_albedo(field.surface)
    field.waits += D * (even * summed + np.maximum(albedo(field.surface) - even, 0) * all_of)
