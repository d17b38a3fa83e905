"""Bundles of arrays: taken apart, changed and put together again, world by world."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
import pytest

from bt_tasksim.core.bundles import Rows, mapped, merged, parts, taken
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.transfer import Index


class Pair(NamedTuple):
    first: Any
    second: Any


@dataclasses.dataclass(frozen=True)
class Kept:
    path: Any
    count: Any
    derived: Any = dataclasses.field(default=None, init=False)


def bundle(n=4):
    numbers = np.arange(float(n))
    return Kept(
        Pair(numbers, np.stack([numbers, -numbers], axis=1)),
        {"ticks": numbers.astype(int), "said": "a text", "more": [numbers > 1.0, None]},
    )


def test_parts_are_found_by_name_and_an_array_has_none():
    assert parts(Pair(1, 2)) == {"first": 1, "second": 2}
    assert set(parts(bundle())) == {"path", "count"}, "what is no argument of a dataclass is not a part"
    assert parts({"a": 1}) == {"a": 1} and parts([5, 6]) == {"0": 5, "1": 6} == parts((5, 6))
    assert (
        parts(np.zeros(3)) is None and parts("text") is None and parts(None) is None and parts(Kept) is None
    )


def test_a_change_keeps_the_kind_of_every_bundle():
    found = mapped(lambda values: values * 2, bundle())
    assert type(found) is Kept and type(found.path) is Pair and type(found.count["more"]) is list
    assert found.path.first.tolist() == [0, 2, 4, 6] and found.count["said"] == "a text"
    assert found.count["more"][1] is None and mapped(lambda values: values, None) is None
    both = mapped(lambda a, b: a + b, Pair(np.ones(2), 1), Pair(np.ones(2), 2))
    assert both.first.tolist() == [2, 2] and both.second == 3


def test_worlds_are_taken_in_any_order_from_every_array():
    found = taken(bundle(), np.array([3, 0]))
    assert found.path.first.tolist() == [3, 0] and found.path.second.tolist() == [[3, -3], [0, 0]]
    assert found.count["ticks"].tolist() == [3, 0] and found.count["more"][0].tolist() == [True, False]


@pytest.mark.parametrize(
    ("rows", "expected"), [([3, 0], [3, 0]), ((1,), [1]), ([], []), ([False, True, False, True], [1, 3])]
)
def test_worlds_are_named_by_a_sequence_or_by_booleans_as_well(rows, expected):
    found = taken(bundle(), rows)
    assert found.path.first.tolist() == expected and found.count["ticks"].tolist() == expected
    back = merged(bundle(), rows, mapped(lambda values: values, found), 4)
    assert back.path.first.tolist() == [0, 1, 2, 3] and back.count["ticks"].tolist() == [0, 1, 2, 3]


def test_what_replaces_some_worlds_leaves_the_others_and_what_was_given():
    whole, rows = bundle(), np.array([1, 3])
    new = mapped(lambda values: ~values if values.dtype == bool else values - 10, taken(whole, rows))
    found = merged(whole, rows, new, 4)
    assert found.path.first.tolist() == [0, -9, 2, -7] and found.count["ticks"].tolist() == [0, -9, 2, -7]
    assert found.count["more"][0].tolist() == [False, True, True, False]
    assert whole.path.first.tolist() == [0, 1, 2, 3], "nothing that was given is changed"
    assert found.count["ticks"].dtype == whole.count["ticks"].dtype


def test_all_worlds_are_replaced_as_they_are():
    new = bundle()
    assert merged(None, np.arange(4), new, 4) is new and merged(bundle(), np.arange(4), new, 4) is new


def test_where_there_was_nothing_the_other_worlds_are_zeros():
    new = taken(bundle(), np.array([1, 2]))
    found = merged(None, np.array([3, 1]), new, 5)
    assert found.path.first.tolist() == [0, 2, 0, 1, 0] and found.path.second.shape == (5, 2)
    assert found.count["more"][0].tolist() == [False, True, False, False, False]
    assert merged(None, np.array([0]), None, 5) is None and merged(None, np.array([0]), (), 5) == ()


def test_memories_of_unlike_shapes_are_refused():
    with pytest.raises(InputError, match=r"one shape .* it has \(N, 3\) at first and \(N, 2\)"):
        merged(np.zeros((4, 3)), np.array([1]), np.zeros((1, 2)), 4)


def test_a_memory_of_another_shape_is_refused_where_all_worlds_get_it_too():
    with pytest.raises(InputError, match=r"one shape .* a.b has \(N, 3\) at first and \(N, 2\)"):
        merged({"a": {"b": np.zeros((1, 3))}}, np.array([0]), {"a": {"b": np.zeros((1, 2))}}, 1)


@pytest.mark.parametrize(("shape", "worlds"), [((), 1), ((7,), 1), ((1, 3), 2)])
def test_a_memory_without_a_row_for_each_world_is_refused(shape, worlds):
    with pytest.raises(InputError, match=f"row for each world, but 0 has the shape .* {worlds} world"):
        merged(None, np.arange(worlds), [np.zeros(shape)], worlds)


def test_in_torch_too():
    torch = pytest.importorskip("torch")
    whole = Pair(torch.arange(4.0), None)
    found = merged(whole, np.array([2]), Pair(torch.tensor([9.0]), None), 4)
    assert found.first.tolist() == [0, 1, 9, 3] and whole.first.tolist() == [0, 1, 2, 3]
    assert merged(None, np.array([2]), torch.tensor([9.0]), 4).tolist() == [0, 0, 9, 0]
    assert taken(whole, torch.tensor([3])).first.tolist() == [3.0]


def test_numbers_of_rows_on_another_device_are_not_fetched():
    torch = pytest.importorskip("torch")
    rows = torch.tensor([3], device="meta")  # which has no values to fetch
    assert Index(rows).rows is rows


def test_rows_are_taken_when_they_are_first_looked_at_and_then_kept():
    looked = []

    def change(values):
        looked.append(len(values))
        return values[1:]

    rows = Rows(Pair(np.arange(3), np.arange(2)), change)
    assert not looked
    assert rows.first.tolist() == [1, 2] and rows.first is rows.first and looked == [3]
    with pytest.raises(AttributeError):
        _ = rows.third
    with pytest.raises(AttributeError):
        _ = rows.__nothing__


@pytest.mark.parametrize("rows", [[0], [0, 1]])
@pytest.mark.parametrize(
    ("before", "now", "named"),
    [
        (Pair(np.zeros(2, int), None), Pair(np.full(2, 1.5), None), "first is an array of int64"),
        (Pair(np.zeros(2), None), Pair(np.zeros(2), np.zeros(2)), "second is None"),
        (Pair(np.zeros(2), "left"), Pair(np.zeros(2), "right"), "second is 'left'"),
        (np.zeros(2), Pair(np.zeros(2), None), "it is an array"),
        (Pair({"a": np.zeros(2)}, None), Pair({"b": np.zeros(2)}, None), "first is a dict of a"),
    ],
)
def test_a_memory_is_of_one_kind_however_many_worlds_come_at_once(rows, before, now, named):
    with pytest.raises(InputError, match=named):
        merged(before, np.array(rows), taken(now, np.array(rows)), 2)


def test_arrays_that_are_still_what_was_taken_are_not_put_back():
    whole, rows = Pair(np.arange(4.0), np.arange(4.0)), np.array([1, 3])
    was = taken(whole, rows)
    found = merged(whole, rows, was._replace(second=np.array([7.0, 8.0])), 4, was)
    assert found.first is whole.first and found.second.tolist() == [0.0, 7.0, 2.0, 8.0]
    assert whole.second.tolist() == [0.0, 1.0, 2.0, 3.0], "nothing given is changed"


def test_worlds_may_be_told_by_booleans():
    which = np.array([True, False, True, True])
    found, same = taken(bundle(), which), taken(bundle(), np.flatnonzero(which))
    np.testing.assert_array_equal(found.path.first, same.path.first)
    np.testing.assert_array_equal(found.path.second, same.path.second)
