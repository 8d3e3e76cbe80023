"""The quick display pass against what OpenColorIO makes of each pixel."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import PyOpenColorIO as ocio
import pytest

from usdslf.color import BUILT_IN, USD_DEFAULT_SPACE, color_of
from usdslf.display import CHANNELS, FALSE_COLORS, NOT_A_NUMBER, DisplayPass, DisplaySettings
from usdslf.errors import InputError

COLOR = color_of(None, USD_DEFAULT_SPACE)
ACES = DisplaySettings("sRGB - Display", "ACES 2.0 - SDR 100 nits (Rec.709)")


def pixels_of_all_kinds(height: int = 131, width: int = 77) -> np.ndarray:
    """Colours 9 stops below to 7 above middle grey, from grey to saturated."""
    rng = np.random.default_rng(5)
    count = height * width
    level = 0.18 * 2 ** rng.uniform(-9, 7, (count, 1))
    hue, saturation = rng.dirichlet([1, 1, 1], count) * 3, rng.uniform(0, 1, (count, 1))
    return (level * (saturation * hue + 1 - saturation)).astype(np.float32).reshape(height, width, 3)


PIXELS = pixels_of_all_kinds()


def codes_of(settings: DisplaySettings, pixels: np.ndarray = PIXELS) -> np.ndarray:
    return DisplayPass.of(COLOR, settings).codes(pixels, settings)


def plain(settings: DisplaySettings, pixels: np.ndarray) -> np.ndarray:
    """OpenColorIO alone, every pixel through the whole view: 0..255, not rounded."""
    config = ocio.Config.CreateFromFile(BUILT_IN)
    view = ocio.DisplayViewTransform(
        src=USD_DEFAULT_SPACE, display=settings.display, view=settings.view, looksBypass=bool(settings.look)
    )
    steps = [ocio.MatrixTransform.Scale([2.0**settings.exposure] * 3 + [1.0])]
    if settings.look:
        steps.append(ocio.LookTransform(src=USD_DEFAULT_SPACE, dst=USD_DEFAULT_SPACE, looks=settings.look))
    steps += [view, ocio.ExponentTransform([1 / settings.gamma] * 3 + [1.0])]
    out = np.array(pixels, np.float32)
    config.getProcessor(ocio.GroupTransform(steps)).getDefaultCPUProcessor().applyRGB(out)
    return np.clip(out, 0, 1) * 255


@pytest.mark.parametrize(
    "settings",
    [
        ACES,
        replace(ACES, exposure=1.5, gamma=1.4),
        replace(ACES, look="ACES 1.3 Reference Gamut Compression"),
        replace(ACES, view="Un-tone-mapped", exposure=-1.0),
        replace(ACES, display="Rec.2100-PQ - Display", view="ACES 2.0 - HDR 1000 nits (Rec.2020)"),
    ],
)
def test_codes_are_those_of_opencolorio_but_for_what_the_table_costs(settings: DisplaySettings) -> None:
    off = np.abs(codes_of(settings) - plain(settings, PIXELS))
    assert off.mean() < 0.25 + 0.1  # rounding alone has a mean of a quarter
    assert np.quantile(off, 0.999) < 1.25
    assert off.max() < 6.5


def test_exposure_is_a_factor_of_the_pixels() -> None:
    np.testing.assert_array_equal(codes_of(replace(ACES, exposure=2.0)), codes_of(ACES, PIXELS * 4))


def test_gamma_acts_on_code_values() -> None:
    settings = replace(ACES, view="Un-tone-mapped")
    before = plain(settings, PIXELS)
    off = np.abs(codes_of(replace(settings, gamma=2.2)) - 255 * (before / 255) ** (1 / 2.2))
    assert off[before > 16].max() < 0.5 + 0.75  # darker ones are steeper
    assert off.mean() < 0.25 + 0.1


@pytest.mark.parametrize("channel", ["red", "green", "blue"])
def test_a_channel_is_shown_as_grey_of_its_value(channel: str) -> None:
    grey = np.repeat(PIXELS[..., CHANNELS.index(channel) - 1, None], 3, -1)
    np.testing.assert_array_equal(codes_of(replace(ACES, channel=channel)), codes_of(ACES, grey))


def test_luminance_is_that_of_rec_709() -> None:
    grey = np.repeat((PIXELS.astype(np.float64) @ [0.2126, 0.7152, 0.0722])[..., None], 3, -1)
    off = codes_of(replace(ACES, channel="luminance")).astype(int) - codes_of(ACES, grey.astype(np.float32))
    assert np.abs(off).max() <= 1


def test_false_colour_tells_stops_about_middle_grey_whatever_the_view() -> None:
    edges = [stops for stops, _, _ in FALSE_COLORS[1:]]
    stops = np.array([edges[0] - 1, *((a + b) / 2 for a, b in pairwise(edges)), edges[-1] + 1])
    grey = (0.18 * 2**stops)[None, :, None].repeat(3, -1).astype(np.float32)
    palette = [[codes for _, codes, _ in FALSE_COLORS]]
    settings = DisplaySettings(channel="false_color")
    np.testing.assert_array_equal(codes_of(settings, grey), palette)
    np.testing.assert_array_equal(codes_of(replace(settings, exposure=3.0, gamma=2.0), grey / 8), palette)
    assert len({codes for _, codes, _ in FALSE_COLORS} | {NOT_A_NUMBER}) == len(FALSE_COLORS) + 1


def test_what_is_no_number_is_black_and_has_its_own_false_colour() -> None:
    odd = np.array([[[np.nan] * 3, [np.inf] * 3, [-np.inf] * 3, [0.18, np.nan, 0.18]]], np.float32)
    shown = codes_of(ACES, odd)
    assert not shown[0, [0, 2, 3]].any() and (shown[0, 1] == 255).all()
    assert (codes_of(replace(ACES, channel="false_color"), odd) == NOT_A_NUMBER).all()


def test_pictures_of_any_size_and_with_alpha_are_shown() -> None:
    with_alpha = np.concatenate([PIXELS, PIXELS[..., :1]], -1)
    np.testing.assert_array_equal(codes_of(ACES, with_alpha), codes_of(ACES))
    np.testing.assert_array_equal(codes_of(ACES, PIXELS[::7, ::3]), codes_of(ACES)[::7, ::3])
    assert codes_of(ACES, PIXELS[:0]).shape == (0, 77, 3)


def test_what_the_config_lacks_is_named() -> None:
    for settings, words in (
        (replace(ACES, view="Sepia"), "no display 'sRGB - Display' with view 'Sepia'"),
        (replace(ACES, look="Sepia"), "no look 'Sepia', it has ACES 1.3"),
        (replace(ACES, channel="alpha"), "no channel 'alpha', choose from color, red"),
    ):
        with pytest.raises(InputError, match=words):
            codes_of(settings)
