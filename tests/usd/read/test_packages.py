"""Textures inside packages: within packages, with brackets in their names, and in tiles."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from pxr import Ar

from usdslf.color import color_of
from usdslf.scene.records import Texture
from usdslf.textures.files import split_package
from usdslf.textures.images import load_texture, sample_texture, unreadable
from usdslf.usd.read.read import read_scene

PATHS = [
    ["/a/b.png"],
    ["/a/b.usdz", "0/c.png"],
    ["/a/b.usdz", "0/p.usdz", "0/t.png"],
    ["/a/b.usdz", "0/p[2].usdz", "q.usdz", "0/a[1].png"],
    ["/a/b.usdz", "0/a[1].png"],
    ["/a/b.usdz", "a[.png"],
    ["/a/b.usdz", "a].png"],
    ["/folder[3]/b.usdz", "c.png"],
    ["/folder[3]/b.png"],
]


@pytest.mark.parametrize("names", PATHS)
def test_packages_are_split_as_the_resolver_joins_them(names: list[str]) -> None:
    path = Ar.JoinPackageRelativePath(names) if len(names) > 1 else names[0]
    assert split_package(path) == names
    assert split_package(path)[0] == (Ar.SplitPackageRelativePathOuter(path)[0] or path)


@pytest.mark.parametrize("path", ["a]", "[a]", "", "]", "a[b", "a\\]"])
def test_what_leads_into_no_package_is_a_name(path: str) -> None:
    assert split_package(path) == [path]


@pytest.mark.parametrize("name", ["n", "br", "p", "udim"])
def test_textures_of_packages_are_read(inputs: Path, name: str) -> None:
    scene = read_scene(inputs / "nested_package" / f"{name}.usdz")
    (texture,) = [v for m in scene.materials for v in vars(m).values() if isinstance(v, Texture)]
    assert load_texture(texture, color_of(None, "lin_rec709_scene")), texture.path
    assert not [w for w in scene.warnings if "texture" in w and "read" in w], scene.warnings


def test_a_damaged_package_inside_a_package_is_a_reason(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.usdz", "w") as archive:
        archive.writestr("b.usdz", b"PK no package")
    texture = Texture(prim="/t", path=f"{tmp_path}/a.usdz[b.usdz[c.png]]", fallback=(0.1, 0.2, 0.3, 1.0))
    color = color_of(None, "lin_rec709_scene")
    ((_, why),) = unreadable(texture, color)
    assert "c.png cannot be taken out of" in why
    np.testing.assert_allclose(sample_texture(texture, [[0.5, 0.5]], color)[0], (0.1, 0.2, 0.3, 1), atol=1e-6)
