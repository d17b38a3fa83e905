"""Around a sequence: which stages it has, when they are skipped, and that what is lost is taken again."""

import dataclasses
from itertools import combinations

import numpy as np
import pytest
from draws import successes
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from bt_tasksim import Goal
from bt_tasksim.concept_nodes import (
    AtPose,
    Bring,
    CloseDrawer,
    Grasp,
    HandEmpty,
    Inside,
    Lifted,
    OpenDrawer,
    Over,
    Pick,
    Place,
    Release,
    Upright,
    Wait,
    Withdraw,
)
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.runner import Runner
from bt_tasksim.execution.session import Session
from bt_tasksim.trees import (
    any_order,
    fallback,
    reactive_sequence,
    recovering,
    retry,
    same_tree,
    sequence,
    tidy,
    tree_from_xml,
    tree_to_xml,
)
from bt_tasksim.trees.backchain import asked_by, condition_named
from bt_tasksim.trees.load import load_source, scenarios
from bt_tasksim.trees.nodes.any_order import AnyOrder
from bt_tasksim.trees.stages import cut, lasting, opened
from bt_tasksim.trees.steps import are_tied, in_steps
from bt_tasksim.trees.walk import nodes_of


def task(target="cube", on="goal"):
    return [Grasp(target), Pick(target), Bring(target, to=on), Place(target, on=on), Release(target)]


def value(asked):
    return condition_named(asked.condition).value(**asked.arguments)


@pytest.mark.parametrize(
    ("leaves", "guard"),
    [
        (task(), AtPose.value("cube", on="goal")),
        (task()[:4], AtPose.value("cube", on="goal")),
        (task()[:3], Over.value("cube", "goal")),
        (task()[:2], Lifted.value("cube", height=0.1)),
        ([*task()[:3], Release("cube", into="bin")], Inside.value("cube", "bin")),
        ([*task()[:3], Release("cube")], None),
        ([*task()[:4], *task("cube", "bin")[1:3], Release("cube")], None),
        ([*task()[:4], *task("cube", "there")[1:]], AtPose.value("cube", on="there")),
        ([*task()[:4], Pick("cube")], Lifted.value("cube", height=0.1)),
    ],
)
def test_what_lasts_is_what_was_brought_about_and_not_undone(leaves, guard):
    found = lasting(leaves, "cube")
    assert (None if found is None else value(found)) == guard


def test_a_sequence_is_cut_where_the_hand_is_free():
    first, second, wait, upright = task("a", "s1"), task("b", "s2"), Wait(1.0), Upright("b")
    found = cut([wait, *first, *second, upright])
    assert [len(stage.nodes) for stage in found] == [1, 5, 6]
    assert [list(map(value, stage.guards)) for stage in found] == [
        [],
        [AtPose.value("a", on="s1")],
        [AtPose.value("b", on="s2"), Upright.value("b")],
    ]


def test_a_condition_behind_a_stage_tells_that_it_is_done_where_nothing_else_does():
    (stage,) = cut([*task()[:3], Release("cube"), Upright("cube")])
    assert list(map(value, stage.guards)) == [Upright.value("cube")]


def test_stages_may_be_nodes_of_their_own():
    inner = sequence("carry", *task("a", "s1"))
    own = fallback("b is there", Upright("b"), sequence("again", *task("b", "s2")))
    tried = retry(3, sequence("fetch", *task("c", "s3")[:2]))
    found = cut([inner, own, tried, *task("c", "s3")[2:]])
    assert [(len(s.nodes), s.own, *map(value, s.guards)) for s in found] == [
        (1, False, AtPose.value("a", on="s1")),
        (1, True, Upright.value("b")),
        (4, False, AtPose.value("c", on="s3")),
    ]


def test_every_object_of_a_stage_is_asked_about():
    tried = retry(3, sequence("both", *task("a", "s1"), *task("b", "s2")))
    (stage,) = cut([tried])
    wanted = [AtPose.value("a", on="s1"), AtPose.value("b", on="s2")]
    assert list(map(value, stage.guards)) == wanted
    _, work, *_ = recovering(sequence("all", tried)).decorated.children
    assert work.name == "a and b are done"
    assert [guard.model for guard in work.children[0].children] == wanted


def test_an_object_of_a_stage_of_which_nothing_tells_where_it_is_is_named():
    thrown = sequence("both", *task("a", "s1")[:3], Release("a", name="let it fly"), *task("b", "s2"))
    with pytest.raises(InputError, match="nothing tells whether 'a' is done after 'let it fly'"):
        recovering(sequence("all", retry(2, thrown)))


def test_sequences_in_sequences_are_cut_like_the_one_that_they_make():
    rows = {"a": task("a", "s1"), "b": task("b", "s2"), "c": task("c", "s3"), "d": task("d", "s4")}
    inner = sequence("inner", *rows["b"], *rows["c"][:2])
    whole = sequence("carry d", *rows["d"])
    tree = sequence("outer", sequence("first", *rows["a"], inner), *rows["c"][2:], whole)
    assert opened(tree.children) == [*rows["a"], *rows["b"], *rows["c"], whole]
    assert inner.children[0] is rows["b"][0] and inner.parent is not None  # nothing is moved by looking
    _, work, *checks = recovering(tree).decorated.children
    assert [node.name for node in work.children] == [f"{name} is done" for name in "abcd"]
    assert not tree.children and whole.parent is not None and len(checks) == 4


def test_what_stands_in_any_order_is_found_in_sequences_too():
    two, one = sequence("two", *task("a", "s1"), *task("b", "s2")), sequence("one", *task("c", "s3"))
    given = any_order("both", two, one)
    _, work, *checks = recovering(sequence("outer", sequence("inner", given))).decorated.children
    assert type(work) is AnyOrder and not given.children and len(checks) == 3
    assert [node.name for node in work.children[0].children] == ["a is done", "b is done"]
    assert work.children[1].name == "c is done"


def test_every_stage_is_guarded_and_all_are_asked_at_the_end():
    tree = recovering(sequence("two", *task("a", "s1"), *task("b", "s2")), attempts=3)
    assert tree.attempts == 5  # one, and two more for each stage
    free, both, *checks = tree.decorated.children
    first, second = both.children
    assert free.children[0].model == HandEmpty.value()
    wanted = [AtPose.value("a", on="s1"), AtPose.value("b", on="s2")]
    assert [stage.children[0].model for stage in (first, second)] == wanted
    assert [stage.children[1].children[-1].model for stage in (first, second)] == wanted
    assert [check.model for check in checks] == wanted


STAGES = {
    "a": task("a", "s1"),
    "b on a": task("b", "a"),
    "c": task("c", "s3"),
    "d on b": task("d", "b"),
    "wait": [Wait(1.0)],
    "held": task("e", "s5")[:2],
}


@pytest.mark.parametrize(
    ("row", "steps"),
    [
        (["a", "c"], [[["a"], ["c"]]]),
        (["a", "b on a"], [[["a", "b on a"]]]),
        (["a", "b on a", "c"], [[["a", "b on a"], ["c"]]]),
        (["a", "c", "b on a"], [[["a", "c", "b on a"]]]),
        (["c", "a", "b on a", "d on b"], [[["c"], ["a", "b on a", "d on b"]]]),
        (["d on b", "a", "c"], [[["d on b"], ["a"], ["c"]]]),
        (["a", "wait", "c"], [[["a"]], [["wait"]], [["c"]]]),
        (["a", "c", "held"], [[["a"], ["c"]], [["held"]]]),
    ],
)
def test_stages_keep_their_order_where_one_names_what_the_other_moves(row, steps):
    of = {id(leaf): name for name, leaves in STAGES.items() for leaf in leaves}
    found = in_steps(cut([leaf for name in row for leaf in STAGES[name]]))
    assert [[[of[id(s.nodes[0])] for s in block] for block in step] for step in found] == steps


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 9)), min_size=1, max_size=8))
def test_steps_hold_all_stages_in_their_order(pairs):
    row = cut([leaf for k, to in pairs for leaf in task(f"o{k}", f"o{to}")])
    steps = in_steps(row)
    assert [stage for step in steps for block in step for stage in block] == row
    for step in steps:
        for first, second in combinations(step, 2):
            assert not any(are_tied(a, b) for a in first for b in second)


def test_what_may_change_places_stands_in_any_order_and_the_rest_in_a_row():
    row = sequence("three", *task("a", "s1"), *task("b", "a"), *task("c", "s3"))
    _, work, *checks = recovering(row).decorated.children
    assert type(work) is AnyOrder and len(checks) == 3
    tied, other = work.children
    assert [len(tied.children), other.name] == [2, "c is done"]
    _, first, second, *_ = recovering(sequence("two", *task("a", "s1"), *task("b", "a"))).decorated.children
    assert [first.name, second.name] == ["a is done", "b is done"]


def test_an_order_that_an_author_leaves_open_stays_open():
    given = any_order("both", sequence("one", *task("a", "s1")), sequence("other", *task("b", "a")))
    _, work, *_ = recovering(given).decorated.children
    assert type(work) is AnyOrder and [node.name for node in work.children] == ["a is done", "b is done"]
    assert not given.children


def test_what_tidy_gives_is_taken_over_and_the_old_tree_is_left_without_it():
    goals = [Goal("b", "a"), Goal("a", "s1"), Goal("c", "table", relation="lifted")]
    old = tidy(goals, parking="table")
    names = [node.name for node in old.decorated.children[0].children]
    body = old.decorated
    _, work, held, *checks = recovering(old).decorated.children
    assert [node.name for node in work.children] == names and held.name == "c is done"
    assert {asked_by(check).arguments["target"] for check in checks} == {"a", "b", "c"}
    assert not body.children and all(node.parent is work for node in work.children)


def test_what_is_asked_already_is_not_asked_twice():
    for tree in (
        recovering(sequence("one", *task(), AtPose("cube", on="goal"))),
        recovering(tidy([Goal("cube", "goal")])),
    ):
        asked = [node for node in nodes_of(tree) if asked_by(node) is not None]
        assert sum(node.model == AtPose.value("cube", on="goal") for node in asked) == 2
    two = recovering(tidy([Goal("a", "s1"), Goal("b", "s2")]))
    asked = [n for n in nodes_of(two) if asked_by(n) is not None and n.model == AtPose.value("a", on="s1")]
    assert len(asked) == 3 and two.attempts == 2 + 2 * 2


NOT_RECOVERED = {
    **dict.fromkeys(("pull", "push"), "takes a sequence"),
    "press_button": "holds nothing that takes an object",
    **dict.fromkeys(("slide", "slide_to_stop", "push_with_tool", "pull_with_tool"), "nothing tells whether"),
}
"""Scenarios whose trees cannot be recovered by themselves, and why: what is slid or used as a tool is put
down anywhere."""


@pytest.mark.parametrize("name", scenarios())
def test_it_is_a_tree_like_any_other(name):
    tree = load_source(name).build()
    if name in NOT_RECOVERED:
        with pytest.raises(InputError, match=NOT_RECOVERED[name]):
            recovering(tree)
        return
    tree = recovering(tree)
    assert same_tree(tree_from_xml(tree_to_xml(tree)), tree)


@pytest.mark.parametrize(
    ("tree", "sentence"),
    [
        (
            lambda: Grasp("cube"),
            "recovering takes a sequence, or what tidy gives, and 'grasp cube' is a Grasp",
        ),
        (lambda: reactive_sequence("r", Upright("cube"), Wait(1.0)), "and 'r' is a Sequence: put it into"),
        (lambda: sequence("idle", Wait(1.0)), "'idle' holds nothing that takes an object"),
        (
            lambda: sequence("throw", *task()[:3], Release("cube", name="let it fly")),
            "nothing tells whether 'cube' is done after 'let it fly'",
        ),
        (lambda: sequence("a", sequence("b", *task())).children[0], "'b' stands under 'a'"),
    ],
)
def test_what_it_cannot_recover_is_refused_and_left_as_it_was(tree, sentence):
    given = tree()
    children = list(given.children)
    with pytest.raises(InputError, match=sentence):
        recovering(given)
    assert given.children == children and all(child.parent is given for child in children)


@pytest.mark.parametrize("attempts", [0, -1, 1.5, True])
def test_attempts_are_counted(attempts):
    with pytest.raises(InputError, match="'attempts' should be a positive whole number"):
        recovering(sequence("one", *task()), attempts=attempts)


def test_a_stage_that_is_done_is_skipped(toy):
    stage = toy(recovering(sequence("one", *task("cup", "goal"))))
    stage.world.stand("cup", "goal")
    stage.look()
    assert stage.tick() == Status.SUCCESS and not stage.world.steps


def test_the_hand_is_freed_before_anything_else(toy):
    stage = toy(recovering(sequence("one", *task("cup", "goal"))))
    stage.world.put(closure=np.float64(0.9), contacts=np.ones(2, bool))
    stage.look()
    stage.tick()
    assert stage.tree.tip().model == Withdraw.value()


LIFTED = Goal("cup", "table", relation="lifted")


def lifted(stage):
    """The cup hangs in the hand."""
    stage.world.hold("cup")
    stage.look()
    return stage


@pytest.mark.parametrize(
    "tree",
    [
        lambda: tidy([LIFTED]),
        lambda: sequence("take it", Grasp("cup"), Pick("cup", distance=0.1)),
        lambda: sequence("look and take it", Upright("box"), Grasp("cup"), Pick("cup"), Upright("cup")),
    ],
)
def test_what_is_to_be_held_and_is_held_is_not_dropped(toy, tree):
    stage = lifted(toy(recovering(tree())))
    assert stage.tick() == Status.SUCCESS and not stage.world.steps


def test_what_is_held_is_put_down_while_something_else_is_to_be_done_first(toy):
    tree = recovering(tidy([Goal("box", "goal"), LIFTED]))
    stage = lifted(toy(tree))
    stage.tick()
    assert stage.tree.tip().model == Place.value("cup", anywhere=True)
    stage = toy(tree)
    stage.world.stand("box", "goal")
    assert lifted(stage).tick() == Status.SUCCESS and not stage.world.steps


# ---- in physics ------------------------------------------------------------------------------------------

KNOCKED = "pick_and_place_recovering"


@pytest.mark.physical
def test_what_is_knocked_out_of_the_hand_is_taken_again():
    """The plain sequence succeeds in 1 of 20 of these draws, the recovering one in all."""
    scene = load_source(KNOCKED).scene
    results = successes(Runner(recovering(sequence("plain", *task())), scene).run, range(7, 12))
    assert all(result.status == Status.SUCCESS for result in results)
    plain = Runner(sequence("plain", *task()), scene)
    assert sum(plain.run(seed).success for seed in range(7, 12)) <= 2


@pytest.mark.physical
@pytest.mark.parametrize("high", [0.2, 0.4])
def test_what_can_be_brought_no_further_is_put_down_and_not_dropped(high):
    scene = dataclasses.replace(load_source(KNOCKED).scene, disturbed=None)
    carried = [Bring("cube", position=(0.45, 0.0, high)), Bring("cube", position=(0.2, 1.4, 0.3))]
    tree = recovering(sequence("too far", *task()[:2], *carried, *task()[3:]), attempts=2)
    falls = []
    with Session(tree, scene, seed=7) as session:
        while session.step() and session.tree.rounds < 1:
            pass
        while session.step():
            falls.append(float(session.hidden.velocities[0, 2]))
    assert session.result.status == Status.FAILURE and "does not reach" in session.result.why
    assert min(falls) > -0.3  # one that is let go 10 mm above a table falls so fast


@pytest.mark.physical
def test_it_ends_after_a_bounded_number_of_attempts():
    scene = load_source(KNOCKED).scene
    tree = recovering(sequence("one", *task(on="goal")[:4], Release("cube"), Upright("cube", angle=0.0)))
    result = Runner(tree, scene).run(7)
    assert result.status == Status.FAILURE and tree.rounds == 3
    assert "attempt 3 of 3 failed" in result.why


@pytest.mark.physical
def test_a_batch_comes_to_the_same():
    scene = load_source(KNOCKED).scene

    def build():
        return recovering(tidy([Goal("cube", "goal")]))

    runner = Runner(build(), scene)
    alone = {seed: runner.run(seed) for seed in (7, 8, 9)}
    with BatchRunner(build, scene, None, 3, 1) as batch:
        together = dict(batch.run(range(7, 10)))
    for seed, one in alone.items():
        assert (one.success, one.why, one.control_steps) == (
            together[seed].success,
            together[seed].why,
            together[seed].control_steps,
        )


def test_what_is_no_tree_or_empty_is_said_to_be():
    with pytest.raises(InputError, match=r"recovering takes a tree, such as .*, found nothing"):
        recovering(None)
    with pytest.raises(InputError, match="'nobody' is empty"):
        recovering(sequence("nobody"))


# ---- what is undone on purpose --------------------------------------------------------------------------


def carried(name, to):
    return [Grasp(name), Pick(name), Bring(name, to=to), Place(name, on=to), Release(name)]


def guards_of(tree):
    """The conditions that are asked at the end of all, and the first child of each stage."""
    work = tree.decorated
    ends = [type(node.model).__name__ for node in work.children if not node.children]
    return ends, [stage.children[0] for stage in work.children[1:] if stage.children]


def test_a_drawer_that_is_shut_again_need_not_be_open_at_the_end():
    work = [
        *(Grasp("drawer"), OpenDrawer("drawer"), Release("drawer")),
        *carried("cup", "goal"),
        *(Grasp("drawer"), CloseDrawer("drawer"), Release("drawer")),
    ]
    ends, (opens, carries, shuts) = guards_of(recovering(sequence("fetch", *work)))
    assert ends == ["AtPose", "IsShut"]
    asked = [type(leaf.model).__name__ for leaf in opens.iterate() if not leaf.children]
    assert asked == ["IsOpen", "AtPose"], "it has served where the cup is at its goal"
    assert not carries.children and not shuts.children


def test_what_is_moved_on_need_not_be_where_it_was_first():
    work = [*carried("cup", "first"), *carried("cup", "second")]
    ends, (one, two) = guards_of(recovering(sequence("on and on", *work)))
    assert ends == [], "the last stage has just asked"
    assert [leaf.model.on for leaf in one.iterate() if not leaf.children] == ["first", "second"]
    assert two.model.on == "second"


def test_what_two_stages_do_to_unlike_things_is_asked_of_both():
    ends, _ = guards_of(recovering(sequence("both", *carried("cup", "first"), *carried("box", "second"))))
    assert ends == ["AtPose", "AtPose"]
