"""Settle: time passes until nothing moves, and nothing is commanded."""

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept_nodes import Settle
from bt_tasksim.core.world import Command


def ticked(toy, speed, until):
    """Seconds that it takes while the cup moves at a speed until a time."""
    stage = toy(Settle(still=0.3, slack=0.008, longest=4.0))
    step = stage.world.step

    def moving(command):
        assert command == Command()
        objects = stage.world.now.objects.copy()
        if stage.context.now < until:
            objects[0, 0] += 0.05 * speed
        step(command)
        stage.world.put(objects=objects)
        return stage.world.now

    stage.world.step = moving
    assert stage.tick(200) == Status.SUCCESS
    return stage.context.now


@pytest.mark.parametrize(("speed", "until", "lasts"), [(0.0, 9.0, 0.3), (0.2, 1.0, 1.3), (0.2, 9.0, 4.0)])
def test_it_waits_until_nothing_moves(toy, speed, until, lasts):
    assert ticked(toy, speed, until) == pytest.approx(lasts, abs=0.11)


def test_what_is_not_seen_does_not_move(toy):
    stage = toy(Settle())
    stage.world.put(objects=np.full_like(stage.world.now.objects, np.nan))
    stage.look()
    assert stage.tick(200) == Status.SUCCESS and stage.context.now == pytest.approx(0.3, abs=0.06)
