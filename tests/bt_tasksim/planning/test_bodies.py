"""A robot's bodies: all are convex, those of the hand are known, and which are to be kept apart."""

import numpy as np
import pytest

from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import Collisions
from bt_tasksim.planning.things import box_corners


def test_they_are_made_once_for_a_robot(panda):
    assert bodies_of(panda.robot) is bodies_of(panda.robot)


def test_every_body_is_convex_and_the_hands_are_known(each):
    bodies = bodies_of(each.robot)
    assert not any(isinstance(g.geometry, coal.BVHModelBase) for g in bodies.shapes.geometryObjects)
    assert bodies.hand.any() and not bodies.hand.all()
    tips = {link for tip in each.robot.tips for link in tip.links}
    found = {link for link, hand in zip(bodies.links, bodies.hand, strict=True) if hand}
    assert tips & set(bodies.links) <= found
    assert not bodies.moves[[link == each.robot.base_link for link in bodies.links]].any()


def test_pairs_that_are_kept_apart_never_touch_at_rest_and_leave_out_the_hand_itself(each):
    bodies = bodies_of(each.robot)
    assert len(bodies.apart)
    for i, j in bodies.apart.tolist():
        joints = [bodies.shapes.geometryObjects[k].parentJoint for k in (i, j)]
        assert joints[0] != joints[1] and not (bodies.hand[i] and bodies.hand[j])
    assert Collisions(bodies, each.hand, []).free(each.robot.rest)


def test_an_arm_that_folds_into_itself_is_not_free(panda):
    folded = panda.robot.rest.copy()
    folded[3], folded[5] = panda.robot.arm_lower[3], 0.2
    touches = Collisions(bodies_of(panda.robot), panda.hand, []).touches(folded)
    assert touches and all(name.startswith("panda_") for pair in touches for name in pair)


def test_configurations_put_joints_where_the_model_has_them(each):
    bodies, robot = bodies_of(each.robot), each.robot
    arm, hand = np.arange(1.0, 1.0 + len(robot.arm_joints)), np.arange(100.0, 100.0 + len(robot.hand_joints))
    q = bodies.configuration(arm, hand)
    for name, value in zip(robot.joints, [*arm, *hand], strict=True):
        assert q[bodies.model.joints[bodies.model.getJointId(name)].idx_q] == value


def test_a_hull_is_that_of_its_corners():
    hull = convex(box_corners((0.2, 0.4, 0.6)))
    hull.computeLocalAABB()
    assert np.allclose(hull.aabb_local.max_ - hull.aabb_local.min_, (0.2, 0.4, 0.6), atol=1e-9)


@pytest.mark.parametrize("name", ["panda_hand", "panda_link5"])
def test_a_hull_with_few_corners_holds_the_whole_mesh(panda, name):
    import pinocchio as pin

    robot, bodies = panda.robot, bodies_of(panda.robot)
    plain = pin.buildModelFromUrdf(str(robot.urdf))
    folders = [str(robot.urdf.parent), str(robot.urdf.parent.parent)]
    found = pin.buildGeomFromUrdf(plain, str(robot.urdf), pin.GeometryType.COLLISION, package_dirs=folders)
    k = bodies.links.index(name)
    original = next(g for g in found.geometryObjects if plain.frames[g.parentFrame].name == name)
    ours = bodies.shapes.geometryObjects[k].geometry
    corners = np.array(original.geometry.vertices()).reshape(-1, 3)
    here = coal.Transform3s.Identity()
    for corner in corners[:: max(1, len(corners) // 60)]:
        point = coal.Sphere(1e-6)
        at = coal.Transform3s(np.eye(3), corner)
        assert coal.distance(ours, here, point, at, coal.DistanceRequest(), coal.DistanceResult()) < 1e-4
