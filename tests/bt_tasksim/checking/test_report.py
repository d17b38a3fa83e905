"""What a report prints: each finding counts for what was being checked when it was made."""

import inspect

from bt_tasksim.checking.report import ERROR, WARNING, Report


def test_each_thing_that_was_checked_has_what_was_found_about_it():
    report = Report()
    report.add(WARNING, "a", "x", "is odd", "look")
    report.done("the first")
    report.done("the second")
    report.done("the third")
    report.done_rather("the last")
    report.add(ERROR, "b", "", "is wrong", "mend it")
    assert report.checked == ("the first", "the second", "the last")
    assert report.lines()[2:] == [
        "ok: the first; 0 errors, 1 warning",
        "ok: the second; 0 errors, 0 warnings",
        "not ok: the last; 1 error, 0 warnings",
    ]


def test_things_of_the_same_words_are_told_apart():
    report = Report()
    word = "the same"
    report.done(word)
    report.add(ERROR, "a", "", "is wrong", "mend it")
    report.done(word)
    assert report.lines()[1:] == [
        "ok: the same; 0 errors, 0 warnings",
        "not ok: the same; 1 error, 0 warnings",
    ]


def test_what_was_checked_is_said_by_done_alone():
    assert list(inspect.signature(Report).parameters) == ["findings", "seen"]
    assert Report().lines() == []
