"""Imports of version 0.1: converted to what is there today, and what cannot be converted is said."""

from __future__ import annotations

import importlib
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest

import bt_tasksim
from bt_tasksim.core import former
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.former import FORMER, PACKAGE, advice, convert
from bt_tasksim.trees.load import load_source


def converted(source: str) -> str:
    found = convert(textwrap.dedent(source), "file.py")
    assert not found.unknown
    return found.text


def test_every_module_of_the_table_is_there_today():
    for old, new in FORMER.items():
        assert former._file(f"{PACKAGE}.{new}").is_file(), f"{old} became {new}, which has moved on"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("from bt_tasksim.world import Command\n", "from bt_tasksim import Command\n"),
        ("from bt_tasksim import Scene, poses\n", "from bt_tasksim import Scene, poses\n"),
        ("import bt_tasksim.poses as p\n", "import bt_tasksim.core.poses as p\n"),
        ("from trees import sequence\n", "from trees import sequence\n"),
        ("from trees.authoring import retry, sequence\n", "from trees import retry, sequence\n"),
        ("from bt_tasksim.trees.authoring import sequence as s\n",
         "from bt_tasksim.trees import sequence as s\n"),
        ("from trees.authoring import Retry\n", "from bt_tasksim.trees.nodes.retry import Retry\n"),
        ("from bt_tasksim.motion import plan as way\n",
         "from concept_nodes.former import plan as way\n"),
        ("from bt_tasksim.poses import *\n", "from bt_tasksim.core.poses import *\n"),
        ("from bt_tasksim.concept import ConceptModel, Condition\n",
         "from concept_nodes.former import OneWorldConcept as ConceptModel\n"
         "from bt_tasksim import Condition\n"),
        ("from bt_tasksim import ConceptModel\n", "from bt_tasksim import ConceptModel\n"),
        ("from bt_tasksim.training.command import load_settings\n",
         "from bt_tasksim.training.session import load_settings\n"),
        ("from bt_tasksim.twin import gap\n", "from bt_tasksim.hardware.twin import gap\n"),
        ("from bt_tasksim.robot import load_robot  # mine\n", "from bt_tasksim import load_robot  # mine\n"),
        ("x = 1; from bt_tasksim.world import Command, WorldModel\n",
         "x = 1; from bt_tasksim import Command; from bt_tasksim.core.world import WorldModel\n"),
        ("é = 'ß'; import bt_tasksim.poses as p\n", "é = 'ß'; import bt_tasksim.core.poses as p\n"),
    ],
)  # fmt: skip
def test_an_import_of_today(old: str, new: str):
    assert converted(old) == new
    assert converted(new) == new, "what is converted stays"


def test_names_that_went_different_ways_get_a_statement_each():
    source = """
    if True:
        from bt_tasksim.poses import (
            Array,
            rotate,
        )
        print(rotate)
    """
    assert converted(source) == textwrap.dedent(
        """
        if True:
            from bt_tasksim import Array
            from bt_tasksim.core.poses import rotate
            print(rotate)
        """
    )


def test_dotted_names_of_a_plain_import_follow_it():
    source = """
    import bt_tasksim.poses
    import bt_tasksim.engines.ros.button

    turn = bt_tasksim.poses.yaw(0.1)
    other.bt_tasksim.poses
    """
    found = converted(source)
    assert "import bt_tasksim.core.poses" in found and "bt_tasksim.core.poses.yaw(0.1)" in found
    assert "import bt_tasksim.hardware.ros.button" in found and "other.bt_tasksim.poses" in found


def test_a_name_that_nothing_defines_is_said_with_its_line():
    found = convert("import os\nfrom bt_tasksim.poses import no_such_thing, yaw\n", "f.py")
    assert len(found.unknown) == 1 and "line 2" in found.unknown[0] and "no_such_thing" in found.unknown[0]
    assert "yaw" in found.text


@pytest.mark.parametrize("source", ["def (", "\0", "(" * 5000])
def test_what_is_not_python_is_one_sentence(source: str):
    with pytest.raises(InputError):
        convert(source, "f.py")


def test_what_authors_need_is_handed_on_by_the_package_itself():
    for name in bt_tasksim.__all__:
        assert getattr(bt_tasksim, name) is not None
    assert set(bt_tasksim.__all__) == set(bt_tasksim._HOME)
    with pytest.raises(AttributeError):
        bt_tasksim.no_such_thing  # noqa: B018  # asked for, not used


@pytest.mark.parametrize("module", ["motion", "parameters", "world", "engines.rendering_sapien"])
def test_an_old_import_that_fails_names_the_command(tmp_path: Path, monkeypatch: Any, module: str):
    monkeypatch.setattr(sys, "path", [*sys.path])
    helper = tmp_path / f"helper_{module.replace('.', '_')}.py"
    helper.write_text(f"\nfrom bt_tasksim.{module} import something\n")
    tree = tmp_path / "tree.py"
    tree.write_text(f"import {helper.stem}\ndef build(): pass\n")
    with pytest.raises(InputError, match="bt-tasksim convert") as caught:
        load_source(str(tree))
    assert str(helper) in str(caught.value), "the file to convert is the one that imports"


def test_other_failures_of_an_import_get_no_such_advice():
    for name in ("numpy.no_such", "bt_tasksim.no_such", "no_such"):
        with pytest.raises(ImportError) as caught:
            importlib.import_module(name)
        assert advice(caught.value) == ""
    assert advice(ValueError("bt_tasksim.poses")) == ""
