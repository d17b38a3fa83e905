"""A cluster as a fleet: errors come through, lost actors are made up for, and nothing is left of Ray."""

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import psutil
import pytest

from bt_tasksim.core import cluster as module
from bt_tasksim.core.cluster import Cluster, check_address
from bt_tasksim.core.errors import BtTasksimWarning, InputError, LeafError, MachineError

needs_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'bt-tasksim[cluster]'"
)

WORK = '''
import os, signal, sys, time
from bt_tasksim.core.errors import InputError, LeafError

def make():
    return [os.getpid()]

def no_good():
    raise InputError("there is no tree file 'a.py'")

def collect(state, items):
    """Puts items to what is kept; some end the actor, once or always."""
    for index, item in reversed(list(enumerate(items))):
        state.append(item)
        if item == "error":
            raise LeafError("leaf 'a' is broken")
        if item == "mine":
            raise ZeroDivisionError("no such thing")
        if item == "always" or (item != "error" and os.path.isabs(item) and not os.path.exists(item)):
            if item != "always":
                open(item, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.01)
        yield index, (state[0], item, os.getcwd(), "queue" in [os.path.basename(p) for p in sys.path])
'''


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """A module that actors can import."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "fleet_work.py").write_text(WORK)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), str(folder)])))
        yield importlib.import_module("fleet_work")


def of_ray():
    """Processes of Ray that this one has and that run."""

    def words(process: psutil.Process) -> list[str]:
        try:
            return [process.name(), *process.cmdline()]
        except psutil.NoSuchProcess:  # it ends as it is looked at, or nobody has asked yet how it ended
            return []

    found = psutil.Process().children(recursive=True)
    return {process for process in found if any("ray" in word for word in words(process))}


@pytest.fixture(scope="module")
def local(work):
    """A cluster of this machine with two actors."""
    before = set(Path(tempfile.gettempdir()).glob("bt-ray-*"))
    with Cluster(work.make, "local", 2) as fleet:
        yield fleet
    assert set(Path(tempfile.gettempdir()).glob("bt-ray-*")) <= before and not of_ray()


@needs_ray
def test_actors_keep_what_they_have_and_give_each_result_once(local, work):
    first = dict(local.spread(work.collect, [str(k) for k in range(40)], 5))
    again = dict(local.spread(work.collect, [str(k) for k in range(7)], 5))
    assert [first[k][1] for k in range(40)] == [str(k) for k in range(40)] and sorted(again) == [*range(7)]
    assert len({found[0] for found in first.values()}) == 2, "two actors"
    assert {found[0] for found in again.values()} <= {found[0] for found in first.values()}
    assert {found[2] for found in first.values()} == {os.getcwd()}
    listening = [c.laddr.ip for p in of_ray() for c in p.net_connections("inet") if c.status == "LISTEN"]
    assert listening and {ip.removeprefix("::ffff:") for ip in listening} == {"127.0.0.1"}, "nobody else's"


@needs_ray
def test_an_actor_that_ends_is_made_up_for(local, work, tmp_path):
    items = [str(k) for k in range(30)]
    items[11] = str(tmp_path / "once")
    with pytest.warns(BtTasksimWarning, match="an actor on .* ended"):
        found = list(local.spread(work.collect, items, 8))
    assert sorted(number for number, _ in found) == list(range(30)), "none twice"


@needs_ray
def test_errors_come_as_they_are_and_what_ends_every_actor_is_named(local, work):
    """The last use of the module's cluster: an error ends the fleet."""
    with (
        pytest.warns(BtTasksimWarning),
        pytest.raises(MachineError, match="always has ended one actor after the other"),
    ):
        list(local.spread(work.collect, ["0", "always", "2"], 1))


@needs_ray
@pytest.mark.parametrize(
    ("make", "item", "kind", "sentence"),
    [
        ("make", "error", LeafError, "^leaf 'a' is broken$"),
        ("make", "mine", InputError, r"^fleet_work.py:\d+: ZeroDivisionError: no such thing$"),
        ("no_good", "0", InputError, r"^fleet_work.py:\d+: there is no tree file 'a.py'$"),
    ],
)
def test_an_error_ends_it_in_one_sentence(work, make, item, kind, sentence):
    before = of_ray()
    with pytest.raises(kind, match=sentence), Cluster(getattr(work, make), "local", 1) as fleet:
        list(fleet.spread(work.collect, ["1", item], 2))
    assert of_ray() <= before


PARENT = """
import time
from bt_tasksim.core.cluster import Cluster
import fleet_work
fleet = Cluster(fleet_work.make, "local", 1)
for number, (pid, *_) in fleet.spread(fleet_work.collect, ["1"]):
    print(pid, flush=True)
time.sleep(600)
"""


@needs_ray
def test_nothing_of_ray_outlives_a_killed_process(work, tmp_path):
    before = set(Path(tempfile.gettempdir()).glob("bt-ray-*"))
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    try:
        assert int(parent.stdout.readline()) > 0
        begun = psutil.Process(parent.pid).children(recursive=True)
        assert len(begun) > 4
    finally:
        parent.kill()
        parent.wait()
        parent.stdout.close()
    _, left = psutil.wait_procs(begun, timeout=30.0)
    assert [p for p in left if p.status() != psutil.STATUS_ZOMBIE] == []
    until = time.monotonic() + 10.0
    while set(Path(tempfile.gettempdir()).glob("bt-ray-*")) - before and time.monotonic() < until:
        time.sleep(0.1)
    assert set(Path(tempfile.gettempdir()).glob("bt-ray-*")) <= before


@needs_ray
@pytest.mark.parametrize(
    "address", ["", "here", "10.0.0.1", "10.0.0.1:0", "10.0.0.1:65536", "ray://a:1", "a b:1"]
)
def test_what_is_no_address_is_one_sentence(address):
    with pytest.raises(InputError, match="a cluster is 'local' or HOST:PORT") as caught:
        check_address(address)
    assert "\n" not in str(caught.value)


@needs_ray
def test_a_cluster_that_is_lost_is_one_sentence(work, monkeypatch):
    """Ray ends its process after a minute without the head, with a line in its log."""
    line = (
        "[2026-11-22 18:20:54,426 E 20454 20624] (driver) rpc_client.h:204: Failed to connect. It's killed."
    )
    monkeypatch.setattr(module, "_BEGIN", f"print({line!r})")
    with pytest.raises(MachineError, match=r"^Ray was lost: Failed to connect$"):
        Cluster(work.make, "local")


def test_where_ray_is_not_installed_it_says_what_to_do(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'bt-tasksim\[cluster\]'"):
        Cluster(list, "local")


@needs_ray
def test_where_nobody_answers_it_says_so_soon():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with pytest.raises(MachineError, match=f"no Ray cluster answers at 127.0.0.1:{port}.*ray start"):
        Cluster(list, f"127.0.0.1:{port}")


GREETING = bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
"""An empty frame of settings: what a head begins with, at least."""


@needs_ray
@pytest.mark.parametrize(
    ("says", "sentence"),
    [
        (b"", "does not answer as the head of a Ray cluster"),
        (None, "does not answer as the head of a Ray cluster"),
        (b"SSH-2.0-OpenSSH_9.6\r\n", "does not answer as the head of a Ray cluster"),
        (GREETING, "did not answer within 4 s|cannot be joined"),
    ],
    ids=["silent", "hangs up", "another one", "only greets"],
)
def test_who_is_no_head_is_told_from_one_soon(monkeypatch, says, sentence):
    monkeypatch.setattr(module, "GREET", 1.0)
    monkeypatch.setattr(module, "START", 4.0)
    before, kept = of_ray(), []

    def serve(server):
        with contextlib.suppress(OSError):
            while True:
                kept.append(server.accept()[0])
                if says is None:
                    kept.pop().close()
                else:
                    kept[-1].sendall(says)

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=serve, args=(server,), daemon=True).start()
        port, began = server.getsockname()[1], time.monotonic()
        with pytest.raises(MachineError, match=sentence) as caught:
            Cluster(list, f"127.0.0.1:{port}")
    assert "\n" not in str(caught.value) and of_ray() <= before
    assert time.monotonic() - began < (30.0 if says == GREETING else 5.0)
    for connection in kept:
        connection.close()
