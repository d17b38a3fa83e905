"""From a decomposition graph to a tree."""

import networkx as nx
import numpy as np
import pytest
from draws import successes
from py_trees.composites import Sequence

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp import decompose_log, open_log
from bt_tasksim.trees.from_graph import tree_from_graph
from bt_tasksim.trees.nodes.fallback import Fallback

pytestmark = pytest.mark.physical


def graph(*nodes, alternatives=(), chain=True):
    made = nx.DiGraph()
    for i, (concept, parameters) in enumerate(nodes):
        made.add_node(f"{concept} {i}", concept=concept, parameters=parameters, uncertainty={}, share=1.0)
    if chain:
        nx.add_path(made, list(made))
    made.graph["alternatives"] = list(alternatives)
    return made


GRASP = ("grasp", {"target": "cup", "approach": (0.0, 0.0, -1.0)})
PICK = ("pick", {"target": "cup", "direction": (0.0, 0.0, 1.0), "distance": 0.12})
BRING = ("bring", {"target": "cup", "to": "goal", "via": [(0.0, -0.1, 0.2)]})
PLACE = ("place", {"target": "cup", "on": "goal", "direction": (0, 0, -1.0), "distance": 0.08})
RELEASE = ("release", {"target": "cup"})


def test_common_order_becomes_a_sequence_with_its_parameters():
    tree = tree_from_graph(graph(GRASP, PICK, BRING, PLACE, RELEASE), "carry")
    assert isinstance(tree, Sequence) and tree.memory and tree.name == "carry"
    assert [type(c.model) for c in tree.children] == [Grasp, Pick, Bring, Place, Release]
    pick, bring, place = (leaf.model for leaf in tree.children[1:4])
    assert pick.distance == pytest.approx(0.12) and pick.direction == (0, 0, 1)
    assert bring.to == "goal" and bring.via == ((0.0, -0.1, 0.2),)
    assert bring.hover == pytest.approx(0.08), "it ends where the place after it began"
    assert place.on == "goal"


@pytest.mark.parametrize(("distance", "hover"), [(0.5, 0.12), (0.001, 0.03)])
def test_the_hover_is_kept_within_reason(distance, hover):
    place = ("place", {**PLACE[1], "distance": distance})
    assert tree_from_graph(graph(GRASP, PICK, BRING, place)).children[2].model.hover == pytest.approx(hover)


@pytest.mark.parametrize(("degrees", "kept"), [(10, False), (20, True), (90, True)])
def test_an_approach_that_is_vertical_as_far_as_can_be_told_is_left_to_the_robot(degrees, kept):
    a = np.deg2rad(degrees)
    given = ("grasp", {"target": "cup", "approach": (np.sin(a), 0.0, -np.cos(a))})
    leaf = tree_from_graph(graph(given)).children[0].model
    assert (leaf.approach is not None) == kept
    assert not kept or leaf.approach == pytest.approx(given[1]["approach"], abs=1e-4)


def test_alternatives_become_a_fallback_that_tries_the_commoner_way_first():
    found = graph(GRASP, PICK, ("bring", {**BRING[1], "to": "other"}), BRING, RELEASE, chain=False)
    names = list(found)
    nx.add_path(found, [names[0], names[1], names[2], names[4]])
    nx.add_path(found, [names[1], names[3], names[4]])
    found.nodes[names[2]]["share"], found.nodes[names[3]]["share"] = 0.2, 0.8
    found.graph["alternatives"] = [[[names[2]], [names[3]]]]
    tree = tree_from_graph(found)
    assert [type(getattr(c, "model", c)) for c in tree.children] == [Grasp, Pick, Fallback, Release]
    ways = tree.children[2]
    assert ways.memory and [way.model.to for way in ways.children] == ["goal", "other"]


def test_the_spread_of_demonstrations_becomes_uncertainty():
    found = graph(GRASP, PICK)
    found.nodes["pick 1"]["uncertainty"] = {"distance": 0.02, "direction": np.array([0.03, 0.04, 0.0])}
    pick = tree_from_graph(found).children[1].model
    assert pick.uncertainty == {"distance": pytest.approx(0.02), "direction": pytest.approx(0.05)}


def test_what_cannot_become_a_tree_is_one_sentence():
    with pytest.raises(InputError, match="'empty': no task was recognised, so there is no tree to make"):
        tree_from_graph(nx.DiGraph(), "empty")
    with pytest.raises(InputError, match="the concept 'graps', which does not exist; did you mean 'grasp'"):
        tree_from_graph(graph(("graps", {"target": "cup"})))
    nowhere = ("place", {"target": "cup", "on": None, "distance": 0.1})
    with pytest.raises(InputError, match="'cup' was placed on something that the log does not name"):
        tree_from_graph(graph(GRASP, nowhere))


@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf", "pick_and_throw"])
def test_a_shipped_log_becomes_a_tree_that_runs(scenario):
    from bt_tasksim.execution.runner import Runner
    from bt_tasksim.trees.load import load_source

    log = open_log(asset("demonstrations", scenario, "03.h5"))
    tree = tree_from_graph(decompose_log(log, None).graph, scenario)
    successes(Runner(tree, load_source(scenario).scene).run, range(3, 8))
