"""Boxes about shapes: where frames are, and that no pair of shapes that touches is passed over."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.boxes import ArmFrames, BoxPairs, box_of
from bt_tasksim.planning.collision import Collisions
from bt_tasksim.planning.pairs import _OFTEN
from bt_tasksim.planning.things import Thing
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.kinematics.models import se3

ROBOTS = ("panda", "so100", "xarm7_ability")


def slide_and_hinge():
    """An arm of a slide aslant and a hinge, as no robot of the package is."""
    model = pin.Model()
    aslant = np.array([0.6, 0.0, 0.8])
    first = model.addJoint(0, pin.JointModelPrismaticUnaligned(aslant), se3([0.1, 0, 0, 1, 0, 0, 0]), "slide")
    model.addJoint(first, pin.JointModelRY(), se3([0, 0.2, 0, 0.6, 0.8, 0, 0]), "hinge")
    return model


@pytest.mark.parametrize("name", [*ROBOTS, "slide"])
def test_frames_are_where_pinocchio_has_them(name):
    model = slide_and_hinge() if name == "slide" else arm_of(load_robot(name))._model
    data, rng = model.createData(), np.random.default_rng(1)
    joints = rng.uniform(-2.0, 2.0, (20, model.nq))
    found = ArmFrames(model)(joints)
    for q, frames in zip(joints, found, strict=True):
        pin.forwardKinematics(model, data, q)
        np.testing.assert_allclose(frames, [m.homogeneous for m in data.oMi], atol=1e-12)
        np.testing.assert_allclose(ArmFrames(model)(q[None])[0], frames, atol=1e-12)


def shape_of(kind, rng):
    if kind == "hull":
        return convex(rng.uniform(-0.05, 0.05, (12, 3)))
    return coal.Box(*rng.uniform(0.01, 0.1, 3))


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    kinds=st.tuples(st.sampled_from(["box", "hull"]), st.sampled_from(["box", "hull"])),
    margin=st.floats(0.0, 0.03),
    swept=st.floats(0.0, 0.03),
)
def test_what_is_within_its_margin_is_near(seed, kinds, margin, swept):
    """Both move, or one does; a margin is one of the pair or is swept about a shape."""
    rng = np.random.default_rng(seed)
    shapes = [shape_of(kind, rng) for kind in kinds]
    if swept:
        shapes[1].setSweptSphereRadius(swept)
    turns = poses.from_rotation_vector(rng.uniform(-2.0, 2.0, (2, 3)))
    at = np.concatenate([rng.uniform(-0.1, 0.1, (2, 3)), turns], axis=1)
    placed = [se3(pose) for pose in at]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    where = [coal.Transform3s(m.rotation, m.translation) for m in placed]
    apart = coal.distance(shapes[0], where[0], shapes[1], where[1], request, result)
    frames = np.array([[np.eye(4), *(m.homogeneous for m in placed)]])
    moving = np.array([box_of(shape, np.eye(4)) for shape in shapes])
    standing = np.array([moving[0], box_of(shapes[1], placed[1].homogeneous)])
    pair, within = np.array([[0, 1]]), np.array([margin])
    for boxes, numbers in ((moving, [1, 2]), (standing, [1, 0])):
        near = bool(BoxPairs(boxes, np.array(numbers), pair, within).near(frames)[0, 0])
        assert near or apart > margin
        assert not near or apart < 0.5


def test_pairs_of_which_none_moves_count_as_near():
    boxes = np.array([np.eye(4)] * 4) * [[0.01, 0.01, 0.01, 1.0]]
    boxes[:, 0, 3] = 5.0, 0.0, 3.0, 8.0
    pairs = np.array([[1, 2], [0, 1], [2, 3], [0, 2], [0, 3]])
    found = BoxPairs(boxes, np.array([1, 0, 0, 1]), pairs, np.full(5, 0.01))
    near = found.near(np.array([[np.eye(4), np.eye(4)]]))[0]
    told = {tuple(pair): bool(value) for pair, value in zip(found.pairs.tolist(), near, strict=True)}
    assert told == {(0, 3): False, (0, 1): False, (0, 2): False, (2, 3): False, (1, 2): True}


def test_what_is_nowhere_is_near_everything():
    frames = np.array([[np.eye(4), np.eye(4)]])
    frames[0, 1, 0, 3] = np.nan
    boxes = np.array([np.eye(4)] * 2)
    assert BoxPairs(boxes, np.array([0, 1]), np.array([[0, 1]]), np.zeros(1)).near(frames).all()


def touches_by_all_pairs(collisions, q):
    """What Pinocchio and coal say when all pairs are compared, whatever is said of boxes."""
    pairs = collisions._pairs
    pairs._compare_too(np.ones(len(pairs._compared), bool))
    work = pairs._working
    return pin.computeCollisions(
        collisions._bodies.model, collisions._bodies.data, work.shapes, work.found, collisions._at(q), False
    )


@pytest.mark.parametrize("name", ROBOTS)
def test_a_way_is_free_where_every_posture_is_by_all_pairs(name):
    robot = load_robot(name)
    bodies, rng = bodies_of(robot), np.random.default_rng(2)
    tool = arm_of(robot).tool(robot.rest)[:3]
    things = [
        Thing(f"box {k}", np.array([*at, 1.0, 0.0, 0.0, 0.0]), size=(0.05, 0.05, 0.05), margin=0.01)
        for k, at in enumerate(tool + rng.uniform(-0.2, 0.2, (20, 3)))
    ]
    things = [each for each in things if Collisions(bodies, robot.hand_open, [each]).free(robot.rest)][:5]
    drawn = rng.uniform(robot.arm_lower, robot.arm_upper, (60, len(robot.rest)))
    postures = robot.rest + 0.3 * (drawn - robot.rest)
    among = [Collisions(bodies, robot.hand_open, things) for _ in range(5)]
    touching = np.array([touches_by_all_pairs(among[0], q) for q in postures])
    assert 5 < touching.sum() < len(postures) - 5
    assert len(postures) > 2 * _OFTEN
    for k, q in enumerate(postures):
        assert among[1].free(q) != touching[k]
        assert among[2].all_free(postures[k : k + 1]) != touching[k]
    assert among[3].all_free(postures[~touching])
    assert not among[4].all_free(postures)
