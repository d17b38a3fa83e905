"""An activation as an episode: when the leaf acts, what it is paid, how it ends."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence
from toys import (
    DONE,
    DOWN,
    SCENE,
    STEP,
    STILL,
    UP,
    Below,
    Check,
    Even,
    Move,
    Raise,
    Turn,
    Unprogrammed,
    activations,
    honest,
    play,
)  # fmt: skip

from bt_tasksim import ObjectSpec, Scene
from bt_tasksim.concept_nodes import Wait
from bt_tasksim.core.batch_leaf import RUNNING
from bt_tasksim.core.errors import InputError, LeafError, MachineError, NoDrawError, UnreachableError
from bt_tasksim.core.outcomes import PRECONDITION_UNMET
from bt_tasksim.execution.clear_start import clear_draw
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import LearnedPolicy
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.episode_batch import REDRAWS
from bt_tasksim.training.learning_leaves import find_train
from bt_tasksim.training.reward import PARTS, Reward
from bt_tasksim.trees import (
    fallback,
    force_failure,
    force_success,
    invert,
    parallel,
    reactive_sequence,
    repeat,
    retry,
    sequence,
    subtree,
    timeout,
)
from bt_tasksim.trees.nodes.train import Train, train_nodes

HERE = 0.35
"""Where the tool is at first."""


def simple(height=0.45, **settings):
    return sequence("s", Train(Raise(height=height, **settings)), Check(height=height))


def paid(info):
    return {part: value for part, value in info["reward"].items() if value and part != "shaping"}


def running(env):
    tree = env.batch.batch
    return [node.name for node, status in zip(tree.nodes, tree.status[0], strict=True) if status == RUNNING]


# ---- when the leaf acts --------------------------------------------------------------------------------

NESTS = {
    "leaf": lambda node: node,
    "sequences": lambda node: sequence("a", sequence("b", Below(2.0), node)),
    "fallback": lambda node: fallback("a", Below(0.1), node),
    "fallback first": lambda node: fallback("a", node, Move()),
    "parallel": lambda node: parallel("a", node, Wait(0.1)),
    "parallel last": lambda node: parallel("a", Wait(0.1), sequence("b", node), success=2),
    "retry": lambda node: retry(3, node),
    "repeat": lambda node: repeat(1, node),
    "time-out": lambda node: timeout(9.0, node),
    "inverted twice": lambda node: invert(invert(node)),
    "forced": lambda node: force_success(node),
    "forced to fail": lambda node: invert(force_failure(node)),
    "guarded": lambda node: reactive_sequence("a", Below(2.0), node),
    "subtree": lambda node: subtree("a", sequence("b", node)),
    "all of it": lambda node: retry(
        2,
        subtree(
            "a", fallback("b", Below(0.1), timeout(9.0, sequence("c", parallel("d", invert(invert(node))))))
        ),
    ),
}
BEFORE = {
    "nothing before": (),
    "a programmed one before": (lambda: Move(0.3),),
    "several before": (lambda: Move(0.3), lambda: Wait(0.1), lambda: retry(2, sequence("m", Move(0.35)))),
}


@pytest.mark.parametrize("before", BEFORE.values(), ids=list(BEFORE))
@pytest.mark.parametrize("nest", NESTS.values(), ids=list(NESTS))
def test_the_leaf_acts_once_a_period_and_only_when_told(env_of, nest, before):
    leaf = Raise()
    tree = sequence("root", *(make() for make in before), nest(Train(leaf)), Check())
    env = env_of(tree)
    world = env.batch.worlds.pipeline
    features, _ = env.reset(seed=3)
    for _ in range(3):
        assert leaf.log == ["begin"] and activations(env, leaf) == 1, "it has begun, and did nothing yet"
        steps, expected = len(world.steps), []
        while True:
            action = honest(features)
            features, _, terminated, truncated, info = env.step(np.array(action))
            if terminated or truncated:
                break
            expected.append(f"command {action[0]:g}")
            steps += 1
            assert leaf.log == ["begin", *expected] and len(world.steps) == steps
        assert leaf.log == ["begin", *expected] and len(expected) >= 5
        assert info["is_success"] and info["follower"] == "SUCCESS", info["why"]
        leaf.log.clear()
        activations(env, leaf)[:] = 0
        features, _ = env.reset()
    assert env.redrawn == 0


@pytest.mark.parametrize("nest", NESTS.values(), ids=list(NESTS))
def test_a_wrong_signal_is_not_paid_wherever_it_stands(env_of, nest):
    env = env_of(sequence("root", nest(Train(Raise())), Check()))
    _, terminated, _, info = play(env, lambda features: DONE)
    assert terminated and paid(info) == {"failure": -1.0} and not info["is_success"]


def test_a_single_leaf_is_a_tree(env_of):
    rewards, _, _, info = play(env_of(Train(Raise())), honest)
    assert info["is_success"] and rewards[-1] > 0.9 and len(rewards) == 6


@pytest.mark.parametrize("follower", [(), (Check,)])
def test_several_leaves_learn_and_programmed_ones_act_among_them(env_of, follower):
    first, second = Raise(height=0.37, name="first"), Raise(height=0.45, name="second")
    inner = sequence(
        "i", Move(0.33), first, fallback("f", Below(0.1), Move(0.41)), second, Wait(0.1), Move(0.45)
    )
    env = env_of(sequence("s", Move(0.3), Train(inner), *(make() for make in follower)))
    assert env.learners == [first, second] and env.observation_space.shape == (3,)
    rewards, _, _, info = play(env, honest)
    assert info["is_success"], info["why"]
    assert [log.split()[0] for log in first.log] == ["begin"] + ["command"] * 2
    assert [log.split()[0] for log in second.log] == ["begin"] + ["command"] * 2
    assert len(rewards) == 2 + 2 + 2, "programmed leaves decide for themselves"
    # The way from the first leaf's last decision to the second's first one is nobody's doing.
    assert rewards[2] == 0.0


def test_what_was_learned_before_acts_before(env_of):
    up = Network(np.zeros(3), np.ones(3), [(np.array([[10.0, 0, 0], [-10.0, 0, 0]]), np.array([0.0, 3.0]))])
    tree = sequence("s", Unprogrammed(name="first", height=0.4), Train(Raise()), Check())
    env = env_of(tree, policies={"first": LearnedPolicy(up, "up")})
    features, _ = env.reset(seed=0)
    assert 0.0 < features[0] < 0.8, "the first one has brought the tool some of the way"
    assert play(env, honest)[3]["is_success"]
    with pytest.raises(InputError, match="leaf 'first' has no policy yet: Unprogrammed is not programmed"):
        env_of(sequence("s", Unprogrammed(name="first"), Train(Raise()))).reset(seed=0)


def test_ticks_without_a_decision_go_by(env_of):
    class Late(Raise):
        """Decides after a while only."""

        def decides(self, seen, memory):
            return memory >= 4

    leaf = Late()
    env = env_of(Train(leaf))
    env.reset(seed=0)
    assert leaf.log == ["begin"] + ["command 0"] * 4 and env.batch.context.now == pytest.approx(0.2)


# ---- what it is paid -----------------------------------------------------------------------------------


def test_the_motion_counts_for_nothing_when_it_is_done(env_of):
    leaf = Raise()
    env = env_of(Train(leaf))
    env.reset(seed=0)
    env.step(np.array(UP))
    _, reward, terminated, _, info = env.step(np.array([1.0, 1.0]))
    assert terminated and leaf.log == ["begin", "command 1"]
    assert env.batch.worlds.pipeline.now.tool_pose[2] == pytest.approx(HERE + STEP)
    gained = STEP / 0.1
    assert info["reward"]["shaping"] == pytest.approx(-Reward().shaping * gained), "failed: nothing is kept"
    assert reward == pytest.approx(-1.0 - Reward().shaping * gained)


def test_shaping_is_the_change_of_the_necessary_cost(env_of):
    env = env_of(simple(), reward=Reward(shaping=2.0, gamma=0.9))
    env.reset(seed=0)
    found = [env.step(np.array(a))[1] for a in (UP, UP, STILL, DOWN)]
    # Potentials 0, 0.2, 0.4, 0.4, 0.2.
    assert found == pytest.approx([2 * 0.18, 2 * (0.36 - 0.2), 2 * (0.36 - 0.4), 2 * (0.18 - 0.4)])


ENDS = {
    "right": (lambda: simple(), honest, {"success": 1.0}, "check 0.45 succeeded"),
    "wrong": (lambda: simple(), lambda f: DONE, {"failure": -1.0}, "check 0.45: limit violated"),
    "time-out": (lambda: simple(), lambda f: STILL, {"timeout": -1.0}, "not done within 1.5 s"),
    "violated": (lambda: simple(limit=0.4), lambda f: UP, {"violated": -1.0}, "limit violated: the tool"),
    "failed": (
        lambda: sequence("r", Train(sequence("i", Raise(), Below(0.1))), Check()),
        honest, {"failure": -1.0}, "the tool is 450 mm high",
    ),
    "interrupted": (
        lambda: reactive_sequence("r", Below(0.4), simple()), lambda f: UP, {}, "interrupted",
    ),
    "out of time": (
        lambda: timeout(0.2, simple()), lambda f: UP, {}, "interrupted",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("tree", "decide", "parts", "why"), ENDS.values(), ids=list(ENDS))
def test_how_it_ends_and_what_is_said(env_of, tree, decide, parts, why):
    env = env_of(tree())
    features, _ = env.reset(seed=5)
    while True:
        features, reward, terminated, truncated, info = env.step(np.array(decide(features)))
        assert tuple(info["reward"]) == PARTS
        assert sum(info["reward"].values()) == reward
        if terminated or truncated:
            break
    assert terminated and not truncated, "an end from inside the tree is an end"
    assert paid(info) == parts and info["why"].startswith(why)
    assert info["is_success"] is ("success" in parts)
    assert info["status"] == {"interrupted": "INVALID"}.get(why, "SUCCESS" if "check" in why else "FAILURE")
    assert not info["discarded"] and info["seconds"] == env.batch.context.now
    assert features.shape == (3,), "an end has an observation too"
    with pytest.raises(RuntimeError, match="call reset"):
        env.step(np.array(STILL))


def test_a_parallel_that_fails_interrupts(env_of):
    tree = parallel("p", Train(Raise()), sequence("w", Wait(0.1), Below(0.1)))
    _, terminated, _, info = play(env_of(tree), lambda f: UP)
    assert terminated and info["why"] == "interrupted" and paid(info) == {}


def test_the_next_attempt_is_another_episode(env_of):
    leaf = Raise(limit=0.4)
    env = env_of(retry(3, Train(leaf)))
    _, terminated, _, info = play(env, lambda f: UP)
    assert terminated and paid(info) == {"violated": -1.0} and activations(env, leaf) == 1


def test_an_attempt_that_could_not_begin_is_passed_over(env_of):
    class Picky(Raise):
        """Cannot start before the tool is low."""

        def initial_state(self, seen):
            return PRECONDITION_UNMET.where(seen.tool[:, 2] >= 0.34, text="the tool is too high")

    env = env_of(retry(3, sequence("s", fallback("f", Train(Picky()), force_failure(Move(0.3))))))
    _, _, _, info = play(env, honest)
    assert info["is_success"]


def test_without_what_follows_only_shaping_and_limits_pay(env_of):
    env = env_of(simple(), reward=Reward(sufficient=False))
    assert paid(play(env, honest)[3]) == {} == paid(play(env, lambda f: DONE)[3])
    assert paid(play(env, lambda f: STILL)[3]) == {"timeout": -1.0}
    assert play(env, honest)[3]["is_success"], "it is said, and not paid"


# ---- what never pays -----------------------------------------------------------------------------------


def returns(env, decide, seed=0):
    """The plain and the discounted return of an episode."""
    rewards = play(env, decide, seed)[0]
    return sum(rewards), sum(env.reward.gamma**t * r for t, r in enumerate(rewards))


@pytest.mark.parametrize("before", [(), (lambda: Move(0.45),)])
def test_idling_undoing_and_running_out_of_time_never_pay(env_of, before):
    """The second tree has its work done by an earlier sibling: undoing it and doing it again pays nothing."""
    env = env_of(sequence("s", *(make() for make in before), Train(Raise()), Check()))
    turns = {"n": 0}

    def undo_and_redo(features):
        turns["n"] += 1
        return DOWN if turns["n"] % 10 < 5 else UP

    def undo_redo_and_signal(features):
        turns["n"] += 1
        return DOWN if turns["n"] <= 5 else honest(features)

    best = returns(env, honest)
    assert best[1] > 0.9
    for decide in (lambda f: STILL, lambda f: UP, lambda f: DOWN, undo_and_redo):
        for found in returns(env, decide):
            assert found <= 0.0
    turns["n"] = 0
    assert returns(env, undo_redo_and_signal)[1] < best[1]
    # Coming there without ever saying so.
    for found, other in zip(returns(env, lambda f: [10 * float(f[0]), 0.0]), best, strict=True):
        assert found <= 0.0 < other


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=28))
def test_no_way_that_fails_pays(motions):
    env = shared_env()
    rest = iter([[m, 0.0] for m in motions])
    rewards, _, _, info = play(env, lambda f: next(rest, DONE))
    if not info["is_success"]:
        assert sum(env.reward.gamma**t * r for t, r in enumerate(rewards)) <= 0.0


_SHARED = []


def shared_env():
    """One environment for many examples."""
    if not _SHARED:
        from unittest import mock

        import toys

        with mock.patch("bt_tasksim.training.episode_batch.worlds_for", toys.toy_worlds):
            _SHARED.append(EpisodeEnv(simple(), SCENE))
    return _SHARED[0]


# ---- draws, limits, errors -----------------------------------------------------------------------------


def test_draws_that_do_not_reach_it_are_drawn_again_and_counted(env_of):
    env = env_of(sequence("s", Even(), Train(Raise()), Check()))
    counts = [env.reset(seed=k)[1]["redrawn"] for k in range(40)]
    assert env.redrawn == sum(counts) and 10 < sum(counts) < 120
    assert min(counts) == 0
    for k in range(5):
        _, info = env.reset(seed=k)
        cup = SCENE.sample(info["draw"], "training").objects[0].pose
        assert cup[0] > 0.5, "the world that is said is the one there is"


def test_what_is_never_reached_is_one_sentence(env_of):
    env = env_of(sequence("s", Below(0.1), Train(Raise(), "mine")))
    with pytest.raises(InputError) as caught:
        env.reset(seed=0)
    assert str(caught.value).startswith(f"'mine' was not reached in {REDRAWS} draws; the last one (seed ")
    assert "ended with FAILURE: the tool is 350 mm high" in str(caught.value)
    with pytest.raises(InputError, match=r"not reached in 1 draws; the last one \(seed 7\)"):
        env.reset(options={"draw": 7})


def test_what_starts_in_the_robot_is_drawn_again_and_what_always_does_is_one_sentence(env_of):
    scene = Scene(objects={"cup": ObjectSpec("box", on="table", centre=(-0.38, 0.0), area=(0.12, 0.0))})
    env = env_of(simple(), scene)
    counts = [env.reset(seed=k)[1]["redrawn"] for k in range(10)]
    assert env.redrawn == sum(counts) > 0 and min(counts) == 0
    _, info = env.reset(seed=0)
    clear_draw(scene, info["draw"], "training", env.batch.robot)
    _, terminated, _, info = play(env, honest)
    assert terminated and info["is_success"]
    near = Scene(objects={"cup": ObjectSpec("box", on="table", centre=(-0.55, 0.0), area=(0.0, 0.0))})
    env = env_of(simple(), near)
    with pytest.raises(NoDrawError, match=r"^with seed 7 'cup' starts \d+ mm inside"):
        env.reset(options={"draw": 7})
    said = f"was not reached in {REDRAWS} draws; the last one had no world: with seed \\d+ 'cup' starts"
    with pytest.raises(InputError, match=said):
        env.reset(seed=0)


def test_a_limit_from_outside_truncates(env_of):
    env = env_of(simple(), longest=0.2)
    rewards, terminated, truncated, info = play(env, lambda f: STILL)
    assert truncated and not terminated and info["reason"] == "time_over"
    assert paid(info) == {} and not info["discarded"] and env.discarded == 0
    assert len(rewards) == 5 and env.batch.context.now == pytest.approx(0.2)


def test_a_limit_while_it_is_judged_discards(env_of):
    env = env_of(sequence("s", Train(Raise(height=HERE)), Check(height=HERE, ticks=1.0)), longest=0.3)
    _, terminated, truncated, info = play(env, honest)
    assert truncated and not terminated and info["discarded"] and env.discarded == 1
    assert paid(info) == {} and not info["is_success"] and info["reason"] == "follower_late"


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (MachineError("the engine stopped"), "machine_failed"),
        (UnreachableError("100 mm too far", 0.1, 0.0), "out_of_reach"),
    ],
)
def test_an_error_while_it_is_judged_discards(env_of, error, reason):
    env = env_of(simple(HERE))
    env.reset(seed=0)
    env.batch.worlds.pipeline.error = error
    _, _, terminated, truncated, info = env.step(np.array(DONE))
    assert truncated and not terminated and info["discarded"] and env.discarded == 1
    assert paid(info) == {} and not info["is_success"] and info["reason"] == reason
    env.batch.worlds.pipeline.error = None
    assert play(env, honest)[3]["is_success"] and env.discarded == 1


def test_out_of_reach_of_the_learner_is_its_failure(env_of):
    env = env_of(simple())
    env.reset(seed=0)
    env.batch.worlds.pipeline.error = UnreachableError("100 mm too far", 0.1, 0.0)
    _, _, terminated, _, info = env.step(np.array(UP))
    assert terminated and paid(info) == {"failure": -1.0} and info["reason"] == "out_of_reach"


class Broken(Check):
    """Raises."""

    def done(self, seen, memory):
        raise ZeroDivisionError("no such thing")


def test_a_leaf_that_raises_is_named_and_nothing_runs_on(env_of):
    env = env_of(sequence("s", Train(Raise(height=HERE)), Broken(HERE, name="bad")))
    env.reset(seed=0)
    with pytest.raises(LeafError, match=r"leaf 'bad' raised ZeroDivisionError in test_env.py:\d+: no"):
        env.step(np.array(DONE))
    assert running(env) == []
    with pytest.raises(RuntimeError, match="call reset"):
        env.step(np.array(DONE))
    env.reset(seed=0)


# ---- what is refused -----------------------------------------------------------------------------------


@pytest.mark.parametrize("action", [[0.0], [0.0, 0.0, 0.0], [[0.0, 0.0]], [np.nan, 0.0], [0.0, np.inf], 0.0])
def test_an_action_that_is_none_is_one_sentence(env_of, action):
    leaf = Raise()
    env = env_of(Train(leaf))
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"should be finite numbers of shape \(2,\), found"):
        env.step(np.array(action))
    assert leaf.log == ["begin"]
    env.step(np.array(UP))


def test_what_cannot_be_an_episode_is_refused(env_of):
    with pytest.raises(InputError, match=r"'a' and 'b' below 'both' see or do different things"):
        env_of(Train(sequence("s", Raise(name="a"), Turn(name="b")), "both"))
    with pytest.raises(InputError, match="'inner' stands below 'outer': one Train inside another"):
        env_of(Train(sequence("s", Train(Raise(), "inner")), "outer"))
    with pytest.raises(InputError, match=r"tree 's' has no Train\(\.\.\.\) node"):
        env_of(sequence("s", Raise()))
    with pytest.raises(InputError, match=r"nothing below 'train move 0.3' can learn"):
        env_of(Train(Move()))
    with pytest.raises(InputError, match="no Train node 'c' in the tree; there is 'a', 'b'"):
        env_of(sequence("s", Train(Raise(), "a"), Train(Raise(), "b")), train="c")
    with pytest.raises(InputError, match="render_mode should be"):
        env_of(Train(Raise()), render_mode="human")


class Ticks(Behaviour):
    """A user's own behaviour, which no batch knows: runs for two ticks."""

    def __init__(self, end=Status.SUCCESS):
        super().__init__("ticks")
        self.end, self.count = end, 0

    def initialise(self):
        self.count = 0

    def update(self):
        self.count += 1
        self.feedback_message = "ticked enough" if self.count > 2 else ""
        return self.end if self.count > 2 else Status.RUNNING


class Own(Sequence):
    """A user's own composite."""

    def __init__(self, *children):
        super().__init__("own", memory=True, children=list(children))


def test_behaviours_of_ones_own_run_before_between_and_in_what_follows(env_of):
    follower = Own(Below(), Check(), Ticks(), Check(name="second"))
    env = env_of(sequence("s", Ticks(), Train(sequence("i", Raise(), Ticks())), Ticks(), follower))
    for seed in (0, 1):
        rewards, _, _, info = play(env, honest, seed)
        assert info["is_success"] and info["why"] == "own succeeded" and len(rewards) == 6
        # Two ticks each of what is unknown, five of the leaf, two of each check.
        assert info["seconds"] == pytest.approx(0.05 * (2 + 5 + 2 + 2 + 2 + 2 + 2))
    info = play(env, lambda features: DONE)[3]
    assert info["follower"] == "FAILURE" and info["why"].startswith("check 0.45: limit violated")


def test_one_of_ones_own_that_fails_says_why(env_of):
    failing = sequence("s", Train(Raise()), Own(Check(), Ticks(Status.FAILURE)))
    info = play(env_of(failing), honest)[3]
    assert paid(info) == {"failure": -1.0} and info["why"] == "ticks: ticked enough"


def test_goals_below_a_composite_of_ones_own_are_judged(env_of):
    for tree in (
        lambda: sequence("s", Train(Raise()), Own(Check(blind=True))),
        lambda: Train(sequence("i", Raise(), Own(Check(blind=True)))),
    ):
        env = env_of(tree())
        assert play(env, honest)[3]["is_success"]
        env.batch.worlds.pipeline.truth = -0.05
        info = play(env, honest)[3]
        assert info["reason"] == "goal_missed" and not info["is_success"]


@pytest.mark.parametrize("make", [lambda: Own(Train(Raise())), lambda: Train(Own(Raise()))])
def test_what_learns_below_a_composite_of_ones_own_is_refused(env_of, make):
    with pytest.raises(InputError, match=r"cannot be trained below 'own': Own has no form that waits"):
        env_of(make())


def test_features_that_do_not_fit_their_layout_are_refused(env_of):
    class Wrong(Raise):
        """Says too little."""

        def features(self, seen, memory):
            return np.zeros((len(seen.tool), 2))

    with pytest.raises(InputError, match=r"'wrong 0.45': features\(\) gives \(2,\), layout\(\) says \(3,\)"):
        env_of(Train(Wrong())).reset(seed=0)


def test_a_train_node_is_found_by_name():
    tree = sequence("s", Train(Raise(), "a"), Train(Raise(), "b"))
    assert find_train(tree).name == "a" and find_train(tree, "b") is train_nodes(tree)[1]


def test_one_of_two_train_nodes_learns_and_the_other_is_programmed(env_of):
    first, second = Raise(height=0.4, name="first"), Raise(height=0.45, name="second")
    tree = sequence("s", Train(first, "a"), Train(second, "b"), Check())
    env = env_of(tree, train="b")
    env.reset(seed=0)
    assert len(first.log) > 1 and second.log == ["begin"]
    again = env_of(tree, train="a")
    first.log.clear()
    second.log.clear()
    again.reset(seed=0)
    assert first.log == ["begin"] and second.log == []
    assert play(again, honest)[3]["why"] == "b succeeded"
    assert len(second.log) > 1, "and now the other one decides for itself"


# ---- episodes do not disturb each other ----------------------------------------------------------------


@pytest.mark.parametrize("steps", [0, 1, 3])
def test_a_reset_in_the_middle_leaves_nothing_running(env_of, steps):
    leaf = Raise()
    tree = retry(2, sequence("root", sequence("s", fallback("f", Train(leaf))), Check()))
    env = env_of(tree)
    whole = play(env, honest, seed=4)
    env.reset(seed=9)
    for _ in range(steps):
        env.step(np.array(UP))
    leaf.log.clear()
    env.reset(seed=4)
    assert running(env) == [] and leaf.log == ["begin"], "it is in its first tick, and nothing else is"
    assert play(env, honest, seed=4) == whole


def test_the_same_seed_is_the_same_episode_bit_for_bit(env_of):
    def episode(env, seed):
        rng = np.random.default_rng(seed)
        features, info = env.reset(seed=seed)
        rows = [features.tobytes(), info["draw"]]
        while True:
            features, reward, *over, info = env.step(rng.uniform(-1, 0.55, 2))
            rows += [features.tobytes(), reward, tuple(over)]
            if any(over):
                return rows

    one, other = env_of(simple()), env_of(simple())
    expected = [episode(one, k) for k in range(6)]
    assert [episode(other, k) for k in reversed(range(6))][::-1] == expected
    assert len({rows[0] for rows in expected}) == 6


def test_two_environments_do_not_disturb_each_other(env_of):
    alone = [play(env_of(simple()), honest, seed=k) for k in (1, 2)]
    envs = [env_of(simple()), env_of(simple())]
    features = [env.reset(seed=k)[0] for env, k in zip(envs, (1, 2), strict=True)]
    rewards: list[list[float]] = [[], []]
    ends = [None, None]
    while not all(ends):
        for k in (0, 1):
            if ends[k] is None:
                features[k], reward, *over, info = envs[k].step(np.array(honest(features[k])))
                rewards[k].append(reward)
                if any(over):
                    ends[k] = (rewards[k], *over, info)
    assert ends == alone


def test_a_draw_can_be_asked_for(env_of):
    env = env_of(simple())
    features, info = env.reset(seed=1)
    again, told = env.reset(options={"draw": info["draw"]})
    assert told["draw"] == info["draw"] and np.array_equal(features, again)


def test_after_it_the_tree_can_be_run(env_of, toy):
    tree = simple()
    env = env_of(tree)
    env.reset(seed=0)
    env.step(np.array(UP))
    env.close()
    assert env.batch.worlds.pipeline.closed == 1
    stage = toy(tree)
    assert stage.tick(50) == Status.SUCCESS


# ---- checkers ------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:.*Box.*", "ignore:.*infinity.*")
@pytest.mark.parametrize("tree", [simple, lambda: Train(Raise()), lambda: sequence("s", Even(), simple())])
def test_checkers_of_gymnasium_and_stable_baselines_pass(env_of, tree):
    check_env(env_of(tree()))
    from stable_baselines3.common.env_checker import check_env as check_for_stable_baselines

    check_for_stable_baselines(env_of(tree()))


def test_wrappers_of_gymnasium_work(env_of):
    env = gymnasium.wrappers.RecordEpisodeStatistics(gymnasium.wrappers.TimeLimit(env_of(simple()), 3))
    _, terminated, truncated, info = play(env, lambda f: STILL)
    assert truncated and not terminated and info["episode"]["l"] == 3
