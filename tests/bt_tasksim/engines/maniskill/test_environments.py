"""Real environments, small: names, poses, what is felt, the environment's own word, the same bits again."""

import sys

import numpy as np
import pytest
from draws import successes
from py_trees.common import Status

from bt_tasksim.cli.main import main
from bt_tasksim.concept_nodes import Grasp, Pick, Wait
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.plugins import scratch
from bt_tasksim.core.world import Command
from bt_tasksim.engines.maniskill.environment import Environment
from bt_tasksim.engines.maniskill.files import load_environment_file
from bt_tasksim.engines.maniskill.robot import Controls
from bt_tasksim.engines.rendering.sapien import SapienRendering
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees import sequence
from bt_tasksim.trees.load import load_source

pytestmark = pytest.mark.usefixtures("maniskill")
PICK, STACK = "maniskill:PickCube-v1", "maniskill:StackCube-v1"


def runner(tree, engines=PICK, noise="none", robot=None, **options):
    options = EngineOptions(engines=engines, noise=noise, **options)
    world = options.own_world()
    return Runner(tree, world if robot is None else world.with_robot(robot), options)


def example(name, engines, noise="none"):
    options = EngineOptions(engines=engines, noise=noise)
    source = load_source(f"examples/maniskill/{name}.py", world=options.own_world())
    return Runner(source.build(), source.scene, options)


@pytest.fixture(scope="module")
def still(maniskill):
    made = runner(sequence("wait", Wait(0.2)))
    yield made
    made.pipeline.close()


def test_a_hole_is_where_the_environment_has_it():
    made = runner(sequence("wait", Wait(0.2)), "maniskill:PegInsertionSide-v1")
    try:
        (hole,) = [place for place in made.scene.sample(100).places if place.name == "hole"]
        base = made.pipeline.physics._open().base
        theirs = base.box_hole_pose.raw_pose[0].numpy().astype(float)
        theirs[:3] += [0.615, 0.0, 0.0]
        mine, length = np.asarray(hole.pose), float(base.peg_half_sizes[0, 0])
        assert mine[:3] - length * poses.rotate(theirs[3:], np.array([1.0, 0, 0])) == pytest.approx(
            theirs[:3], abs=1e-5
        )
        assert poses.z_axis(mine[3:]) == pytest.approx(-poses.to_matrix(theirs[3:])[:, 0], abs=1e-5)
        wide = 2.0 * float(base.box_hole_radii[0])
        assert hole.extent == pytest.approx((wide, wide), abs=1e-5)
        assert hole.height == pytest.approx(2.0 * length, abs=1e-5)
    finally:
        made.pipeline.close()


def test_a_drawn_world_is_the_environments_own_in_the_robots_frame(still):
    world = still.scene.sample(5)
    (cube,), base = world.objects, still.pipeline.physics._open().base
    assert (cube.kind, cube.size, cube.on) == ("cube", (0.04, 0.04, 0.04), "table")
    theirs, goal = (a.pose.p[0].numpy() for a in (base.cube, base.goal_site))
    assert np.allclose(np.array(cube.pose[:3]) - [0.615, 0, 0], theirs, atol=1e-6)
    places = {place.name: place for place in world.places}
    assert np.allclose(places["goal"].pose[:3] - [0.615, 0, -0.02], goal, atol=1e-6)
    assert abs(places["table"].pose[2]) < 1e-6 and places["table"].fixture == "table"
    (table,) = world.fixtures
    top = max(poses.multiply(table.pose_array(), np.array(b.pose))[2] + b.size[2] / 2 for b in table.boxes)
    assert abs(top) < 1e-6
    assert world.control_frequency == 20 and world.physics_frequency == 100


def test_seeds_are_those_of_the_environments_reset(still):
    base = still.pipeline.physics._open().base
    drawn = np.array(still.scene.sample(1000).objects[0].pose[:3])
    base.reset(seed=1000)
    assert np.allclose(drawn - [0.615, 0, 0], base.cube.pose.p[0].numpy(), atol=1e-6)
    assert still.scene.sample(1000, "training").objects[0].pose != still.scene.sample(1000).objects[0].pose


def test_a_world_that_was_not_drawn_here_is_refused(still):
    import dataclasses

    world = still.scene.sample(3)
    moved = dataclasses.replace(world.objects[0], pose=(0.7, *world.objects[0].pose[1:]))
    with pytest.raises(InputError, match="seed 3"):
        still.reset(dataclasses.replace(world, objects=(moved,)))


def test_nothing_is_felt_at_a_reset_whatever_was_felt_before(still):
    held = runner(sequence("hold", Grasp("cube"), Pick("cube", distance=0.05)))
    assert held.run(3).status == Status.SUCCESS
    configuration = held.scene.sample(4)
    held.reset(configuration)
    seen = held.context.observation
    assert not seen.contacts.any() and np.abs(seen.wrench).max() == 0.0
    held.pipeline.close()


def test_forces_of_a_held_cube_are_its_weight_and_its_squeeze():
    held = runner(sequence("hold", Grasp("cube"), Pick("cube", distance=0.08)))
    assert held.run(2).status == Status.SUCCESS
    for _ in range(30):
        held.pipeline.step(Command())
    seen, hidden = held.context.observation, held.pipeline.hidden()
    state = held.pipeline.state
    weight = 9.81 * held.configuration.objects[0].mass
    force = poses.rotate(state.tool_pose[3:], state.wrench[:3])
    assert force[2] == pytest.approx(-weight, rel=0.15), (
        "external force at the tool, the hand's weight removed"
    )
    assert np.abs(force[:2]).max() < weight, "what PhysX leaves of 20 N from both sides"
    assert seen.contacts.all() and not hidden.support.any()
    left, right = state.tip_force
    assert np.linalg.norm(left) == pytest.approx(20.0, rel=0.15), "stiffness 1000 N/m, 20 mm"
    assert np.linalg.norm(left + right) < 0.2 * np.linalg.norm(left)
    assert hidden.hand_force[0] == pytest.approx(2 * np.linalg.norm(left), rel=0.1)
    held.pipeline.close()


@pytest.mark.parametrize(("name", "engines"), [("pick_cube", PICK), ("stack_cube", STACK)])
@pytest.mark.parametrize("noise", ["none", "fine"])
def test_shipped_trees_do_what_the_environments_ask(name, engines, noise):
    done = example(name, engines, noise)
    successes(done.run, (100, 101, 102), n=2)
    done.pipeline.close()


def test_the_verdict_is_the_environments_own_and_says_what_is_missing(still):
    result = still.run(7)
    assert result.status == Status.SUCCESS and not result.success
    assert result.reason == "environment_no_success"
    assert "is_obj_placed no" in result.why and "is_robot_static yes" in result.why
    assert result.verdict.position_error > 0.025


def test_the_same_seed_gives_the_same_bits_in_any_order_and_in_another_simulation():
    def states(one, seed):
        found = []
        one.run(seed, record=lambda step: found.append(step.pipeline.state))
        return [np.concatenate([s.joint_position, s.objects.ravel(), s.wrench]) for s in found]

    first, second = example("pick_cube", PICK, "fine"), example("pick_cube", PICK, "fine")
    forth = {seed: states(first, seed) for seed in (11, 12)}
    back = {seed: states(second, seed) for seed in (12, 13, 11)}
    for seed, expected in forth.items():
        assert np.array_equal(expected, back[seed])
    first.pipeline.close()
    second.pipeline.close()


def test_a_run_is_replayed_bit_for_bit_and_no_log_opens_a_file(tmp_path):
    import json

    from bt_tasksim import run
    from bt_tasksim.execution.recorded import _options
    from bt_tasksim.execution.replay import replay

    tree = sequence("hold", Grasp("cube"), Wait(0.2))
    run(tree, seed=4, out=tmp_path / "run", engines=PICK)
    assert json.loads((tmp_path / "run" / "result.json").read_text())["engines"] == PICK
    again = replay(tmp_path / "run")
    assert again.identical, again.why
    for name in ("maniskill:mine.yaml", "maniskill:a.module:B-v0", "maniskill"):
        with pytest.raises(InputError):
            _options({"engines": name}, "here")


def test_the_camera_robot_of_the_description_is_the_environments():
    tree = sequence("wait", Wait(0.2))
    for robot in ("panda_wristcam", "panda"):
        made = runner(tree, STACK, robot=robot)
        made.reset(made.scene.sample(1))  # which compares the tool's pose with that of kinematics
        assert made.robot.name == robot and made.pipeline.physics._open().base.robot_uids == robot
        made.pipeline.close()


def test_an_unknown_actor_is_named_with_the_nearest_one(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("environment: PickCube-v1\nrobots: {panda: panda}\nobjects: {cub: {}}\n")
    made = runner(sequence("wait", Wait(0.2)), f"maniskill:{path}")
    with pytest.raises(InputError, match="did you mean 'cube'"):
        made.run(0)
    made.pipeline.close()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("PickCub-v1", "did you mean 'PickCube-v1'"),
        ("no_such_module:PickCube-v1", "no_such_module"),
        ("CartPole-v1", "none of ManiSkill's"),
        ("PickSingleYCB-v1", "assets"),
    ],
)
def test_what_is_no_environment_that_can_start_is_refused(tmp_path, name, said):
    path = tmp_path / "mine.yaml"
    path.write_text(f"environment: {name}\nrobots: {{panda: panda}}\n")
    with pytest.raises(InputError, match=said):
        Environment(load_environment_file(str(path)), "panda")


def test_without_a_render_device_the_sentence_says_what_to_do(monkeypatch):
    import gymnasium

    def refuse(*words, **named):
        raise RuntimeError("failed to find a rendering device")

    monkeypatch.setattr(gymnasium, "make", refuse)
    with pytest.raises(MachineError, match=r"Vulkan device.*make setup"):
        Environment(load_environment_file("PickCube-v1"), "panda")


def test_scaled_and_following_joints_get_what_the_drives_are_told(still):
    agent = still.pipeline.physics._open().base.agent
    joints = still.robot.joints
    controls = Controls(agent.controller, joints, "here")
    told = np.concatenate([still.robot.rest, [0.0, 0.03]])
    action, target = controls.action(told)
    assert action[7] == pytest.approx(2 * 0.01 / 0.05 - 1), "from -10 to 40 mm"
    assert np.allclose(target, [*still.robot.rest, 0.0, 0.0]), "the second finger follows the first"
    _, beyond = controls.action(np.full(9, 10.0))
    assert np.all(beyond[:7] <= still.robot.arm_upper + 1e-6) and beyond[8] == pytest.approx(0.04)
    with pytest.raises(InputError, match="panda_finger_joint1"):
        Controls(agent.controller, joints[:7], "here")


def test_pictures_are_maniskills_own():
    drawn = runner(sequence("wait", Wait(0.1)), rendering=True)
    assert drawn.run(0).status == Status.SUCCESS
    seen = drawn.pipeline.render("overview", depth=True, size=(64, 48))
    assert seen.colour.shape == (48, 64, 3) and seen.colour.std() > 10.0
    assert 0.5 < np.median(seen.depth) < 10.0
    assert drawn.pipeline.render("render_camera", size=(32, 32)).colour.std() > 10.0
    with pytest.raises(InputError, match="render_camera"):
        drawn.pipeline.render("render_camara")
    drawn.pipeline.close()


@pytest.mark.parametrize("order", [("ours", "maniskill"), ("maniskill", "ours")], ids="-".join)
def test_both_draw_in_one_process(order):
    """SAPIEN draws with one device a process, and knows the same one by several names."""
    drawn = []
    for who in order:
        if who == "ours":
            drawn.append(SapienRendering())
        else:
            drawn.append(runner(sequence("wait", Wait(0.1)), rendering=True))
            drawn[-1].run(0)
            assert drawn[-1].pipeline.render("overview", size=(32, 32)).colour.shape == (32, 32, 3)
    for one in drawn:
        one.close()


OWN = """
from mani_skill.envs.tasks import PickCubeEnv
from mani_skill.utils.registration import register_env


@register_env("OwnCube-v1", max_episode_steps=50)
class OwnCube(PickCubeEnv):
    pass
"""


def test_an_environment_of_ones_own_is_loaded_by_whoever_names_its_module(tmp_path, monkeypatch, capsys):
    (tmp_path / "own_envs.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "mine.yaml"
    path.write_text("environment: own_envs:OwnCube-v1\nrobots: {panda: panda}\nobjects: {cube: {}}\n")
    with pytest.raises(InputError, match=r"runs no code.*--plugin own_envs"):
        Environment(load_environment_file(str(path)), "panda")
    assert "own_envs" not in sys.modules, "a file imports nothing"
    tree = tmp_path / "lift.py"
    tree.write_text(
        "from bt_tasksim.concept_nodes import Grasp\nfrom bt_tasksim.trees import sequence\n\n\n"
        "def build():\n    return sequence('lift', Grasp('cube'))\n"
    )
    words = ["run", str(tree), "--engines", f"maniskill:{path}", "--out"]
    for k, plugin in enumerate((str(tmp_path / "own_envs.py"), "own_envs")):
        with scratch():
            code = main([*words, str(tmp_path / f"out{k}"), "--plugin", plugin])
        assert code in (0, 1), capsys.readouterr().err
        assert "OwnCube-v1 calls it" in capsys.readouterr().out
    sys.modules.pop("own_envs", None)


@pytest.mark.parametrize(
    "said",
    [None, {}, {"success": "yes"}, {"success": float("nan")}, {"success": [True, False]}, {"success": 2}],
)
def test_a_success_that_is_none_is_one_sentence(still, monkeypatch, said):
    environment = still.pipeline.physics._open()
    monkeypatch.setattr(environment.base, "evaluate", lambda: said)
    with pytest.raises(InputError, match=r"'PickCube-v1' .*success") as caught:
        environment.evaluate()
    assert "\n" not in str(caught.value)


def test_a_success_may_be_a_number(still, monkeypatch):
    environment = still.pipeline.physics._open()
    monkeypatch.setattr(
        environment.base, "evaluate", lambda: {"success": np.array([1]), "odd": [[1], [2, 3]]}
    )
    assert environment.evaluate() == {"success": True, "odd": [[1], [2, 3]]}


def test_a_robot_whose_assets_are_not_there_is_refused_without_a_question(tmp_path):
    from mani_skill.agents.registration import REGISTERED_AGENTS
    from mani_skill.utils import assets

    if all(map(assets.is_data_source_downloaded, REGISTERED_AGENTS["xarm6_robotiq"].asset_download_ids)):
        pytest.skip("its assets are on this machine")
    path = tmp_path / "mine.yaml"
    path.write_text("environment: PickCube-v1\nrobots: {xarm6_robotiq: panda}\n")
    with pytest.raises(InputError, match=r"'xarm6_robotiq' needs assets .*download_asset xarm6_robotiq'"):
        Environment(load_environment_file(str(path)), "xarm6_robotiq")
