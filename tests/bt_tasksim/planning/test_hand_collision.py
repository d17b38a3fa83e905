"""A hand alone touches what it touches on its arm."""

import numpy as np
import pytest

from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import Collisions
from bt_tasksim.planning.hand_collision import HandCollisions
from bt_tasksim.planning.things import Leave


@pytest.mark.parametrize("aside", [0.0, 0.001, 0.002, -0.001])
def test_one_thing_inside_another_touches(each, aside):
    """Coal calls some of these 2e-12 m apart."""
    tool = each.arm.tool(each.robot.rest)
    around = each.box(tool[:3] + aside, (0.03, 0.03, 0.03))
    found = HandCollisions(bodies_of(each.robot), each.hand, [around], each.held((0.02, 0.02, 0.02)))
    assert not found.free(tool) and ("held", "box") in found.touches(tool)


@pytest.mark.parametrize(
    "leave",
    [
        None,
        Leave(hand={"near"}),
        Leave(held={"near", "far"}),
        Leave(pairs={("held", "near")}),
    ],
)
def test_it_touches_what_the_hand_touches_on_its_arm(each, leave):
    rng, bodies, robot = np.random.default_rng(0), bodies_of(each.robot), each.robot
    hand = {link for link, is_hand in zip(bodies.links, bodies.hand, strict=True) if is_hand}
    tool, held = each.arm.tool(robot.rest), each.held((0.02, 0.03, 0.1))
    things = [
        each.box(np.add(tool[:3], [0.0, 0.03, -0.05]), (0.05, 0.03, 0.04), 0.01, name="near"),
        each.box(np.add(tool[:3], [0.1, -0.1, 0.0]), (0.2, 0.1, 0.02), name="far"),
    ]
    alone = HandCollisions(bodies, each.hand, things, held, leave)
    whole = Collisions(bodies, each.hand, things, held, leave)
    touched = []
    for _ in range(60):
        arm = robot.rest + rng.normal(scale=0.25, size=len(robot.rest))
        of_hand = [(a, b) for a, b in whole.touches(arm) if a in hand | {"held"} and b in {"near", "far"}]
        at = each.arm.tool(arm)
        assert alone.touches(at) == of_hand and alone.free(at) == (not of_hand)
        touched.append(bool(of_hand))
    assert 5 < sum(touched) < 55
