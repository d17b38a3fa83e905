"""The JSON schemas of docs/schemas are those of the models, and fit the bundled files."""

import json

import pytest

from bt_tasksim.core.document import read_document
from bt_tasksim.core.resources import asset
from tools.schemas import FOLDER, MODELS, schema, text

jsonschema = pytest.importorskip("jsonschema")

FILES = {
    "robot": sorted(asset("robots").glob("*.yaml")),
    "scene": sorted(asset("scenes").glob("*.yaml")),
    "object": sorted(asset("objects").glob("*.yaml")),
    "fixture": sorted(asset("fixtures").glob("*.yaml")),
    "twin": [asset("twin", "gap.yaml")],
    "ros": sorted(asset("robots", "ros").glob("*.yaml")),
}
CASES = [(name, path) for name, paths in FILES.items() for path in paths]


@pytest.mark.parametrize("name", MODELS)
def test_they_are_up_to_date(name):
    assert (FOLDER / f"{name}.schema.json").read_text(encoding="utf-8") == text(name), (
        "make them anew: python -m tools.schemas"
    )
    jsonschema.Draft202012Validator.check_schema(json.loads(text(name)))


@pytest.mark.parametrize(("name", "path"), CASES, ids=[path.stem for _, path in CASES])
def test_bundled_files_fit_and_name_their_schema(name, path):
    value = read_document(path, "file").value
    checker = jsonschema.Draft202012Validator(schema(name))
    checker.validate(value)
    assert not checker.is_valid({**value, "nonsense": 1})
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("# yaml-language-server: $schema=")
    assert (path.resolve().parent / first.partition("=")[2]).resolve() == FOLDER / f"{name}.schema.json"


@pytest.mark.parametrize("name", MODELS)
def test_every_field_is_described(name):
    made = schema(name)
    for entry in (made, *made.get("$defs", {}).values()):
        assert entry["description"]
        for field, about in entry["properties"].items():
            assert about.get("description") or "$ref" in about, f"{entry['title']}.{field}"
