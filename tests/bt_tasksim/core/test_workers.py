"""Workers: each keeps something of its own, errors come through, and none outlives what made it."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from bt_tasksim.core.errors import InputError, LeafError, MachineError, NoWayError
from bt_tasksim.core.fleet import results_of
from bt_tasksim.core.workers import Workers


def one_by_one(kept, tasks, /):
    """Work of a fleet: does tasks one after the other."""
    for index, task in enumerate(tasks):
        yield index, task.run(kept)


METHODS = pytest.mark.parametrize("method", ["fork", "spawn"])


@dataclass(frozen=True)
class Append:
    """Puts a number to what the worker keeps."""

    number: int

    def run(self, kept, /):
        kept.append(self.number)
        return os.getpid(), list(kept)


@dataclass(frozen=True)
class Raising:
    """Raises an error."""

    error: Exception

    def run(self, kept, /):
        raise self.error


@dataclass(frozen=True)
class Killed:
    """Ends the worker, as one ends that takes too much memory."""

    def run(self, kept, /):
        os.kill(os.getpid(), signal.SIGKILL)


@dataclass(frozen=True)
class Sleeping:
    """Takes a while."""

    def run(self, kept, /):
        time.sleep(600.0)


class FussyError(InputError):
    """Cannot be unpickled from its sentence alone."""

    def __init__(self, first, second):
        super().__init__(f"{first} and {second}")


def alive(pid):
    stat = Path(f"/proc/{pid}/stat")
    try:
        return stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@METHODS
def test_every_worker_keeps_its_own(method):
    with Workers(list, 2, method) as pool:
        pids = set(pool.pids)
        found = dict(pool.spread(one_by_one, [Append(k) for k in range(6)]))
    assert sorted(found) == list(range(6))
    assert {pid for pid, _ in found.values()} <= pids and os.getpid() not in pids
    for pid in {pid for pid, _ in found.values()}:
        own = [kept for k, (of, kept) in sorted(found.items()) if of == pid]
        assert own == [own[-1][: n + 1] for n in range(len(own))], "its own tasks in their order"
    assert not any(alive(pid) for pid in pids)


@METHODS
@pytest.mark.parametrize("error", [LeafError("leaf 'a' is broken"), NoWayError("too far")])
def test_an_error_comes_as_it_is(method, error):
    with pytest.raises(type(error), match=f"^{error}$"), Workers(list, 1, method) as pool:
        list(pool.spread(one_by_one, [Raising(error)]))


def broken():
    raise ZeroDivisionError("no such thing")


def test_an_error_that_cannot_come_is_one_of_its_kind_with_its_sentence():
    with pytest.raises(InputError, match=r"^this and that$"), Workers(list, 1) as pool:
        list(pool.spread(one_by_one, [RaisingFussy()]))


@dataclass(frozen=True)
class RaisingFussy:
    """Raises an error that cannot be unpickled."""

    def run(self, kept, /):
        raise FussyError("this", "that")


def test_what_else_is_raised_is_one_error():
    with (
        pytest.raises(InputError, match=r"^test_workers.py:\d+: ZeroDivisionError: no such thing$"),
        Workers(broken, 2) as pool,
    ):
        list(pool.spread(one_by_one, [Append(0), Append(1)]))
    with (
        pytest.raises(MachineError, match="TypeError"),
        Workers(list, 1) as pool,
    ):  # not in a user's code
        list(pool.spread(results_of, [None]))


@METHODS
def test_a_worker_that_is_killed_is_an_error_and_no_waiting(method):
    with (
        pytest.raises(MachineError, match=r"^a worker process ended; is there enough memory\?$"),
        Workers(list, 2, method) as pool,
    ):
        list(pool.spread(one_by_one, [Append(0), Killed(), Append(2)]))


def test_what_they_are_doing_is_not_waited_for_where_it_is_broken_off():
    began = time.monotonic()
    with pytest.raises(InputError), Workers(list, 2) as pool:
        pids = pool.pids
        list(pool.spread(one_by_one, [Sleeping(), Raising(InputError("no good"))]))
    assert time.monotonic() - began < 60.0 and not any(alive(pid) for pid in pids)


PARENT = """
import time
from bt_tasksim.core.workers import Workers
pool = Workers(list, 3)
print(*pool.pids, flush=True)
time.sleep(600)
"""


def test_they_end_when_their_parent_is_killed():
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    try:
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        assert len(pids) == 3 and all(alive(pid) for pid in pids)
    finally:
        parent.kill()
        parent.wait()
        parent.stdout.close()
    until = time.monotonic() + 20.0
    while any(alive(pid) for pid in pids) and time.monotonic() < until:
        time.sleep(0.05)
    assert [pid for pid in pids if alive(pid)] == []


def threads():
    return [os.environ.get(name) for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")]


@dataclass(frozen=True)
class Threads:
    """How many threads it may take for linear algebra."""

    def run(self, kept, /):
        return threads()


def test_spawned_ones_take_one_thread_each_and_the_parent_what_it_took():
    before = threads()
    with Workers(partial(list), 1, "spawn") as pool:
        assert dict(pool.spread(one_by_one, [Threads()])) == {0: ["1", "1"]}
    assert threads() == before


def test_they_find_no_modules_in_the_current_folder(tmp_path):
    """Neither they nor what begins with the first of them: people have files of such names."""
    here, script = tmp_path / "here", tmp_path / "script" / "own.py"
    here.mkdir()
    script.parent.mkdir()
    for name in ("multiprocessing", "queue", "signal", "bt_tasksim", "trees"):
        (here / f"{name}.py").write_text(f"open({str(here / 'ran')!r}, 'a').write({name!r})\n")
    script.write_text(SPAWNING)
    path = os.pathsep.join([*filter(None, sys.path), str(Path(__file__).parent)])
    done = subprocess.run(
        [sys.executable, str(script)], stdout=subprocess.PIPE, timeout=120.0, cwd=here,
        env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert not (here / "ran").exists() and done.stdout == b"[0]\n"


SPAWNING = """
from bt_tasksim.core.workers import Workers
from test_workers import Append, one_by_one
if __name__ == "__main__":
    with Workers(list, 1, "spawn") as pool:
        print(*[kept for _, (_, kept) in pool.spread(one_by_one, [Append(0)])])
"""
