"""The policies at hand: lists, and which one is pinned."""

import json
import os

import pytest

from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.resources import asset
from bt_tasksim.policy.library import (
    PROGRAMMED,
    describe,
    folder_of_pinned,
    list_policies,
    measured_text,
    pin,
    pinned_programmed,
    read_pins,
    unpin,
)
from bt_tasksim.robot.description import load_robot

CONCEPTS = {"grasp": Grasp, "pick": Pick}


def test_what_is_shipped_can_be_used():
    found = list_policies(None, CONCEPTS)
    assert [(e.name, e.problem) for e in found if e.problem] == []
    for concept, robots in json.loads(asset("policies", "pins.json").read_text()).items():
        for robot, name in robots.items():
            if name == PROGRAMMED:
                assert concept in CONCEPTS and load_robot(robot) and folder_of_pinned(concept, robot) is None
                continue
            assert folder_of_pinned(concept, robot).name == name
            card = next(e.card for e in found if e.name == name and e.pinned)
            assert (card.concept, card.robot) == (concept, robot)


def test_pins_are_written_and_read(shipped):
    home = shipped("one")
    shipped("two")
    assert read_pins() == {} and folder_of_pinned("grasp", "panda") is None
    assert pin("one", CONCEPTS).concept == "grasp"
    assert read_pins() == {"grasp": {"panda": "one"}}
    pin("two", CONCEPTS)
    assert folder_of_pinned("grasp", "panda") == home / "two"
    assert [(e.name, e.pinned) for e in list_policies()] == [("one", False), ("two", True)]
    assert unpin("grasp", "panda") == "two" and read_pins() == {}
    assert sorted(p.name for p in home.iterdir()) == ["one", "pins.json", "two"]


def test_the_programmed_policy_is_pinned_in_the_file(shipped):
    home = shipped(
        "one", pins={"pick": {"so100": "programmed"}, "grasp": {"so100": "one", "panda": "programmed"}}
    )
    assert folder_of_pinned("grasp", "panda") is None and folder_of_pinned("grasp", "so100") == home / "one"
    assert pinned_programmed() == ["programmed  grasp on panda  pinned", "programmed  pick on so100  pinned"]
    assert [entry.name for entry in list_policies()] == ["one"]
    with pytest.raises(InputError, match=r"every concept has its 'programmed' policy: say in '.*pins.json'"):
        pin("programmed", CONCEPTS)
    assert unpin("grasp", "panda") == "programmed" and pinned_programmed() == [
        "programmed  pick on so100  pinned"
    ]


def test_an_empty_file_pins_nothing(shipped):
    (shipped() / "pins.json").write_text("")
    assert read_pins() == {}


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("tow", r"no policy 'tow' in '.*policies'; did you mean 'two'\?; only a policy that is there"),
        ("smeller", "'smell' is none of the concept's|its feature 'smell'"),
        ("other", "is for the concept 'wipe', which is not a bundled one"),
        ("robot", "unknown robot 'pandora'"),
        ("cut", "is damaged"),
    ],
)
def test_only_what_can_be_used_is_pinned(shipped, name, sentence):
    home = shipped("two")
    layout = list(Grasp.layout(load_robot("panda")).items())
    shipped("smeller", features=(("smell", layout[0][1]), *layout[1:]))
    shipped("other", concept="wipe")
    shipped("robot", robot="panda")
    card = json.loads((home / "robot" / "card.json").read_text()) | {"robot": "pandora"}
    (home / "robot" / "card.json").write_text(json.dumps(card))
    shipped("cut")
    (home / "cut" / "policy.safetensors").write_bytes(b"")
    with pytest.raises(InputError, match=sentence):
        pin(name, CONCEPTS)
    assert not (home / "pins.json").exists()


def test_what_is_not_pinned_cannot_be_taken_out(shipped):
    shipped("one", {"grasp": {"panda": "one"}})
    with pytest.raises(InputError, match="no policy is pinned for 'grap' on 'panda'; did you mean 'grasp'"):
        unpin("grap", "panda")
    with pytest.raises(InputError, match="no policy is pinned for 'grasp' on 'pandas'; did you mean 'panda'"):
        unpin("grasp", "pandas")


def test_a_full_disk_leaves_the_pins(shipped, monkeypatch):
    def disk_full(*arguments):
        raise OSError(28, "No space left on device")

    home = shipped("one", {"grasp": {"so100": "x"}})
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", disk_full)
        with pytest.raises(MachineError, match="No space left"):
            pin("one", CONCEPTS)
    assert read_pins() == {"grasp": {"so100": "x"}}
    assert sorted(p.name for p in home.iterdir()) == ["one", "pins.json"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", "pins '.*pins.json', line 1: not JSON"),
        ("[]", "should map concepts to robots"),
        ('{"grasp": "one"}', "'grasp' should map robots to names"),
        ('{"grasp": {"panda": 1}}', "'grasp' should map robots to names"),
        ('{"grasp": {"panda": "../../one"}}', "'grasp' should map robots to names of policies beside it"),
        ('{"grasp": {"panda": ".."}}', "'grasp' should map robots to names of policies beside it"),
    ],
)
def test_damaged_pins(shipped, text, sentence):
    (shipped("one") / "pins.json").write_text(text)
    with pytest.raises(InputError, match=sentence):
        folder_of_pinned("grasp", "panda")


def test_a_pinned_policy_that_is_gone(shipped):
    shipped("one", {"grasp": {"panda": "once"}})
    with pytest.raises(
        InputError, match=r"the policy 'once', pinned for 'grasp' on 'panda', is not in .*'one'"
    ):
        folder_of_pinned("grasp", "panda")
    assert [(e.name, e.pinned, bool(e.problem)) for e in list_policies()] == [
        ("once", True, True),
        ("one", False, False),
    ]


def test_a_damaged_policy_does_not_end_the_list(shipped):
    home = shipped("b-good", pins={"grasp": {"panda": "b-good"}})
    shipped("a-cut")
    (home / "a-cut" / "policy.safetensors").write_bytes(b"x")
    shipped("c-no-card")
    (home / "c-no-card" / "card.json").unlink()
    (home / "notes").mkdir()
    entries = list_policies(None, CONCEPTS)
    lines = [describe(e).splitlines() for e in entries]
    assert lines[0][0] == "a-cut" and "cannot be used: weights file" in lines[0][1] and len(lines[0]) == 2
    assert lines[1] == [
        f"b-good@{entries[1].card.hash}  grasp on panda  pinned",
        "  trained in grasp_then_pick, 5,000 steps by hand",
        "  960 of 1000 (96.0 %, 94.6 to 97.0) grasp_then_pick, noise original",
    ]
    assert "has no card.json" in lines[2][1] and len(lines) == 3


def test_a_folder_of_policies_and_one_policys_folder_are_listed(policy, tmp_path):
    policy("mine", measured=())
    (tmp_path / "other").mkdir()
    (found,) = list_policies(tmp_path, CONCEPTS)
    assert found.name == "mine" and not found.pinned and describe(found).endswith("never measured")
    assert [e.name for e in list_policies(tmp_path / "mine")] == ["mine"]
    assert list_policies(tmp_path / "other") == []
    with pytest.raises(InputError, match="there is no folder"):
        list_policies(tmp_path / "gone")


def test_a_measurement_in_words():
    measured = {"tree": "t", "episodes": 3, "successes": 3, "confidence_interval": [0.4385, 1.0]}
    assert measured_text(measured) == "3 of 3 (100.0 %, 43.9 to 100.0) t"
    assert measured_text(measured | {"noise": "hard"}).endswith(" t, noise hard")
    assert measured_text(measured | {"perception": "camera"}).endswith(" t, camera")
