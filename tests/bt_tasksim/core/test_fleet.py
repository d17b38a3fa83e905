"""Shares: every item has exactly one result, whoever is lost."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError, LeafError, MachineError
from bt_tasksim.core.fleet import Here, Shares, TooManyLostError, results_of


@given(
    items=st.integers(0, 60),
    share=st.integers(1, 9),
    members=st.integers(1, 5),
    events=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 8), st.booleans()), max_size=200),
)
def test_every_item_has_one_result(items, share, members, events):
    shares, found, names = Shares(items, share), [], iter(range(10**6))
    held = {next(names): [] for _ in range(members)}  # what each has left, by index in its share

    def fill():
        for name, left in held.items():
            if not left:
                taken = shares.take(name, members)
                assert len(taken) <= share
                held[name] = list(range(len(taken)))

    fill()
    for who, which, is_lost in events:
        name = list(held)[who % members]
        left = held[name]
        if is_lost:
            try:
                shares.lost(name)
            except TooManyLostError as error:
                assert 0 <= error.number < items
                return
            del held[name]
            held[next(names)] = []
        elif left:
            found.append(shares.done(name, left.pop(which % len(left))))
        fill()
    while shares.left:
        fill()
        for name, left in held.items():
            while left:
                found.append(shares.done(name, left.pop()))
    assert sorted(found) == list(range(items)) and shares.waiting == 0


def test_shares_are_smaller_near_the_end():
    shares, sizes = Shares(100, 16), []
    while taken := shares.take("a", 2):
        sizes.append(len(taken))
        for index in range(len(taken)):
            shares.done("a", index)
    assert sizes[0] == 16 and sizes[-1] == 1 and sum(sizes) == 100 and sizes == sorted(sizes, reverse=True)


def test_what_ends_its_member_again_and_again_is_found_out():
    shares, lost = Shares(8, 4), 0
    assert shares.take("a0", 1) == [0, 1, 2, 3]
    assert shares.done("a0", 0) == 0 and shares.lost("a0") == [1, 2, 3]
    with pytest.raises(TooManyLostError) as caught:
        while True:
            lost += 1
            (taken,) = shares.take(f"a{lost}", 1)
            if taken == 2:
                shares.lost(f"a{lost}")
            else:
                shares.done(f"a{lost}", 0)
    assert caught.value.number == 2 and shares.left


def test_this_process_is_a_fleet():
    def work(state, items):
        for index, item in reversed(list(enumerate(items))):
            yield index, state + item

    with Here(10) as fleet:
        assert list(fleet.spread(work, [1, 2, 3])) == [(2, 13), (1, 12), (0, 11)]


def broken(state, items):
    yield 0, items[0]
    raise LeafError("leaf 'a' is broken")


@pytest.mark.parametrize(
    ("work", "kind", "sentence"),
    [
        (broken, LeafError, "leaf 'a' is broken"),
        (lambda state, items: iter([(0, 5)]), MachineError, "no result came of 1 of 2 items"),
        (lambda state, items: iter([(0, 5), (0, 5)]), MachineError, "KeyError"),
        (lambda state, items: iter([(0, 1 / state)]), InputError, "ZeroDivisionError"),
    ],
)
def test_a_member_says_what_is_wrong(work, kind, sentence):
    *_, (last, error) = results_of(lambda: 0, work, [5, 6])
    assert last == "error" and isinstance(error, kind) and sentence in str(error)
