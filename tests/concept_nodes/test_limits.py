"""Limits at the wrist."""

import numpy as np
import pytest

from bt_tasksim.concept_nodes.limits import FORCE_LIMIT, force_at_wrist, strained


class Felt:
    """A view of the wrist alone."""

    def __init__(self, wrench):
        self.wrench = np.asarray(wrench, float)


@pytest.mark.parametrize(("force", "too_much"), [([0, 0, 59.9], False), ([36.0, 0, -48.1], True)])
def test_strained_by_force_and_not_by_torque(force, too_much):
    assert bool(strained(Felt([*force, 1e3, 0, 0]), FORCE_LIMIT)) is too_much


def test_batched():
    wrench = np.random.default_rng(0).normal(0, 60, (4, 5, 6))
    one_by_one = [[strained(Felt(w), 60.0) for w in row] for row in wrench]
    assert np.array_equal(strained(Felt(wrench), 60.0), one_by_one)
    assert np.allclose(force_at_wrist(Felt(wrench)), np.linalg.norm(wrench[..., :3], axis=-1))
