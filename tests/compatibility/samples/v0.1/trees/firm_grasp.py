from bt_tasksim import EpisodeEnv, Train
from concept_nodes import Grasp, Pick
from trees import sequence
from trees.scenarios.grasp_then_pick import scene


def build():
    return sequence("grasp then pick", Train(Grasp("target")), Pick("target", distance=0.3))


if __name__ == "__main__":
    env = EpisodeEnv(build(), scene())  # a gymnasium.Env, for any library
    features, info = env.reset(seed=0)
    print(features.shape, env.action_space.shape)
