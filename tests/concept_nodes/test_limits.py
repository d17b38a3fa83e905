"""Limits at the wrist."""

import numpy as np
import pytest

from bt_tasksim.concept_nodes.limits import FAR, FORCE_LIMIT, WRIST_STRAINED, force_at_wrist, gentler, strain


class Felt:
    """A view of the wrist alone."""

    def __init__(self, wrench):
        self.wrench = np.asarray(wrench, float).reshape(-1, 6)


@pytest.mark.parametrize(("force", "too_much"), [([0, 0, 59.9], False), ([36.0, 0, -48.1], True)])
def test_strained_by_force_and_not_by_torque(force, too_much):
    assert strain(Felt([*force, 1e3, 0, 0]), FORCE_LIMIT).applies.tolist() == [too_much]


def test_a_strained_wrist_says_how_much_and_how_much_is_allowed():
    outcome = strain(Felt([0, 0, 71.2, 0, 0, 0]), FORCE_LIMIT).at(0)
    assert outcome.is_a(WRIST_STRAINED) and outcome.numbers == {"value": 71.2, "limit": 60.0}
    assert outcome.to_data()["units"] == {"value": "N", "limit": "N"}


def test_each_world_has_its_own_force(rows_alike):
    wrench = np.random.default_rng(0).normal(0, 60, (20, 6))
    applies = rows_alike(lambda rows: strain(Felt(wrench[rows]), 60.0).applies, 20)
    force = np.linalg.norm(wrench[:, :3], axis=-1)
    assert np.array_equal(applies, force > 60.0) and np.allclose(force_at_wrist(Felt(wrench)), force)
    assert strain(Felt(wrench), 60.0).at(7).numbers == pytest.approx({"value": force[7], "limit": 60.0})


def test_an_arm_comes_the_more_gently_the_nearer_its_tool_is_to_its_base():
    tools = np.zeros((4, 7))
    tools[:, 0], tools[:, 2] = [FAR / 4, FAR / 2, FAR, 2 * FAR], 0.3
    assert gentler(tools) == pytest.approx([1 / 16, 1 / 4, 1.0, 1.0])
