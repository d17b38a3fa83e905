"""Policies on disk: what is written is read again, and whatever is wrong is one sentence."""

import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import safetensors.numpy

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.policy.files import (
    CARD,
    FILES,
    WEIGHTS,
    PolicyCard,
    PolicySlot,
    check_fits,
    load_card,
    load_policy,
    save_policy,
)
from bt_tasksim.policy.network import Network


def small(seed=0, inputs=3, outputs=2):
    rng = np.random.default_rng(seed)
    layers = [
        (rng.normal(size=(4, inputs)), rng.normal(size=4)),
        (rng.normal(size=(outputs, 4)), np.zeros(outputs)),
    ]
    return Network(rng.normal(size=inputs), np.ones(inputs), layers)


CARD_OF_SMALL = PolicyCard(
    "grasp", "panda", (("gap", 2), ("time", 1)), 1, "grasp_then_pick",
    steps=10, seeds=(3,), wall_seconds=7, configuration={"hidden": (4,), "a": {"b": None}},
)  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    save_policy(tmp_path / "one", small(), CARD_OF_SMALL)
    return tmp_path / "one"


def change(folder, **changes):
    content = json.loads((folder / CARD).read_text())
    for name, value in changes.items():
        if value is ...:
            del content[name]
        else:
            content[name] = value
    (folder / CARD).write_text(json.dumps(content))


def test_what_is_written_is_read(folder, tmp_path):
    network, card = load_policy(folder)
    assert {p.name for p in folder.iterdir()} == set(FILES)
    x = np.random.default_rng(1).normal(size=(9, 3))
    assert (network(x) == small()(x)).all()
    assert card == save_policy(tmp_path / "two", small(), CARD_OF_SMALL) == load_card(folder)
    assert card.seeds == (3,) and card.features == CARD_OF_SMALL.features and len(card.weights) == 64
    assert safetensors.numpy.load_file(folder / WEIGHTS).keys() == network.arrays().keys()


def test_an_older_policy_is_replaced_and_anything_else_is_not(folder):
    save_policy(folder, small(1), CARD_OF_SMALL)
    assert (load_policy(folder)[0].mean == small(1).mean).all()
    (folder / "diary.txt").write_text("dear")
    with pytest.raises(InputError, match=r"holds other things, such as 'diary.txt'"):
        save_policy(folder, small(2), CARD_OF_SMALL)
    assert (folder / "diary.txt").exists()


@pytest.mark.parametrize("when", ["fsync", "rename"])
def test_a_full_disk_leaves_the_older_policy(folder, monkeypatch, when):
    def disk_full(*arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, when, disk_full)
        with pytest.raises(MachineError, match="No space left"):
            save_policy(folder, small(1), CARD_OF_SMALL)
    assert (load_policy(folder)[0].mean == small(0).mean).all()
    assert [p.name for p in folder.parent.iterdir()] == ["one"]


def test_the_hash_names_the_policy_and_not_what_is_said_of_it(folder):
    card = load_card(folder)
    assert re.fullmatch("[0-9a-f]{12}", card.hash)
    measured = ({"tree": "t", "episodes": 2, "successes": 1, "confidence_interval": [0.1, 0.9]},)
    assert save_policy(folder, small(), dataclasses.replace(card, measured=measured, remarks="x")) != card
    assert load_card(folder).hash == card.hash and load_card(folder).measured == measured
    others = [dataclasses.replace(card, **c) for c in ({"steps": 11}, {"weights": "0"}, {"robot": "xarm7"})]
    assert len({card.hash, *(o.hash for o in others)}) == 4


@pytest.mark.parametrize(
    ("network", "changes", "sentence"),
    [
        (small(inputs=4), {}, "the weights take 4 features, the card has 3"),
        (
            small(outputs=1),
            {},
            "the weights give 1 outputs, the card has 1 actions and the completion signal",
        ),
        (small(), {"configuration": {"rate": float("nan")}}, "cannot be written as JSON"),
        (small(), {"configuration": {"where": object()}}, "cannot be written as JSON"),
        (small(), {"measured": ({"tree": "t"},)}, "'measured.episodes' is missing"),
        (small(), {"steps": -1}, "'steps' should not be negative"),
        (small(), {"seeds": (True,)}, "'seeds' should be whole numbers, found True"),
    ],
)
def test_a_policy_that_could_not_be_read_is_not_written(tmp_path, network, changes, sentence):
    with pytest.raises(InputError, match=sentence):
        save_policy(tmp_path / "new", network, dataclasses.replace(CARD_OF_SMALL, **changes))
    assert list(tmp_path.iterdir()) == []


# ---- what is damaged --------------------------------------------------------------------------------------


def refused(folder):
    with pytest.raises(InputError) as found:
        load_policy(folder)
    sentence = str(found.value)
    assert "\n" not in sentence and folder.name in sentence, "one sentence that says where"
    return sentence


def test_missing_folders_and_files(folder, tmp_path):
    assert refused(tmp_path / "gone").endswith("gone' does not exist; check the path")
    assert refused(folder / CARD).endswith("is a file; a policy is a folder")
    (folder / WEIGHTS).rename(tmp_path / "w")
    assert "has no policy.safetensors; copy the policy's folder again" in refused(folder)
    (folder / CARD).unlink()
    assert "has no card.json; name a folder that training has written" in refused(folder)


@pytest.mark.parametrize(
    "text", ["", "{", "\xff\xfe", '{"steps": NaN}', "[" * 100000, '{"a": 1}{"b": 2}'], ids=range(6)
)
def test_a_card_that_is_not_json(folder, text):
    (folder / CARD).write_text(text, encoding="latin-1")
    assert refused(folder).endswith("copy the policy's folder again")


@pytest.mark.parametrize("field", list(CARD_OF_SMALL.to_json()))
def test_every_field_of_the_card_is_needed_and_has_its_type(folder, field):
    change(folder, **{field: ...})
    assert f"'{field}' is missing: it should be" in refused(folder)
    for wrong in (None, True):
        change(folder, **{field: wrong})
        assert f"'{field}' should be" in refused(folder) and f"found {wrong}" in refused(folder)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"version": 2}, "its version is 2, and only 1 is known; use a matching bt-tasksim"),
        ({"step": 3}, "unknown field 'step'; did you mean 'steps'"),
        ({"seeds": [1, "2"]}, "'seeds' should be whole numbers, found '2'"),
        ({"steps": 1.5}, "'steps' should be a whole number, found 1.5"),
        ({"layout": {"features": [["gap", 2]], "actions": 1}}, "'layout.sha256' is missing"),
        ({"layout": {"features": [["gap"]], "actions": 1, "sha256": ""}}, "a name and a size, found ['gap']"),
        ({"layout": {"features": [["gap", True]], "actions": 1, "sha256": ""}}, "found ['gap', True]"),
        ({"layout": {"features": [], "actions": 1, "sha256": ""}}, "at least one feature, and none twice"),
        ({"layout": {"features": [["a", 1]] * 2, "actions": 1, "sha256": ""}}, "and none twice"),
        ({"layout": {"features": [["gap", 3]], "actions": 1, "sha256": ""}}, "'layout' was changed"),
        ({"measured": [3]}, "'measured' should be a list of mappings, found 3"),
        (
            {"measured": [{"tree": "t", "episodes": 3, "successes": 4, "confidence_interval": [0, 1]}]},
            "counts 4 successes in 3 episodes",
        ),
        (
            {"measured": [{"tree": "t", "episodes": 3, "successes": 2, "confidence_interval": [0, 97]}]},
            "should be two shares, found [0, 97]",
        ),
    ],
)
def test_cards_that_make_no_sense(folder, changes, sentence):
    change(folder, **changes)
    assert sentence in refused(folder)


def test_a_card_that_is_no_mapping(folder):
    (folder / CARD).write_text("[1, 2]")
    assert "a card should be a mapping, found [1, 2]" in refused(folder)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_weights_that_were_cut_off(folder, share):
    content = (folder / WEIGHTS).read_bytes()
    (folder / WEIGHTS).write_bytes(content[: int(share * len(content))])
    assert "is damaged or not the card's: its SHA-256 begins with" in refused(folder)


def test_weights_of_another_policy(folder, tmp_path):
    save_policy(tmp_path / "two", small(5), CARD_OF_SMALL)
    shutil.copy(tmp_path / "two" / WEIGHTS, folder / WEIGHTS)
    assert "is damaged or not the card's" in refused(folder)


def weights(content):
    """A change that puts weights in and their hash in the card."""

    def put(folder):
        import hashlib

        (folder / WEIGHTS).write_bytes(content)
        change(folder, weights=hashlib.sha256(content).hexdigest())

    return put


def arrays(**changes):
    kept = {**small().arrays(), **changes}
    return safetensors.numpy.save({k: v for k, v in kept.items() if v is not None})


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is no safetensors file"),
        (b"garbage" * 50, "is no safetensors file"),
        (b"\xff" * 8 + b"{}", "is no safetensors file"),
        (b"\x80\x04cos\nsystem\n(S'true'\ntR.", "is no safetensors file"),
        (arrays(mean=None), "do not fit together, such as 'mean'"),
        (arrays(extra=np.zeros(2)), "do not fit together, such as 'extra'"),
        (arrays(mean=np.full(3, np.nan)), "not finite"),
        (arrays(mean=np.zeros(2), deviation=np.ones(2)), "layer 0 has weights"),
        (safetensors.numpy.save(small(inputs=4).arrays()), "take 4 features, the card has 3"),
    ],
)
def test_weights_that_are_none(folder, content, sentence):
    weights(content)(folder)
    assert sentence in refused(folder)


# ---- whether it fits --------------------------------------------------------------------------------------

LAYOUT = {"gap": 2, "time": 1}


def test_it_fits_the_concept_it_was_trained_for(folder):
    check_fits(load_card(folder), folder, PolicySlot("grasp", "panda", LAYOUT, 1))


@pytest.mark.parametrize(
    ("concept", "robot", "layout", "actions", "sentence"),
    [
        ("pick", "panda", LAYOUT, 1, "is for the concept 'grasp', not for 'pick'"),
        ("grasp", "xarm7", LAYOUT, 1, "is for the robot 'panda', not for 'xarm7'; train one for 'xarm7'"),
        ("grasp", "panda", {"gap": 3, "time": 1}, 1, "its feature 'gap' has size 2, the concept's has 3"),
        ("grasp", "panda", {"gap": 2}, 1, "its feature 'time' is none of the concept's"),
        ("grasp", "panda", {**LAYOUT, "new": 1}, 1, "the concept's feature 'new' is none of its own"),
        ("grasp", "panda", {"time": 1, "gap": 2}, 1, "its feature 1 is 'gap', the concept's is 'time'"),
        ("grasp", "panda", LAYOUT, 5, "it has 1 actions, the concept has 5; train it again"),
        ("grasp", "panda", {}, 0, "its feature 'gap' is none of the concept's"),
    ],
)
def test_it_does_not_fit(folder, concept, robot, layout, actions, sentence):
    with pytest.raises(InputError, match=sentence):
        check_fits(load_card(folder), folder, PolicySlot(concept, robot, layout, actions))


def test_reading_needs_numpy_and_safetensors_alone(folder):
    code = (
        "import sys\n"
        "for name in ('torch', 'sapien', 'mani_skill', 'gymnasium', 'scipy'): sys.modules[name] = None\n"
        "from bt_tasksim.policy.files import load_policy\n"
        f"print(load_policy({str(folder)!r})[1].concept)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "grasp"
