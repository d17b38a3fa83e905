"""The command line as a whole."""

from __future__ import annotations

import json
import os
import re
import resource
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).resolve().parents[3]
COMMANDS = (
    "bench", "check", "convert", "decompose", "demo", "evaluate", "new", "new-key", "policies", "replay",
    "run", "serve-engine", "show", "train", "twin",
)  # fmt: skip
HEAVY = (
    "torch", "sapien", "mani_skill", "pinocchio", "mujoco", "ray", "cv2", "scipy", "h5py", "networkx", "zmq",
    "msgpack", "pydantic", "numpy", "py_trees", "rich", "yaml",
)  # fmt: skip


def test_help_comes_at_once_and_without_anything_heavy():
    code = (
        "import sys, bt_tasksim, bt_tasksim.cli.main as c\nassert c.main(['--help']) == 0\n"
        f"heavy = [n for n in {HEAVY!r} if n in sys.modules]\n"
        "print(heavy, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert "Usage: bt-tasksim" in done.stdout
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "bt_tasksim.cli", "--help"], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.5


def test_the_package_hands_on_its_names_without_anything_heavy():
    code = f"import sys, bt_tasksim; print([n for n in {HEAVY!r} if n in sys.modules], dir(bt_tasksim))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("[] ") and "'Scene'" in done.stdout and "'run'" in done.stdout


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("run pick_and_t", ["pick_and_throw"]),
        ("replay r --tree pick_and_t", ["pick_and_throw"]),
        ("show t.xml --scene shelf", ["shelf_to_shelf"]),
        ("evaluate t --robot xarm", ["xarm7_ability"]),
    ],
)
def test_a_shell_asks_and_nothing_heavy_is_loaded(words, wanted):
    heavy = set(HEAVY) - {"pydantic"}  # Typer's own, for values of options
    code = (
        "import atexit, sys, bt_tasksim.cli.main as c\n"
        f"atexit.register(lambda: print([n for n in {heavy!r} if n in sys.modules], file=sys.stderr))\n"
        "c.main([])"
    )
    asked = f"bt-tasksim {words}"
    shell = {
        "_BT_TASKSIM_COMPLETE": "complete_bash",
        "COMP_WORDS": asked,
        "COMP_CWORD": str(len(asked.split()) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env={**os.environ, **shell}
    )
    assert done.stdout.split() == wanted and done.stderr.strip() == "[]", done.stderr


def test_without_a_command_the_help_is_shown(call):
    code, out, _ = call()
    assert code == 0
    for command in COMMANDS:
        assert f"\n  {command} " in out


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_has_its_help(call, command):
    code, out, _ = call(command, "--help")
    assert code == 0 and out.startswith(f"Usage: bt-tasksim {command}") and "--plugin" in out


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ("evaluate pick_and_place --episodes 0", "'--episodes': should be a positive whole number"),
        ("evaluate pick_and_place --episodes 9999999", "'--episodes': should be at most 1000000"),
        ("evaluate pick_and_place --workers many", "'--workers': should be a whole number"),
        ("evaluate pick_and_place --seed 18446744073709551615 --episodes 2", "18446744073709551616"),
        ("run pick_and_place --seed -1", "'--seed': should be zero or a positive whole number"),
        ("run pick_and_place --seed 18446744073709551616", "'--seed': should be at most"),
        (f"run pick_and_place --seed {'9' * 5000}", "'--seed': should be"),
        ("train grasp_then_pick --seed 18446744073709551616", "'--seed': should be at most"),
        ("twin --seed 18446744073709551616", "'--seed': should be at most"),
        ("run pick_and_place --timeout soon", "'--timeout': "),
        ("run pick_and_place --timeout nan", "time-out"),
        ("run pick_and_place --policy grasp", "--policy should be CONCEPT=POLICY"),
        ("policies --pin a --unpin b c", "--pin and --unpin"),
        ("policies --unpin b", "'--unpin'"),
        ("run pick_and_place --sed 3", "--seed"),
        ("new concpet push", "concept"),
        ("runn pick_and_place", "did you mean 'run'"),
        ("--foo", "--foo"),
        ("run --plugin", "--plugin needs"),
        ("run", "missing argument 'TREE'"),
    ],
)
def test_options_that_make_no_sense(refused, words, part):
    sentence = refused(*words.split())
    assert part in sentence and len(sentence) < 300


def test_an_interrupt_from_outside_ends_the_process_and_its_workers(tmp_path):
    words = ["evaluate", "pick_and_place", "--episodes", "5000", "--workers", "2", "--json", "e.json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "bt_tasksim.cli", *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    deadline = time.monotonic() + 60.0
    while len(psutil.Process(process.pid).children()) < 3:  # two workers, and what watches their resources
        assert time.monotonic() < deadline
        time.sleep(0.1)
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130 and "Traceback" not in err, err
    assert re.fullmatch(r"interrupted(; \d+ of 5000 episodes had ended)?", err.strip()), err
    kept = tmp_path / "e.json"
    ended = int(err.split()[1]) if ";" in err else 0
    assert [p.name for p in tmp_path.iterdir()] == (["e.json"] if ended else [])
    if ended:
        content = json.loads(kept.read_text())
        assert content["episodes"] == ended and not content["complete"] and f" of {ended} (" in out


def start(*words, **options):
    """The command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "bt_tasksim.cli", *words], text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), **options.pop("env", {})}, **options,
    )  # fmt: skip


@pytest.mark.parametrize("columns", [80, 60])
def test_help_fits_the_terminal(columns, call, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    for command in COMMANDS:
        printed = call(command, "--help")[1]
        assert printed and max(map(len, printed.splitlines())) <= columns
        assert not set("╭│╰…") & set(printed)


def test_the_commands_are_listed_with_whole_sentences(call):
    assert "..." not in call("--help")[1].split("Commands:")[1]


def test_the_version_is_that_of_the_package(call):
    from importlib import metadata

    assert call("--version") == (0, f"bt-tasksim {metadata.version('bt-tasksim')}\n", "")


def test_a_shell_gets_a_script_and_completes_words():
    # Which shell it is for is asked of the processes above, so there has to be one.
    line = f"{shlex.quote(sys.executable)} -m bt_tasksim.cli --show-completion; true"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    script = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=True, env=environment)
    assert "_BT_TASKSIM_COMPLETE" in script.stdout, script.stderr
    ask = {"_BT_TASKSIM_COMPLETE": "complete_bash", "COMP_CWORD": "1"}
    found = start(capture_output=True, env={**ask, "COMP_WORDS": "bt-tasksim ev"})
    assert found.stdout.split() == ["evaluate"], found.stderr
    found = start(capture_output=True, env={**ask, "COMP_WORDS": "bt-tasksim run --se", "COMP_CWORD": "2"})
    assert found.stdout.split() == ["--seed"], found.stderr


@pytest.mark.parametrize(("words", "code"), [("policies", 0), ("show pick_and_place", 0), ("show gone", 2)])
def test_closed_streams_are_no_error(words, code, tmp_path):
    for closed in (">&-", "2>&-", "<&- >&- 2>&-"):
        line = f"{sys.executable} -m bt_tasksim.cli {words} {closed}"
        done = subprocess.run(
            line, shell=True, capture_output=True, text=True, check=False, cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        assert done.returncode == code and "Traceback" not in done.stderr
        assert "Exception" not in done.stderr


def test_a_full_or_broken_output_is_one_sentence_at_most(tmp_path):
    with open("/dev/full", "w") as full:
        done = start("show", "pick_and_place", stdout=full, stderr=subprocess.PIPE, cwd=tmp_path)
    assert done.returncode == 1 and done.stderr == "bt-tasksim: No space left on device\n"
    reading, writing = os.pipe()
    os.close(reading)
    done = start("show", "pick_and_place", stdout=writing, stderr=subprocess.PIPE, cwd=tmp_path)
    os.close(writing)
    assert done.returncode == 1 and done.stderr == ""


def test_an_interrupt_while_the_command_line_is_imported_is_one_word():
    code = (
        "import sys\n"
        "class Stop:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'typer':\n            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Stop())\n"
        "from bt_tasksim.cli.start import main\nsys.exit(main())\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "interrupted\n")
