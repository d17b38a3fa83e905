"""What is made of a view is made once, however many questions of a tick need it."""

from types import SimpleNamespace

import numpy as np

from bt_tasksim.concept.seen import Seen


def test_what_is_made_of_a_view_is_made_once_and_of_each_view_anew():
    made = []

    def make():
        made.append(1)
        return np.zeros(3)

    views = [Seen(SimpleNamespace(), None, None, np.zeros(1)) for _ in range(2)]
    first = views[0].once(("room", "shelf"), make)
    assert views[0].once(("room", "shelf"), make) is first and len(made) == 1
    assert views[0].once(("room", "table"), make) is not first and len(made) == 2
    assert views[1].once(("room", "shelf"), make) is not first and len(made) == 3


def test_a_view_of_some_worlds_has_their_rows_of_what_was_made_by_world():
    world = SimpleNamespace(map=lambda change: world)
    whole = Seen(SimpleNamespace(), world, None, np.zeros(3), failures=np.zeros(3))
    numbers = whole.once("numbers", lambda: np.arange(3.0), by_world=True)
    whole.once("other", lambda: np.arange(3.0))
    some = whole.at(np.array([0, 2])).at(np.array([1]))
    assert np.array_equal(some.once("numbers", lambda: np.full(1, np.nan), by_world=True), numbers[2:])
    assert np.array_equal(some.once("other", lambda: np.full(1, 7.0)), [7.0]), (
        "nobody has said it is by world"
    )
    assert np.array_equal(some.once("new", lambda: np.full(1, 8.0), by_world=True), [8.0])
