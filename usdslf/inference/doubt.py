"""Doubt: what of the radiance at painted points renderers do not agree on.

    doubtful_radiance(samples, field) -> (S, 3, 3) that grows with the diffuse colour, with F0, and with F90

A normal map can tilt a shading normal so far that it faces away from the eye, or that light arrives along it from below
the surface itself.  UsdPreviewSurface says nothing about either, and renderers bend the normal, turn it about, fold the
light up, or show none: at a point of bumpy wood or skin that is up to all that is seen.  A picture that somebody
painted on may have been made by any of them.  Here normals are bent and light is folded up (kernels/sample_rays.cl);
what came of that is told apart, so that dabs which show much of it are heard less.

Source: Schuessler, Heitz, Hanika and Dachsbacher 2017 (which choices there are, and what they lose or make up).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.evidence import arriving_light, columns_of_light
from usdslf.inference.samples import Samples
from usdslf.light_field.light_field import LightField
from usdslf.surfaces.reflectance import model_of

TILTED = 0.97  # cosine of a normal to the surface's own, above which what is below matters not
STEP = 2048  # samples at once


def doubtful_radiance(samples: Samples, field: LightField) -> NDArray[np.float64]:
    """Returns the radiance (S, 3, 3) that samples send to their eyes by folded light and off bent normals.

    Args:
        field: whose light of now surfaces send.

    Returns: what grows with the diffuse colour, with F0 and with F90, in the channels.
    """
    out = np.zeros((len(samples.eye), 3, 3))
    rows = np.flatnonzero((samples.horizon[:, 2] < TILTED) | samples.is_bent)
    if not len(rows):
        return out
    light, towards = (field.device.download(x) for x in (arriving_light(samples, field), samples.light.towards_d))
    s, model = samples.surface, model_of(field.model)
    rough = s.roughness.astype(np.float64)
    for first in range(0, len(rows), STEP):
        part = rows[first : first + STEP]
        arrives, there = light[part], towards[part]
        below = np.einsum("sck,sc->sk", there, samples.horizon[part]) < 0
        arrives = arrives * (below | samples.is_bent[part, None])[:, None]
        columns = columns_of_light(field, samples.eye[part], there, arrives, rough[part, None]).astype(np.float64)
        d, f0, f90 = (x[part, None].astype(np.float64) for x in (s.diffuse, s.f0, s.f90))
        whole, specular, of_f0 = (
            model.bilinear(columns, x, f0, y, False)[0][:, 0] for x, y in ((d, f90), (0 * d, f90), (0 * d, 0 * f90))
        )
        out[part] = np.stack([whole - specular, of_f0, specular - of_f0], 1)
    return out
