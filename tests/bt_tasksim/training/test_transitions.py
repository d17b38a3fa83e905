"""Decisions as transitions: potentials from the leaf's own beginning, and the motion before."""

from types import SimpleNamespace

import numpy as np

from bt_tasksim.concept.leaf import Decision
from bt_tasksim.training.transitions import Transitions


def leaf():
    return SimpleNamespace(model=SimpleNamespace(necessary_cost=lambda seen, memory: np.array([seen])))


def test_potentials_count_from_the_first_decision():
    one = leaf()
    transitions = Transitions(Decision(one, 5.0, None), 0.9)
    transitions.decided(np.array([0.1]))
    first = transitions.to(Decision(one, 3.0, None))
    assert (first.before, first.after, first.gamma, first.end) == (0.0, 2.0, 0.9, "")
    assert first.last_motion is None and first.decision.seen == 5.0
    transitions.decided(np.array([0.2]))
    second = transitions.to(Decision(one, 4.0, None))
    assert (second.before, second.after) == (2.0, 1.0) and second.last_motion == np.array([0.1])


def test_a_leaf_that_takes_over_starts_from_nothing():
    one, other = leaf(), leaf()
    transitions = Transitions(Decision(one, 5.0, None), 1.0)
    transitions.decided(np.array([0.1]))
    assert transitions.to(Decision(one, 3.0, None)).after == 2.0
    transitions.decided(np.array([0.2]))
    over = transitions.to(Decision(other, 9.0, None))
    assert (over.before, over.after) == (0.0, 0.0)
    transitions.decided(np.array([0.3]))
    assert transitions.to(Decision(other, 8.0, None)).last_motion is None


def test_at_the_end_the_potential_stays_or_falls_to_nothing():
    for kept, after in ((True, 2.0), (False, 0.0)):
        one = leaf()
        transitions = Transitions(Decision(one, 5.0, None), 1.0)
        transitions.decided(np.array([0.1]))
        transitions.to(Decision(one, 3.0, None))
        end = transitions.to_end("success", kept)
        assert (end.before, end.after, end.end) == (2.0, after, "success")
