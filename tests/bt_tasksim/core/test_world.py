"""Bundles of arrays, and names that are resolved or refused."""

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Command


def test_a_command_over_another_one_keeps_what_it_lacks():
    below = Command(tool=np.zeros(7), hand=np.array([0.1]))
    hand = Command(hand=np.array([0.9]))
    both = hand.over(below)
    assert both.tool is below.tool and both.hand is hand.hand
    assert Command().over(below) == below and below.over(Command()) == below


def test_names_and_their_places_in_the_arrays(toy, act):
    model = toy(act("move")).world.model
    assert [model.object_index(o.name) for o in model.objects] == [0, 1]
    assert model.object("box").kind == "box" and model.place("goal").kind == "spot"
    assert model.control_period == 0.05 and len(model.tips) == 2
    with pytest.raises(InputError, match="no object 'cap' in the scene; did you mean 'cup'"):
        model.object("cap")
    with pytest.raises(InputError, match="no place 'shelf' in the scene; known: goal, table"):
        model.place("shelf")


def test_bundles_are_frozen(toy, act):
    stage = toy(act("move"))
    for bundle, name in ((stage.world.now, "time"), (Command(), "tool"), (stage.context.world, "tips")):
        with pytest.raises(AttributeError):
            setattr(bundle, name, None)
