"""How actors are kept alive and given work, on a Ray that is played: no room, lost nodes, other versions."""

import pickle
import queue
from types import SimpleNamespace

import pytest

from bt_tasksim.core import cluster_process
from bt_tasksim.core.cluster_process import ClusterDriver, Settings
from bt_tasksim.core.errors import InputError, LeafError, MachineError
from bt_tasksim.core.identity import identity


class PlayedError(Exception):
    """Ray says that an actor is gone."""


class PlayedRay:
    """Actors in this process; `dies` says by an actor's number and method whether it ends in this call."""

    def __init__(self, room=2, dies=lambda number, method: False, versions=None):
        self.room, self.dies, self.versions = room, dies, versions
        self.made, self.killed, self.waits = [], 0, 0
        self.exceptions = SimpleNamespace(RayTaskError=ZeroDivisionError, RayError=PlayedError)
        self.cloudpickle = SimpleNamespace(register_pickle_by_value=lambda module: None)

    def remote(self, **options):
        assert options == {"num_cpus": 1, "memory": 5, "max_restarts": 0, "max_task_retries": 0}
        return lambda kind: SimpleNamespace(remote=lambda: self._actor(kind()))

    def nodes(self):
        gigabytes = [(True, 2), (True, 3), (False, 9)]
        return [{"Alive": alive, "Resources": {"memory": 1e9 * size}} for alive, size in gigabytes]

    def _actor(self, member):
        number = len(self.made)
        self.made.append(member)
        return SimpleNamespace(
            **{
                name: SimpleNamespace(remote=lambda *a, name=name: self._call(number, name, *a))
                for name in ("about", "begin", "more")
            }
        )

    def _call(self, number, name, *arguments):
        def call():
            if self.dies(number, name):
                raise PlayedError
            if name == "about" and self.versions is not None:
                return "far", *self.versions
            return getattr(self.made[number], name)(*arguments)

        return call

    def wait(self, calls, timeout):
        self.waits += 1
        return [calls[self.waits % len(calls)]] if self.room else [], calls

    def get(self, call):
        return call()

    def kill(self, handle):
        self.killed += 1

    def available_resources(self):
        return {"CPU": float(self.room), "memory": 1e9}


def collect(state, items):
    for index, item in enumerate(items):
        if item == "error":
            raise LeafError("leaf 'a' is broken")
        yield index, item


def spread(ray, items, count=None, address="far:1"):
    sent = []
    settings = Settings(address, count, 5, pickle.dumps(list), ".", identity(), "")
    driver = ClusterDriver(ray, settings, SimpleNamespace(send=sent.append), queue.Queue())
    driver.spread(pickle.dumps(collect), [pickle.dumps(item) for item in items], 4)
    parts = [what for kind, what in sent if kind == "part"]
    assert sorted(number for number, _ in parts) == list(range(len(items)))
    assert all(pickle.loads(content) == items[number] for number, content in parts)
    return [what for kind, what in sent if kind == "lost"]


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    for name, value in {"LOOK": 0.001, "LONGEST_REST": 0.0, "GATHER": 0.0}.items():
        monkeypatch.setattr(cluster_process, name, value)


@pytest.mark.parametrize(("count", "actors"), [(None, 2), (1, 1), (3, 3)])
def test_there_are_as_many_actors_as_asked_or_as_there_is_room_for(count, actors):
    ray = PlayedRay()
    assert spread(ray, list(range(30)), count) == []
    assert len(ray.made) == actors


@pytest.mark.parametrize("count", [None, 2])
def test_lost_actors_are_made_up_for(count):
    calls = []

    def dies(number, method):
        calls.append(method)
        return method == "more" and len(calls) % 7 == 0 and len(calls) < 60

    ray = PlayedRay(dies=dies)
    lost = spread(ray, list(range(40)), count)
    assert lost and len(lost) == ray.killed and all(node != "?" for node, _ in lost)


def test_actors_that_cannot_begin_are_an_error_where_no_other_lives():
    with pytest.raises(MachineError, match="end while they begin"):
        spread(PlayedRay(dies=lambda number, method: method == "begin"), [1, 2])
    # a node that is gone and not yet missed takes one after the other, and another node works on
    ray = PlayedRay(dies=lambda number, method: number > 0 and method == "about")
    assert spread(ray, list(range(200)), 2) == [] and len(ray.made) > 5


def test_where_there_is_no_room_it_is_said(monkeypatch):
    monkeypatch.setattr(cluster_process, "ROOM", 0.05)
    with pytest.raises(MachineError, match=r"no room for an actor.*largest node has 3\.0 GB.*ray status"):
        spread(PlayedRay(room=0), [1])


@pytest.mark.parametrize(
    ("versions", "said"),
    [
        (({**identity(), "source": "x"}, ""), "the node far of the cluster has another version .*source"),
        (({**identity(), "numpy": "1.0"}, ""), "numpy 1.0, here"),
        (({}, "ImportError: none"), "the node far of the cluster has no bt-tasksim.*ImportError"),
    ],
)
def test_another_version_is_an_error(versions, said):
    with pytest.raises(InputError, match=said):
        spread(PlayedRay(versions=versions), [1])


def test_errors_of_the_work_come_as_they_are():
    with pytest.raises(LeafError, match=r"^leaf 'a' is broken$"):
        spread(PlayedRay(), [1, "error"])
