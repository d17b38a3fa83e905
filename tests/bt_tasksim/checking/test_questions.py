"""How pure functions are asked: all of them stand in one table, and bundles are compared part by part."""

import inspect
from typing import NamedTuple

import numpy as np
import pytest

from bt_tasksim.checking.bundles import different, frozen, joined, shapes, without_worlds
from bt_tasksim.checking.perturbation import changed_memory
from bt_tasksim.checking.questions import QUESTIONS, possible, spoken
from bt_tasksim.concept.functions import ConceptFunctions
from bt_tasksim.concept.limit import Limit
from bt_tasksim.core.outcomes import Form, register_reason
from bt_tasksim.core.units import METRES
from bt_tasksim.planning.reference_motion import Path

CROWDED = register_reason("crowded", "{value} is more than {limit}", value=METRES, limit=METRES)
WITHOUT_MEMORY = {"initial_state", "begin"}


def test_every_function_of_what_is_seen_or_hidden_and_the_memory_can_be_asked():
    found = {
        name
        for name, function in inspect.getmembers(ConceptFunctions, inspect.isfunction)
        if "memory" in inspect.signature(function).parameters
    }
    assert found | WITHOUT_MEMORY == set(QUESTIONS)


class Kept(NamedTuple):
    """A memory with one of its own inside."""

    path: Path
    ticks: np.ndarray


def memory(at):
    return Kept(Path(np.full((1, 2, 7), at), np.array([at])), np.array([int(at)]))


def test_bundles_are_joined_and_compared_part_by_part():
    one = [memory(1.0), memory(2.0)]
    many = joined(one)
    assert many.path.table.shape == (2, 2, 7) and many.ticks.tolist() == [1, 2]
    assert different("memory", one, many) == []
    assert different("memory", one, many._replace(ticks=many.ticks + 1)) != []
    assert shapes(one[0]) == shapes(one[1]) != shapes(many)
    assert frozen(one[0]) == frozen(memory(1.0)) != frozen(one[1])


def test_the_last_bit_counts_where_no_tolerance_is_given():
    one, many = [np.array([1.0]), np.array([2.0])], np.array([1.0, np.nextafter(2.0, 3.0)])
    assert different("a", one, many) == [] and different("a", one, many, tolerance=0.0) != []


@pytest.mark.parametrize("answer", [np.True_, np.array([True]), np.array([[True], [True]])])
def test_an_answer_has_a_row_for_each_world(answer):
    assert len(different("a", [np.array([True]), np.array([True])], answer)) == 1


def test_what_has_no_row_for_each_world_is_found():
    assert without_worlds(joined([memory(1.0), memory(2.0)]), 2, "memory") == ""
    assert "memory.ticks" in without_worlds(memory(1.0)._replace(ticks=3), 1, "memory")
    assert "memory.path.table" in without_worlds(joined([memory(1.0)] * 2), 3, "memory")


def test_statements_and_what_may_apply_are_compared_world_by_world():
    said = Form("{object} is {far} off", {"far": METRES})(object=("cup", "box"), far=np.array([0.1, 0.2]))
    found = spoken(said, 2)
    assert found["object"].tolist() == ["cup", "box"] and found["far"].tolist() == [0.1, 0.2]
    assert different("a", [spoken(said.at(k), 1) for k in range(2)], found) == []
    assert different("a", [spoken(said.at(k), 1) for k in (1, 0)], found) != []
    limit = Limit(CROWDED, np.array([0.1, 0.2]), 0.15)
    assert possible([limit], 2)[0]["applies"].tolist() == [False, True]


def test_a_path_in_a_memory_is_moved_as_one():
    changed = changed_memory(memory(1.0), np.random.default_rng(0))
    moves = changed.path.table[..., :3] - 1.0
    assert np.ptp(moves, axis=1).max() == 0.0 and np.abs(moves).min() > 0.0
    assert (changed.path.table[..., 3:] == 1.0).all()
