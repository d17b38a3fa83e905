"""Episodes in many worlds at once: each is what an environment of its own would have had, bit for bit."""

import contextlib
import logging

import gymnasium
import numpy as np
import pytest
import toys
from gymnasium.error import ClosedEnvironmentError
from py_trees.behaviours import Failure
from py_trees.common import Status
from test_rollouts import UP as NETWORK
from toys import DONE, SCENE, STILL, UP, Below, Check, Even, Move, Raise, Turn, Unprogrammed, alone, honest

from bt_tasksim import ObjectSpec, Scene
from bt_tasksim.concept.leaf import ONE, ContextLeaf
from bt_tasksim.concept_nodes import Grasp, Pick, Wait
from bt_tasksim.core.errors import InputError, LeafError, MachineError, UnreachableError
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Command
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.training.collectors import DrawTask, RolloutTask
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.episode_batch import REDRAWS, EpisodeBatch
from bt_tasksim.training.keepers import KeeperElsewhere, Keeping
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.training.reward import Reward
from bt_tasksim.training.reward_parts import RewardPart
from bt_tasksim.training.rollouts import in_batch
from bt_tasksim.training.sb3_vector_env import SB3VectorEnv
from bt_tasksim.training.vector_env import EpisodeVectorEnv
from bt_tasksim.trees import (
    fallback,
    force_failure,
    force_success,
    invert,
    parallel,
    reactive_fallback,
    reactive_sequence,
    repeat,
    retry,
    sequence,
    subtree,
    timeout,
)
from bt_tasksim.trees.nodes.train import Train, concepts_in
from tests.unlike_worlds import holding, mixed

HERE = 0.35


class Late(Raise):
    """Decides after a while only."""

    def decides(self, seen, memory):
        return memory >= 4


def simple(height=0.45, **settings):
    return sequence("s", Train(Raise(height=height, **settings)), Check(height=height))


def several():
    first, second = Raise(height=0.37, name="first"), Raise(height=0.45, name="second")
    inner = sequence("i", Move(0.33), first, fallback("f", Below(0.1), Move(0.41)), second, Wait(0.1))
    return sequence("s", Move(0.3), Train(inner), Check())


def high_then_low():
    return sequence("s", Train(Raise()), Check(blind=True), Move(0.5), Check(name="second"))


TREES = {
    "simple": simple,
    "alone": lambda: Train(Raise()),
    "passed over": lambda: sequence("s", Even(), simple()),
    "a long way before": lambda: sequence("s", Wait(0.3), Even(), Move(0.3), simple()),
    "several leaves": several,
    "two in parallel": lambda: Train(parallel("p", Raise(name="a"), Wait(0.3), success=2)),
    "in a parallel": lambda: parallel("a", Wait(0.1), sequence("b", Train(Raise())), success=2),
    "tried again": lambda: retry(3, sequence("s", Train(Raise(limit=0.5)), Check())),
    "repeated": lambda: repeat(2, sequence("s", Train(fallback("e", Below(0.4), Raise())), Check())),
    "interrupted": lambda: reactive_sequence("r", Below(0.4), simple()),
    "interrupted by a fallback": lambda: reactive_fallback("r", invert(Below(0.4)), simple()),
    "out of time": lambda: timeout(0.3, simple()),
    "the subtree's time": lambda: sequence("s", Train(timeout(0.3, Raise())), Check()),
    "a failing subtree": lambda: sequence("r", Train(sequence("i", Raise(), Below(0.1))), Check()),
    "forced": lambda: sequence("r", force_success(Train(Raise())), Check()),
    "forced to fail": lambda: sequence("r", invert(force_failure(Train(Raise()))), Check()),
    "late": lambda: sequence("s", Train(Late()), Check()),
    "blind follower": lambda: sequence("s", Train(Raise()), Check(blind=True)),
    "two checks": high_then_low,
    "a follower that begins anew": lambda: retry(
        2, sequence("s", Train(Raise()), force_failure(Check(blind=True)), Check())
    ),
    "guarded": lambda: reactive_sequence(
        "g", Below(0.4), sequence("s", Train(Raise(height=HERE)), Move(0.45), Check())
    ),
    "late follower": lambda: sequence("s", Train(Raise(height=HERE)), Check(height=HERE, ticks=1.0)),
    "composite follower": lambda: sequence(
        "s", Train(Raise()), sequence("then", Below(), Check(), Wait(0.1), Check(name="second"))
    ),
    "recovering": lambda: sequence(
        "s", Train(Raise()), fallback("r", Check(height=0.9, name="vain"), Check())
    ),
    "subtree": lambda: subtree("t", sequence("u", Below(2.0), Train(Raise())), ) ,
}  # fmt: skip


def task(number, decisions=40, std=0.3, stage=None):
    return RolloutTask(NETWORK, np.full(2, std, np.float32), (7, number), decisions, stage)


def as_bytes(found):
    return {k: v.tobytes() if isinstance(v, np.ndarray) else v for k, v in vars(found).items()}


def batched(batch, tasks):
    return [as_bytes(found) for _, found in sorted(in_batch(batch, tasks), key=lambda pair: pair[0])]


@pytest.fixture
def batch_of(toy_engines):
    return lambda tree, scene=SCENE, **settings: EpisodeBatch(tree, scene, **settings)


@pytest.fixture
def vector_of(toy_engines):
    return lambda tree, scene=SCENE, **settings: EpisodeVectorEnv(tree, scene, **settings)


# ---- rollouts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("longest", [30.0, 0.6])
@pytest.mark.parametrize("tree", TREES.values(), ids=list(TREES))
def test_rollouts_are_those_of_an_environment_of_their_own(env_of, batch_of, tree, longest):
    tasks = [task(k, decisions=14) for k in range(4)]
    expected = []
    try:
        expected = [as_bytes(alone(env_of(tree(), longest=longest), t)) for t in tasks]
    except InputError as error:
        with pytest.raises(InputError) as caught:
            batched(batch_of(tree(), worlds=3, longest=longest), tasks)
        assert str(caught.value).startswith(str(error).split("draws")[0])
        return
    assert batched(batch_of(tree(), worlds=5, longest=longest), tasks) == expected
    again = batch_of(tree(), worlds=2, longest=longest)
    assert batched(again, tasks[::-1])[::-1] == expected
    assert batched(again, tasks) == expected, "and the same worlds once more"


@pytest.mark.parametrize("tree", ["simple", "passed over", "several leaves", "blind follower"])
def test_held_apart_draws_too(env_of, batch_of, tree):
    tasks = [DrawTask(NETWORK, k) for k in range(8)]
    env = env_of(TREES[tree]())
    expected = [alone(env, t) for t in tasks]
    found = sorted(in_batch(batch_of(TREES[tree](), worlds=3), tasks))
    assert [result for _, result in found] == expected


def test_an_episode_is_pulled_up_by_no_other(batch_of):
    """Worlds tick and step together, whatever each waits for."""
    batch = batch_of(simple(), worlds=4)
    batched(batch, [task(k) for k in range(4)])
    (worlds,) = toys.Worlds.made
    assert sum(worlds.sizes) / len(worlds.sizes) > 3.0, "but for the end"


@pytest.mark.parametrize(
    "error", [MachineError("the engine stopped"), UnreachableError("100 mm too far", 0.1, 0.0)]
)
def test_an_error_while_it_is_judged_discards_this_world_alone(env_of, vector_of, error):
    env = env_of(simple(HERE))
    env.reset(seed=1)
    env.batch.worlds.pipeline.error = error
    expected = env.step(np.array(DONE))
    vector = vector_of(simple(HERE), num_envs=3)
    vector.reset(seed=0)
    vector.batch.worlds.each[1].error = error
    vector.send(np.arange(3), np.array([STILL, DONE, STILL]))
    found = {}
    while len(found) < 3:
        rows, ready = vector.recv()
        vector.batch.worlds.each[1].error = None
        for k, row in enumerate(rows.tolist()):
            found[row] = ready.rewards[k], ready.terminated[k], ready.truncated[k], ready.infos[k]
    assert found[1][3]["final_info"] == expected[4] and expected[4]["discarded"] and vector.discarded == 1
    assert found[1][:3] == expected[1:4]
    assert not any(found[row][1] or found[row][2] for row in (0, 2))


def test_an_engine_that_fails_before_ends_that_worlds_episode_alone(vector_of):
    vector, alone = vector_of(simple(), num_envs=2), vector_of(simple(), num_envs=2)
    for some in (vector, alone):
        some.reset(seed=0)
    vector.batch.worlds.each[1].error = MachineError("the engine stopped")
    vector.send(np.arange(2), np.array([UP, UP]))
    rows, ready = vector.recv()
    vector.batch.worlds.each[1].error = None
    while 1 not in rows:
        rows, ready = vector.recv()
    told = ready.infos[rows.tolist().index(1)]["final_info"]
    assert told["discarded"] and told["reason"] == "machine_failed" and vector.discarded == 1
    alone.step(np.array([UP, UP]))
    features = [some.step(np.array([UP, UP]))[0][0].tolist() for some in (vector, alone)]
    assert features[0] == features[1], "the other world goes on as ever"


def test_worlds_begin_with_given_draws(vector_of):
    vector, other = vector_of(simple(), num_envs=2), vector_of(simple(), num_envs=2)
    _, told = vector.reset(seed=0, options={"draw": [7, 9]})
    assert told["draw"].tolist() == [7, 9]
    with pytest.raises(InputError, match="2 worlds, and 1 draws"):
        other.reset(seed=0, options={"draw": [7]})


def test_an_engine_that_fails_before_the_first_decision_is_given_another_world(vector_of):
    vector = vector_of(sequence("s", Move(0.3), simple()), num_envs=2)
    vector.begin(np.arange(2), 0)
    vector.batch.worlds.each[1].error = MachineError("the engine stopped")
    step = vector.batch.worlds.step

    def once(*about):
        found = step(*about)
        vector.batch.worlds.each[1].error = None
        return found

    vector.batch.worlds.step = once
    ready = vector.wait(np.arange(2))
    assert [info["redrawn"] for info in ready.infos] == [0, 1] and vector.discarded == 0


def test_an_engine_that_always_fails_is_an_error(vector_of):
    vector = vector_of(simple(), num_envs=2)
    vector.reset(seed=0)
    vector.batch.worlds.each[1].error = MachineError("the engine stopped")
    with pytest.raises(MachineError, match=r"^the engine stopped$"):
        for _ in range(200):
            vector.step(np.array([DONE, UP]))
    vector.batch.worlds.each[1].error = None
    with pytest.raises(RuntimeError, match="does not wait for one"):
        vector.step(np.array([UP, UP]))
    vector.reset(seed=0)
    vector.step(np.array([UP, UP]))


class Broken(Check):
    """Raises."""

    def done(self, seen, memory):
        raise ZeroDivisionError("no such thing")


def test_a_leaf_that_raises_is_named_and_nothing_runs_on(vector_of):
    vector = vector_of(sequence("s", Train(Raise(height=HERE)), Broken(HERE, name="bad")), num_envs=2)
    vector.reset(seed=0)
    with pytest.raises(LeafError, match=r"leaf 'bad' raised ZeroDivisionError in test_vector_env.py:\d+: no"):
        vector.step(np.array([UP, DONE]))
    assert not vector.batch.batch.status.any() and not len(vector.batch.waiting)


# ---- the vector environment ----------------------------------------------------------------------------


def test_it_is_a_vector_of_environments(env_of, vector_of):
    """As gymnasium's own, which has an environment for each."""
    mode = gymnasium.vector.AutoresetMode.SAME_STEP
    own = gymnasium.vector.SyncVectorEnv(
        [lambda: env_of(sequence("s", Even(), simple()), longest=0.8)] * 3, autoreset_mode=mode
    )
    vector = vector_of(sequence("s", Even(), simple()), num_envs=3, longest=0.8)
    assert vector.metadata["autoreset_mode"] == mode
    assert vector.observation_space == own.observation_space and vector.action_space == own.action_space
    pairs = [(own.reset(seed=5), vector.reset(seed=5))]
    rng, ends = np.random.default_rng(0), 0
    for _ in range(60):
        actions = rng.uniform([-0.2, -1.0], [1.0, 0.6], (3, 2)).astype(np.float32)
        pairs.append((own.step(actions), vector.step(actions)))
        ends += int(pairs[-1][1][2].sum() + pairs[-1][1][3].sum())
    assert ends > 10
    for expected, found in pairs:
        for one, other in zip(expected[:-1], found[:-1], strict=True):
            assert np.array_equal(one, other)
        same(expected[-1], found[-1])


def same(expected, found):
    """Infos are alike; a number that is in nobody's is of no meaning."""
    assert set(found) == set(expected)
    for key, value in expected.items():
        if isinstance(value, dict):
            same(value, found[key])
        elif not key.startswith("_"):
            given = expected["_" + key] if "_" + key in expected else slice(None)
            assert [str(v) for v in value[given]] == [str(v) for v in found[key][given]], key


def test_worlds_that_are_ready_need_not_wait_for_others(env_of, vector_of):
    """Each world is given its actions as soon as it asks: it comes to what it comes to by itself."""

    def tree():
        return sequence("s", Even(), Move(0.3), Train(Raise()), Check())

    env = env_of(tree())
    vector = vector_of(tree(), num_envs=3)
    vector.begin(np.arange(3), 0)
    episodes, rewards, counts = [[], [], []], [[], [], []], set()
    features = {}
    turn = 0
    while min(map(len, episodes)) < 4:
        rows, ready = vector.recv()
        counts.add(len(rows))
        for k, row in enumerate(rows.tolist()):
            features[row] = ready.features[k]
            if "draw" not in ready.infos[k] or "final_info" in ready.infos[k]:
                rewards[row].append(ready.rewards[k])
            if ready.terminated[k]:
                episodes[row].append(rewards[row])
                rewards[row] = []
        turn += 1
        held = turn % 3 if len(features) > 1 else -1  # one of them is late now and then
        sent = [row for row in sorted(features) if row != held]
        vector.send(np.array(sent), np.array([honest(features.pop(row)) for row in sent]))
    assert len(counts) > 1
    for seed in (0, 1, 2):
        expected = []
        for k in range(4):
            seen, _ = env.reset(seed=None if k else seed)
            expected.append([])
            over = False
            while not over:
                seen, reward, over, _, _ = env.step(np.array(honest(seen)))
                expected[k].append(reward)
        assert expected == episodes[seed][:4]


def test_draws_that_start_in_the_robot_are_drawn_again_without_the_neighbours_feeling_it(vector_of, env_of):
    scene = Scene(objects={"cup": ObjectSpec("box", on="table", centre=(-0.38, 0.0), area=(0.12, 0.0))})
    vector = vector_of(simple(), scene, num_envs=4)
    _, infos = vector.reset(seed=0)
    alone = env_of(simple(), scene)
    expected = [alone.reset(seed=k)[1] for k in range(4)]
    assert infos["draw"].tolist() == [info["draw"] for info in expected]
    assert infos["redrawn"].tolist() == [info["redrawn"] for info in expected]
    assert vector.redrawn == sum(info["redrawn"] for info in expected) > 0
    vector.step(np.array([UP] * 4))
    near = Scene(objects={"cup": ObjectSpec("box", on="table", centre=(-0.55, 0.0), area=(0.0, 0.0))})
    with pytest.raises(InputError, match=f"not reached in {REDRAWS} draws; the last one had no world: with"):
        vector_of(simple(), near, num_envs=2).reset(seed=0)


def test_what_is_asked_wrongly_is_one_sentence(vector_of):
    vector = vector_of(simple(), num_envs=2)
    with pytest.raises(RuntimeError, match="begin an episode first"):
        vector.step(np.zeros((2, 2)))
    vector.reset(seed=0)
    with pytest.raises(InputError, match="there are 2 worlds, and 3 seeds"):
        vector.reset(seed=[1, 2, 3])
    rows, ready = vector.recv()
    assert len(rows) == 0 and ready.features.shape == (0, 3), "all wait already"
    vector.step(np.array([UP, UP]))
    never = vector_of(sequence("s", Below(0.1), Train(Raise(), "mine")), num_envs=2)
    with pytest.raises(InputError, match=f"'mine' was not reached in {REDRAWS} draws; the last one"):
        never.reset(seed=0)
    with pytest.raises(InputError, match=r"should be a tree, such as build\(\), found a function.*build="):
        vector_of(simple)
    with pytest.raises(InputError, match="see or do different things"):
        vector_of(Train(sequence("s", Raise(name="a"), Turn(name="b"))))
    with pytest.raises(InputError, match="has no form for many worlds"):
        vector_of(sequence("s", Failure("no"), Train(Raise())))
    with pytest.raises(InputError, match="leaf 'first' has no policy yet"):
        vector_of(sequence("s", Unprogrammed(name="first"), Train(Raise()))).reset(seed=0)


def test_a_mask_begins_some_worlds_anew(vector_of):
    vector = vector_of(simple(), num_envs=3)
    first, _ = vector.reset(seed=0)
    vector.step(np.array([UP, UP, UP]))
    again, _ = vector.reset(seed=0, options={"reset_mask": np.array([True, False, True])})
    assert np.array_equal(again[[0, 2]], first[[0, 2]]) and not np.array_equal(again[1], first[1])


def test_a_reward_part_of_ones_own_sees_each_decision(env_of, vector_of):
    @register("reward part", "high")
    class High(RewardPart):
        def pay(self, transition):
            assert transition.decision.memory.shape == (1,)
            return float(transition.decision.seen.tool[0, 2])

    reward = Reward(terms={"high": 0.1})
    env, vector = env_of(simple(), reward=reward), vector_of(simple(), num_envs=2, reward=reward)
    env.reset(seed=1)
    vector.reset(seed=0)
    for _ in range(3):
        expected = env.step(np.array(UP))[1]
        assert vector.step(np.array([STILL, UP]))[1][1] == expected != 0.0


def test_after_it_the_tree_can_be_run(vector_of, toy):
    tree = simple()
    vector = vector_of(tree, num_envs=2)
    vector.reset(seed=0)
    vector.close()
    assert [world.closed for world in vector.batch.worlds.each] == [1, 1]
    assert toy(tree).tick(50) == Status.SUCCESS


class Own(ContextLeaf):
    """A behaviour of one's own, which goes up by a step each tick, and forgets nothing."""

    def __init__(self, name="own"):
        super().__init__(name)
        self.ticks = 0

    def update(self):
        self.ticks += 1
        if self.ticks % 5 == 0:
            return Status.SUCCESS
        tool = self.context.observation.tool_pose + np.array([0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0])
        self.context.write(Command(tool=tool), ONE, self)
        return Status.RUNNING


def with_own():
    return sequence("s", Own(), Train(Raise()), fallback("f", Below(0.1), Own("second")), Check())


@pytest.mark.parametrize("worlds", [1, 3])
def test_a_behaviour_of_ones_own_is_ticked_in_a_tree_for_each_world(env_of, vector_of, worlds, caplog):
    caplog.set_level(logging.ERROR)
    with pytest.raises(InputError, match=r"Own has no form for many worlds.*build="):
        vector_of(with_own(), num_envs=2)
    vector = vector_of(with_own(), num_envs=worlds, build=with_own)
    features, _ = vector.reset(seed=4)
    envs = [env_of(with_own(), build=with_own) for _ in range(worlds)]
    assert features.tolist() == [env.reset(seed=4 + k)[0].tolist() for k, env in enumerate(envs)]
    ends = 0
    for t in range(40):
        action = np.array(UP if t % 3 else DONE)
        features, rewards, terminated, _, infos = vector.step(np.tile(action, (worlds, 1)))
        for k, env in enumerate(envs):
            seen, paid, ended, cut, info = env.step(action)
            assert (rewards[k], terminated[k]) == (paid, ended)
            if ended or cut:
                ends += 1
                assert infos["final_info"]["why"][k] == info["why"]
                seen, _ = env.reset()
            assert features[k].tolist() == seen.tolist()
    assert ends > 3


@pytest.mark.parametrize("where", ["worlds_for", "Judgement"])
def test_a_tree_that_cannot_be_trained_after_all_can_be_run(vector_of, toy, monkeypatch, where):
    def fails(*about):
        raise InputError("no room")

    tree = simple()
    monkeypatch.setattr(f"bt_tasksim.training.episode_batch.{where}", fails)
    with pytest.raises(InputError, match="no room"):
        vector_of(tree, num_envs=2)
    assert not any(leaf.under_training for leaf in concepts_in(tree))
    assert all(world.closed == 1 for made in toys.Worlds.made for world in made.each)
    assert toy(tree).tick(50) == Status.SUCCESS


@pytest.mark.parametrize("error", [None, InputError("no such file")])
def test_what_is_told_to_other_processes_leaves_the_tree_as_it_was(toy_engines, toy, monkeypatch, error):
    def subject(*about):
        assert raised.under_training, "it is in training as long as it is looked at"
        if error is not None:
            raise error
        return {}

    raised = Raise()
    tree = sequence("s", Train(raised, "mine"), Check())
    keeping = Keeping("mine", EngineOptions(), Reward(), {}, 2)
    monkeypatch.setattr(Keeping, "subject", subject)
    with pytest.raises(InputError) if error is not None else contextlib.nullcontext():
        KeeperElsewhere.of(keeping, NamedTree("x"), tree, SCENE)
    assert not raised.under_training
    assert toy(tree).tick(50) == Status.SUCCESS


@pytest.mark.parametrize(
    ("actions", "found"),
    [
        (np.zeros((2, 2)), r"\(3, 2\), found shape \(2, 2\)"),
        (np.zeros((3, 3)), r"\(3, 2\), found shape \(3, 3\)"),
        (np.zeros(2), r"\(3, 2\), found shape \(2,\)"),
        (np.array([UP, [np.nan, 0.0], UP]), "found nan among them"),
        ([[1.0, 2.0], [1.0]], r"\(3, 2\), found \[\[1"),
        ("up", "found 'up'"),
    ],
)
def test_wrong_actions_are_refused_and_nothing_has_happened(vector_of, actions, found):
    vector, other = vector_of(simple(), num_envs=3), vector_of(simple(), num_envs=3)
    vector.reset(seed=0)
    other.reset(seed=0)
    with pytest.raises(InputError, match=found):
        vector.step(actions)
    assert vector.step(np.array([UP] * 3))[0].tobytes() == other.step(np.array([UP] * 3))[0].tobytes()


def test_a_single_environment_speaks_of_a_single_action(env_of):
    env = env_of(simple())
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"\(2,\), found shape \(3,\)"):
        env.step(np.zeros(3))


def test_once_closed_it_stays_closed(vector_of, env_of):
    for env, action in ((vector_of(simple(), num_envs=2), np.array([UP, UP])), (env_of(simple()), UP)):
        env.reset(seed=0)
        env.close()
        env.close()
        with pytest.raises(ClosedEnvironmentError, match="make a new one"):
            env.reset(seed=0)
        with pytest.raises(ClosedEnvironmentError, match="make a new one"):
            env.step(action)


def test_nothing_is_waited_for_where_nothing_is_under_way(vector_of):
    vector = vector_of(simple(), num_envs=2)
    vector.reset(seed=0)
    with pytest.raises(RuntimeError, match="under way in world 1"):
        vector.wait([1])


# ---- for stable-baselines3 ---------------------------------------------------------------------------------


def test_stable_baselines_has_the_same_episodes(vector_of):
    vector, wrapped = vector_of(simple(), num_envs=3), SB3VectorEnv(vector_of(simple(), num_envs=3))
    wrapped.seed(5)
    assert wrapped.reset().tobytes() == vector.reset(seed=5)[0].tobytes()
    ends = 0
    for _ in range(60):
        actions = np.array([UP, DONE, STILL])
        features, rewards, terminated, truncated, infos = vector.step(actions)
        seen, paid, done, said = wrapped.step(actions)
        assert seen.tobytes() == features.tobytes() and paid.dtype == np.float32
        assert np.array_equal(paid, rewards.astype(np.float32))
        assert np.array_equal(done, terminated | truncated)
        for row in np.flatnonzero(done).tolist():
            ends += 1
            assert said[row]["is_success"] == infos["final_info"]["is_success"][row]
            assert said[row]["terminal_observation"].tobytes() == infos["final_obs"][row].tobytes()
            assert said[row]["TimeLimit.truncated"] == truncated[row]
    assert ends >= 60, "one world says at once that it is done"
    wrapped.close()


def test_stable_baselines_asks_the_one_batch(vector_of):
    wrapped = SB3VectorEnv(vector_of(simple(), num_envs=3))
    assert wrapped.get_attr("num_envs", [0, 2]) == [3, 3] and wrapped.get_attr("stream", 1) == ["training"]
    assert wrapped.env_is_wrapped(object) == [False] * 3
    for refused in (lambda: wrapped.set_attr("stage", 1), lambda: wrapped.env_method("reset")):
        with pytest.raises(NotImplementedError):
            refused()


def test_ppo_of_stable_baselines_learns_in_many_worlds(vector_of):
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    envs = VecMonitor(SB3VectorEnv(vector_of(simple(), num_envs=4)))
    model = PPO("MlpPolicy", envs, n_steps=32, batch_size=64, n_epochs=1, device="cpu", seed=0)
    model.learn(256)
    assert model.num_timesteps == 256 and len(model.ep_info_buffer) and len(model.ep_success_buffer)


# ---- worlds that physics simulates -------------------------------------------------------------------------


def grasp_env(make, scene, **settings):
    return make(sequence("s", Train(Grasp("target", timeout=10.0)), Pick("target")), scene, **settings)


@pytest.mark.physical
@pytest.mark.parametrize("first", [[1], [2, 0]])
def test_some_worlds_may_be_the_first_to_begin(first):
    scene = holding("target")
    vector = grasp_env(EpisodeVectorEnv, scene, num_envs=3)
    env = grasp_env(EpisodeEnv, scene)
    vector.begin(first, seed=5)
    begun = {}
    while len(begun) < len(first):
        rows, ready = vector.recv()
        begun |= dict(zip(rows.tolist(), ready.features, strict=True))
    assert sorted(begun) == sorted(first)
    for row, features in begun.items():
        assert np.array_equal(features, env.reset(seed=5 + row)[0])
    vector.close()
    env.close()


def scripted(count):
    """Go on fast, and say after a while that it is held."""
    return np.array([0.0] * 5 + [1.0, 1.0 if count == HELD else -1.0])


HELD, EPISODES = 70, 2


@pytest.mark.physical
def test_worlds_with_unlike_objects_are_judged_each_by_its_own():
    scene = mixed(holding("target", "box"), holding("box", "target"), holding("tall", "box", "target"))
    vector, env = grasp_env(EpisodeVectorEnv, scene, num_envs=2), grasp_env(EpisodeEnv, scene)
    first, _ = vector.reset(seed=0)
    found, now, ends = {0: [], 1: []}, {row: [first[row].tobytes()] for row in (0, 1)}, []
    while min(map(len, found.values())) < EPISODES:
        features, paid, ended, cut, infos = vector.step(np.stack([scripted(len(now[row])) for row in now]))
        for row, episodes in found.items():
            if ended[row] or cut[row]:
                final = infos["final_info"]
                episodes.append((now[row], paid[row], final["reason"][row], final["seconds"][row]))
                ends.append(final["follower"][row])
                now[row] = []
            now[row].append(features[row].tobytes())
    assert any(ends), "some are judged by what follows"
    for row, episodes in found.items():
        for k, episode in enumerate(episodes[:EPISODES]):
            seen, over = [env.reset(seed=None if k else row)[0].tobytes()], False
            while not over:
                features, reward, ended, cut, info = env.step(scripted(len(seen)))
                over = ended or cut
                seen += [] if over else [features.tobytes()]
            assert episode == (seen, reward, info["reason"], info["seconds"])
    vector.close()
    env.close()
