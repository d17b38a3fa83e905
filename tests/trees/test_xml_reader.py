"""What is read, and what is refused: by name and line, in one sentence."""

from __future__ import annotations

import time
import traceback

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim import trees
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.leaf import ModelLeaf
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Direction, Metres, ObjectName
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Command
from bt_tasksim.trees.xml_reader import MOST_NODES
from bt_tasksim.trees.xml_source import LARGEST


class Poke(ConceptModel):
    """A concept."""

    target: ObjectName
    direction: Direction = (0.0, 0.0, 1.0)
    distance: Metres = 0.1

    def command(self, action, seen, memory):
        return Command()

    def done(self, seen, memory):
        return np.True_


class Near(Condition):
    """A condition."""

    target: ObjectName

    def holds(self, seen):
        return np.True_


NODES = {"Poke": Poke, "Near": Near}


def read(body: str, *more: str, root: str = 'BTCPP_format="4" main_tree_to_execute="main"'):
    text = (
        f'<root {root}>\n<BehaviorTree ID="main">\n{body}\n</BehaviorTree>\n' + "\n".join(more) + "\n</root>"
    )
    return trees.tree_from_xml(text, NODES, source="kitchen.xml")


def test_compact_and_explicit_forms_are_the_same():
    compact = read('<Sequence name="a"><Near target="cup"/><Poke target="cup" distance="0.2"/></Sequence>')
    explicit = read(
        '<Control ID="Sequence" name="a"><Condition ID="Near" target="cup"/>'
        '<Action ID="Poke" target="cup" distance="0.2"/></Control>'
    )
    assert trees.same_tree(compact, explicit)
    assert trees.same_tree(compact, trees.sequence("a", Near("cup"), Poke("cup", distance=0.2)))


def test_every_node_of_the_subset():
    tree = read(
        """
        <Fallback>
          <ReactiveSequence name="guarded"><Near target="cup"/><Poke target="cup"/></ReactiveSequence>
          <ReactiveFallback><Near target="cup"/><Poke target="cup"/></ReactiveFallback>
          <Parallel success_count="1" failure_count="-1"><Near target="a"/><Near target="b"/></Parallel>
          <Inverter><Near target="cup"/></Inverter>
          <RetryUntilSuccessful num_attempts="3"><Poke target="cup"/></RetryUntilSuccessful>
          <Repeat num_cycles="-1"><Poke target="cup"/></Repeat>
          <Timeout msec="1500"><Poke target="cup"/></Timeout>
          <ForceSuccess><Poke target="cup"/></ForceSuccess>
          <ForceFailure><Poke target="cup"/></ForceFailure>
        </Fallback>
        """
    )

    def poke():
        return Poke("cup")

    def near(name="cup"):
        return Near(name)

    assert trees.same_tree(
        tree,
        trees.fallback(
            "Fallback",
            trees.reactive_sequence("guarded", near(), poke()),
            trees.reactive_fallback("ReactiveFallback", near(), poke()),
            trees.parallel("Parallel", near("a"), near("b"), success=1, failure=-1),
            trees.invert(near()),
            trees.retry(3, poke()),
            trees.repeat(-1, poke()),
            trees.timeout(1.5, poke()),
            trees.force_success(poke()),
            trees.force_failure(poke()),
        ),
    )


def test_settings_of_a_concept_are_ports():
    node = read(
        '<Poke target="cup" policy="programmed" timeout="3" tolerance="0.01" uncertainty="distance=0.02"/>'
    )
    assert node.arguments() == {
        "target": "cup",
        "policy": "programmed",
        "timeout": 3.0,
        "tolerance": 0.01,
        "uncertainty": {"distance": 0.02},
    }


SUBTREE = (
    '<BehaviorTree ID="fetch"><Sequence><Poke target="{what}" distance="{far}"/></Sequence></BehaviorTree>'
)


def test_parameters_of_a_subtree_are_put_in_place():
    tree = read(
        '<Sequence name="s"><SubTree ID="fetch" what="cup" far="0.2"/>'
        '<SubTree ID="fetch" name="again" what="box" far="0.3" _autoremap="false"/></Sequence>',
        SUBTREE,
    )
    expected = trees.sequence(
        "s",
        trees.subtree("fetch", trees.sequence("Sequence", Poke("cup", distance=0.2))),
        trees.subtree("again", trees.sequence("Sequence", Poke("box", distance=0.3))),
    )
    assert trees.same_tree(tree, expected)


def the_poke(tree):
    return next(n for n in tree.iterate() if isinstance(n, ModelLeaf) and isinstance(n.model, Poke))


def test_parameters_go_through_subtrees_of_subtrees():
    outer = '<BehaviorTree ID="outer"><SubTree ID="fetch" what="{thing}" far="{=}"/></BehaviorTree>'
    tree = read('<SubTree ID="outer" thing="cup" far="0.2"/>', outer, SUBTREE)
    assert the_poke(tree).arguments() == {
        "target": "cup",
        "distance": 0.2,
    }


def test_a_subtree_model_gives_defaults():
    port = '<input_port name="far" default="0.4"/>'
    model = f'<TreeNodesModel><SubTree ID="fetch">{port}</SubTree></TreeNodesModel>'
    tree = read('<SubTree ID="fetch" what="cup"/>', SUBTREE, model)
    assert the_poke(tree).model.distance == 0.4


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("<Grapsp/>", "line 3: unknown node 'Grapsp'; did you mean 'Grasp'?"),
        ('<Action ID="Pokee"/>', "line 3: unknown node 'Pokee'; did you mean 'Poke'?"),
        ('<Condition ID="Poke" target="cup"/>', "'Poke' is no Condition; write <Action"),
        ("<Action/>", "line 3: <Action> should have an ID"),
        ('<Poke ID="x"/>', "line 3: <Poke> may not have an ID"),
        ("<Poke/>", "line 3: poke: parameter 'target' is missing"),
        ('<Poke target="cup" distance="far"/>', "should be a number in m, found 'far'"),
        ('<Poke target="cup" distance="nan"/>', "it is not finite"),
        ('<Poke target="cup" direction="1;0"/>', "it has 2 numbers"),
        ('<Poke target="cup" distanse="1"/>', "no parameter 'distanse'; did you mean 'distance'?"),
        ('<Poke target="cup" timeout="-1"/>', "'timeout' should be a positive number, found -1.0"),
        ('<Poke target="cup" uncertainty="distance"/>', "should read like 'distance=0.01;angle=0.1'"),
        ('<Poke target="{cup}"/>', "line 3: 'target' refers to a blackboard ({cup})"),
        ('<Poke target="cup"><Near target="cup"/></Poke>', "line 3: <Poke> may not hold nodes, found <Near>"),
        ('<Poke target="cup">text</Poke>', "line 3: <Poke> holds text: 'text'"),
        ("<Sequence>\n</Sequence>", "line 3: <Sequence> should have at least one child"),
        ("<Inverter/>", "line 3: <Inverter> should have one child, found 0"),
        ('<Inverter>\n<Near target="a"/><Near target="a"/></Inverter>', "should have one child, found 2"),
        ('<Repeat><Near target="a"/></Repeat>', "line 3: <Repeat>: parameter 'num_cycles' is missing"),
        ('<Repeat num_cycles="two"><Near target="a"/></Repeat>', "a whole number from -2147483648 to"),
        (f'<Repeat num_cycles="{10**400}"><Near target="a"/></Repeat>', "should be a whole number from"),
        (f'<Timeout msec="{10**400}"><Near target="a"/></Timeout>', "to 4294967295, found '10000"),
        ('<Repeat num_cycles="0"><Near target="a"/></Repeat>', "should be a positive whole number, or -1"),
        ('<Repeat cycles="2"><Near target="a"/></Repeat>', "'cycles'; did you mean 'num_cycles'?"),
        ('<Timeout msec="0"><Near target="a"/></Timeout>', "line 3: 'Timeout': seconds should be a number"),
        ('<Parallel success_count="2"><Near target="a"/></Parallel>', "success count should lie between"),
        ('<Script code="a:=1"/>', "line 3: <Script> of BehaviorTree.CPP is outside the subset"),
        ('<SequenceWithMemory><Near target="a"/></SequenceWithMemory>', "outside the subset"),
        ('<Switch2 variable="a"/>', "outside the subset"),
        ('<Near target="a" _skipIf="b"/>', "line 3: the script '_skipIf' is outside the subset"),
        ('<Sequence><Near target="a"/>\n<Near target="a" _onSuccess="b"/></Sequence>', "line 4: the script"),
        ('<SubTree ID="fetsh"/>', "line 3: there is no subtree 'fetsh'"),
        ("<SubTree/>", "line 3: <SubTree> should have an ID"),
        ('<SubTree ID="main"/>', "line 3: subtrees go round in a circle: main -> main"),
        ('<ReactiveSequence name="r">\n<Poke target="a"/><Near target="a"/></ReactiveSequence>',
         "line 3: reactive sequence 'r' has no memory and would start 'poke a' anew"),
    ],
)  # fmt: skip
def test_bad_nodes_are_refused(body, sentence):
    with pytest.raises(InputError) as error:
        read(body)
    assert str(error.value).startswith("kitchen.xml, line ")
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("use", "sentence"),
    [
        (
            '<SubTree ID="fetch" what="cup"/>',
            "line 6: 'distance' refers to {far}, but subtree 'fetch' is used",
        ),
        (
            '<SubTree ID="fetch" what="cup" far="1" near="2"/>',
            "line 3: subtree 'fetch' has no parameter 'near'; known: far, what",
        ),
        ('<SubTree ID="fetch" what="cup" far="x"/>', "line 6: Poke: parameter 'distance' should be a number"),
        ('<SubTree ID="fetch" _autoremap="true"/>', "line 3: _autoremap is not read"),
        (
            '<SubTree ID="fetch"><Near target="a"/></SubTree>',
            'line 3: <SubTree ID="fetch"> may not hold nodes',
        ),
        ('<SubTree ID="fetch" what="{cup}" far="1"/>', "line 3: 'what' refers to a blackboard"),
        ("<fetch/>", "line 3: unknown node 'fetch'; to use the tree, write <SubTree ID=\"fetch\"/>"),
    ],
)
def test_bad_uses_of_subtrees_are_refused(use, sentence):
    with pytest.raises(InputError) as error:
        read(use, "", SUBTREE)
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "malformed XML: no element found"),
        ("<root", "line 1: malformed XML: unclosed token"),
        ('<root BTCPP_format="4">\n<BehaviorTree>\n<Sequence></root>', "line 3: malformed XML: mismatched"),
        ("<tree/>", "the first element should be <root>, found <tree>"),
        ("<root/>", 'line 1: <root> should have BTCPP_format="4"'),
        ('<root BTCPP_format="3"/>', 'line 1: BTCPP_format should be "4", found "3"'),
        ('<root BTCPP_format="4"/>', "there is no <BehaviorTree>"),
        ('<root BTCPP_format="4" main_tree="a"/>', "did you mean 'main_tree_to_execute'?"),
        ('<root BTCPP_format="4"><BehaviorTree ID="a"/></root>', "should hold one node, found 0"),
        ('<root BTCPP_format="4">\n<include path="/etc/passwd"/></root>', "line 2: <include> is not read"),
        ('<root BTCPP_format="4">\n<Behavior/></root>', "line 2: unknown element <Behavior>"),
        ('<root BTCPP_format="4"><TreeNodesModel/>\n<TreeNodesModel/></root>', "line 2: there is a second"),
        ('<!DOCTYPE root SYSTEM "http://example.org/a.dtd"><root/>', "a document type (DTD) is declared"),
        ("<root BTCPP_format='4'>&cup;</root>", "undefined entity"),
    ],
)  # fmt: skip
def test_bad_documents_are_refused(text, sentence):
    with pytest.raises(InputError) as error:
        trees.tree_from_xml(text, NODES, source="kitchen.xml")
    assert str(error.value).startswith("kitchen.xml, line ")
    assert sentence in str(error.value)


def one(name: str, body: str = '<Near target="a"/>') -> str:
    return f'<BehaviorTree ID="{name}">{body}</BehaviorTree>\n'


@pytest.mark.parametrize(
    ("attributes", "definitions", "sentence"),
    [
        ("", one("a") + one("b"), "of several trees (a, b), main_tree_to_execute should name one"),
        ('main_tree_to_execute="aa"', one("a"), "names no tree 'aa'"),
        ("", one("a") + one("a"), "line 2: a second <BehaviorTree> has the ID 'a', the first is on line 1"),
        ("", one("Sequence"), "may not have the ID 'Sequence'"),
        ('main_tree_to_execute="a"', one("a", '<SubTree ID="b"/>') + one("b", '<SubTree ID="c"/>')
         + one("c", '<SubTree ID="b"/>'), "line 3: subtrees go round in a circle: b -> c -> b"),
    ],
)  # fmt: skip
def test_bad_sets_of_trees_are_refused(attributes, definitions, sentence):
    with pytest.raises(InputError) as error:
        trees.tree_from_xml(f'<root BTCPP_format="4" {attributes}>{definitions}</root>', NODES)
    assert sentence in str(error.value)


def test_entities_are_refused_by_line():
    bomb = '<!DOCTYPE root [\n<!ENTITY a "aaaa">\n<!ENTITY b "&a;&a;">]>\n<root BTCPP_format="4">&b;</root>'
    with pytest.raises(InputError, match=r"line 1: a document type \(DTD\) is declared, which is not read"):
        trees.tree_from_xml(bomb)


def test_deep_files_are_refused_without_recursion():
    for levels in (220, 300, 30_000):
        body = "<Inverter>" * levels + '<Near target="a"/>' + "</Inverter>" * levels
        with pytest.raises(
            InputError, match=r"line 3: (more than 250 levels|the tree has more than 200 levels)"
        ):
            read(body)


def test_large_files_are_refused(tmp_path):
    path = tmp_path / "large.xml"
    path.write_bytes(b" " * (LARGEST + 10))
    with pytest.raises(InputError, match="is larger than"):
        trees.load_tree(path)


def test_subtrees_that_multiply_are_refused_soon():
    uses = "".join(
        one(f"t{i}", f'<Sequence><SubTree ID="t{i + 1}"/><SubTree ID="t{i + 1}"/></Sequence>')
        for i in range(60)
    )
    start = time.process_time()  # whatever else the machine does
    with pytest.raises(InputError, match=f"more than {MOST_NODES} nodes"):
        read('<SubTree ID="t0"/>', uses, one("t60"))
    assert time.process_time() - start < 10


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no tree file"):
        trees.load_tree(tmp_path / "nowhere.xml")
    with pytest.raises(InputError, match="not an ordinary file"):
        trees.load_tree(tmp_path)


def test_what_editors_leave_behind_is_passed_over():
    tree = trees.tree_from_xml(
        '<?xml version="1.0" encoding="UTF-8"?>\n<!-- by hand -->\n<root BTCPP_format="4">\n'
        '<BehaviorTree ID="main" _fullpath=""><Near target="a" _uid="3"/></BehaviorTree>\n'
        '<TreeNodesModel><Condition ID="Near"><input_port name="target">words</input_port></Condition>'
        "</TreeNodesModel></root>",
        NODES,
    )
    assert trees.same_tree(tree, Near("a"))


@pytest.mark.parametrize(
    "content",
    [
        b'<?xml version="1.0" encoding="martian"?><root/>',
        b'<root BTCPP_format="\xff"/>',
        b"\xff\xfe<\x00",
        b"\x00" * 100,
        b"\x89PNG\r\n\x1a\n",
    ],
)
def test_bytes_that_are_no_xml_are_refused(content):
    with pytest.raises(InputError, match="malformed XML"):
        trees.tree_from_xml(content)


def test_other_encodings_are_read():
    body = '<root BTCPP_format="4"><BehaviorTree><Near target="Tür"/></BehaviorTree></root>'
    text = '<?xml version="1.0" encoding="utf-16"?>' + body
    assert trees.same_tree(trees.tree_from_xml(text.encode("utf-16"), NODES), Near("Tür"))
    assert trees.same_tree(trees.tree_from_xml(text, NODES), Near("Tür"))


GOOD = trees.tree_to_xml(
    trees.sequence(
        "a", trees.retry(2, trees.subtree("s", Poke("cup", distance=0.2, uncertainty={"distance": 0.1})))
    )
).encode()


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, len(GOOD)), st.integers(0, 30), st.binary(max_size=6)),
        min_size=1,
        max_size=4,
    )
)
def test_a_damaged_file_is_read_or_refused_in_one_sentence(damages):
    content = GOOD
    for start, length, new in damages:
        content = content[:start] + new + content[start + length :]
    try:
        trees.tree_from_xml(content, NODES)
    except InputError as error:
        assert "\n" not in str(error)


def test_a_file_too_deep_is_refused_as_the_file_and_not_within_expat():
    """The command line names the code that an error comes from, and nobody wrote ``pyexpat.c``."""
    text = f'<root BTCPP_format="4"><BehaviorTree ID="a">{"<Inverter>" * 50_000}'
    with pytest.raises(InputError, match=r"^tree, line 1: more than 250 levels of elements$") as refused:
        trees.tree_from_xml(text)
    assert not [place for place in traceback.extract_tb(refused.tb) if "pyexpat" in place.filename]
