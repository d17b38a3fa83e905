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
