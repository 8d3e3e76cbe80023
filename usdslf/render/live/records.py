"""Where things stand in the rows that host and kernels share, as build constants of kernels/live_*.cl."""

from __future__ import annotations

from usdslf.rays import ULPS
from usdslf.render.wide_field import BLOCK

SURFACE = 32  # floats of a surface: two cache lines
POSITION, ALPHA, NORMAL, COAT_ALPHA, GEOMETRIC, COAT, VIEW, COAT_F_ZERO = 0, 3, 4, 7, 8, 11, 12, 15
DIFFUSE, LIFT, F_ZERO, MATERIAL, F_NINETY, ELEMENT, EMISSION, COVER = 16, 19, 20, 23, 24, 27, 28, 31
"""COVER: opacity, negative where all of the outgoing radiance is scaled by it; MATERIAL: -1, nothing is seen."""

INPUTS = 17  # of a material, as floats
IN_DIFFUSE, IN_SPECULAR, IN_EMISSION, IN_METALLIC, IN_ROUGHNESS = 0, 3, 6, 9, 10
IN_COAT, IN_COAT_ROUGHNESS, IN_IOR, IN_OPACITY = 11, 12, 13, 14
MAT = 26  # floats of a material: inputs, then these
MAT_THRESHOLD, MAT_WORKFLOW, MAT_PRESENCE, MAT_FIRST, MAT_COUNT, MAT_NORMAL, MAT_GLOWS = 18, 19, 20, 21, 22, 23, 24

REF = 26  # floats of a reference to a texture
REF_INPUT, REF_SIZE, REF_CHANNEL, REF_SET, REF_MATRIX, REF_SCALE, REF_BIAS = 0, 1, 2, 3, 4, 10, 14
REF_WRAP, REF_IMAGE, REF_FALLBACK = 18, 20, 22

SOURCE = 64  # floats of a source of light
SRC_KIND, SRC_RADIANCE, SRC_LINEAR, SRC_INVERSE, SRC_CENTER, SRC_SIZE, SRC_VOLUME = 0, 1, 4, 13, 22, 25, 27
SRC_AXIS, SRC_DIFFUSE, SRC_SPECULAR, SRC_ALONE, SRC_SAMPLED, SRC_POWER, SRC_SHAPING = 28, 31, 32, 33, 34, 35, 37
SRC_CONE, SRC_FOCUS, SRC_TINT, SRC_PICTURE, SRC_TABLE, SRC_DRAWN, SRC_REACH, SRC_WIDE = 38, 40, 41, 44, 47, 49, 50, 51

TILE = 8  # pixels on a side that share a set of numbers
SET = 64  # numbers that the pixels of a tile of 8 x 8 share
ROUNDS = 64  # sets of directions of each dome, one for so many frames as a set has numbers
DRAWN = SET * ROUNDS
PATH = 12  # floats of a path's state
QUEUED = 16  # floats of a ray that waits to be followed: its row, what it brings, what was drawn
Q_ROW, Q_LIGHT, Q_RAY = 0, 3, 6
DRAWN_RAY = 10  # floats of a ray of a lobe; its density is with the guide, that of the lobe without
RAY_PDF, RAY_WEIGHTS, RAY_FOLDED, RAY_ELEMENT, RAY_MATTE, RAY_LOBE_PDF = 0, 1, 6, 7, 8, 9
COLUMNS = 24  # floats of a row's light: X, Y of sources, X, Y of surfaces, A, B, coat
FRAMES, GATHERED = 21, 22  # frames of the columns; those that sent a ray of the diffuse lobe
KEPT = 26  # floats of a row's columns and moments, kept aside
GUIDE = 16  # floats of what neighbours are compared by, the position first
G_GAP, G_NORMAL, G_CLASS, G_MIRROR, G_ALPHA = 3, 4, 7, 8, 11  # G_GAP: how far neighbours may lie off its plane
G_TILE, G_WIDTH = 12, 13  # rows on a side that share numbers of specular light; how far mirror directions may differ
LIGHT = 16  # the same, as they are shown: X, Y, A, B, coat
FRESNEL_COSINES = 64  # cosines of the eye for which the share of the column Y is known
FILTERED_FRAMES = 4  # from which on the filter is faded out, until each pixel has had a whole set
KNOWN_FRAMES = 4.0  # of gathered diffuse light, that the elements' light counts as
EDGE_COSINE = 0.9  # between normals of neighbours, below which there is an edge
DIFFUSE_COLUMNS = 2  # X and Y come first
WEAK_EVERY = 4  # 1 / WEAK_SHARE
WEAK_SHARE = 0.25  # of the frames in which a ray of a wide and weak specular lobe is sent: wider, and seen less
WEAK_ALPHA, WEAK_COSINE, WEAK_F_ZERO = 0.15, 0.3, 0.06  # at a grazing angle, than these
LITTLE = 0.05  # throughput of paths below which they end by chance
WIDE_SIDE = 64  # of the octahedral table of a dome's wide radiance

MIN_ALPHA = 4e-4  # sharper lobes drown in the rounding of half vectors
NORMAL_COSINE = 0.985  # normals of neighbours that share light may differ by 10 degrees
LOBE_SHARE = 1.0  # mirror directions of neighbours may differ by this many alphas, but no more than WIDEST
FLAT_SHARE = 3.0  # the same for flat surfaces, whose tiles are whole: few rays would be wrong alike in all pixels
WIDEST = 0.15
FLAT = 0.25  # change of the normal, of that of the mirror direction, below which a surface is flat

WIDE_PDF = 2.0  # [1/sr] density up to which a ray reads the light field averaged over directions
UNEVEN = 1.8  # times its mean that the brightest of a hit's near elements may be
BRIGHT = 4.0  # times the mean of all that rays meet, above which the light field is not trusted either
SHARP_PDF = 8.0  # [1/sr] density from which on a ray counts as a reflection
# Smoother surfaces count as this rough for rays of wide lobes that follow them: found by chance, their highlights
# would be fireflies.  Source: Kaplanyan and Dachsbacher 2013, path space regularization.
CAUSTIC_ROUGHNESS = 0.35
# What surfaces send along one ray of a wide lobe may bring this many times the mean of all light that arrives at
# the nearest element, or about it; more is cut off.  It is the one place where light is clamped.
RAY_MOST = 16.0

_FLOATS = {
    "MIN_ALPHA": MIN_ALPHA, "OFFSET": ULPS * 2**-23, "WIDE_PDF": WIDE_PDF, "SHARP_PDF": SHARP_PDF,
    "CAUSTIC_ROUGHNESS": CAUSTIC_ROUGHNESS, "RAY_MOST": RAY_MOST, "UNEVEN": UNEVEN, "BRIGHT": BRIGHT, "LITTLE": LITTLE,
    "KNOWN_FRAMES": KNOWN_FRAMES, "EDGE_COSINE": EDGE_COSINE, "NORMAL_COSINE": NORMAL_COSINE,
    "LOBE_WIDTH": FLAT_SHARE, "CURVED_WIDTH": LOBE_SHARE,
    "FLAT": FLAT, "WIDEST": WIDEST, "WEAK_SHARE": WEAK_SHARE, "WEAK_ALPHA": WEAK_ALPHA, "WEAK_COSINE": WEAK_COSINE,
    "WEAK_F_ZERO": WEAK_F_ZERO,
}  # fmt: skip
CONSTANTS: dict[str, object] = {
    **{name: value for name, value in list(globals().items()) if name.isupper() and isinstance(value, int)},
    "BLOCK": BLOCK,
    **{name: f"{value}f" for name, value in _FLOATS.items()},
}
"""Build constants of all kernels of the live picture."""
