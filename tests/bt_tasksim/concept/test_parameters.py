"""Typed parameters: what fits, what is refused with which sentence, and the way to text and back."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.concept.parameters import (
    Direction,
    Flag,
    Metres,
    ObjectName,
    PlaceName,
    Points,
    Position,
    Ratio,
    Seconds,
    Text,
    bind_arguments,
    declared_parameters,
)
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, catalogue
from bt_tasksim.core.errors import InputError


class Base:
    pass


class Wipe(Base):
    target: ObjectName
    direction: Direction
    distance: Metres
    press: Ratio = 0.5
    after: Seconds | None = None
    via: Points = ()
    at: Position = (0.0, 0.0, 0.0)
    on: PlaceName | None = None
    gently: Flag = False
    note: Text = ""
    ticks: int = 0  # no quantity: no parameter


DECLARED = {p.name: p for p in declared_parameters(Wipe, Base)}
GIVEN = {"target": "cup", "direction": (0, 0, 2), "distance": 0.1}


def test_declarations_are_read_in_order():
    assert list(DECLARED) == [
        "target", "direction", "distance", "press", "after", "via", "at", "on", "gently", "note",
    ]  # fmt: skip
    assert [p.name for p in DECLARED.values() if p.required] == ["target", "direction", "distance"]
    assert DECLARED["distance"].quantity.unit == "m" and DECLARED["after"].quantity.unit == "s"
    assert DECLARED["after"].optional and not DECLARED["press"].optional


def test_required_ones_come_first_whatever_the_order_of_inheritance():
    class Scrub(Wipe):
        force: Metres

    names = [p.name for p in declared_parameters(Scrub, Base)]
    assert names[:4] == ["target", "direction", "distance", "force"]


def test_values_are_checked_and_take_their_type():
    values = bind_arguments(DECLARED, ("cup", np.array([0, 3.0, 4.0])), {"distance": 1}, "wipe")
    assert values["direction"] == pytest.approx((0, 0.6, 0.8)) and isinstance(values["direction"], tuple)
    assert values["distance"] == 1.0 and isinstance(values["distance"], float)
    assert values["press"] == 0.5 and values["after"] is None and values["via"] == ()
    assert bind_arguments(DECLARED, (), {**GIVEN, "via": np.zeros((2, 3))}, "wipe")["via"] == ((0, 0, 0),) * 2


WRONG = [
    ({"distance": "far"}, r"wipe: parameter 'distance' should be a number in m, found 'far'"),
    ({"distance": True}, r"'distance' should be a number in m, found True"),
    ({"distance": math.nan}, r"'distance' .* it is not finite"),
    ({"distance": 1e300}, r"'distance' .* it should not be above 1e\+06"),
    ({"at": (0.0, -1e300, 0.0)}, r"'at' .* it should lie between -1e\+06 and 1e\+06"),
    ({"via": [(1e300, 0.0, 0.0)]}, r"'via' .* it should not be above 1e\+06"),
    ({"distance": None}, r"'distance' may not be left empty"),
    ({"press": 1.5}, r"'press' .*1.5: it should lie between 0 and 1"),
    ({"after": -1.0}, r"'after' should be a number in s, .*not be below 0"),
    ({"direction": (0, 0, 0)}, r"'direction' .* a direction may not be zero"),
    ({"direction": (1, 0)}, r"'direction' should be three numbers, .* it has 2 numbers"),
    ({"direction": "up"}, r"'direction' should be three numbers, found 'up'"),
    ({"at": (1, 2, math.inf)}, r"'at' should be three numbers in m, .*not finite"),
    ({"via": "here"}, r"'via' should be a list of points"),
    ({"target": 7}, r"'target' should be the name of an object, found 7"),
    ({"target": " "}, r"'target' .* it is empty"),
    ({"gently": 1}, r"'gently' should be true or false, found 1"),
    ({"note": 3}, r"'note' should be text, found 3"),
    ({"distanc": 0.1}, r"wipe has no parameter 'distanc'; did you mean 'distance'\?"),
]


@pytest.mark.parametrize(("change", "sentence"), WRONG)
def test_what_does_not_fit_is_refused_by_name(change, sentence):
    with pytest.raises(InputError, match=sentence) as error:
        bind_arguments(DECLARED, (), {**GIVEN, **change}, "wipe")
    assert "\n" not in str(error.value)


def test_missing_doubled_and_too_many():
    with pytest.raises(InputError, match="wipe: parameter 'distance' is missing"):
        bind_arguments(DECLARED, ("cup", (0, 0, 1)), {}, "wipe")
    with pytest.raises(InputError, match="wipe: parameter 'target' is given twice"):
        bind_arguments(DECLARED, ("cup",), GIVEN, "wipe")
    with pytest.raises(InputError, match="wipe takes at most 10 arguments, 11 were given"):
        bind_arguments(DECLARED, (1,) * 11, {}, "wipe")


finite = st.floats(-1e6, 1e6)
VALUES = {
    "distance": st.floats(0, 1e6),
    "press": st.floats(0, 1),
    "at": st.tuples(finite, finite, finite),
    "via": st.lists(st.tuples(finite, finite, finite), max_size=4).map(tuple),
    "gently": st.booleans(),
    "target": st.sampled_from(["cup", "a b", "ü"]),
}


@given(st.data(), st.sampled_from(sorted(VALUES)))
def test_text_and_back_is_exact(data, name):
    parameter = DECLARED[name]
    value = parameter.check(data.draw(VALUES[name]), "wipe")
    assert parameter.from_text(parameter.to_text(value), "wipe") == value


@given(st.tuples(finite, finite, finite).filter(lambda v: math.hypot(*v) > 1e-3))
def test_a_direction_as_text_stays_the_same_direction(v):
    parameter = DECLARED["direction"]
    value = parameter.check(v, "wipe")
    assert parameter.from_text(parameter.to_text(value), "wipe") == value


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("distance", "0,1", "'distance' should be a number in m, found '0,1'"),
        ("distance", "", "'distance' may not be left empty"),
        ("direction", "0;0", "'direction' should be three numbers"),
        ("via", "1;2;3;4", "'via' should be a list of points"),
        ("gently", "maybe", "'gently' should be true or false, found 'maybe'"),
    ],
)
def test_unreadable_text_is_refused(name, text, sentence):
    with pytest.raises(InputError, match=sentence):
        DECLARED[name].from_text(text, "wipe")


def test_empty_text_is_none_where_that_is_allowed():
    assert DECLARED["after"].from_text("", "wipe") is None
    assert DECLARED["after"].to_text(None) == ""


# ---- the bundled concepts ---------------------------------------------------------------------------------


def test_every_quantity_of_the_bundled_leaves_has_a_unit():
    for leaf in catalogue().values():
        for parameter in leaf.parameters().values():
            if parameter.quantity.kind in ("number", "vector", "points"):
                assert parameter.quantity.unit, f"{leaf.__name__}.{parameter.name}"


def test_a_leaf_is_built_again_from_its_arguments():
    leaf = Bring("cup", to="goal", via=[(0, 0, 0.1)], hover=0.1, timeout=3, uncertainty={"hover": 0.01})
    again = Bring(**leaf.arguments())
    assert again.model == leaf.model and again.model.timeout == 3
    assert again.model.uncertainty == {"hover": 0.01}
    assert leaf.arguments().keys() == {"target", "to", "via", "hover", "timeout", "uncertainty"}


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Pick(), "pick: parameter 'target' is missing"),
        (lambda: Pick("cup", distance="high", name="lift"), "pick 'lift': parameter 'distance' should"),
        (lambda: Pick("cup", distanse=0.1), "did you mean 'distance'"),
        (lambda: Grasp("cup", grip=2), "'grip' .*between 0 and 1"),
        (lambda: Grasp("cup", timeout=0), "'timeout' should be a positive number, found 0"),
        (lambda: Grasp("cup", tolerance=math.nan), "'tolerance' should be a positive number"),
        (lambda: Grasp("cup", policy=3), "'policy' should be text, found 3"),
        (lambda: Grasp("cup", uncertainty={"speeed": 1}), "unknown parameter 'speeed'; did you mean 'speed'"),
        (lambda: Grasp("cup", uncertainty={"target": 1}), "'target' is not a number and has no uncertainty"),
    ],
)  # fmt: skip
def test_faulty_leaves_cannot_be_built(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()
