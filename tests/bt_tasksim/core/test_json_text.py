"""JSON is read with bounds."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.json_text import parse_json, parse_json_object

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=30,
)


@given(values)
def test_what_was_dumped_comes_back(data):
    assert parse_json(json.dumps(data), "file") == data


@given(st.text() | st.binary() | st.lists(st.sampled_from('[]{}",:1e-truenull\\')).map("".join))
def test_any_text_is_a_value_or_an_input_error(text):
    try:
        parse_json(text, "file")
    except InputError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[" * 100_000, "nested deeper"),
        ('{"a":' * 100_000, "nested deeper"),
        ('{"a": 1, "a": 2}', "twice"),
        ("[NaN]", "not a number"),
        ("9" * 5000, "too many digits"),
        ('{\n"a": }', "line 2: not JSON"),
        (b"\xff\xfe", "UTF-8"),
    ],
)
def test_what_is_refused(text, reason):
    with pytest.raises(InputError, match=reason):
        parse_json(text, "file")


def test_brackets_in_texts_are_no_nesting():
    assert parse_json(json.dumps("[" * 1000 + '\\"'), "file") == "[" * 1000 + '\\"'


def test_an_object_is_asked_for():
    with pytest.raises(InputError, match="in braces"):
        parse_json_object("[1]", "file")
