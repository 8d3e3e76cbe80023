"""Explanations that could not be written without spoiling maps are left out, or cost what they take."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from kit.eyelets import CARD, CLOTH, write_eyelets
from kit.stage_parts import StageBuilder, rectangle

import usdslf
from usdslf.color import color_of
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.edits.whole_set import Colored
from usdslf.errors import AuthorError
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.changes import with_varying
from usdslf.inference.solve import score
from usdslf.inference.weights import Options
from usdslf.strokes.paint import paint_stroke
from usdslf.usd.read.read import read_scene

SEEN = Reflectance(np.array(CLOTH), np.full(3, 0.04), 0.7)
BLUE = replace(SEEN, f0=np.array((0.06, 0.06, 0.3)))


def plain_card(folder: Path) -> Path:
    b = StageBuilder(folder)
    b.mesh("card", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), b.material("cloth", diffuseColor=CLOTH))
    b.dome_light("dome", 1.0)
    b.camera((0, 3, 0.01), (0, 0, 0), 45)
    return b.save()


def answers_of(stage: Path) -> tuple[Tables, list[Candidate]]:
    """What a bright blue stroke between the eyelets asks for."""
    session = usdslf.open(str(stage), elements=200, bounces=2)
    path = np.stack([np.linspace(0.47, 0.53, 8), np.full(8, 0.5)], 1)
    session.add_stroke(paint_stroke(session.scene, session.tracer, session.camera(), [path], 0.01, (0.15, 0.2, 0.95)))
    (answer,) = session.solve(options=Options.of({"kind": 0.0}))  # colours are not odd
    return answer.tables, list(answer.candidates)


def with_color(candidates: list[Candidate]) -> list[Candidate]:
    return [c for c in candidates if np.ptp(c.delta_f0) > 1e-6]


def test_where_maps_leave_only_an_ior_nothing_asks_for_a_coloured_highlight(tmp_path: Path) -> None:
    for name in ("plain", "maps", "never"):
        (tmp_path / name).mkdir()
    assert with_color(answers_of(plain_card(tmp_path / "plain"))[1])
    assert with_color(answers_of(write_eyelets(tmp_path / "maps"))[1])
    candidates = answers_of(write_eyelets(tmp_path / "never", packed_wrap="clamp"))[1]
    assert not with_color(candidates) and {"specular", "diffuse+specular"} <= {c.id for c in candidates}


def test_a_coloured_highlight_that_takes_the_place_of_maps_is_twice_as_odd(tmp_path: Path) -> None:
    o = Options()
    tables, candidates = answers_of(plain_card(tmp_path))
    colored = replace(next(c for c in with_color(candidates) if c.id == "specular"), level=tables.own)
    grey = replace(colored, delta_f0=np.full(3, 0.1))
    maps = replace(tables, colored=Colored.MAPS)
    assert score(maps, o, colored) == pytest.approx(score(tables, o, colored) + o.kind)
    assert score(maps, o, grey) == score(tables, o, grey)


def asking(material: int, of: MaterialChange, alike: tuple[int, ...]) -> Any:
    """An answer of one offset, as far as its writing looks at it."""
    chosen = Candidate(of.freed, delta_f0=of.after.f0 - of.before.f0)
    return SimpleNamespace(
        chosen=chosen, varying=None, onto_similar=None,
        pool=SimpleNamespace(material=material, similar=alike, similar_in_part=()),
    )  # fmt: skip


def test_what_is_similar_stays_where_its_maps_would_be_spoilt(tmp_path: Path) -> None:
    """The painted material has constants; the similar one has maps that only an ior leaves what they mean."""
    scene = read_scene(write_eyelets(tmp_path, packed_wrap="clamp"))
    plain = replace(scene.materials[0], path="/World/mtl/plain", metallic=np.zeros(1, np.float32))
    card = replace(scene.meshes[0], material_of_triangle=np.array([0, 1], np.int32))
    scene = replace(scene, materials=(plain, scene.materials[0]), meshes=(card,))
    changes = [MaterialChange(m, "material", (CARD,), ("specular",), SEEN, BLUE, map="add") for m in scene.materials]
    said: list[str] = []
    color = color_of(scene.ocio, scene.working_space)
    found = with_varying(changes, [asking(0, changes[0], (1,))], scene, tmp_path / "t", color, said)
    assert [c.material.path for c in found] == ["/World/mtl/plain"]
    assert "/World/mtl/cloth stays" in said[-1] and "wrap modes that differ" in said[-1]
    with pytest.raises(AuthorError, match="/World/mtl/cloth stays"):  # what was painted is not passed over
        with_varying(changes[1:], [asking(1, changes[1], ())], scene, tmp_path / "t", color, said)
