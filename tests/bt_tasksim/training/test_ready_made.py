"""The registered environment, with real physics: checkers, any learner, and what never pays."""

import subprocess
import sys
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from draws import successes
from gymnasium.utils.env_checker import check_env

from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.training.ready_made import grasp_then_pick
from bt_tasksim.training.vector_env import EpisodeVectorEnv
from bt_tasksim.trees.scenarios import grasp_then_pick as scenario

pytestmark = pytest.mark.physical

NAME = "bt_tasksim.training:bt_tasksim/GraspThenPick-v0"
CUP = ObjectSpec(kinds=("cup",), on="table", mass=(0.1, 0.11), friction=(0.8, 0.81))


@pytest.fixture(scope="module")
def env():
    """Easy cups, drawn by the registered name."""
    made = gymnasium.make(NAME, robot="panda", target=CUP, noise="fine")
    yield made
    made.close()


def idle(env):
    """No offset from the reference motion, and never done."""
    return np.zeros(env.action_space.shape[0])


def signal(env):
    """Done."""
    return np.append(np.zeros(env.action_space.shape[0] - 1), 1.0)


def honest(env):
    """The reference motion, and done when the concept's own goal is seen."""
    decision = env.unwrapped.decision
    done = decision.leaf.model.done(decision.seen, decision.memory)[0]
    return signal(env) if done else idle(env)


def away(env):
    """All the offset that there is, and never done."""
    return np.append(np.ones(env.action_space.shape[0] - 1), 0.0)


def play(env, decide, seed):
    env.reset(seed=seed)
    rewards = []
    while True:
        _, reward, terminated, truncated, info = env.step(decide(env))
        rewards.append(reward)
        if terminated or truncated:
            return rewards, info


def test_grasping_pays_and_idling_rushing_and_straying_never_do(env):
    gamma = env.unwrapped.reward.gamma

    def grasp(seed):
        rewards, info = play(env, honest, seed)
        return SimpleNamespace(
            success=info["is_success"], reason="", why=info["why"], seed=seed, rewards=rewards, info=info
        )

    best = {}
    for good in successes(grasp, range(1, 6), n=2):
        assert good.info["follower"] == "SUCCESS" and good.why == "pick target succeeded"
        assert len(good.rewards) > 10
        best[good.seed] = sum(good.rewards)
        assert best[good.seed] > 0.5
    for decide in (idle, signal, away):
        for seed in best:
            rewards, info = play(env, decide, seed)
            assert not info["is_success"] and info["why"]
            assert sum(rewards) <= 0.0 < best[seed]
            assert sum(gamma**t * r for t, r in enumerate(rewards)) <= 0.0
            assert info["reward"]["success"] == 0.0


def test_a_signal_with_an_empty_hand_is_judged_by_the_pick(env):
    rewards, info = play(env, signal, 3)
    assert len(rewards) == 1 and info["status"] == "SUCCESS" and info["reward"]["failure"] == -1.0
    assert info["follower"] in ("FAILURE", "SUCCESS") and not info["discarded"]


def test_the_same_seed_is_the_same_episode_bit_for_bit(env):
    other = grasp_then_pick("panda", CUP, noise="fine")
    assert play(env, honest, 5) == play(other, honest, 5)
    other.close()


def test_stages_and_the_held_apart_draws_can_be_asked_for():
    stages = scenario.scene().stages
    for stage, expected in ((-1, len(stages) - 1), (0, 0), (None, None)):
        made = grasp_then_pick(stage=stage)
        assert made.stage == expected and made.scene.stages == stages
        made.close()
    made = grasp_then_pick(target=CUP, stage=0)
    assert made.stage is None and made.scene.objects == {"target": CUP}
    made.close()
    with pytest.raises(InputError, match=r"unknown robot|no robot"):
        grasp_then_pick("pandah")


@pytest.mark.filterwarnings("ignore")
def test_checkers_pass(env):
    check_env(env.unwrapped, skip_render_check=True)
    from stable_baselines3.common.env_checker import check_env as check_for_stable_baselines

    check_for_stable_baselines(env.unwrapped)


def test_many_worlds_by_name_are_one_batch():
    made = gymnasium.make_vec(NAME, num_envs=2, target=CUP, noise="fine")
    env = grasp_then_pick("panda", CUP, noise="fine")
    assert isinstance(made, EpisodeVectorEnv) and made.spec.id == NAME.split(":")[1]
    features, _ = made.reset(seed=3)
    assert features[1].tobytes() == env.reset(seed=4)[0].tobytes()
    made.close()
    env.close()
    made = gymnasium.make_vec(NAME, num_envs=1, stage=0)
    assert made.stage == 0
    made.close()


def test_soft_actor_critic_of_stable_baselines_trains_it(env):
    import torch
    from stable_baselines3 import SAC

    torch.set_num_threads(1)
    model = SAC(
        "MlpPolicy", env, learning_starts=40, batch_size=32, buffer_size=1000, device="cpu", seed=0,
        policy_kwargs={"net_arch": [16]},
    )  # fmt: skip
    before = [p.detach().clone() for p in model.actor.parameters()]
    model.learn(80)
    assert model.num_timesteps == 80 and model.replay_buffer.size() == 80
    assert any(not bool((a == b).all()) for a, b in zip(before, model.actor.parameters(), strict=True))


PLAIN = f"""
import gymnasium
env = gymnasium.make({NAME!r})
observation, info = env.reset(seed=1)
ended = 0
for _ in range(40):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    assert observation in env.observation_space
    if terminated or truncated:
        ended += 1
        observation, info = env.reset()
env.close()
print(ended)
"""


def test_a_loop_that_knows_gymnasium_alone():
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PLAIN], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) >= 1
