"""People's own code: what a module imports, however it does it, and what of a file counts."""

import importlib
import sys

import pytest

from bt_tasksim.core.own_code import code_hash, is_own, own_modules

FILES = {
    "main_one.py": "import numpy\nimport helper_one\nfrom parts_one import lift\n",
    "helper_one.py": "from trees import sequence\n\ndef later():\n    import lazy_one\n    return lazy_one\n",
    "lazy_one.py": "import importlib\n\nnamed = importlib.import_module('named_one')\n",
    "named_one.py": "",
    "parts_one/__init__.py": "",
    "parts_one/lift.py": "from . import _inner\n",
    "parts_one/_inner.py": "def never():\n    import no_such_module_one\n    from ... import nothing\n",
    "parts_one/unused.py": "",
    "stranger_one.py": "",
}
EXPECTED = {"main_one", "helper_one", "lazy_one", "named_one"} | {
    f"parts_one{inner}" for inner in ("", ".lift", "._inner")
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.partition(".")[0].endswith("_one")]:
        del sys.modules[name]


def test_all_that_it_imports_counts_whether_it_has_done_it_or_not(folder):
    module = importlib.import_module("main_one")
    assert "lazy_one" not in sys.modules
    before = own_modules([module])
    assert set(before) == EXPECTED
    sys.modules["helper_one"].later()
    importlib.import_module("stranger_one")
    assert own_modules([module]) == before, "what else this process has loaded is nothing to it"


def test_of_names_that_are_computed_those_count_that_were_loaded(folder):
    (folder / "main_one.py").write_text("import importlib\nimportlib.import_module('named' + '_one')\n")
    assert set(own_modules([importlib.import_module("main_one")])) == {"main_one", "named_one"}


def test_comments_and_layout_of_code_do_not_count(tmp_path):
    file = tmp_path / "a.py"
    file.write_text("x = [1, 2]\n")
    before = code_hash(file)
    file.write_text("# as before\nx = [\n    1,\n    2,\n]\n")
    assert code_hash(file) == before
    file.write_text("x = [1, 3]\n")
    assert code_hash(file) != before
    file.write_text("x = [1,\n")
    assert code_hash(file) != before, "no code at all"


def test_what_is_installed_or_ours_is_nobodys_own():
    import json

    import numpy

    from bt_tasksim import trees

    for module in (json, numpy, trees):
        assert not is_own(module.__name__, module.__file__)
    assert is_own(__name__, __file__)
