"""The ids of explanations: what reports say and what an artist may choose by."""

from __future__ import annotations

import pytest

from usdslf.inference.explanations import Meaning


@pytest.mark.parametrize(
    ("meaning", "said", "names", "others"),
    [
        (Meaning("none"), "none", ["none"], ["", "none of /ring"]),
        (
            Meaning("specular+glossiness", "/World/mtl/ring"),
            "specular+glossiness of /World/mtl/ring",
            ["specular+glossiness", "specular+glossiness@/World/mtl/ring", "specular+glossiness of /World/mtl/ring"],
            ["specular", "/World/mtl/ring", "specular+glossiness@/World/mtl", "specular+glossiness@"],
        ),
        (
            Meaning("diffuse", "all in sight"),
            "diffuse of all in sight",
            ["diffuse", "diffuse@all in sight", "diffuse of all in sight"],
            ["diffuse of all"],
        ),
    ],
)
def test_an_explanation_is_called_by_its_id_or_by_its_parameters(
    meaning: Meaning, said: str, names: list[str], others: list[str]
) -> None:
    assert str(meaning) == said
    assert all(meaning.is_called(name) for name in names)
    assert not any(meaning.is_called(name) for name in others)
