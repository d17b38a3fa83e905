"""How a shell completes words: names of what is bundled and files, at once."""

from __future__ import annotations

from pathlib import Path

from bt_tasksim.cli.options import completion
from bt_tasksim.core.registry import parts
from bt_tasksim.trees.load import scenarios


def test_the_names_are_those_that_the_commands_know():
    assert completion.trees("") == completion.scenes("") == scenarios()
    assert sorted(completion.robots("")) == sorted(parts("robot"))


def test_files_of_the_right_kind_and_folders_are_offered():
    Path("mine").mkdir()
    for name in ("mine.py", "mine.xml", "mine.yaml", "mine.txt", "mine/a.py", ".hidden.py"):
        Path(name).touch()
    assert completion.trees("mi") == ["mine/", "mine.py", "mine.xml"]
    assert completion.trees("mine/") == ["mine/a.py"]
    assert completion.scenes("mi") == ["mine/", "mine.py", "mine.yaml"]
    assert completion.robots("mi") == ["mine/", "mine.yaml"]
    assert completion.trees("no/such/") == []
    assert completion.trees(f"{Path.cwd()}/mine.p") == [f"{Path.cwd()}/mine.py"]
