"""Parts announce themselves, once each, and are found by name."""

from __future__ import annotations

import importlib
import logging
import sys
from importlib import metadata

import pytest

from bt_tasksim.core import plugins, registry
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.registry import part, parts, register


@pytest.fixture(autouse=True)
def forgotten():
    with plugins.scratch():
        yield


def test_a_registered_part_is_found_by_its_own_name_or_by_a_given_one():
    @register("shape")
    class Wedge:
        pass

    register("shape", "cone of mine")(Wedge)
    assert part("shape", "Wedge") is Wedge
    assert part("shape", "cone of mine") is Wedge


def test_one_name_for_two_different_parts_is_refused_and_both_are_named():
    register("shape", "wedge")(object())
    with pytest.raises(InputError, match="wedge"):
        register("shape", "wedge")(object())


def test_the_same_definition_run_again_replaces_the_first():
    def define():
        @register("shape")
        class Wedge:
            pass

        return Wedge

    first, second = define(), define()
    assert first is not second
    assert part("shape", "Wedge") is second


def test_a_file_that_is_loaded_under_two_names_is_no_conflict_and_the_first_counts(tmp_path, monkeypatch):
    file = tmp_path / "wedges.py"
    file.write_text("from bt_tasksim.core.registry import register\n@register('shape')\nclass Wedge: pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    first = plugins.load_plugin(str(file)).Wedge
    second = importlib.import_module("wedges").Wedge
    assert first is not second and part("shape", "Wedge") is first


def test_unknown_kinds_are_refused_with_the_nearest():
    with pytest.raises(InputError, match="'concept'"):
        register("concpet")
    with pytest.raises(InputError):
        parts("concpet")


def test_a_part_without_a_name_is_refused():
    with pytest.raises(InputError):
        register("shape")(3)


def test_a_missing_library_is_said_when_the_part_is_asked_for(tmp_path, monkeypatch):
    package = tmp_path / "homes_of_parts"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "heavy.py").write_text("import no_such_library_at_all\n")
    (package / "light.py").write_text(
        "from bt_tasksim.core.registry import register\nregister('engine/physics', 'light')(7)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(registry.HOMES, "engine/physics", ("homes_of_parts",))
    monkeypatch.setattr(registry, "_discovered", set())
    monkeypatch.setitem(registry._parts, "engine/physics", {})
    assert part("engine/physics", "light") == 7
    with pytest.raises(MachineError, match="no_such_library_at_all"):
        part("engine/physics", "heavy")
    with pytest.raises(InputError, match="light"):
        part("engine/physics", "lihgt")


def test_installed_packages_announce_modules_and_a_broken_one_is_left_out(tmp_path, monkeypatch, caplog):
    (tmp_path / "good_parts.py").write_text(
        "from bt_tasksim.core.registry import register\nregister('shape', 'from a package')(5)\n"
    )
    (tmp_path / "bad_parts.py").write_text("raise RuntimeError('broken')\n")
    monkeypatch.syspath_prepend(tmp_path)
    entries = [metadata.EntryPoint(name, name, registry.GROUP) for name in ("bad_parts", "good_parts")]
    monkeypatch.setattr(registry.metadata, "entry_points", lambda group: entries)
    monkeypatch.setattr(registry, "_discovered", {"shape"})
    with caplog.at_level(logging.WARNING):
        assert part("shape", "from a package") == 5
    assert "bad_parts" in caplog.text


def test_a_plugin_file_is_run_once_and_its_faults_name_the_line(tmp_path):
    good, bad = tmp_path / "good.py", tmp_path / "bad.py"
    good.write_text(
        "from bt_tasksim.core.registry import register\n\n\n@register('shape')\nclass Wedge:\n    pass\n"
    )
    assert plugins.load_plugin(str(good)) is plugins.load_plugin(str(good))
    assert part("shape", "Wedge").__name__ == "Wedge"
    assert str(good.resolve()) in plugins.loaded()
    bad.write_text("x = 1\ny = x / 0\n")
    with pytest.raises(InputError, match="line 2"):
        plugins.load_plugin(str(bad))
    assert not [name for name in sys.modules if name == "_plugin_bad"]


def test_a_plugin_that_is_not_there_is_one_sentence(tmp_path):
    for plugin in (str(tmp_path / "none.py"), "no_such_module_of_parts"):
        with pytest.raises(InputError, match="no"):
            plugins.load_plugin(plugin)


def test_a_file_of_the_package_that_is_run_under_another_name_changes_nothing():
    from bt_tasksim.concept_nodes import Wait
    from bt_tasksim.concept_nodes import wait as module
    from bt_tasksim.trees.load import own_nodes

    found = own_nodes(str(module.__file__))
    assert found["Wait"] is not Wait
    assert part("concept", "Wait") is Wait
