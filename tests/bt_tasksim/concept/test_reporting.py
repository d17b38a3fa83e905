"""What a concept says about where things stand becomes a statement."""

from bt_tasksim.concept.reporting import as_statement
from bt_tasksim.core.outcomes import DONE, TEXT


def test_statements_stay_and_words_become_one():
    said = DONE(elapsed=1.0)
    assert as_statement(said) is said
    assert as_statement("no cup") == TEXT(text="no cup")
    assert as_statement("") is None
    assert as_statement(None) is None
