"""Rolling resistance: the law, and what it does to a cylinder that rolls over the table."""

import math

import numpy as np
import pytest
from physics_cases import Still, lifted, scene

from bt_tasksim.engines.physics.rolling import ROLLING_RESISTANCE, SPINNING_RESISTANCE, rolling_damping

pytestmark = pytest.mark.physical

INERTIA = (2e-4, 3e-4, 4e-4)
DOWN = (0.0, 0.0, 1.5)
"""The force of a floor, N."""


@pytest.mark.parametrize("speed", [0.1, 1.0, 20.0])
def test_the_torque_is_lever_times_normal_force_at_any_speed(speed):
    for axis, moment in ((0, INERTIA[0]), (1, INERTIA[1])):
        spin = [0.0, 0.0, 0.0]
        spin[axis] = -speed
        torque = rolling_damping(spin, INERTIA, [DOWN]) * moment * speed
        assert torque == pytest.approx(ROLLING_RESISTANCE * 1.5)


def test_contacts_add_up_and_none_resists_nothing():
    spin = (0.0, 3.0, 0.0)
    one, wall = rolling_damping(spin, INERTIA, [DOWN]), (0.5, 0.0, 0.0)
    assert rolling_damping(spin, INERTIA, [DOWN, wall]) == pytest.approx(one * 2.0 / 1.5)
    assert rolling_damping(spin, INERTIA, []) == 0.0
    assert rolling_damping(spin, INERTIA, [(0.0, 0.0, 0.0)]) == 0.0


def test_spinning_about_the_normal_has_a_lever_of_its_own():
    upright = rolling_damping((0.0, 0.0, 5.0), INERTIA, [DOWN])
    assert upright * 4e-4 * 5.0 == pytest.approx(SPINNING_RESISTANCE * 1.5)
    aslant = rolling_damping((3.0, 0.0, 4.0), INERTIA, [DOWN])
    moment = (2e-4 * 9 + 4e-4 * 16) / 25
    assert aslant * moment * 5.0 == pytest.approx(
        (ROLLING_RESISTANCE * 3 + SPINNING_RESISTANCE * 4) * 1.5 / 5
    )


def moving(still, engine, velocity, spin):
    """Its object has these velocities from now on."""
    if engine == "sapien":
        body = still.physics.simulated.world.objects[0]
        body.set_linear_velocity(velocity)
        body.set_angular_velocity(spin)
    else:
        data, world = still.physics.simulated.data, still.physics.simulated.world
        address = world.object_dof[0]
        local = data.xmat[world.object_body[0]].reshape(3, 3).T @ spin
        data.qvel[address] = [*velocity, *local]


def rolling_cylinder(engine, speed):
    """A cylinder on its side that rolls along x."""
    configuration = scene("cylinder").sample(1)
    size = configuration.objects[0].size
    radius = size[0] / 2
    still = Still(lifted(configuration, radius - size[2] / 2 + 1e-4, turn=(math.pi / 2, 0.0, 0.0)), engine)
    still.step(20)
    moving(still, engine, [speed, 0.0, 0.0], [0.0, speed / radius, 0.0])
    return still


@pytest.mark.parametrize("engine", ["sapien", "mujoco"])
def test_what_stands_on_a_point_does_not_spin_on(engine):
    """Some superellipsoids stand on a point of their hull; without a patch they turn by 109 degrees."""
    for seed in range(6):
        still = Still(scene("superellipsoid").sample(seed), engine)
        still.step(20)
        moving(still, engine, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
        before = still.state.objects[0, 3:].copy()
        turned = 2.0 * np.arccos(np.minimum(np.abs(still.step(40).objects[0, 3:] @ before), 1.0))
        assert turned < 0.2 and np.abs(still.state.velocities).max() < 0.01


@pytest.mark.parametrize("engine", ["sapien", "mujoco"])
def test_a_rolling_cylinder_comes_to_rest(engine):
    """Without rolling resistance it would be a metre away, and still roll at 0.1 m/s."""
    still = rolling_cylinder(engine, speed=0.12)
    start = still.state.objects[0, 0]
    way = [float(still.step().objects[0, 0] - start) for _ in range(80)]
    assert 0.01 < way[-1] < 0.3, "it rolls, and not far"
    assert abs(way[-1] - way[-10]) < 1e-3
    assert np.abs(still.state.velocities).max() < 0.01


def test_rolling_resistance_ends_where_the_hand_touches_or_nothing_moves():
    still = rolling_cylinder("sapien", speed=0.12)
    body = still.physics.simulated.world.objects[0]
    own = body.angular_damping
    found = []
    for _ in range(6):
        still.step()
        found.append(body.angular_damping)
    assert max(found) > own, "now and then an edge of it hops, and touches nothing"
    still.step(100)
    assert body.angular_damping == own
