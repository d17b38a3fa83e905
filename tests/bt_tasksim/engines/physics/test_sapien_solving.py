"""The solver works longer on what is held far from its centre of mass or by many fingers, on nothing else."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.engines.physics.sapien_solving import LEVER, LONG, MANY, Solving

USUAL = 15
TOOL = np.array([0.0, 0.0, 0.1])
places = st.tuples(*[st.floats(-0.2, 0.2)] * 3)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


class Pose(SimpleNamespace):
    """A pose of SAPIEN's."""

    def __getstate__(self):
        return tuple(self.numbers)


def pose(point, turn=(0.0, 0.0, 0.0)):
    return Pose(numbers=[*point, *poses.from_rotation_vector(np.array(turn)).tolist()])


def body(at, centre=(0.0, 0.0, 0.0), iterations=USUAL):
    """Something in PhysX that knows how long the solver works on it."""
    found = SimpleNamespace(entity_pose=at, iterations=iterations)
    found.get_cmass_local_pose = lambda: pose(centre)
    found.get_solver_position_iterations = lambda: found.iterations
    found.set_solver_position_iterations = lambda n: setattr(found, "iterations", n)
    return found


@given(places, turns, places)
def test_it_works_longer_the_farther_the_centre_of_mass_is_wherever_the_hand_may_be(point, turn, away):
    hand = body(pose(point, turn))
    tool = poses.transform(np.array(hand.entity_pose.numbers), TOOL)
    thing, other = body(pose(tool), centre=away), body(pose(tool), centre=(0.2, 0.0, 0.0))
    solving = Solving(hand, TOOL, [thing, other])
    solving.look([30.0, 0.0])
    lever = float(np.linalg.norm(away))
    if abs(lever - LEVER) > 1e-6:
        assert thing.iterations == (LONG if lever > LEVER else USUAL)
    assert other.iterations == USUAL


def test_what_is_let_go_or_changes_hands_is_as_before():
    far = [
        body(pose([0.1, 0.0, 0.1])),
        body(pose([0.0, 0.1, 0.1])),
        body(pose([0.0, 0.2, 0.1]), iterations=90),
    ]
    solving = Solving(body(pose([0.0, 0.0, 0.0])), TOOL, far)
    for force, expected in (
        ([30.0, 0.0, 0.0], [LONG, USUAL, 90]),
        ([0.0, 30.0, 0.0], [USUAL, LONG, 90]),
        ([0.0, 0.0, 30.0], [USUAL, USUAL, 90]),
        ([0.1, 0.0, 0.0], [USUAL, USUAL, 90]),
        ([0.0, 0.0, 0.0], [USUAL, USUAL, 90]),
    ):
        solving.look(force)
        assert [thing.iterations for thing in far] == expected
    Solving(body(pose([0.0, 0.0, 0.0])), TOOL, []).look([])


def test_it_works_longer_on_whatever_many_fingers_hold():
    things = [
        body(pose([0.01, 0.0, 0.1])),
        body(pose([0.1, 0.0, 0.1])),
        body(pose([0.0, 0.0, 0.1]), iterations=90),
    ]
    solving = Solving(body(pose([0.0, 0.0, 0.0])), TOOL, things, many=True)
    for force, expected in (
        ([30.0, 0.0, 0.0], [MANY, USUAL, 90]),
        ([0.0, 30.0, 0.0], [USUAL, MANY, 90]),
        ([0.0, 0.0, 30.0], [USUAL, USUAL, 90]),
        ([0.0, 0.0, 0.0], [USUAL, USUAL, 90]),
    ):
        solving.look(force)
        assert [thing.iterations for thing in things] == expected
