"""Outcomes: numbers with units, one sentence, names in files, codes in a process."""

import json
import math
import pickle

import numpy as np
import pytest
from defusedxml import ElementTree

from bt_tasksim.concept.limit import Limit
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import (
    CANNOT_START,
    DONE,
    TIMED_OUT,
    Form,
    Possible,
    outcome_from_data,
    reason_named,
    reason_of,
    recorded_outcome,
    register_reason,
)
from bt_tasksim.core.registry import module_of, parts, scratch
from bt_tasksim.core.units import METRES, NEWTONS, RADIANS, SHARE


@pytest.fixture
def slipped():
    with scratch():
        yield register_reason(
            "test_slipped", "{object} slipped by {way}, {turn} ({way:.2f})", way=METRES, turn=RADIANS
        )


def test_the_sentence_shows_numbers_in_handy_units_and_the_value_keeps_si(slipped):
    outcome = slipped(object="cup", way=0.0312, turn=math.pi / 4)
    assert outcome.sentence == "cup slipped by 31 mm, 45.0 degrees (31.20 mm)"
    assert outcome.numbers == {"way": 0.0312, "turn": math.pi / 4} and outcome.names == {"object": "cup"}


def test_two_numbers_that_differ_never_read_alike():
    heavy = Form("nut weighs {value}, more than {limit}", {"value": NEWTONS, "limit": NEWTONS})
    said = heavy(value=3.207, limit=3.0)
    assert said.sentence == "nut weighs 3.2 N, more than 3.0 N"
    assert said.values == {"value": "3.2 N", "limit": "3.0 N"}
    assert heavy(value=3.0, limit=3.0).sentence == "nut weighs 3 N, more than 3 N"
    assert heavy(value=math.nan, limit=3.0).sentence == "nut weighs nan N, more than 3 N"
    formatted = Form("{value:.2f} over {limit:g}", {"value": NEWTONS, "limit": NEWTONS})
    assert formatted(value=3.0001, limit=3.0).sentence == "3.00 N over 3 N"


def test_files_hold_the_name_the_numbers_and_their_units(slipped):
    outcome = CANNOT_START(slipped(object="cup", way=0.03, turn=math.inf))
    data = outcome.to_data()
    assert data["reason"] == "cannot_start" and data["numbers"] == {}
    inner = data["detail"]
    assert inner["reason"] == "test_slipped" and inner["units"] == {"way": "m", "turn": "rad"}
    assert inner["numbers"] == {"way": 0.03, "turn": None} and inner["names"] == {"object": "cup"}


def test_the_cause_is_the_innermost_outcome(slipped):
    inner = slipped(object="cup", way=0.03, turn=0.0)
    outcome = CANNOT_START(inner)
    assert outcome.cause is inner and outcome.reason is CANNOT_START
    assert outcome.is_a(slipped) and outcome.is_a(CANNOT_START) and not outcome.is_a(DONE)
    assert outcome.sentence == f"cannot start: {inner.sentence}"


def test_what_was_measured_is_a_detail_and_no_cause():
    measured = Form("hand {closed} closed, {force} at the wrist", {"closed": SHARE, "force": NEWTONS})
    outcome = TIMED_OUT(measured(closed=0.5, force=12.4), limit=8.0)
    assert outcome.sentence == "not done within 8 s: hand 50 % closed, 12 N at the wrist"
    assert outcome.cause is outcome and outcome.to_data()["detail"]["numbers"]["force"] == 12.4


@pytest.mark.parametrize("values", [{}, {"limit": 1.0, "object": "cup"}])
def test_a_missing_or_an_unknown_number_is_refused(values):
    with pytest.raises(TypeError, match="takes limit"):
        TIMED_OUT(**values)


# ---- statements about several worlds ----------------------------------------------------------------------


def test_a_statement_about_a_batch_says_of_each_world_what_it_would_say_of_it_alone(slipped):
    ways, turns, names = np.array([0.03, 0.01, np.nan]), np.array([0.1, 0.2, 0.3]), ("cup", "box", "nut")
    many = slipped(object=names, way=ways, turn=turns)
    for k in range(3):
        alone = slipped(object=names[k], way=float(ways[k]), turn=float(turns[k]))
        one = many.at(k)
        assert type(one) is type(alone) and one.to_data() == alone.to_data()
        assert one.sentence == alone.sentence and type(one.numbers["way"]) is float
        assert pickle.loads(pickle.dumps(one)).sentence == alone.sentence


def test_what_is_the_same_in_all_worlds_is_said_once(slipped):
    many = slipped(object="cup", way=np.array([0.03, 0.01]), turn=0.5)
    assert [many.at(k) for k in (0, 1)] == [slipped(object="cup", way=way, turn=0.5) for way in (0.03, 0.01)]
    plain = TIMED_OUT(limit=2.0)
    assert plain.at(7) == plain


def test_details_are_of_the_same_world(slipped):
    measured = Form("{force} at the wrist", {"force": NEWTONS})(force=np.array([1.0, 2.0]))
    many = CANNOT_START(slipped(measured, object=("cup", "box"), way=np.array([0.03, 0.01]), turn=0.0))
    one = many.at(1)
    assert one.detail.names == {"object": "box"} and one.cause.detail.numbers == {"force": 2.0}
    assert one.sentence.endswith("2 N at the wrist")


def test_an_outcome_is_possible_where_it_applies(slipped):
    way = np.array([0.03, 0.001, 0.05])
    possible = slipped.where(way > 0.02, object=("a", "b", "c"), way=way, turn=0.0)
    assert isinstance(possible, Possible) and possible.applies.tolist() == [True, False, True]
    assert possible.at(2) == slipped(object="c", way=0.05, turn=0.0)
    with pytest.raises(TypeError, match="takes way, turn, object"):
        slipped.where(way > 0.02, way=way, turn=0.0)


def test_a_limit_applies_where_it_is_exceeded_and_counts(slipped):
    heavy = register_reason(
        "test_heavy", "{object} weighs {value}, more than {limit}", value=NEWTONS, limit=NEWTONS
    )
    value, limits = np.array([5.0, 5.0, 1.0, np.nan]), np.array([2.0, 6.0, 2.0, 2.0])
    names = {"object": "nut"}
    assert Limit(heavy, value, 2.0, names).applies.tolist() == [True, True, False, False]
    limit = Limit(heavy, value, limits, names, counts=np.array([True, True, True, True]))
    assert limit.applies.tolist() == [True, False, False, False]
    assert limit.at(0) == heavy(object="nut", value=5.0, limit=2.0)
    assert limit.at(1) == heavy(object="nut", value=5.0, limit=6.0)
    later = Limit(heavy, value, 2.0, names, counts=np.array([False, True, True, True]))
    assert later.applies.tolist() == [False, True, False, False]
    with pytest.raises(TypeError, match="takes value, limit, object"):
        Limit(heavy, value, 2.0).at(0)


def test_codes_and_names_lead_back_to_the_reason(slipped):
    assert slipped.code > 0 and reason_of(slipped.code) == slipped == reason_named("test_slipped")
    assert reason_of(0) is None
    with pytest.raises(InputError, match="no reason has the code"):
        reason_of(10**6)
    with pytest.raises(InputError, match="did you mean 'test_slipped'"):
        reason_named("test_sliped")


def test_a_reason_announces_itself_with_its_module(slipped):
    assert parts("reason")["test_slipped"] is slipped
    assert module_of("reason", "test_slipped") == __name__


def test_an_outcome_travels_between_processes_whether_its_reason_is_known_there_or_not(slipped):
    outcome = slipped(object="cup", way=0.03, turn=0.0)
    sent = pickle.dumps(outcome)
    assert pickle.loads(sent) == outcome
    unknown = register_reason("test_elsewhere", "gone by {way}", way=METRES)(way=0.01)
    sent = pickle.dumps(unknown).replace(b"test_elsewhere", b"test_elsewherf")
    back = pickle.loads(sent)
    assert back.reason.name == "test_elsewherf" and back.sentence == "gone by 10 mm" and back.reason.code == 0


@pytest.mark.parametrize("name", ["Not In Place", "not in place", "", "NOT"])
def test_a_name_that_is_not_in_snake_case_is_refused(name):
    with pytest.raises(InputError, match="lower-case words"):
        register_reason(name, "")


def test_an_outcome_comes_back_from_its_data(slipped):
    measured = Form("{force} at the wrist {{}}", {"force": NEWTONS})(force=3.0)
    outcome = CANNOT_START(slipped(measured, object="cup", way=0.03, turn=0.1))
    back = outcome_from_data(json.loads(json.dumps(outcome.to_data())))
    assert back.is_a(slipped) and back.sentence == outcome.sentence
    assert back.cause.detail.numbers == {"force": 3.0}


def test_an_outcome_comes_back_where_its_reason_is_not_known_or_has_changed():
    data = {**TIMED_OUT(limit=3.0).to_data(), "reason": "of_somebody_else", "sentence": "odd {x}"}
    back = outcome_from_data(data)
    assert back.reason.name == "of_somebody_else" and back.sentence == "odd {x}"
    assert back.numbers == {"limit": 3.0} and back.to_data()["units"] == {"limit": "s"}
    changed = outcome_from_data({**data, "reason": "timed_out", "numbers": {}, "units": {}})
    assert changed.is_a(TIMED_OUT) and changed.sentence == "odd {x}"


def test_older_files_hold_a_reason_in_words():
    old = recorded_outcome("not in place", "cup does not stand on goal: 31 mm")
    assert old.reason.name == "not_in_place" and old.sentence == "cup does not stand on goal: 31 mm"


def test_an_outcome_shows_its_numbers_with_units_and_escapes_its_names(slipped):
    outcome = CANNOT_START(slipped(object="<b>", way=0.031, turn=math.nan))
    rows = {row[0].text: row[1].text for row in ElementTree.fromstring(outcome._repr_html_()).iter("tr")}
    assert rows["why"] == outcome.sentence
    assert rows["reason"] == "test_slipped"
    assert "way 31 mm" in rows["measured"] and "object <b>" in rows["measured"]
    assert "nan" not in rows["measured"]
