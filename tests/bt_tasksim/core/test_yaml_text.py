"""YAML is read with bounds: whatever it holds, the answer comes soon, and is a value or one sentence."""

import time

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.yaml_text import parse_yaml


def value(text):
    return parse_yaml(text, "file")[0]


def bomb(ways=9, levels=9):
    lines = [f"a0: &a0 [{','.join(['x'] * ways)}]"]
    lines += [f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * ways)}]" for i in range(1, levels)]
    return "\n".join(lines)


def test_values_and_their_lines():
    text = "name: a\nlist:\n  - 1\n  - {x: 2.5,\n     y: on}\nlast: ~\n"
    found, lines = parse_yaml(text, "file")
    assert found == {"name": "a", "list": [1, {"x": 2.5, "y": "on"}], "last": None}
    assert lines["name",] == 1 and lines["list", 1] == 4 and lines["list", 1, "y"] == 5
    assert lines["last",] == 6


def test_as_in_yaml_1_2():
    assert value("[on, off, yes, no, true, 1e-3, 2E+3, .5, 2001-12-14, '1']") == [
        "on", "off", "yes", "no", True, 1e-3, 2000.0, 0.5, "2001-12-14", "1",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "text",
    ["{a: &x [1, 2], b: *x}", "{a: &x {p: 1}, b: {<<: *x, q: 2}}", "a: {<<: [{x: 1}, {x: 2, y: 3}], z: 4}"],
)
def test_aliases_and_merges_mean_what_they_mean_elsewhere(text):
    assert value(text) == yaml.safe_load(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (bomb(), "more than 100000 values"),
        ("[" * 3000, "nested deeper"),
        ("{a: " * 3000, "nested deeper"),
        ("- " * 3000, "nested deeper"),
        ("\n".join("  " * i + "a:" for i in range(3000)), "nested deeper"),
        ("[" + "1," * 200_000 + "1]", "more than 100000 values"),
        ("a: 1\nb: 2\na: 3", "line 3: 'a' stands there twice"),
        ("&a [*a]", "stands for nothing before it"),
        ("a: *b", "stands for nothing before it"),
        ("--- 1\n--- 2", "second document"),
        ("!!python/object/apply:os.system [ls]", "unknown tag"),
        ("a: !secret b", "unknown tag"),
        ("{? [1]: 2}", "a key should be a name"),
        ("a: " + "9" * 5000, "is no int"),
        ("a: [1, 2", "not YAML"),
        ("a: \x1b[2J", "not YAML"),
    ],
)
def test_what_is_refused_is_refused_at_once(text, reason):
    begin = time.monotonic()
    with pytest.raises(InputError, match=reason) as error:
        value(text)
    assert time.monotonic() - begin < 5.0
    assert "\n" not in str(error.value) and str(error.value).isprintable()


def test_a_bomb_of_400_bytes_is_one():
    assert len(bomb()) < 400


PIECES = st.sampled_from(
    ["a", "b: ", "- ", "[", "]", "{", "}", "&x ", "*x", "!!int ", "? ", ": ", "\n", "\n  ", "'", '"', "1e9",
     "<<: ", "|\n", "#", "%", "@", "~", "\t", "\x00", "\x85", "é", "---", "...", "!", ",", "0x", ".inf", "="]
)  # fmt: skip


@settings(max_examples=400, deadline=5000)
@given(st.lists(PIECES, max_size=40).map("".join) | st.text(max_size=60))
def test_any_text_is_a_value_or_an_input_error(text):
    try:
        parse_yaml(text, "file")
    except InputError as error:
        assert str(error).startswith("file") and "\n" not in str(error)


scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text("abc: -#'é\n", max_size=8)
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text("abcé", min_size=1, max_size=4), inner, max_size=4)
    ),
    max_leaves=20,
)


@settings(max_examples=200, deadline=None)
@given(values)
def test_what_was_dumped_comes_back(data):
    assert value(yaml.safe_dump(data)) == data
