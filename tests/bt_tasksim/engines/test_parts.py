"""Parts of fixtures in every physics: friction, limits, springs, latches, weight, and what lies in them.

One world holds them all, each a fixture of its own; weight is the force that is known.
"""

import dataclasses
import functools

import numpy as np
import pytest

from bt_tasksim.core.joints import Joints
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.base import EngineSetup, engine_class
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.carpentry import board
from bt_tasksim.scene.fixtures import Fixture, FixturePart
from bt_tasksim.scene.parts import part_actor
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec, ObjectSpec

G = 9.81
MASS = 0.5
PERIODS = 30
"""Control periods for which the world goes on: 1.5 s."""
DOWN = (0.0, 0.0, -1.0)
LID = {"kind": "hinge", "axis": (0.0, 1.0, 0.0), "origin": (0.1, 0.0, 0.0), "limits": (0.0, 1.9)}
DOOR = {"kind": "hinge", "axis": DOWN, "origin": (0.1, 0.0, 0.0), "limits": (0.0, 1.9)}
SLIDE = {"kind": "slide", "axis": DOWN, "limits": (0.0, 0.1)}
CASES = {
    "stuck": (SLIDE | {"friction": 1.2 * MASS * G}, 0.03),
    "sliding": (SLIDE | {"friction": 0.8 * MASS * G}, 0.03),
    "slow": (SLIDE | {"damping": 5.0, "limits": (0.0, 0.3)}, 0.0),
    "latched": (SLIDE | {"latch": 1.3 * MASS * G}, 0.0),
    "unlatched": (SLIDE | {"latch": 0.5 * MASS * G}, 0.0),
    "sprung": (SLIDE | {"stiffness": MASS * G / 0.04, "damping": 20.0}, 0.0),
    "lid": (LID | {"damping": 0.02}, 1.0),
    "laid back": (LID | {"damping": 0.02}, 1.7),
    "door": (DOOR | {"stiffness": 0.5, "damping": 0.1}, 1.0),
    "ajar": (DOOR | {"friction": 0.3, "stiffness": 0.2}, 1.0),
}
"""What differs from a plain part, and how far open it begins."""


def world(latches):
    """All of them in a row behind the robot, and a drawer that its spring shuts with a box in it."""
    pulled = {"spring": 40.0, "damping": 30.0, "friction": 1.0, "value": 0.18, "opens": 0.2, "mass": 1.0}
    box = ObjectSpec(kinds=("box",), inside="drawer", mass=(0.1, 0.1), size=((0.05, 0.05, 0.05),) * 2)
    drawn = Scene(fixtures=[FixtureSpec("drawer", parameters=pulled)], objects={"box": box}).sample(0)
    fixtures, objects = list(drawn.fixtures), list(drawn.objects)
    for k, (name, (fields, value)) in enumerate(CASES.items()):
        if "latch" in fields and not latches:
            continue
        name = name.replace(" ", "_")
        leaf: Box = board((0.0, 0.0, 0.0), (0.2, 0.06, 0.02))
        part = FixturePart(name=name, boxes=(leaf,), mass=MASS, **fields)
        fixture = Fixture(
            f"of_{name}", (-0.5 - 0.4 * (k % 2), -1.0 + 0.2 * k, 0.6, 1, 0, 0, 0), (), (), (part,)
        )
        objects.append(part_actor(fixture, part, value))
        fixtures.append(dataclasses.replace(fixture, parts=()))
    return dataclasses.replace(drawn, objects=tuple(objects), fixtures=tuple(fixtures))


@functools.cache
def went(engine):
    """Values by name and period ``(periods + 1,)``, and where the box is in the drawer."""
    drawn, rows = world(engine != "mujoco_warp"), np.arange(1)
    many = engine_class("physics", engine).batch(load_robot("panda"), EngineSetup(engine), 1, 1)
    many.reset(rows, [drawn])
    assert many.errors == [None]
    target = many.state(rows).joint_position
    states = [many.state(rows).objects[0]]
    for _ in range(PERIODS):
        many.step(JointTarget(target, np.zeros_like(target)), rows)
        states.append(many.state(rows).objects[0])
    poses = np.array(states)
    values = {
        actor.name: Joints.of([actor.joint] * len(poses)).value(poses[:, k])
        for k, actor in enumerate(drawn.objects)
        if actor.joint is not None
    }
    return values, poses[:, 0, :3] - poses[:, 1, :3]


@pytest.fixture(params=["sapien", "mujoco", "mujoco_warp"])
def engine(request):
    if request.param == "mujoco_warp":
        pytest.importorskip("mujoco_warp", reason="MuJoCo Warp is not installed")
    return request.param


def test_friction_holds_what_is_lighter_and_lets_go_what_is_heavier(engine):
    values, _ = went(engine)
    assert np.abs(values["stuck"] - 0.03).max() < 1e-3
    assert values["sliding"][-1] == pytest.approx(0.1, abs=2e-3)
    fell = values["sliding"][4] - 0.03  # in 0.2 s, by a fifth of its weight
    assert fell == pytest.approx(0.5 * 0.2 * G * 0.2**2, rel=0.1)


def test_limits_stop_it(engine):
    values, _ = went(engine)
    for name, (fields, _) in CASES.items():
        if (found := values.get(name.replace(" ", "_"))) is not None:
            low, high = fields["limits"]
            assert np.all((found > low - 1e-3) & (found < high + 1e-3))


def test_damping_slows_it(engine):
    slow, period, decay = went(engine)[0]["slow"], 0.05, MASS / 5.0
    time = 6 * period
    fell = G * decay * (time - decay * (1.0 - np.exp(-time / decay)))
    assert slow[6] == pytest.approx(fell, rel=0.08)


def test_a_latch_holds_up_to_its_force(engine):
    if engine == "mujoco_warp":
        many = engine_class("physics", engine).batch(load_robot("panda"), EngineSetup(engine), 1, 1)
        many.reset(np.arange(1), [world(latches=True)])
        assert "does not simulate latches, and 'latched' has one" in str(many.errors[0])
        return
    values, _ = went(engine)
    assert values["latched"].max() < 0.003
    assert values["unlatched"][-1] == pytest.approx(0.1, abs=2e-3)


def test_springs_bear_weights_and_shut_doors(engine):
    values, _ = went(engine)
    assert values["sprung"][-1] == pytest.approx(0.04, abs=2e-3)
    assert values["door"][-1] < 0.1 < values["door"][5] < 1.0
    assert np.abs(values["ajar"] - 1.0).max() < 5e-3  # 0.2 Nm of the spring, 0.3 Nm of friction


def test_weight_shuts_a_lid_unless_it_leans_back(engine):
    values, _ = went(engine)
    assert values["lid"][-1] < 0.01
    assert values["laid_back"][-1] == pytest.approx(1.9, abs=0.01)


def test_what_lies_in_a_drawer_goes_along(engine):
    values, inside = went(engine)
    assert values["drawer"][0] == pytest.approx(0.18, abs=1e-6) and values["drawer"][-1] < 0.1
    assert np.abs(inside - inside[0]).max() < 0.004
