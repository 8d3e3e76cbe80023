"""Remarks: sentences about strokes that stay what they are wherever sentences go."""

from __future__ import annotations

import copy
import json
import pickle

from usdslf.strokes.remarks import About, Remark


def test_a_remark_is_its_sentence_and_knows_its_strokes_when_it_is_copied() -> None:
    said = Remark(("/a", "/b"), "too bright: by 2", About.PAINT)
    assert said == "/a, /b: too bright: by 2" and json.dumps([said]) == '["/a, /b: too bright: by 2"]'
    for other in (said, copy.copy(said), copy.deepcopy(said), pickle.loads(pickle.dumps(said))):
        assert other == said and (other.strokes, other.what, other.about) == (("/a", "/b"), said.what, About.PAINT)
