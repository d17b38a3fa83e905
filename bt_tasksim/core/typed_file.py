"""Files that people write, checked against pydantic models.

A model says what may stand in a file: fields, types, bounds, and what each means. `load_typed` reads a file
and gives the model's instance, or one sentence with the file, the line, the field and the nearest right name.
The JSON schemas of docs/schemas are made from the same models.
"""

from __future__ import annotations

import dataclasses
import inspect
import os
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, get_type_hints

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from bt_tasksim.core.bounded_text import LARGEST
from bt_tasksim.core.document import Document, read_document
from bt_tasksim.core.errors import FieldError, InputError, nearest
from bt_tasksim.core.names import name_fault
from bt_tasksim.core.plain import Plain, Where, printable, short, shown, where_text
from bt_tasksim.core.renamed import former_names, with_present_names

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

UNKNOWN = "unknown_field"
TAG = "~"
"""First character of the tags of unions: they are in pydantic's paths, and not in the file."""


class Model(BaseModel):
    """Base of the models of files: no unknown fields, nothing converted, no number that is not finite."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    former: ClassVar[Mapping[str, str]] = {}
    """Present names of fields by the names that they had in earlier versions; both are read."""

    @model_validator(mode="before")
    @classmethod
    def _known(cls, data: object) -> object:
        """Say which field was meant, before anything else is looked at."""
        if isinstance(data, dict):
            if cls.former.keys() & data.keys():
                data = _present(data, cls.former)
            known = {field.alias or name for name, field in cls.model_fields.items()}
            for key in data:
                if key not in known:
                    said = nearest(shown(str(key)), known)
                    raise PydanticCustomError(UNKNOWN, "{said}", {"said": said, "key": str(key)})
        return data


def _present(data: dict[str, object], former: Mapping[str, str]) -> dict[str, object]:
    try:
        return with_present_names(data, former)
    except InputError as error:
        raise ValueError(str(error)) from None


Typed = TypeVar("Typed", bound=Model)


# ---- types of fields ---------------------------------------------------------------------------------------


def sized(n: int) -> BeforeValidator:
    """A check that a value is a list of ``n`` entries."""

    def check(value: object) -> object:
        if not isinstance(value, (list, tuple)) or len(value) != n:
            raise ValueError(f"should be {n} numbers")
        return value

    return BeforeValidator(check)


def _unit(pose: tuple[float, ...]) -> tuple[float, ...]:
    length = sum(v * v for v in pose[3:]) ** 0.5
    if abs(length - 1.0) > 1e-3:
        raise ValueError("should be x y z and a unit quaternion w x y z")
    return pose


def _direction(vector: tuple[float, ...]) -> tuple[float, ...]:
    if sum(v * v for v in vector) < 1e-12:
        raise ValueError("should be a direction, and not zero")
    return vector


def _name(value: str) -> str:
    if fault := name_fault(value):
        raise ValueError(fault.partition(", found")[0])
    return value


def _word(value: object) -> object:
    """Numbers and truth values are names where a name is wanted, as they stand in the file."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


_SWITCHES = {"yes": True, "on": True, "no": False, "off": False}


def _switch(value: object) -> object:
    return _SWITCHES.get(value.lower(), value) if isinstance(value, str) else value


Number = float
"""A finite number."""
Switch = Annotated[bool, BeforeValidator(_switch)]
"""True or false; `yes` and `no`, `on` and `off` too, as YAML 1.1 has them."""
Coordinate = Annotated[Number, Field(ge=-100.0, le=100.0)]
"""Metres, or parts of a quaternion."""
Positive = Annotated[Number, Field(gt=0.0, le=1e6)]
NotNegative = Annotated[Number, Field(ge=0.0, le=1e6)]
Length = Annotated[Number, Field(gt=0.0, le=100.0)]
"""Metres above zero."""
Share = Annotated[Number, Field(ge=0.0, le=1.0)]
Vector2 = Annotated[tuple[Coordinate, Coordinate], Field(strict=False), sized(2)]
Vector3 = Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False), sized(3)]
Direction = Annotated[Vector3, AfterValidator(_direction)]
"""A vector that is not zero."""
Size3 = Annotated[tuple[Length, Length, Length], Field(strict=False), sized(3)]
"""Full size along x, y and z, metres."""
Extent2 = Annotated[tuple[Length, Length], Field(strict=False), sized(2)]
"""Full size along x and y, metres."""
Quaternion = Annotated[tuple[Coordinate, Coordinate, Coordinate, Coordinate], Field(strict=False), sized(4)]
Pose7 = Annotated[
    tuple[Coordinate, Coordinate, Coordinate, Coordinate, Coordinate, Coordinate, Coordinate],
    Field(strict=False),
    sized(7),
    AfterValidator(_unit),
]
"""Position in metres, unit quaternion w x y z."""
Text = Annotated[str, BeforeValidator(_word), Field(min_length=1, max_length=200)]
Name = Annotated[str, BeforeValidator(_word), AfterValidator(_name)]
"""A name as `bt_tasksim.core.names` has it."""


# ---- dataclasses as models ---------------------------------------------------------------------------------


_MODELS: dict[type, type[Model]] = {}


def record_model(record: type) -> type[Model]:
    """The model of a dataclass: its fields with their types, bounds, defaults, and what its docstring says.

    Args:
        record: A dataclass all of whose fields have defaults. Their types may be `Annotated` with pydantic's
            fields, or dataclasses of this kind.
    """
    if record in _MODELS:
        return _MODELS[record]
    hints, texts = get_type_hints(record, include_extras=True), _attributes(record.__doc__ or "")
    fields: dict[str, Any] = {}
    for item in dataclasses.fields(record):
        hint = hints[item.name]
        nested = dataclasses.is_dataclass(hint)
        made = item.default_factory
        default: Any = {} if nested else item.default if made is dataclasses.MISSING else made()
        fields[item.name] = (
            record_model(hint) if nested else hint,
            Field(default, validate_default=nested, description=texts.get(item.name)),
        )
    first = (record.__doc__ or "").partition("\n")[0]
    model = create_model(record.__name__, __base__=Model, __doc__=first, **fields)
    model.former = former_names(record)
    _MODELS[record] = model
    return model


def check_record(record: DataclassInstance, owner: str) -> None:
    """Check a dataclass's fields as its model would.

    Raises:
        InputError: A field is of a wrong type or out of bounds.
    """
    values: dict[str, Plain] = {}
    for item in dataclasses.fields(record):
        value = getattr(record, item.name)
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            value = dataclasses.asdict(value)
        values[item.name] = value
    validate(record_model(type(record)), Document(owner, values))


def _attributes(doc: str) -> dict[str, str]:
    """What a Google-style docstring says of attributes, by name."""
    out: dict[str, str] = {}
    name = ""
    for line in inspect.cleandoc(doc).partition("Attributes:\n")[2].splitlines():
        if found := re.match(r"    (\w+): (.*)", line):
            name = found[1]
            out[name] = found[2]
        elif name and line.startswith("        "):
            out[name] += " " + line.strip()
        else:
            name = ""
    return out


# ---- loading -----------------------------------------------------------------------------------------------


def load_typed(
    model: type[Typed], path: str | os.PathLike[str], what: str, largest: int = LARGEST
) -> tuple[Typed, Document]:
    """The content of a file as a model's instance, and the document for errors found later.

    Args:
        model: What may stand in the file.
        path: The file, YAML or JSON.
        what: Its kind, for errors, such as ``scene file``.
        largest: Bytes beyond which it is refused.

    Raises:
        InputError: It cannot be read, or something in it is wrong: one sentence says what and where.
    """
    document = read_document(path, what, largest)
    return validate(model, document), document


def validate(model: type[Typed], document: Document) -> Typed:
    """A document's content as a model's instance.

    Raises:
        InputError: It does not fit; says the first of what is wrong.
    """
    try:
        return model.model_validate(document.value)
    except ValidationError as error:
        raise _first(error, document) from None


def checked(model: type[Typed], values: Mapping[str, object], owner: str) -> Typed:
    """Values that a caller gives as a model's instance.

    Args:
        model: What they may be.
        values: By name; arrays and NumPy's numbers are taken as plain ones.
        owner: What they belong to, for the error, such as ``an object``.

    Raises:
        FieldError: They do not fit; says the first of what is wrong.
    """
    try:
        return model.model_validate({name: plain(value) for name, value in values.items()})
    except ValidationError as error:
        where, sentence = _sentence(_chosen(error, None))
        raise FieldError(printable(f"{owner}: {sentence}"), *where) from None


def plain(value: Any) -> Any:
    """A value with lists and numbers for what NumPy makes of them, and text for paths."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, list | tuple) and type(value) in (list, tuple):
        return type(value)(plain(v) for v in value)
    return value


def fault(error: ValidationError, document: Document | None = None) -> str:
    """The first of what pydantic found, as a sentence without file and line."""
    return _sentence(_chosen(error, document))[1]


def _first(error: ValidationError, document: Document) -> InputError:
    where, sentence = _sentence(_chosen(error, document))
    return document.error(sentence, where)


def _chosen(error: ValidationError, document: Document | None) -> ErrorDetails:
    """What to say first: an unknown field, for other errors may follow from it, then what comes first."""

    def order(found: ErrorDetails) -> tuple[bool, bool, int]:
        line = document.line(_where(found)) if document is not None else None
        return found["type"] != UNKNOWN, found["type"] == "too_short", line or 0

    return min(error.errors(include_url=False), key=order)


def _where(found: ErrorDetails) -> Where:
    return tuple(part for part in found["loc"] if not (isinstance(part, str) and _hidden(part)))


def _hidden(part: str) -> bool:
    return part.startswith(TAG) or part == "[key]"


def _sentence(found: ErrorDetails) -> tuple[Where, str]:
    where, kind, context = _where(found), found["type"], found.get("ctx") or {}
    if kind == UNKNOWN:
        inner = (*where, context["key"])
        return inner, f"unknown field '{where_text(inner)}'{context['said']}"
    name = f"'{where_text(where)}'" if where else "it"
    if kind == "missing":
        return where, f"{name} is missing"
    if kind == "value_error":
        said = str(context["error"])
    else:
        said = _SAID[kind](context) if kind in _SAID else found["msg"].replace("Input should", "should")
    if not said.startswith("should"):
        return where, said
    if found["loc"] and found["loc"][-1] == "[key]":
        return where, f"the name {name} {said}"
    return where, f"{name} {said}, found {short(found['input'])}"


_SAID: dict[str, Callable[[dict[str, Any]], str]] = {
    "float_type": lambda c: "should be a number",
    "finite_number": lambda c: "should be a number that is finite",
    "int_type": lambda c: "should be a whole number",
    "bool_type": lambda c: "should be true or false",
    "string_type": lambda c: "should be text",
    "string_too_short": lambda c: "should not be empty",
    "string_too_long": lambda c: f"should have at most {c['max_length']} characters",
    "model_type": lambda c: "should be a mapping of names to values",
    "dict_type": lambda c: "should be a mapping of names to values",
    "list_type": lambda c: "should be a list",
    "tuple_type": lambda c: "should be a list",
    "too_short": lambda c: (
        "should not be empty" if c["min_length"] == 1 else f"should have at least {c['min_length']} entries"
    ),
    "too_long": lambda c: f"should have at most {c['max_length']} entries",
    "greater_than": lambda c: "should be positive" if c["gt"] == 0 else f"should be above {c['gt']:g}",
    "greater_than_equal": lambda c: (
        "should not be negative" if c["ge"] == 0 else f"should be at least {c['ge']:g}"
    ),
    "less_than": lambda c: f"should be below {c['lt']:g}",
    "less_than_equal": lambda c: (
        "should not be positive" if c["le"] == 0 else f"should be at most {c['le']:g}"
    ),
    "literal_error": lambda c: f"should be {c['expected']}",
}
"""Sentences for what pydantic says otherwise, by its types of errors."""


def known_values(known: Callable[[], list[str]], what: str, remedy: str = "") -> AfterValidator:
    """A check that a word is one of those known, with the nearest one, and a remedy, where it is not."""

    def check(value: str) -> str:
        if value not in known():
            raise ValueError(f"unknown {what} '{shown(value)}'{nearest(value, known())}{remedy}")
        return value

    return AfterValidator(check)
