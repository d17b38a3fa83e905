"""How pure functions are asked: all of them stand in one table, and bundles are compared part by part."""

import inspect
from typing import NamedTuple

import numpy as np
import pytest

from bt_tasksim.checking.bundles import different, frozen, mapped, parts, shapes, stacked
from bt_tasksim.checking.perturbation import changed_memory
from bt_tasksim.checking.questions import QUESTIONS
from bt_tasksim.concept.functions import ConceptFunctions
from bt_tasksim.planning.reference_motion import Path

ELSEWHERE = {"explain", "limits", "carry_out"}
"""Answer with a sentence or limits, or are two others together."""


def test_every_function_of_what_is_seen_or_hidden_and_the_memory_can_be_asked():
    found = {
        name
        for name, function in inspect.getmembers(ConceptFunctions, inspect.isfunction)
        if "memory" in inspect.signature(function).parameters
    }
    assert found - ELSEWHERE == set(QUESTIONS)


class Kept(NamedTuple):
    """A memory with one of its own inside."""

    path: Path
    ticks: np.ndarray


def memory(at):
    return Kept(Path(np.full((2, 7), at), np.float64(at)), np.int64(at))


def test_bundles_are_stacked_and_compared_part_by_part():
    one = [memory(1.0), memory(2.0)]
    many = stacked(one)
    assert many.path.table.shape == (2, 2, 7) and many.ticks.tolist() == [1, 2]
    assert different("memory", one, many, 2) == []
    assert different("memory", one, many._replace(ticks=many.ticks + 1), 2) != []
    assert list(parts(many)) == ["path", "ticks"] and parts(3.0) is None
    assert shapes(one[0]) == shapes(one[1]) != shapes(many)
    assert frozen(mapped(lambda a: a + 0, one[0])) == frozen(one[0]) != frozen(one[1])


@pytest.mark.parametrize(("one_for_all", "differences"), [(True, 0), (False, 1)])
def test_one_answer_for_a_batch_is_enough_where_the_question_says_so(one_for_all, differences):
    found = different("a", [np.True_, np.True_], np.True_, 2, one_for_all=one_for_all)
    assert len(found) == differences


def test_a_path_in_a_memory_is_moved_as_one():
    changed = changed_memory(memory(1.0), np.random.default_rng(0))
    moves = changed.path.table[:, :3] - 1.0
    assert np.ptp(moves, axis=0).max() == 0.0 and np.abs(moves).min() > 0.0
    assert (changed.path.table[:, 3:] == 1.0).all()
