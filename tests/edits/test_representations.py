"""Maps that say what is metal keep their meaning, whatever changes: what usd-core composes, texel by texel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.eyelets import BRASS, CARD, CLOTH, MATERIAL, N, composed, maps, reflects, write_eyelets
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from usdslf.color import color_of
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.edits.representations import least_collateral
from usdslf.edits.whole_set import Colored, colored_specular
from usdslf.errors import AuthorError
from usdslf.scene.records import Material, PrimvarInput, Texture, constant
from usdslf.usd.author.author import author_look
from usdslf.usd.read.read import open_stage, read_scene

METAL = maps()[1] > 0
CLOTH_SEEN = Reflectance(np.array(CLOTH) * 0.875, np.full(3, 0.04), 0.7)
BRASS_SEEN = Reflectance(np.zeros(3), np.array(BRASS), 0.25)


def inner(mask: NDArray) -> NDArray:
    """Texels whose neighbours are of the same kind: between kinds, maps are filtered."""
    same = [np.roll(mask, s, a) for a in (0, 1) for s in (-1, 1)]
    return mask & np.logical_and.reduce(same)


def written(folder: Path, painted: Reflectance, freed: str, options: dict[str, Any], **after: Any) -> tuple:
    """Writes a change of what was painted; returns d and F0 (N, N, 3) before and after, and what was said."""
    stage = write_eyelets(folder, **options)
    scene = read_scene(stage)
    change = MaterialChange(
        scene.materials[0], "material", (CARD,), tuple(freed.split("+")), painted,
        replace(painted, **{k: np.array(v) for k, v in after.items()}), map="add",
    )  # fmt: skip
    said: list[str] = []
    color = color_of(scene.ocio, scene.working_space)
    change = least_collateral(scene, 0, change, folder / "look.textures" / "cloth", color, said)
    author_look(open_stage(stage), [change], folder / "look.usda", color=color)
    plain = composed(stage)
    return reflects(plain), reflects(composed(stage, folder / "look.usda")), change


@pytest.mark.parametrize(
    "options",
    [{}, {"wrap": "clamp"}, {"base": (0.3, 0.4, 0.5)}, {"scale": (1, 1, 0.9, 1)}, {"ior": 1.5, "wrap": "mirror"}],
)
def test_a_coloured_specular_of_cloth_is_written_as_the_whole_set(tmp_path: Path, options: dict) -> None:
    (d, f0), (new_d, new_f0), change = written(tmp_path, CLOTH_SEEN, "specular", options, f0=(0.1, 0.08, 0.25))
    assert sorted(change.baked) == ["diffuseColor", "specularColor"]
    assert_allclose(new_d[inner(~METAL)], d[inner(~METAL)], atol=0.01)
    assert_allclose(
        new_f0[inner(~METAL)] - f0[inner(~METAL)],
        np.broadcast_to((0.06, 0.04, 0.21), f0.shape)[inner(~METAL)],
        atol=2e-3,
    )
    assert_allclose(new_d[inner(METAL)], d[inner(METAL)], atol=2e-3)
    as_metal = options.get("scale", (1, 1, 1))[2]  # what is no metal of it changes with the cloth
    assert_allclose(new_f0[inner(METAL)], f0[inner(METAL)], atol=0.21 * (1 - as_metal) + 2e-3)


def test_new_textures_declare_their_outputs_as_what_they_are_like(tmp_path: Path) -> None:
    """Some stages say vector3f of a texture's rgb: two types of one output are an error to validators."""
    stage = write_eyelets(tmp_path)
    stage.write_text(stage.read_text().replace("float3 outputs:rgb", "vector3f outputs:rgb"))
    scene = read_scene(stage)
    after = replace(CLOTH_SEEN, f0=np.array((0.1, 0.08, 0.25)))
    change = MaterialChange(scene.materials[0], "material", (CARD,), ("specular",), CLOTH_SEEN, after, map="add")
    color = color_of(scene.ocio, scene.working_space)
    change = least_collateral(scene, 0, change, tmp_path / "look.textures" / "cloth", color, [])
    author_look(open_stage(stage), [change], tmp_path / "look.usda", color=color)
    shown = composed(stage, tmp_path / "look.usda")
    prims = [p for p in shown.Traverse() if p.HasAttribute("outputs:rgb")]
    said = [{str(x.typeName) for x in p.GetAttribute("outputs:rgb").GetPropertyStack()} for p in prims]
    assert len(prims) > 1 and said == [{"vector3f"}] * len(prims)


def test_a_grey_specular_of_cloth_is_an_ior(tmp_path: Path) -> None:
    (d, f0), (new_d, new_f0), change = written(tmp_path, CLOTH_SEEN, "specular", {}, f0=(0.12,) * 3)
    assert not change.baked
    assert_allclose(new_d, d, atol=1e-6)
    assert_allclose(new_f0[~METAL], 0.12, atol=1e-4)
    assert_allclose(new_f0[METAL], f0[METAL], atol=1e-5)


@pytest.mark.parametrize("wanted", [(0.5, 0.1, 0.1), (0.05, 0.05, 0.1)])
@pytest.mark.parametrize("options", [{}, {"base": (0.3, 0.4, 0.5)}])
def test_a_diffuse_change_of_cloth_leaves_the_metal(tmp_path: Path, options: dict, wanted: tuple) -> None:
    (d, f0), (new_d, new_f0), change = written(tmp_path, CLOTH_SEEN, "diffuse", options, diffuse=wanted)
    assert sorted(change.baked) == ["diffuseColor"]
    step = np.array(wanted) - CLOTH_SEEN.diffuse
    assert_allclose(new_d[inner(~METAL)], np.clip(d[inner(~METAL)] + step, 0, 1), atol=0.01)
    assert_allclose(new_f0[inner(METAL)], f0[inner(METAL)], atol=2e-3)
    assert_allclose(new_f0[inner(~METAL)], 0.04, atol=1e-3)


def test_a_specular_change_of_the_metal_leaves_the_cloth(tmp_path: Path) -> None:
    wanted = (0.8, 0.4, 0.35)
    (d, f0), (new_d, new_f0), change = written(tmp_path, BRASS_SEEN, "specular", {}, f0=wanted)
    assert sorted(change.baked) == ["diffuseColor"]
    assert_allclose(new_d[inner(~METAL)], d[inner(~METAL)], atol=0.01)
    assert_allclose(new_f0[inner(METAL)], np.broadcast_to(wanted, f0.shape)[inner(METAL)], atol=2e-3)


def test_under_a_clear_coat_the_ior_stays(tmp_path: Path) -> None:
    """It drives the coat too: a grey specular colour is written as the whole set."""
    _, (_, new_f0), change = written(tmp_path, CLOTH_SEEN, "specular", {"clearcoat": 1.0}, f0=(0.12,) * 3)
    assert sorted(change.baked) == ["diffuseColor", "specularColor"]
    assert_allclose(new_f0[inner(~METAL)], 0.12, atol=2e-3)


def test_the_maps_of_a_tiled_set_become_a_tiled_set(tmp_path: Path) -> None:
    (_, _), _, change = written(tmp_path, CLOTH_SEEN, "specular", {"tiles": 2}, f0=(0.1, 0.08, 0.25))
    assert all("<UDIM>" in b.file for b in change.baked.values())
    stage = tmp_path / "stage.usda"
    shot, look = composed(stage), composed(stage, tmp_path / "look.usda")
    for tile, metal in ((0, METAL), (1, METAL[::-1])):
        (d, f0), (new_d, new_f0) = reflects(shot, tile), reflects(look, tile)
        assert_allclose(new_f0[inner(metal)], f0[inner(metal)], atol=2e-3)
        assert_allclose(new_d[inner(~metal)], d[inner(~metal)], atol=0.01)
        assert_allclose(
            new_f0[inner(~metal)] - 0.04, np.broadcast_to((0.06, 0.04, 0.21), f0.shape)[inner(~metal)], atol=2e-3
        )


def test_what_cannot_be_written_without_spoiling_is_refused(tmp_path: Path) -> None:
    scene = read_scene(write_eyelets(tmp_path))
    odd = replace(scene.materials[0], metallic=replace(scene.materials[0].metallic, wrap_s="clamp"))
    change = MaterialChange(
        odd, "material", (CARD,), ("specular",), CLOTH_SEEN, replace(CLOTH_SEEN, f0=np.array((0.1, 0.08, 0.25)))
    )
    with pytest.raises(AuthorError, match=f"{MATERIAL} stays: .*wrap modes that differ"):
        least_collateral(
            replace(scene, materials=(odd,)), 0, change, tmp_path / "t", color_of("", scene.working_space), []
        )
    assert not (tmp_path / "t").exists()


def test_what_a_coloured_specular_takes() -> None:
    t = Texture("/m/t", "a.exr")
    plain, metal = Material("/m"), Texture("/m/p", "b.exr", channels="b")
    assert colored_specular(plain) is Colored.FREE
    assert colored_specular(replace(plain, diffuse_color=t, metallic=constant(0.5))) is Colored.FREE
    assert colored_specular(replace(plain, diffuse_color=t, metallic=metal)) is Colored.MAPS
    assert colored_specular(replace(plain, diffuse_color=t, metallic=PrimvarInput("m", (0.0,)))) is Colored.NEVER
    other = replace(metal, uv_set="st1")
    assert colored_specular(replace(plain, diffuse_color=t, metallic=other)) is Colored.NEVER
    assert colored_specular(replace(plain, use_specular_workflow=True, metallic=other)) is Colored.FREE


def test_kit_maps_are_both_kinds() -> None:
    assert inner(METAL).sum() > 50 and inner(~METAL).sum() > N * N // 2
