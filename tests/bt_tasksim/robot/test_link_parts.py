"""The convex parts of a robot's links."""

import numpy as np
import pytest

from bt_tasksim import load_robot
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.robot.link_parts import link_parts

LARGER = 0.004
"""Metres by which hulls with few corners may reach further."""


@pytest.mark.parametrize("name", ["panda", "so100", "xarm7_ability"])
def test_planning_has_the_same_bodies_or_slightly_larger_ones(name):
    robot = load_robot(name)
    parts, bodies = link_parts(robot).parts, bodies_of(robot)
    assert not link_parts(robot).left_out
    assert sorted(part.link for part in parts) == sorted(bodies.links)
    for link in set(bodies.links):
        ours = [part.form for part in parts if part.link == link]
        theirs = [
            body.geometry
            for body, of in zip(bodies.shapes.geometryObjects, bodies.links, strict=True)
            if of == link
        ]
        more = np.array([_extent(f) for f in theirs]) - np.array([_extent(f) for f in ours])
        assert (more > -1e-6).all() and (more < 2 * LARGER).all()


def _extent(form):
    """Size ``(3,)`` of a shape's box, with the radius by which it is widened on either side."""
    form.computeLocalAABB()
    box = coal.AABB(form.aabb_local)
    return np.array(box.max_) - np.array(box.min_)
