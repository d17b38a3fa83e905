"""Files are checked against models: file, line, field and the nearest right name in every error."""

import os
from dataclasses import dataclass
from typing import Annotated

import pytest
from pydantic import Field

from bt_tasksim.core.bounded_text import LARGEST
from bt_tasksim.core.document import located
from bt_tasksim.core.errors import FieldError, InputError, within
from bt_tasksim.core.typed_file import (
    Direction,
    Model,
    Name,
    Number,
    Pose7,
    Switch,
    Vector3,
    check_record,
    load_typed,
    record_model,
)


class Leg(Model):
    """A leg."""

    length: Annotated[Number, Field(gt=0.0, le=2.0)]
    """m."""
    knees: int = 1


class Table(Model):
    """A table."""

    name: Name
    top: Vector3 = (0.0, 0.0, 1.0)
    pose: Pose7 = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    up: Direction = (0.0, 0.0, 1.0)
    legs: Annotated[tuple[Leg, ...], Field(strict=False, min_length=1, max_length=4)] = ()
    by_name: dict[Name, Leg] = {}
    folds: Switch = False


def load(tmp_path, text, end="yaml"):
    file = tmp_path / f"a.{end}"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_typed(Table, file, "table file")[0]


@pytest.mark.parametrize("end", ["yaml", "json"])
def test_what_is_right_is_taken(tmp_path, end):
    text = '{"name": "desk", "legs": [{"length": 1, "knees": 2}], "folds": true}'
    table = load(tmp_path, text, end)
    assert table.name == "desk" and table.legs[0].length == 1.0 and table.folds is True


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("name: a\nlegz: []", 2, "unknown field 'legz'; did you mean 'legs'?"),
        ("name: a\nlegs:\n  - length: 1\n    kneees: 2", 4, "'legs[0].kneees'; did you mean 'knees'?"),
        ("legs:\n  - length: 1", None, "'name' is missing"),
        ("name: a\nlegs:\n  - knees: 1", 3, "'legs[0].length' is missing"),
        ("name: a\nlegs:\n  - length: 5", 3, "'legs[0].length' should be at most 2, found 5"),
        ("name: a\nlegs:\n  - length: .nan", 3, "'legs[0].length' should be a number that is finite"),
        ("name: a\nlegs:\n  - length: yes", 3, "'legs[0].length' should be a number, found 'yes'"),
        ("name: a\nlegs:\n  - length: true", 3, "'legs[0].length' should be a number, found True"),
        ("name: a\nlegs:\n  - {length: 1, knees: 1.5}", 3, "'legs[0].knees' should be a whole number"),
        ("name: a\nlegs: []", 2, "'legs' should not be empty"),
        ("name: a\nlegs: 3", 2, "'legs' should be a list, found 3"),
        ("name: a\nlegs: [3]", 2, "'legs[0]' should be a mapping"),
        ("name: a\nby_name:\n  b/c: {length: 1}", 3, "'by_name.b/c' should hold no '/'"),
        ("name: a\ntop: [1, 2]", 2, "'top' should be 3 numbers, found [1, 2]"),
        ("name: a\ntop: [1, 2, 1e12]", 2, "'top[2]' should be at most 100"),
        ("name: a\npose: [0, 0, 0, 1, 1, 0, 0]", 2, "'pose' should be x y z and a unit quaternion"),
        ("name: a\nup: [0, 0, 0]", 2, "'up' should be a direction, and not zero"),
        ("name: a.b", 1, "'name' should hold no '/', no '.'"),
        ("name: a\nfolds: maybe", 2, "'folds' should be true or false, found 'maybe'"),
        ("# nothing\n", None, "it should be a mapping of names to values, found nothing"),
    ],
)
def test_an_error_names_file_line_and_field(tmp_path, text, line, said):
    with pytest.raises(InputError) as error:
        load(tmp_path, text)
    at = "" if line is None else f", line {line}"
    assert str(error.value).startswith(f"table file '{tmp_path / 'a.yaml'}'{at}: ")
    assert said in str(error.value) and "\n" not in str(error.value)


def test_lines_of_json_too(tmp_path):
    with pytest.raises(InputError, match=r"line 3: unknown field 'legz'; did you mean 'legs'"):
        load(tmp_path, '{\n"name": "a",\n"legz": []}', "json")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"\xff\xfe", "not text in UTF-8"),
        (b"name: a\0", "NUL"),
        (b"name: a\n" + b"#" * LARGEST, "larger than 1 MiB"),
    ],
)
def test_what_is_no_text_is_refused(tmp_path, content, reason):
    with pytest.raises(InputError, match=reason):
        load(tmp_path, content)


def test_what_is_no_ordinary_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for name, reason in (
        ("pipe.yaml", "not an ordinary file"),
        (".", "cannot be read"),
        ("none.yaml", "No such"),
    ):
        with pytest.raises(InputError, match=reason):
            load_typed(Table, tmp_path / name, "table file")
    with pytest.raises(InputError, match="cannot be read"):
        load_typed(Table, "/dev/zero", "table file")


def test_errors_found_later_get_the_line_of_their_field(tmp_path):
    (tmp_path / "a.yaml").write_text("name: a\nlegs:\n  - length: 1\n  - length: 2\n")
    _, document = load_typed(Table, tmp_path / "a.yaml", "table file")
    with pytest.raises(InputError, match=r"a.yaml', line 4: too long$"), located(document), within("legs", 1):
        raise FieldError("too long", "length")
    with pytest.raises(InputError, match=r"a.yaml': all wrong$"), located(document):
        raise InputError("all wrong")


@dataclass(frozen=True)
class Inner:
    """A part.

    Attributes:
        share: From 0
            to 1.
    """

    share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5


@dataclass(frozen=True)
class Outer:
    """A record.

    Attributes:
        count: How many.
        inner: The part.
    """

    count: Annotated[int, Field(ge=1)] = 1
    inner: Inner = Inner()


def test_a_dataclass_is_a_model():
    model = record_model(Outer)
    assert model.model_validate({}).model_dump() == {"count": 1, "inner": {"share": 0.5}}
    assert model.model_fields["count"].description == "How many."
    assert record_model(Inner).model_fields["share"].description == "From 0 to 1."
    check_record(Outer(2), "a record")
    with pytest.raises(InputError, match="a record: 'count' should be at least 1, found 0"):
        check_record(Outer(0), "a record")
    with pytest.raises(InputError, match=r"'inner.share' should be at most 1"):
        check_record(Outer(1, Inner(2.0)), "a record")
