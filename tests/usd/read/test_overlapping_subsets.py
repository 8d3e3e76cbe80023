"""GeomSubsets that overlap: what binds a material shows, and it is said."""

from __future__ import annotations

from pathlib import Path

from usdslf.usd.read.read import read_scene


def test_a_subset_that_binds_nothing_does_not_hide_one_that_does(inputs: Path) -> None:
    scene = read_scene(inputs / "weak" / "overlapping_subsets.usda")
    (mesh,) = scene.meshes
    shown = {scene.materials[m].path for m in mesh.material_of_triangle}
    assert shown == {"/World/g"}
    assert {mesh.subsets[i] for i in mesh.subset_of_triangle} == {"/World/card/b"}
    assert [w for w in scene.warnings if "/World/card overlap" in w]


def test_of_two_that_bind_the_first_one_shows(inputs: Path, tmp_path: Path) -> None:
    text = (inputs / "weak" / "overlapping_subsets.usda").read_text()
    of = 'uniform token elementType = "face"'
    assert of in text
    shot = tmp_path / "s.usda"
    text = text.replace(of, f"rel material:binding = </World/h>\n{of}", 1)
    material = text[text.index('def Material "g"') : text.rindex("}")].replace("/World/g", "/World/h")
    shot.write_text(text.rstrip()[:-1] + material.replace('"g"', '"h"') + "}\n")
    scene = read_scene(shot)
    assert {scene.materials[m].path for m in scene.meshes[0].material_of_triangle} == {"/World/h"}
