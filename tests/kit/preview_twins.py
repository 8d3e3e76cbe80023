"""Two stages of one shape: a foreign surface, and the UsdPreviewSurface that its look shall be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from kit.shader_nodes import Nodes
from numpy.testing import assert_allclose

FIELDS = (
    "diffuse", "f0", "f90", "roughness", "clearcoat", "clearcoat_roughness", "emission", "opacity", "presence",
)  # fmt: skip
STANDARD = "ND_standard_surface_surfaceshader"
OPEN_PBR = "ND_open_pbr_surface_surfaceshader"


def both(tmp_path: Path) -> tuple[Nodes, Nodes]:
    return Nodes(tmp_path / "foreign.usda"), Nodes(tmp_path / "twin.usda")


def check(foreign: Nodes, twin: Nodes, said: Sequence[str] = (), atol: float = 1e-5) -> None:
    got, words = foreign.made()
    wanted = twin.points()
    for name in FIELDS:
        assert_allclose(getattr(got, name), getattr(wanted, name), atol=atol, err_msg=name)
    assert len(words) == len(said), words
    for word, sentence in zip(said, words):
        assert word in sentence, words


def f0(ior: float) -> float:
    return ((ior - 1) / (ior + 1)) ** 2


CLOTH = (0.3, 0.2, 0.1)
