"""What a concept says about why it cannot go on becomes an outcome, or is refused."""

import pytest

from bt_tasksim.concept.reporting import as_outcome
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import DONE, PRECONDITION_UNMET


def test_outcomes_stay_and_words_become_one():
    said = DONE(elapsed=1.0)
    assert as_outcome(said, PRECONDITION_UNMET) is said
    assert as_outcome("no cup", PRECONDITION_UNMET).reason is PRECONDITION_UNMET
    assert as_outcome("", PRECONDITION_UNMET) is None
    assert as_outcome(None, PRECONDITION_UNMET) is None


@pytest.mark.parametrize("said", [False, True, 3])
def test_anything_else_is_refused(said):
    with pytest.raises(InputError, match=repr(said)):
        as_outcome(said, PRECONDITION_UNMET)
