"""``bt-tasksim policies``."""

from __future__ import annotations

import json
from pathlib import Path


def test_policies_are_listed_pinned_and_unpinned(call, shipped, policy):
    home, pins = shipped("one"), Path("assets/policies/pins.json")
    code, out, _ = call("policies", "--pin", "one")
    assert code == 0 and json.loads(pins.read_text()) == {"grasp": {"panda": "one"}}
    assert out.startswith("pinned one@") and "grasp on panda  pinned" in out
    folder = policy("mine")
    (folder / "card.json").write_text("{")
    code, out, _ = call("policies", "--folder", folder, "--json", "p.json")
    assert code == 0 and "960 of 1000 (96.0 %, 94.6 to 97.0) grasp_then_pick, noise original" in out
    assert "mine\n  cannot be used: card '" in out and out.endswith("wrote p.json\n")
    one, mine = json.loads(Path("p.json").read_text())
    assert one["pinned"] and one["problem"] == "" and one["card"]["steps"] == 5000
    assert one["folder"] == str(home / "one")
    assert mine["card"] is None and "not JSON" in mine["problem"] and not mine["pinned"]
    code, out, _ = call("policies", "--unpin", "grasp", "panda")
    assert code == 0 and out.startswith("'one' is no longer pinned") and json.loads(pins.read_text()) == {}


def test_without_a_policy_the_list_says_so(call, shipped):
    shipped()
    assert call("policies") == (0, "there is no learned policy\n", "")


def test_where_the_programmed_one_is_pinned_the_list_says_so(call, shipped):
    shipped(pins={"grasp": {"panda": "programmed"}})
    assert call("policies") == (0, "programmed  grasp on panda  pinned\n", "")
