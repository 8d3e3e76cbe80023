"""What an image file says of itself: which of its channels are colours and alpha, and their colour space.

Channels go by their names, as OpenEXR has them: those of the unnamed layer that are R, G, B and A, else those
of the first layer that has R, G and B; two of no meaning are grey and alpha.  What is no colour (depth, ids, normals)
is never taken for alpha.

Colour space `auto`, as UsdPreviewSurface says: what the file says of it first, else 8 bits of colour are sRGB and the
rest is linear.
Source: UsdPreviewSurface specification, UsdUVTexture, sourceColorSpace; PNG specification, third edition, 4.3.
"""

from __future__ import annotations

import struct
import zlib

import OpenImageIO as oiio

from usdslf.color import USD_DEFAULT_SPACE

SRGB = "srgb_rec709_scene"
_LINEAR = ("linear", "lin_rec709_scene", "lin_rec709")
_ALPHA = ("A", "ALPHA")


def channels_of(spec: oiio.ImageSpec) -> tuple[int, ...]:
    """Returns which channels (1..4 of them) are read: grey, grey and alpha, rgb, or rgb and alpha."""
    layers: dict[str, dict[str, int]] = {}
    for number, name in enumerate(spec.channelnames[: spec.nchannels]):
        layer, _, short = str(name).rpartition(".")
        layers.setdefault(layer, {}).setdefault(short.upper(), number)
    ordered = sorted(layers.items(), key=lambda item: item[0] != "")
    chosen = next((names for _, names in ordered if {"R", "G", "B"} <= set(names)), None)
    if chosen is not None:
        colors = [chosen[c] for c in "RGB"]
    else:
        chosen = ordered[0][1]
        if spec.nchannels == 2 and {"R", "G"} == set(chosen):
            return 0, 1  # as TIFF has grey and alpha
        plain = [number for name, number in chosen.items() if name not in _ALPHA]
        is_grey = "Y" in chosen and not {"X", "Z"} & set(chosen)
        colors = [chosen["Y"]] if is_grey else plain[: 3 if len(plain) > 2 else 1] or list(chosen.values())[:1]
    alpha = [chosen[a] for a in _ALPHA if a in chosen and chosen[a] not in colors]
    return tuple(colors + alpha[:1])


def words_of_channels(spec: oiio.ImageSpec) -> str:
    """Returns which channels were taken, "" where a file has nothing but colours and alpha."""
    taken = channels_of(spec)
    if len(taken) == spec.nchannels:
        return ""
    names = [str(n) for n in spec.channelnames]
    shown = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
    alpha = "" if len(taken) in (2, 4) else ", alpha is 1"
    return f"it has the channels {shown}: {', '.join(names[i] for i in taken)} are taken{alpha}"


def space_of(color_space: str, spec: oiio.ImageSpec, file: str) -> tuple[str, str]:
    """Returns the colour space of an image's pixels, and in words what was taken where readers may differ.

    Args:
        color_space: as authored; auto or "" asks the file.
        spec: of the open image.
        file: that it was opened from.
    """
    if color_space not in ("auto", ""):
        return color_space, ""
    if len(channels_of(spec)) < 3:
        return "raw", ""
    is_code = str(spec.format) in ("uint8", "uint16")
    declared = str(spec.get_string_attribute("colorInteropID"))
    if declared and not is_code:
        return declared, ""
    by_depth = SRGB if str(spec.format) == "uint8" else USD_DEFAULT_SPACE
    says = _says(spec, file) if is_code else ""
    if not says or says == by_depth:
        return by_depth, ""
    named = "sRGB" if says == SRGB else "linear"
    depth = 8 if str(spec.format) == "uint8" else 16
    return says, f"its {depth} bit pixels are taken as {named}, as the file says: some programs go by the depth alone"


def _says(spec: oiio.ImageSpec, file: str) -> str:
    """The colour space that a file of codes declares, "" where it says none."""
    if spec.get_string_attribute("oiio:ColorSpace") in _LINEAR:
        return USD_DEFAULT_SPACE
    profile = str(spec.get_string_attribute("ICCProfile:profile_description"))
    if profile:
        return _of_profile(profile)
    if spec.get_int_attribute("Exif:ColorSpace") == 1:
        return SRGB
    with open(file, "rb") as stream:
        is_png = stream.read(8) == b"\x89PNG\r\n\x1a\n"
        return _of_png(stream.read(1 << 20)) if is_png else ""


def _of_profile(name: str) -> str:
    words = name.lower()
    if "linear" in words:
        return USD_DEFAULT_SPACE
    return SRGB if "srgb" in words or "61966-2" in words else ""


def _of_png(chunks: bytes) -> str:
    """What the chunks before the pixels of a PNG say: cICP before iCCP before sRGB before gAMA."""
    found: dict[bytes, bytes] = {}
    at = 0
    while at + 8 <= len(chunks):
        size, kind = struct.unpack_from(">I4s", chunks, at)
        if kind == b"IDAT":
            break
        found[kind] = chunks[at + 8 : at + 8 + size]
        at += 12 + size
    if len(found.get(b"cICP", b"")) == 4:
        return {13: SRGB, 8: USD_DEFAULT_SPACE}.get(found[b"cICP"][1], "")
    if b"iCCP" in found:
        name, _, rest = found[b"iCCP"].partition(b"\0")
        try:
            profile = zlib.decompress(rest[1:])
        except zlib.error:
            profile = b""
        return _of_profile(name.decode("latin-1") + " " + profile[128:4096].replace(b"\0", b"").decode("latin-1"))
    if b"sRGB" in found:
        return SRGB
    if len(found.get(b"gAMA", b"")) == 4:
        gamma = struct.unpack(">I", found[b"gAMA"])[0] / 1e5
        return SRGB if abs(gamma - 1 / 2.2) < 0.01 else USD_DEFAULT_SPACE if abs(gamma - 1) < 0.01 else ""
    return ""
