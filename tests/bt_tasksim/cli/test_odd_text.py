"""Names and paths that terminals would obey or cannot show, or that are too long."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bt_tasksim.cli.streams import LONGEST

TREE = '<root BTCPP_format="4" scene="{scene}"><BehaviorTree ID="a">{body}</BehaviorTree></root>'
OBEYED = "&#x9b;31m&#10;SUCCESS&#13;&#x202e;"
"""A colour, a line of its own, back to its beginning, and from right to left."""


def tree(body="<Wait/>", scene="pick_and_place"):
    Path("t.xml").write_text(TREE.format(body=body, scene=scene))
    return "t.xml"


def obeyed(text):
    return [c for c in text if not c.isprintable() and c != "\n"]


def test_a_tree_shows_its_names_and_obeys_none(call):
    code, out, err = call("show", tree(f'<Wait name="{OBEYED}" duration="1"/>'))
    assert (code, err) == (0, "") and not obeyed(out) and out.count("\n") == 1
    assert r"\x9b31m\x0aSUCCESS" in out


def test_a_list_of_policies_obeys_none(call, tmp_path, policy):
    policy("mine").rename(tmp_path / "\x1b]0;mine\x07")
    code, out, _ = call("policies", "--folder", tmp_path)
    assert code == 0 and not obeyed(out) and r"\x1b]0;mine\x07" in out


@pytest.mark.parametrize(
    "words",
    [
        ("show", "\x1b[31mgone"),
        ("show", "pick_and_place", "--scene", "\x9b31m"),
        ("run", "pick_and_place", "--policy", "gr\x1basp=x"),
        ("--plugin", "\x1b[2J.py", "show", "x"),
    ],
)
def test_a_complaint_obeys_none(call, words):
    code, _, err = call(*words)
    assert code == 2 and err.count("\n") == 1 and not obeyed(err)


def test_what_a_file_holds_is_no_line_of_a_complaint(call):
    code, _, err = call("run", tree(scene=OBEYED))
    assert code == 2 and not obeyed(err)
    assert [line[:4] for line in err.splitlines()[1:]] == ["    "] * (len(err.splitlines()) - 1)


def test_a_complaint_is_not_without_end_and_keeps_what_it_advises(refused):
    said = refused("show", tree(f"<Gr{'a' * 100_000}/>"))
    assert len(said) <= LONGEST and said.endswith("a node of your own comes with --plugin FILE.py")


@pytest.mark.parametrize("variables", [{"PYTHONIOENCODING": "ascii"}, {"PYTHONIOENCODING": "utf-8:strict"}])
def test_what_a_terminal_cannot_show_is_spelled_out(variables):
    words = [
        sys.executable,
        "-m",
        "bt_tasksim.cli",
        "show",
        tree('<Sequence><Wait duration="1"/></Sequence>'),
    ]
    done = subprocess.run(
        [*map(os.fsencode, words), b"--picture", b"a\xff.svg"],
        capture_output=True, env={**os.environ, **variables},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, b"") and rb"dcff.svg" in done.stdout


def test_where_nobody_can_be_told_nothing_is_raised():
    with open("/dev/full", "wb") as full:
        done = subprocess.run([sys.executable, "-m", "bt_tasksim.cli", "show", "gone"], stderr=full)
    assert done.returncode == 2


@pytest.mark.parametrize(
    "out",
    ["/", "x" * 300, "a/b/" + "x" * 300, "x" * 240, "/".join(["y" * 200] * 25)],
    ids=["root", "name", "below", "hidden", "path"],
)
def test_a_folder_that_cannot_be_is_bad_input(refused, out):
    assert "cannot write" in refused("run", "pick_and_place", "--out", out)
    assert not list(Path().iterdir())
