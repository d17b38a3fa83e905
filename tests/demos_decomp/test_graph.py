"""Demonstrations of one activity merge into one graph."""

from __future__ import annotations

import json

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.concept.task import Task
from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.decompose import decompose, decompose_log
from bt_tasksim.demos_decomp.graph import build_graph, graph_to_json, in_order
from bt_tasksim.demos_decomp.log import Log
from bt_tasksim.demos_decomp.merging import aligned, merged_parameters
from bt_tasksim.demos_decomp.synthetic import make

WHOLE = ("grasp", "pick", "bring", "place", "release")


def chain(target, start=0.0, on="tray", concepts=WHOLE, distance=0.1):
    """Tasks of one object, one second each."""
    own = {
        "grasp": {"approach": np.array([0.0, 0, -1]), "closing": np.array([0.0, 1, 0])},
        "pick": {"direction": np.array([0.0, 0, 1]), "distance": distance},
        "bring": {"to": on, "via": []},
        "place": {"on": on, "direction": np.array([0.0, 0, -1]), "distance": distance},
        "release": {},
    }
    return [
        Task(concept, start + i, start + i + 1, 0.9, {"target": target, **own[concept]})
        for i, concept in enumerate(concepts)
    ]


def paths(graph, first, second):
    return nx.has_path(graph, first, second), nx.has_path(graph, second, first)


def test_one_demonstration_is_a_chain_with_its_evidence():
    graph = build_graph({"000": chain("cup")}, {"000": ("a.h5", "000")})
    assert list(graph) == [f"{c} cup" for c in WHOLE] == in_order(graph)
    assert list(graph.edges) == list(zip(list(graph)[:-1], list(graph)[1:], strict=True))
    assert graph.nodes["pick cup"]["evidence"] == [
        {"log": "a.h5", "demonstration": "000", "start": 1.0, "end": 2.0, "confidence": 0.9}
    ]
    assert graph.nodes["pick cup"]["uncertainty"] == {}
    assert graph.nodes["pick cup"]["share"] == 1.0


def test_common_order_becomes_a_chain_with_mean_and_deviation():
    graph = build_graph({str(i): chain("cup", distance=0.1 + 0.01 * i) for i in range(3)})
    node = graph.nodes["pick cup"]
    assert node["parameters"]["distance"] == pytest.approx(0.11)
    assert node["uncertainty"]["distance"] == pytest.approx(0.01)
    assert len(node["evidence"]) == 3
    assert graph.number_of_edges() == 4


def test_tasks_shown_in_both_orders_have_no_path_between_them():
    one, two = chain("cup"), chain("plate")
    later = [chain("cup", 5), chain("plate", 5)]
    graph = build_graph({"a": [*one, *later[1]], "b": [*two, *later[0]]})
    for a in WHOLE:
        for b in WHOLE:
            assert paths(graph, f"{a} cup", f"{b} plate") == (False, False)
    assert nx.number_weakly_connected_components(graph) == 2
    assert graph.graph["alternatives"] == []


def test_an_order_that_all_share_is_kept():
    graph = build_graph({n: [*chain("cup"), *chain("plate", 5)] for n in "ab"})
    assert nx.is_path(graph, in_order(graph))


def test_two_ways_of_doing_it_are_alternatives():
    shown = {"a": chain("cup", on="tray"), "b": chain("cup", on="shelf"), "c": chain("cup", on="shelf")}
    graph = build_graph(shown)
    assert graph.graph["alternatives"] == [
        [["bring cup to shelf", "place cup on shelf"], ["bring cup to tray", "place cup on tray"]]
    ]
    assert paths(graph, "bring cup to tray", "bring cup to shelf") == (False, False)
    assert paths(graph, "pick cup", "place cup on tray") == (True, False)
    assert paths(graph, "place cup on tray", "release cup") == (True, False)
    assert graph.nodes["place cup on shelf"]["share"] == pytest.approx(2 / 3)


def test_a_step_that_some_leave_out_is_no_alternative():
    graph = build_graph({"a": chain("cup"), "b": [t for t in chain("cup") if t.concept != "bring"]})
    assert graph.graph["alternatives"] == []
    assert graph.nodes["bring cup"]["share"] == 0.5
    assert nx.is_path(graph, in_order(graph))


def test_a_repeated_attempt_does_not_turn_the_order_round():
    again = [*chain("cup", concepts=("grasp", "release")), *chain("cup", 2)]
    graph = build_graph({"a": chain("cup"), "b": chain("cup"), "c": again})
    assert nx.is_directed_acyclic_graph(graph)
    both = [n for n in in_order(graph) if graph.nodes[n]["share"] == 1.0]
    assert [graph.nodes[n]["concept"] for n in both] == list(WHOLE)
    assert paths(graph, both[0], both[-1]) == (True, False)


def test_same_task_twice_gets_a_number():
    graph = build_graph({"a": [*chain("cup"), *chain("cup", 5)]})
    assert "grasp cup" in graph
    assert "grasp cup #2" in graph


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.lists(st.tuples(st.sampled_from(WHOLE), st.sampled_from(["cup", "plate"])), max_size=7),
        min_size=1,
        max_size=4,
    )
)
def test_any_demonstrations_merge_into_an_acyclic_graph_that_none_contradicts(shown):
    demonstrations = {
        str(n): [chain(target, i, concepts=(concept,))[0] for i, (concept, target) in enumerate(tasks)]
        for n, tasks in enumerate(shown)
    }
    graph = build_graph(demonstrations)
    assert nx.is_directed_acyclic_graph(graph)
    assert sum(len(graph.nodes[n]["evidence"]) for n in graph) == sum(map(len, shown))
    json.dumps(graph_to_json(graph))
    for a, b in nx.transitive_closure(graph).edges:
        when = [
            {piece["demonstration"]: piece["start"] for piece in graph.nodes[name]["evidence"]}
            for name in (a, b)
        ]
        both = when[0].keys() & when[1].keys()
        orders = {when[0][d] < when[1][d] for d in both}
        assert orders != {True, False}, "shown in both orders, but there is a path"


@given(st.permutations(range(4)))
def test_the_order_of_the_demonstrations_does_not_matter(order):
    shown = {
        "0": chain("cup"),
        "1": chain("cup", on="shelf"),
        "2": [*chain("cup"), *chain("plate", 5)],
        "3": [*chain("plate"), *chain("cup", 5)],
    }
    one, other = build_graph(shown), build_graph({str(i): shown[str(i)] for i in order})
    assert set(one) == set(other)
    assert set(one.edges) == set(other.edges)


def test_axes_without_a_sense_are_averaged_as_axes():
    tasks = chain("cup", concepts=("grasp",)) * 2
    turned = [
        Task("grasp", 0, 1, 1.0, {"target": "cup", "closing": np.array(v)})
        for v in ([0.1, 0.995, 0], [0.1, -0.995, 0])
    ]
    values, spread = merged_parameters([*tasks, *turned])
    assert abs(values["closing"][1]) > 0.99
    assert spread["closing"].max() < 0.15


def test_every_task_is_in_one_column():
    shown = {"a": chain("cup"), "b": [*chain("plate"), *chain("cup", 5)]}
    columns = aligned(shown)
    assert sum(len(column) for column in columns) == 15
    assert sorted(len(column) for column in columns) == [1] * 5 + [2] * 5


@pytest.fixture(scope="module")
def ten():
    return Log(
        "synthetic", tuple(make("shelf_to_shelf", 60 + i, name=f"{i:03d}")[0] for i in range(10)), path="x.h5"
    )


def test_a_log_of_ten_merges_into_one_chain(ten):
    found = decompose_log(ten)
    assert [task.concept for task in found.tasks] == list(WHOLE)
    assert nx.is_path(found.graph, in_order(found.graph))
    node = found.graph.nodes["bring cup"]
    assert node["share"] == 1.0
    via, spread = np.array(node["parameters"]["via"]), np.array(node["uncertainty"]["via"])
    assert via.shape == spread.shape
    assert 2 <= len(via) <= 3
    assert via[0][0] == pytest.approx(-0.22, abs=0.03)
    assert via[-1][0] == pytest.approx(-0.22, abs=0.03)
    assert via[0][2] > 0.4 > 0.2 > via[-1][2] > 0.0


def test_one_episode_of_a_log(ten):
    found = decompose_log(ten, episode=3)
    assert [t.to_json() for t in found.tasks] == [t.to_json() for t in decompose(ten.demonstrations[3])]
    assert [e["demonstration"] for e in found.graph.nodes["grasp cup"]["evidence"]] == ["003"]
    with pytest.raises(InputError, match="choose a number from 0 to 9"):
        decompose_log(ten, episode=10)


def test_several_logs_merge_as_one(ten):
    logs = [Log("human", (shown,), path=f"{i}.h5") for i, shown in enumerate(ten.demonstrations)]
    found = decompose_log(logs)
    assert [e["log"] for e in found.graph.nodes["grasp cup"]["evidence"]] == [f"{i}.h5" for i in range(10)]
    assert [t.concept for t in found.tasks] == list(WHOLE)


def test_json_has_what_the_command_line_promises(ten):
    content = json.loads(json.dumps(decompose_log(ten).to_json()))
    assert set(content["tasks"][0]) == {"concept", "start", "end", "confidence", "parameters"}
    assert {n["id"] for n in content["graph"]["nodes"]} == {f"{c} cup" for c in WHOLE}
    assert content["graph"]["edges"][0].keys() == {"from", "to", "demonstrations"}
    assert len(content["demonstrations"]) == 10
    single = json.loads(json.dumps(decompose_log(ten, 0).to_json()))
    assert [task["concept"] for task in single["tasks"]] == list(WHOLE)
    assert "demonstrations" not in single
