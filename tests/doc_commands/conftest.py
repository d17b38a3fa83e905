"""A folder as the pages' readers have it."""

from __future__ import annotations

import json
import shutil

import pytest

from bt_tasksim.cli.main import main
from tests.doc_commands.lines import FILE, PAGES, ROOT, TRAINING


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with what the pages have made before."""
    folder = tmp_path_factory.mktemp("docs")
    for shared in ("assets", "examples"):
        (folder / shared).symlink_to(ROOT / shared)
    for page in PAGES:
        for name, text in FILE.findall(page.read_text(encoding="utf-8")):
            (folder / name).write_text(text, encoding="utf-8")
    (folder / "tiny.json").write_text(json.dumps(TRAINING))
    shutil.copytree(ROOT / "assets" / "policies" / "grasp-panda", folder / "policies" / "grasp-panda")
    log = str(ROOT / "assets" / "demonstrations" / "shelf_to_shelf" / "00.h5")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["decompose", log, "--xml", "kitchen.xml"]) == 0
        assert main(["run", "kitchen.xml", "--seed", "11", "--out", "runs/kitchen"]) in (0, 1)
        assert main(["new", "concept", "nudge"]) == 0
        assert main(["new", "scene", "kitchen"]) == 0
        assert main(["new", "object", "watering_can"]) == 0
        assert main(["new", "tree", "mine"]) == 0
    shutil.copy(folder / "kitchen.xml", folder / "shelf.xml")
    return folder


@pytest.fixture
def workplace(prepared, tmp_path, monkeypatch):
    """A copy of that folder, as the working directory."""
    folder = tmp_path / "docs"
    shutil.copytree(prepared, folder, symlinks=True)
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(ROOT)
    return folder


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """An empty folder, as the working directory: a measurement needs nothing that a page has made."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT)
