"""Solved reflectance -> input opinions: they mean what was solved, in the fewest inputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from reference.preview_surface_inputs import fresnel_at_normal, reflectance

from usdslf.edits.edits import (
    InputEdit,
    MaterialChange,
    Reflectance,
    affine_map,
    inferred,
    material_change_to_input_edits,
)
from usdslf.errors import AuthorError
from usdslf.scene.records import Material, PrimvarInput, Texture, constant
from usdslf.surfaces.preview_surface import ior_for

RED = (0.6, 0.2, 0.1)
GOLD = (1.0, 0.78, 0.34)
FIELDS = {
    "diffuseColor": "diffuse_color",
    "metallic": "metallic",
    "ior": "ior",
    "specularColor": "specular_color",
    "roughness": "roughness",
    "clearcoat": "clearcoat",
}


def material_of(**inputs: Any) -> Material:
    values: dict[str, Any] = {}
    for name, value in inputs.items():
        if name == "useSpecularWorkflow":
            values["use_specular_workflow"] = bool(value)
        elif isinstance(value, Texture | PrimvarInput):
            values[FIELDS[name]] = value
        else:
            values[FIELDS[name]] = constant(*np.ravel(value))
    return Material("/mtl", **values)


def as_reflectance(**inputs: Any) -> Reflectance:
    r = reflectance(**{k: v for k, v in inputs.items() if k != "clearcoat"})
    return Reflectance(np.array(r["d"]), np.array(r["f0"]), r["roughness"])


def solve(inputs: dict, freed: str, d: Any = None, f0: Any = None, roughness: Any = None) -> list[InputEdit]:
    before = as_reflectance(**inputs)
    after = Reflectance(
        before.diffuse if d is None else np.array(d, float),
        before.f0 if f0 is None else np.array(f0, float),
        before.roughness if roughness is None else roughness,
    )
    names = tuple(freed.split("+"))
    change = MaterialChange(material_of(**inputs), "material", ("/a",), names, before, after)
    return material_change_to_input_edits(change)


def check_meaning(inputs: dict, edits: list[InputEdit], d: Any, f0: Any, roughness: float) -> None:
    """The inputs with their edits give the wanted reflectance within 1 %, by the shader's own formulas."""
    known = {k: v for k, v in inputs.items() if k != "clearcoat"}
    got = reflectance(**known | {e.input: e.after for e in edits})
    assert_allclose(got["d"], d, rtol=0.01, atol=1e-5)
    assert_allclose(got["f0"], f0, rtol=0.01, atol=1e-5)
    assert_allclose(got["roughness"], roughness, atol=1e-6)


# inputs, freed, wanted d, wanted F0, the inputs that may be written
DIELECTRIC = {"diffuseColor": RED}
HALF = {"diffuseColor": (0.5, 0.4, 0.2), "metallic": 0.5}
METAL = {"diffuseColor": GOLD, "metallic": 1.0}
SPECULAR = {"diffuseColor": RED, "useSpecularWorkflow": 1, "specularColor": (0.1, 0.05, 0.02)}
AS_HALF_GREEN = as_reflectance(diffuseColor=(0.2, 0.6, 0.2), metallic=0.5)
RULES = [
    (DIELECTRIC, "diffuse", (0.1, 0.3, 0.5), (0.04,) * 3, {"diffuseColor"}),
    (DIELECTRIC, "specular", RED, (0.2,) * 3, {"ior"}),
    (DIELECTRIC, "specular", RED, (0.0,) * 3, {"ior"}),
    (DIELECTRIC, "diffuse+specular", (0.1, 0.3, 0.5), (0.5,) * 3, {"diffuseColor", "ior"}),
    (DIELECTRIC, "specular", RED, (0.3, 0.1, 0.05), {"useSpecularWorkflow", "specularColor"}),
    (DIELECTRIC, "diffuse+specular", (0.0,) * 3, GOLD, {"diffuseColor", "metallic"}),
    (METAL, "specular", (0.0,) * 3, (0.6, 0.6, 0.7), {"diffuseColor"}),
    (METAL, "diffuse", (0.2, 0.1, 0.05), GOLD, {"useSpecularWorkflow", "specularColor", "diffuseColor"}),
    (METAL, "diffuse+specular", RED, (0.04,) * 3, {"diffuseColor", "metallic"}),
    (HALF, "diffuse+specular", AS_HALF_GREEN.diffuse, AS_HALF_GREEN.f0, {"diffuseColor"}),
    (HALF, "diffuse+specular", (0.5, 0.4, 0.2), (0.04,) * 3, {"metallic"}),
    (HALF, "diffuse", (0.4, 0.1, 0.1), None, {"useSpecularWorkflow", "specularColor", "diffuseColor"}),
    (SPECULAR, "diffuse", (0.1, 0.3, 0.5), (0.1, 0.05, 0.02), {"diffuseColor"}),
    (SPECULAR, "specular", RED, (0.5, 0.4, 0.3), {"specularColor"}),
    (SPECULAR, "diffuse+specular", (0.1, 0.3, 0.5), (0.5, 0.4, 0.3), {"diffuseColor", "specularColor"}),
]


@pytest.mark.parametrize(("inputs", "freed", "d", "f0", "written"), RULES)
def test_workflow_rule(inputs: dict, freed: str, d: Any, f0: Any, written: set[str]) -> None:
    f0 = as_reflectance(**inputs).f0 if f0 is None else f0
    edits = solve(inputs, freed, d, f0)
    check_meaning(inputs, edits, d, f0, 0.5)
    assert {e.input for e in edits} == written
    assert all(e.representation == "constant" for e in edits)


@pytest.mark.parametrize("inputs", [DIELECTRIC, METAL, HALF, SPECULAR])
def test_glossiness_is_one_opinion_in_every_workflow(inputs: dict) -> None:
    edits = solve(inputs, "glossiness", roughness=0.15)
    assert [e.input for e in edits] == ["roughness"]
    r = as_reflectance(**inputs)
    check_meaning(inputs, edits, r.diffuse, r.f0, 0.15)


@pytest.mark.parametrize("inputs", [DIELECTRIC, METAL, HALF, SPECULAR])
def test_nothing_is_written_for_what_stays_or_was_not_freed(inputs: dict) -> None:
    assert solve(inputs, "diffuse+specular+glossiness") == []
    assert solve(inputs, "none", (0.9, 0.1, 0.9), (0.9,) * 3, 0.9) == []
    assert {e.input for e in solve(inputs, "glossiness", (0.9, 0.1, 0.9), (0.9,) * 3, 0.9)} == {"roughness"}


def test_a_clear_coat_keeps_its_ior() -> None:
    edits = solve(DIELECTRIC | {"clearcoat": 1.0}, "specular", RED, (0.2,) * 3)
    assert {e.input for e in edits} == {"useSpecularWorkflow", "specularColor"}
    check_meaning(DIELECTRIC, edits, RED, (0.2,) * 3, 0.5)


def test_switching_the_workflow_writes_the_whole_equivalent_set() -> None:
    inputs = {"diffuseColor": (0.5, 0.4, 0.2), "metallic": 0.5}
    f0 = as_reflectance(**inputs).f0
    edits = {e.input: e for e in solve(inputs, "diffuse", (0.4, 0.1, 0.1), f0)}
    assert edits["useSpecularWorkflow"].after == 1
    assert_allclose(edits["specularColor"].after, f0, rtol=1e-6)
    assert_allclose(edits["diffuseColor"].after, (0.4, 0.1, 0.1), rtol=1e-6)


unit = st.floats(0, 1, width=32)
color = st.tuples(unit, unit, unit)


@settings(max_examples=40, deadline=None)
@given(color, unit, st.floats(1, 3), color, unit, st.floats(1, 3), st.booleans())
def test_any_reachable_reflectance_is_said_within_one_percent(
    c: Any, m: float, ior: float, c2: Any, m2: float, ior2: float, specular: bool
) -> None:
    inputs: dict[str, Any] = {"diffuseColor": c, "metallic": m, "ior": ior}
    if specular:
        wanted = as_reflectance(diffuseColor=c2, useSpecularWorkflow=1, specularColor=(m2, ior2 / 3, c[0]))
    else:
        wanted = as_reflectance(diffuseColor=c2, metallic=m2, ior=ior2)
    edits = solve(inputs, "diffuse+specular", wanted.diffuse, wanted.f0)
    got = reflectance(**inputs | {e.input: e.after for e in edits})
    for name, want in (("d", wanted.diffuse), ("f0", wanted.f0)):
        assert_allclose(got[name], want, atol=0.01 * max(want.max(), 0.05))


@settings(max_examples=15, deadline=None)
@given(color, unit, st.floats(1, 3), color, unit)
@example((0.0, 0.0, 0.0), 0.0, 1.0, (0.0, 0.0, 0.75), 0.99999)
def test_the_metal_workflow_stays_where_it_can_say_the_change(
    c: Any, m: float, ior: float, c2: Any, m2: float
) -> None:
    wanted = as_reflectance(diffuseColor=c2, metallic=m2, ior=ior)
    inputs = {"diffuseColor": c, "metallic": m, "ior": ior}
    edits = solve(inputs, "diffuse+specular", wanted.diffuse, wanted.f0)
    assert "useSpecularWorkflow" not in {e.input for e in edits}


@pytest.mark.parametrize("ior", [1.0, 1.3, 1.5, 2.4, 10.0])
def test_ior_and_reflectance_are_each_others_inverse(ior: float) -> None:
    assert_allclose(ior_for(reflectance(ior=ior)["f0"][0]), ior, rtol=1e-9)
    if ior > 1:
        assert_allclose(reflectance(ior=ior)["f0"][0], fresnel_at_normal(ior), rtol=1e-5)


# ---- textured inputs ---------------------------------------------------------------------------

TEXTURE = Texture("/mtl/tex", "x.png")


@pytest.mark.parametrize("kind", ["auto", "add", "multiply"])
@pytest.mark.parametrize("mean", [0.0, 0.2, 0.7, 1.0])
@pytest.mark.parametrize("target", [0.0, 0.2, 0.35, 0.9, 1.0])
def test_affine_map_takes_the_mean_to_the_target_within_range(mean: float, target: float, kind: str) -> None:
    scale, bias = affine_map(mean, target, 1, kind)
    assert_allclose(mean * scale + bias, target, atol=1e-5)
    if kind == "add":
        assert scale == 1
    if kind == "multiply" and mean > 0.002:
        assert bias == 0
    if kind == "auto":
        assert min(bias, scale + bias) >= -1e-5 and max(bias, scale + bias) <= 1 + 1e-5


def test_a_brighter_texture_with_room_is_a_scale() -> None:
    assert affine_map(0.2, 0.4, 0.5) == (2.0, 0.0)


@pytest.mark.parametrize("kind", ["auto", "multiply"])
def test_a_black_texture_is_not_scaled(kind: str) -> None:
    """A roughness is read as 0.001 at least: what is 0 stays so whatever its scale."""
    scale, bias = affine_map(0.001, 0.3, 0.001, kind)
    assert scale == 1
    assert_allclose(bias, 0.3, atol=0.002)


@pytest.mark.parametrize("mean", [None, (0.5, 0.4, 0.2)])
def test_a_textured_colour_is_scaled_channel_by_channel(mean: Any) -> None:
    before = Reflectance(np.array((0.5, 0.4, 0.2)), np.full(3, 0.04), 0.5)
    after = Reflectance(np.array((0.25, 0.4, 0.6)), np.full(3, 0.04), 0.5)
    means = {} if mean is None else {"diffuseColor": mean}
    change = MaterialChange(
        material_of(diffuseColor=TEXTURE), "material", (), ("diffuse",), before, after, means=means
    )
    (edit,) = material_change_to_input_edits(change)
    assert (edit.representation, edit.source, edit.channels) == ("scale", "/mtl/tex", "rgb")
    assert_allclose(np.multiply(edit.scale, before.diffuse) + edit.bias, after.diffuse, atol=1e-6)
    assert_allclose(edit.scale[:2], (0.5, 1.0))


def test_a_textured_metallic_is_read_off_the_mean_reflectance() -> None:
    """The mean surface of metallic 0.3 shows; a change of colour keeps the metal workflow and the texture."""
    r = as_reflectance(diffuseColor=RED, metallic=0.3)
    wanted = as_reflectance(diffuseColor=(0.3, 0.5, 0.1), metallic=0.3)
    material = material_of(diffuseColor=TEXTURE, metallic=Texture("/mtl/m", "m.png", channels="b"))
    change = MaterialChange(material, "material", (), ("diffuse", "specular"), r, wanted)
    edits = {e.input: e for e in material_change_to_input_edits(change)}
    assert "useSpecularWorkflow" not in edits
    m = edits["metallic"].after if "metallic" in edits else 0.3
    got = reflectance(diffuseColor=edits["diffuseColor"].after, metallic=m)
    assert_allclose(got["d"], wanted.diffuse, rtol=0.03)
    assert_allclose(got["f0"], wanted.f0, rtol=0.03)


def test_switching_the_workflow_of_a_textured_metal_scales_its_colour_by_what_is_diffuse() -> None:
    r = as_reflectance(diffuseColor=RED, metallic=0.25)
    after = Reflectance(r.diffuse, np.array([0.5, 0.1, 0.1]), 0.5)
    material = material_of(diffuseColor=TEXTURE, metallic=0.25)
    change = MaterialChange(material, "material", (), ("specular",), r, after)
    edits = {e.input: e for e in material_change_to_input_edits(change)}
    assert edits["useSpecularWorkflow"].after == 1
    assert_allclose(edits["diffuseColor"].scale, (0.75,) * 3, rtol=1e-6)
    assert_allclose(edits["specularColor"].after, after.f0, rtol=1e-6)


def test_textured_roughness_moves_its_mean() -> None:
    r = as_reflectance(roughness=0.6)
    after = Reflectance(r.diffuse, r.f0, 0.3)
    material = material_of(roughness=Texture("/mtl/r", "r.png", channels="g"))
    change = MaterialChange(material, "material", (), ("glossiness",), r, after)
    (edit,) = material_change_to_input_edits(change)
    assert (edit.channels, edit.scale, edit.bias) == ("g", (0.5,), (0.0,))


def test_a_primvar_is_mapped_like_a_texture() -> None:
    r = as_reflectance(diffuseColor=(0.5, 0.4, 0.2))
    after = Reflectance(r.diffuse * 0.5, r.f0, 0.5)
    material = material_of(diffuseColor=PrimvarInput("displayColor", (0.18, 0.18, 0.18)))
    (edit,) = material_change_to_input_edits(
        MaterialChange(material, "material", (), ("diffuse",), r, after)
    )
    assert (edit.representation, edit.source) == ("primvar", "displayColor")
    assert_allclose(edit.scale, (0.5,) * 3, rtol=1e-6)


def test_transparent_surfaces_give_back_their_opacity() -> None:
    material = Material("/m", diffuse_color=constant(0.5, 0.4, 0.2), opacity=constant(0.5))
    before = Reflectance(np.array((0.25, 0.2, 0.1)), np.full(3, 0.04), 0.5)
    after = Reflectance(np.array((0.1, 0.2, 0.1)), np.full(3, 0.04), 0.5)
    change = MaterialChange(material, "material", (), ("diffuse",), before, after)
    (edit,) = material_change_to_input_edits(change)
    assert_allclose(edit.after, (0.2, 0.4, 0.2), rtol=1e-6)


def test_a_colour_that_a_map_of_opacity_is_seen_through_changes_as_seen() -> None:
    """Seen is (.4, .2, .1): half of (.8, .4, .2).  To be seen as half of that it halves."""
    opacity = Texture("/m/t", "t.png", channels="a")
    material = Material("/m", diffuse_color=constant(0.8, 0.4, 0.2), opacity=opacity)
    before = Reflectance(np.array((0.4, 0.2, 0.1)), np.full(3, 0.04), 0.5)
    after = Reflectance(np.array((0.2, 0.1, 0.05)), np.full(3, 0.04), 0.5)
    (edit,) = material_change_to_input_edits(
        MaterialChange(material, "material", (), ("diffuse",), before, after)
    )
    assert_allclose(edit.after, (0.4, 0.2, 0.1), rtol=1e-6)


def test_what_cannot_be_edited_says_why() -> None:
    r = as_reflectance()
    material = Material("/m", why_not_editable="it has no UsdPreviewSurface")
    with pytest.raises(AuthorError, match="no UsdPreviewSurface"):
        material_change_to_input_edits(MaterialChange(material, "material", (), ("diffuse",), r, r))
    bad = Reflectance(np.array([np.nan, 0, 0]), r.f0, 0.5)
    with pytest.raises(AuthorError, match="not finite"):
        material_change_to_input_edits(MaterialChange(Material("/m"), "material", (), ("diffuse",), r, bad))


def test_inferred_names_follow_one_order() -> None:
    assert inferred(("glossiness", "diffuse")) == "diffuse+glossiness"
    assert inferred(()) == "none"
