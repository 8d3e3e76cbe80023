"""Undo and redo are symmetric, whatever is done."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hydra_viewer.model.history import History


@given(st.lists(st.sampled_from(["do", "undo", "redo"]), max_size=40))
def test_undo_and_redo_walk_the_same_states(steps: list[str]) -> None:
    history, states, at = History(0), [0], 0  # a list of states and a place in it, as the plainest model
    for number, step in enumerate(steps, start=1):
        if step == "do":
            history.do(f"step {number}", number)
            states = [*states[: at + 1], number]
            at += 1
        elif step == "undo":
            assert history.undo() == (at > 0)
            at = max(at - 1, 0)
        else:
            assert history.redo() == (at < len(states) - 1)
            at = min(at + 1, len(states) - 1)
        assert history.now == states[at]
        assert bool(history.undoes) == (at > 0) and bool(history.redoes) == (at < len(states) - 1)
        assert not history.redoes or history.redoes == f"step {states[at + 1]}"
