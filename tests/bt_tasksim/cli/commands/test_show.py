"""``bt-tasksim show``."""

from __future__ import annotations

from pathlib import Path

import pytest


def test_show_prints_and_writes_a_tree_that_can_be_run(call):
    code, out, _ = call("show", "shelf_to_shelf", "--picture", "tree.svg", "--xml", "tree.xml")
    assert code == 0 and "Bring cup  (to lower_board)" in out and "wrote tree.svg" in out
    assert "<svg" in Path("tree.svg").read_text()
    again = call("show", "tree.xml")[1]
    assert again.splitlines() == out.splitlines()[: len(again.splitlines())]


EASY = '<root BTCPP_format="4"><BehaviorTree ID="a"><Grasp target="spanner"/></BehaviorTree></root>'


def test_a_tree_is_shown_without_a_scene(call, refused):
    Path("easy.xml").write_text(EASY)
    code, out, _ = call("show", "easy.xml", "--picture", "easy.svg")
    assert code == 0 and "spanner" in out and "<svg" in Path("easy.svg").read_text()
    Path("easy.py").write_text(
        "from bt_tasksim.concept_nodes import Grasp\ndef build(): return Grasp('spanner')"
    )
    assert call("show", "easy.py")[0] == 0
    assert "--scene" in refused("run", "easy.xml")
    assert "spanner" in refused("show", "easy.xml", "--scene", "pick_and_place")


@pytest.mark.parametrize("name", ["a.png", "a.SVG.pdf", "a.jpg"])
def test_pictures_are_svg_and_nothing_else(refused, name):
    assert ".svg" in refused("show", "pick_and_place", "--picture", name)
    assert not Path(name).exists()
