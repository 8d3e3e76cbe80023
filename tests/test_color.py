"""Colour conversions against the published formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from usdslf.color import USD_DEFAULT_SPACE, Color, color_of
from usdslf.errors import InputError

RAMP = np.linspace(0, 1, 33, dtype=np.float32)[:, None] * np.array([1.0, 0.7, 0.3], np.float32)
# Rec.709 to ACES AP1 with Bradford adaptation D65 to D60: ACES TB-2014-004 primaries.
AP1_FROM_REC709 = [
    [0.6130974, 0.3395231, 0.0473795],
    [0.0701937, 0.9163539, 0.0134524],
    [0.0206156, 0.1095698, 0.8698147],
]


def srgb_to_linear(code: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    code = code.astype(np.float64)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("name", ["sRGB", "srgb_rec709_scene", "srgb_texture"])
def test_srgb_codes_become_linear_by_the_standard(name: str) -> None:
    assert color_of(None, USD_DEFAULT_SPACE).to_working(RAMP, name) == pytest.approx(srgb_to_linear(RAMP), abs=2e-6)


@pytest.mark.parametrize("name", ["raw", "data", "", "lin_rec709_scene"])
def test_data_and_the_working_space_stay_as_they_are(name: str) -> None:
    np.testing.assert_array_equal(color_of(None, USD_DEFAULT_SPACE).to_working(RAMP * 9, name), RAMP * 9)


def test_rec709_to_acescg_is_the_published_matrix() -> None:
    found = color_of(None, "lin_ap1_scene").to_working(np.eye(3, dtype=np.float32), "lin_rec709_scene")
    assert pytest.approx(np.array(AP1_FROM_REC709), abs=2e-5) == found.T


@pytest.mark.parametrize("space", ["sRGB", "ACEScg", "g22_rec709_scene"])
def test_conversion_there_and_back_is_identity_and_keeps_alpha(space: str) -> None:
    rgba = np.concatenate([RAMP, RAMP[:, :1] * 0.5], 1)
    color = color_of(None, USD_DEFAULT_SPACE)
    back = color.to_working(color.from_working(rgba, space), space)
    assert back == pytest.approx(rgba, abs=5e-6)


def test_exposure_is_a_power_of_two_before_the_view() -> None:
    color = color_of(None, USD_DEFAULT_SPACE)
    assert color.display(RAMP, exposure=1.5) == pytest.approx(color.display(RAMP * 2**1.5), abs=1e-5)


def test_gamma_acts_on_display_codes() -> None:
    color = color_of(None, USD_DEFAULT_SPACE)
    plain = np.clip(color.display(RAMP), 0, None).astype(np.float64)
    assert color.display(RAMP, gamma=2.0) == pytest.approx(np.sqrt(plain), abs=2e-4)


def test_untonemapped_view_is_the_srgb_curve() -> None:
    found = color_of(None, USD_DEFAULT_SPACE).display(RAMP, view="Un-tone-mapped")
    assert srgb_to_linear(found) == pytest.approx(RAMP, abs=1e-4)


def test_inverse_view_of_display_white_is_far_too_bright_for_a_reflectance() -> None:
    white = np.ones((1, 3), np.float32)
    assert color_of(None, USD_DEFAULT_SPACE).display(white, invert=True) == pytest.approx(128, rel=0.01)


def test_pixels_that_are_not_finite_are_shown() -> None:
    shown = color_of(None, USD_DEFAULT_SPACE).display(np.array([[np.nan, np.inf, -np.inf]], np.float32))
    assert np.isfinite(shown).all()


def test_the_resolved_config_is_named() -> None:
    assert "cg-config" in color_of(None, USD_DEFAULT_SPACE).config_name
    assert color_of(None, USD_DEFAULT_SPACE).display_name in color_of(None, USD_DEFAULT_SPACE).displays()


def test_the_given_config_wins_over_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("OCIO", str(tmp_path / "none.ocio"))
    assert "cg-config" in color_of("ocio://default", USD_DEFAULT_SPACE).config_name
    with pytest.raises(InputError, match=r"none\.ocio.*\$OCIO"):
        color_of(None, USD_DEFAULT_SPACE)


@pytest.mark.parametrize("text", [None, "this is no config", ""])
def test_a_bad_config_is_one_sentence(text: str | None, tmp_path: Path) -> None:
    path = tmp_path / "bad.ocio"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError) as e:
        Color(str(path), USD_DEFAULT_SPACE)
    assert "bad.ocio" in str(e.value)
    assert "\n" not in str(e.value)


def test_unknown_names_are_errors() -> None:
    with pytest.raises(InputError, match="nonsense"):
        color_of(None, USD_DEFAULT_SPACE).to_working(RAMP, "nonsense")
    with pytest.raises(InputError, match="nonsense"):
        color_of(None, "nonsense")
    with pytest.raises(InputError, match="nonsense"):
        color_of(None, USD_DEFAULT_SPACE).display(RAMP, view="nonsense")
    with pytest.raises(InputError, match="channels"):
        color_of(None, USD_DEFAULT_SPACE).to_working(RAMP[:, :2], "sRGB")


def test_a_config_without_usd_names_still_reads_srgb(tmp_path: Path) -> None:
    path = tmp_path / "small.ocio"
    path.write_text(
        "ocio_profile_version: 2.1\n"
        "roles: {scene_linear: work, aces_interchange: aces, default: work}\n"
        "displays:\n  screen:\n    - !<View> {name: plain, colorspace: work}\n"
        "colorspaces:\n"
        "  - !<ColorSpace> {name: aces}\n"
        "  - !<ColorSpace>\n    name: work\n"
        "    to_scene_reference: !<BuiltinTransform> {style: ACEScg_to_ACES2065-1}\n"
    )
    color = Color(str(path), "work")
    expected = srgb_to_linear(RAMP) @ np.array(AP1_FROM_REC709).T
    assert color.to_working(RAMP, "sRGB") == pytest.approx(expected, abs=3e-5)
    assert color.display(RAMP) == pytest.approx(RAMP, abs=1e-5)
