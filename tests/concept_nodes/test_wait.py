"""Wait: time passes, nothing is commanded."""

import pytest
from py_trees.common import Status

from bt_tasksim.concept_nodes import Hold, Wait
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import DONE
from bt_tasksim.core.world import Command


def test_it_waits_and_commands_nothing(toy):
    stage = toy(Wait(0.32))
    assert stage.tick(100) == Status.SUCCESS
    assert stage.context.now == pytest.approx(0.35)
    assert all(command == Command() for command in stage.world.steps)
    assert stage.tree.outcome.is_a(DONE)
    assert stage.tree.outcome.detail.numbers == pytest.approx({"waited": 0.35, "duration": 0.32})


def test_time_does_not_run_backwards():
    with pytest.raises(InputError, match="wait: parameter 'duration' should be a number in s, found -1"):
        Wait(-1)


@pytest.mark.parametrize(
    "made",
    [
        lambda: Wait(1e300),
        lambda: Wait(5.0, timeout=4.0),
        lambda: Hold("cup", direction=(1, 0, 0), duration=5.0, timeout=4.0),
    ],
)
def test_what_could_never_end_well_is_refused(made):
    with pytest.raises(InputError, match=r"'timeout' of .* s would end it before its .* s are over"):
        made()


def test_what_lasts_just_as_long_as_it_may_ends_well(toy):
    assert toy(Wait(0.3, timeout=0.3)).tick(100) == Status.SUCCESS


def test_what_is_held_for_longer_than_usual_has_the_time_for_it():
    leaf = Hold("cup", direction=(1, 0, 0), duration=40.0)
    assert leaf.model.patient and leaf.model.planned(None) == 40.0


def test_each_world_is_treated_as_alone(situations, functions):
    from bt_tasksim.concept_nodes import Pick

    for name in functions:
        if name not in ("maintained", "command", "carry_out", "advance", "begin"):
            situations(Pick).check(name, Wait.value(0.5))
