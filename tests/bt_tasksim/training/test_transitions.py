"""Decisions as transitions: potentials from the leaf's own beginning, and the motion before."""

import numpy as np

from bt_tasksim.training.decision import Decision
from bt_tasksim.training.transitions import Transitions


def decision(leaf):
    return Decision(leaf, None, None, 0)


def test_potentials_count_from_the_first_decision():
    one = object()
    began = decision(one)
    transitions = Transitions(began, 0.9, 5.0)
    transitions.decided(np.array([0.1]))
    first = transitions.to(decision(one), 3.0)
    assert (first.before, first.after, first.gamma, first.end) == (0.0, 2.0, 0.9, "")
    assert first.last_motion is None and first.decision is began
    transitions.decided(np.array([0.2]))
    second = transitions.to(decision(one), 4.0)
    assert (second.before, second.after) == (2.0, 1.0) and second.last_motion == np.array([0.1])


def test_a_leaf_that_takes_over_starts_from_nothing():
    one, other = object(), object()
    transitions = Transitions(decision(one), 1.0, 5.0)
    transitions.decided(np.array([0.1]))
    assert transitions.to(decision(one), 3.0).after == 2.0
    transitions.decided(np.array([0.2]))
    over = transitions.to(decision(other), 9.0)
    assert (over.before, over.after) == (0.0, 0.0)
    transitions.decided(np.array([0.3]))
    assert transitions.to(decision(other), 8.0).last_motion is None


def test_at_the_end_the_potential_stays_or_falls_to_nothing():
    for kept, after in ((True, 2.0), (False, 0.0)):
        one = object()
        transitions = Transitions(decision(one), 1.0, 5.0)
        transitions.decided(np.array([0.1]))
        transitions.to(decision(one), 3.0)
        end = transitions.to_end("success", kept)
        assert (end.before, end.after, end.end) == (2.0, after, "success")
