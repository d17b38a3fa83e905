"""A saved tree loads into an equal tree: random trees of the whole subset."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour

from bt_tasksim import trees
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import (
    Direction,
    Flag,
    Metres,
    ObjectName,
    Parameter,
    PlaceName,
    Points,
    Ratio,
    Text,
)
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Command
from bt_tasksim.trees.check import DEEPEST
from bt_tasksim.trees.nodes.train import Train


class Poke(ConceptModel):
    """A concept with a parameter of each kind."""

    target: ObjectName
    direction: Direction = (0.0, 0.0, 1.0)
    distance: Metres = 0.1
    ratio: Ratio = 0.5
    via: Points = ()
    to: PlaceName | None = None
    gently: Flag = False
    note: Text = "none"

    def command(self, action, seen, memory):
        return Command()

    def done(self, seen, memory):
        return np.True_


class Near(Condition):
    """A condition with a parameter."""

    target: ObjectName
    within: Metres = 0.02

    def holds(self, seen):
        return np.True_


class Ready(Condition):
    """A condition without parameters."""

    def holds(self, seen):
        return np.True_


NODES = {"Poke": Poke, "Near": Near, "Ready": Ready}

numbers = st.floats(-1e6, 1e6)
characters = st.characters(codec="utf-8", exclude_categories=("Cc", "Cs"), exclude_characters="\ufffe\uffff")
texts = (
    st.text(characters, min_size=1, max_size=12) | st.sampled_from(["a\nb", "a\tb", '"&<>', "Grasp"])
).filter(lambda s: s.strip() and not (s.strip()[0] == "{" and s.strip()[-1] == "}") and s != "=")
names = texts | st.sampled_from(["main", "root", "Sequence", "fetch", "fetch"])
vectors = st.tuples(numbers, numbers, numbers)
VALUES = {
    "object": texts,
    "place": texts,
    "text": texts,
    "vector": vectors,
    "points": st.lists(vectors, max_size=3).map(tuple),
    "flag": st.booleans(),
}


def values_of(parameter: Parameter) -> st.SearchStrategy:
    quantity = parameter.quantity
    if quantity.kind == "number":
        return st.floats(max(quantity.low, -1e9), min(quantity.high, 1e9))
    found = VALUES[quantity.kind]
    return found.filter(lambda v: max(map(abs, v)) > 1e-3) if quantity.unit_vector else found


@st.composite
def leaves(draw) -> Behaviour:
    cls = draw(st.sampled_from([Poke, Poke, Near, Ready]))
    arguments = {
        name: draw(values_of(p)) for name, p in cls.parameters().items() if p.required or draw(st.booleans())
    }
    if draw(st.booleans()):
        arguments["name"] = draw(names)
    if cls is Poke and draw(st.booleans()):
        arguments |= {"timeout": draw(st.floats(0.01, 1e4)), "tolerance": draw(st.floats(1e-4, 1.0))}
        arguments |= {"policy": draw(texts), "uncertainty": {"distance": draw(st.floats(1e-6, 1.0))}}
    return cls(**arguments)


def conditions() -> st.SearchStrategy:
    return st.builds(lambda target: Near(target), texts)


def extend(inner: st.SearchStrategy) -> st.SearchStrategy:
    several = st.lists(inner, min_size=1, max_size=3)
    guards = st.lists(conditions(), max_size=2)
    return st.one_of(
        st.builds(lambda n, c: trees.sequence(n, *c), names, several),
        st.builds(lambda n, c: trees.fallback(n, *c), names, several),
        st.builds(lambda n, g, c: trees.reactive_sequence(n, *g, c), names, guards, inner),
        st.builds(lambda n, g, c: trees.reactive_fallback(n, *g, c), names, guards, inner),
        st.builds(parallel_of, names, several, st.integers(-3, 3), st.integers(-3, 3)),
        st.builds(lambda n, c: trees.any_order(n, *c), names, several),
        st.builds(lambda k, c: trees.retry(k, c), st.just(-1) | st.integers(1, 9), inner),
        st.builds(lambda k, c: trees.retry_while_acting(k, c), st.just(-1) | st.integers(1, 9), inner),
        st.builds(lambda k, c, n: trees.repeat(k, c, name=n), st.just(-1) | st.integers(1, 9), inner, names),
        st.builds(lambda s, c: trees.timeout(s, c), st.floats(0.001, 1e4), inner),
        st.builds(lambda c: trees.invert(c), inner),
        st.builds(lambda c, n: trees.force_success(c, name=n), inner, names),
        st.builds(lambda c: trees.force_failure(c), inner),
        st.builds(lambda n, c: trees.subtree(n, c), names, inner),
        st.builds(lambda c, n: Train(c, n), inner, st.none() | names),
    )


def parallel_of(name: str, children: list[Behaviour], success: int, failure: int) -> Behaviour:
    def fit(count: int) -> int:
        return max(-len(children), min(len(children), count or 1))

    return trees.parallel(name, *children, success=fit(success), failure=fit(failure))


random_trees = st.recursive(leaves(), extend, max_leaves=12)


@settings(max_examples=150, deadline=None)
@given(random_trees)
def test_a_saved_tree_loads_into_an_equal_tree(tree):
    text = trees.tree_to_xml(tree)
    loaded = trees.tree_from_xml(text, NODES)
    assert trees.same_tree(tree, loaded)
    assert trees.same_tree(loaded, tree)
    assert trees.tree_to_xml(loaded) == text


@settings(max_examples=50, deadline=None)
@given(random_trees, random_trees)
def test_equal_trees_have_equal_xml(a, b):
    assert trees.same_tree(a, b) == (trees.tree_to_xml(a) == trees.tree_to_xml(b))


def small(**changes) -> Behaviour:
    arguments = {"target": "cup", "distance": 0.2} | changes
    return trees.sequence("main", Near("cup"), trees.retry(2, Poke(**arguments)))


@pytest.mark.parametrize(
    "changes",
    [
        {"target": "box"},
        {"distance": 0.3},
        {"name": "poke it"},
        {"timeout": 3.0},
        {"uncertainty": {"distance": 0.1}},
    ],
)
def test_trees_with_other_arguments_are_not_the_same(changes):
    assert trees.same_tree(small(), small())
    assert not trees.same_tree(small(), small(**changes))


def test_trees_of_other_shape_are_not_the_same():
    def guarded(make, *extra):
        return make("main", Near("cup"), *extra, Poke("cup"))

    plain = guarded(trees.sequence)
    assert not trees.same_tree(plain, guarded(trees.reactive_sequence))
    assert not trees.same_tree(plain, guarded(trees.fallback))
    assert not trees.same_tree(plain, guarded(trees.sequence, Ready()))
    assert not trees.same_tree(trees.retry(2, Ready()), trees.retry(3, Ready()))


def test_an_argument_that_equals_its_default_changes_nothing():
    assert trees.same_tree(small(ratio=0.5, timeout=Poke.default_timeout), small())


def test_only_what_was_given_is_written():
    root = ET.fromstring(trees.tree_to_xml(small()))
    node = root.find(".//BehaviorTree//Poke")
    assert node.attrib == {"target": "cup", "distance": "0.2"}
    assert root.find(".//RetryUntilSuccessful").attrib == {"num_attempts": "2"}


def test_a_file_holds_the_models_of_its_leaves():
    model = ET.fromstring(trees.tree_to_xml(small())).find("TreeNodesModel")
    ports = {p.get("name"): p for p in model.find("Action[@ID='Poke']")}
    assert ports["distance"].attrib == {"name": "distance", "type": "double", "default": "0.1"}
    assert ports["distance"].text == "m"
    assert ports["via"].get("type") == "std::vector<double>"
    assert ports["gently"].get("type") == "bool"
    assert ports["target"].get("default") is None
    assert {"policy", "timeout", "tolerance", "uncertainty"} <= set(ports)
    assert [p.get("name") for p in model.find("Condition[@ID='Near']")] == ["target", "within"]


def test_what_is_to_be_learned_is_written_and_its_decorator_declared():
    tree = trees.sequence("main", Train(Poke("cup")), Poke("box"))
    text = trees.tree_to_xml(tree)
    root = ET.fromstring(text)
    assert root.find(".//BehaviorTree//Train").attrib == {"name": "train poke cup"}
    assert root.find(".//Train/Poke").attrib == {"target": "cup"}
    assert [d.attrib for d in root.findall("TreeNodesModel/Decorator")] == [{"ID": "Train"}]
    loaded = trees.tree_from_xml(text, NODES)
    assert trees.same_tree(tree, loaded) and type(loaded.children[0]) is Train
    explicit = text.replace("<Train ", '<Decorator ID="Train" ').replace("</Train>", "</Decorator>")
    assert trees.same_tree(tree, trees.tree_from_xml(explicit, NODES))
    assert "Decorator" not in trees.tree_to_xml(small()), "only what a file holds is declared in it"
    assert '<Decorator ID="Train"/>' in trees.node_models(NODES), "an editor's palette has it"


def test_a_subtree_used_twice_is_written_once():
    def fetch():
        return trees.subtree("fetch", Poke("cup"))

    root = ET.fromstring(trees.tree_to_xml(trees.sequence("main", fetch(), fetch())))
    assert [tree.get("ID") for tree in root.findall("BehaviorTree")] == ["main", "fetch"]


def test_subtrees_of_one_name_and_other_content_stay_apart():
    tree = trees.sequence("all", *(trees.subtree("fetch it", Poke(o)) for o in ("cup", "box", "can")))
    text = trees.tree_to_xml(tree)
    loaded = trees.tree_from_xml(text, NODES)
    assert trees.same_tree(tree, loaded)
    uses = ET.fromstring(text).findall(".//SubTree")
    names = [use.get("name") for use in uses if use.get("name")]
    assert len(names) == len(set(names)), "BehaviorTree.CPP refuses two subtrees of one name in a tree"


def test_the_deepest_tree_goes_both_ways_and_deeper_is_refused():
    def nest(wrap, levels):
        tree = Ready()
        for _ in range(levels - 1):
            tree = wrap(tree)
        return tree

    for wrap in (trees.invert, lambda c: trees.subtree("s", c), lambda c: trees.sequence("s", c)):
        tree = nest(wrap, DEEPEST)
        assert trees.same_tree(tree, trees.tree_from_xml(trees.tree_to_xml(tree), NODES))
        with pytest.raises(InputError, match="more than 200 levels"):
            trees.tree_to_xml(nest(wrap, 2500))


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "tree.xml"
    trees.save_tree(small(), path)
    before = path.read_bytes()
    assert trees.same_tree(small(), trees.load_tree(path, NODES))
    with pytest.raises(InputError, match="cannot be written as XML"):
        trees.save_tree(trees.sequence("a\x00", Ready()), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["tree.xml"]
    with pytest.raises(InputError, match="does not exist"):
        trees.save_tree(small(), tmp_path / "nowhere" / "tree.xml")


def test_what_xml_cannot_hold_is_refused():
    with pytest.raises(InputError, match="blackboard"):
        trees.tree_to_xml(small(target="{cup}"))

    class Other(Behaviour):
        def update(self):
            raise NotImplementedError

    with pytest.raises(InputError, match=r"'mine' is a .*Other, which cannot be written as XML"):
        trees.tree_to_xml(trees.sequence("main", Other("mine")))


def test_leaves_of_one_name_and_two_classes_are_refused():
    first, second = (type("Same", (Ready,), {"__doc__": "One of two."}) for _ in range(2))
    with pytest.raises(InputError, match="two different leaves are called Same"):
        trees.tree_to_xml(trees.sequence("main", first(), second()))
