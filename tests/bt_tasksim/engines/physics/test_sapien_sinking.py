"""What sinks into something is stopped along the least way out, and what it meets takes its share."""

from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.engines.physics import sapien_sinking
from bt_tasksim.engines.physics.sapien_overlap import DeepestPlace
from bt_tasksim.engines.physics.sapien_sinking import SUNK, Sinking

MASS, INERTIA = 0.2, [4e-5, 5e-5, 6e-5]


class Body:
    """A rigid body with its middle at a place."""

    def __init__(self, at, velocity):
        self.entity_pose = SimpleNamespace(__getstate__=lambda: (*at, 1.0, 0.0, 0.0, 0.0))
        self.mass, self.linear_velocity, self.angular_velocity = MASS, np.array(velocity), np.zeros(3)

    def get_cmass_local_pose(self):
        return SimpleNamespace(__getstate__=lambda: (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))

    def set_linear_velocity(self, value):
        self.linear_velocity = value

    def set_angular_velocity(self, value):
        self.angular_velocity = value

    def velocity_at(self, at, place):
        return self.linear_velocity + np.cross(self.angular_velocity, np.asarray(place) - np.asarray(at))


class Link(Body):
    """A part of furniture on a joint: nobody but its articulation sets how it moves."""

    set_linear_velocity = property(lambda self: self.nothing)
    set_angular_velocity = set_linear_velocity


def meeting(monkeypatch, second, met):
    """A world in which a body that falls meets a second one so, and how often somebody has looked."""
    first, asked = Body((0.0, 0.0, 0.0), (0.1, 0.0, -0.5)), []
    kinds = {first: ("object", 0), second: ("object" if isinstance(second, Body) else "fixture", 1)}
    contact = SimpleNamespace(bodies=(first, second), shapes=("one", "two"))
    world = SimpleNamespace(
        system=SimpleNamespace(get_contacts=lambda: [contact]),
        bodies=kinds,
        objects=[first, second],
        inertia=[([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], INERTIA)] * 2,
    )

    def look(*_):
        asked.append(1)
        return met

    monkeypatch.setattr(sapien_sinking, "deepest_place", look)
    return first, Sinking(world, [0], {}), asked


PLACE, DOWN = np.array([0.02, 0.01, -0.03]), np.array([0.0, 0.0, -1.0])


def test_on_something_that_stands_it_does_not_go_on_into_it(monkeypatch):
    first, sinking, _ = meeting(monkeypatch, "wall", DeepestPlace(2 * SUNK, PLACE, DOWN))
    sinking.stop(0.0)
    assert first.velocity_at((0, 0, 0), PLACE) @ DOWN == pytest.approx(0.0, abs=1e-12)
    assert first.linear_velocity[2] < 0.0 and np.abs(first.angular_velocity).max() > 0.0, "it tips over"
    assert first.linear_velocity[0] == pytest.approx(0.1), "aside it goes on"


def test_of_two_that_move_momentum_stays(monkeypatch):
    second = Body((0.0, 0.0, -0.06), (0.0, 0.0, 0.2))
    first, sinking, _ = meeting(monkeypatch, second, DeepestPlace(2 * SUNK, PLACE, DOWN))
    before = MASS * (first.linear_velocity + second.linear_velocity)
    sinking.stop(0.0)
    assert MASS * (first.linear_velocity + second.linear_velocity) == pytest.approx(before)
    apart = first.velocity_at((0, 0, 0), PLACE) - second.velocity_at((0, 0, -0.06), PLACE)
    assert apart @ DOWN == pytest.approx(0.0, abs=1e-12)


def test_a_part_of_furniture_goes_on_as_it_does(monkeypatch):
    link = Link((0.0, 0.0, -0.06), (0.0, 0.0, 0.2))
    first, sinking, _ = meeting(monkeypatch, link, DeepestPlace(2 * SUNK, PLACE, DOWN))
    sinking.stop(0.0)
    assert link.linear_velocity.tolist() == [0.0, 0.0, 0.2] and not link.angular_velocity.any()
    assert first.velocity_at((0, 0, 0), PLACE) @ DOWN == pytest.approx(-0.2, abs=1e-12), "it goes along"


def test_of_two_parts_of_furniture_none_is_stopped(monkeypatch):
    one = Link((0.0, 0.0, 0.0), (0.0, 0.0, -0.5))
    two = Link((0.0, 0.0, -0.06), (0.0, 0.0, 0.2))
    world = SimpleNamespace(bodies={one: ("object", 0), two: ("object", 1)})
    sapien_sinking.without_nearing(world, (one, two), DeepestPlace(2 * SUNK, PLACE, DOWN))
    assert one.linear_velocity.tolist() == [0.0, 0.0, -0.5]


@pytest.mark.parametrize(("depth", "normal"), [(SUNK / 2, DOWN), (2 * SUNK, -DOWN)])
def test_what_is_hardly_in_it_or_leaves_it_is_let_alone(monkeypatch, depth, normal):
    first, sinking, _ = meeting(monkeypatch, "wall", DeepestPlace(depth, PLACE, normal))
    sinking.stop(0.0)
    assert first.linear_velocity.tolist() == [0.1, 0.0, -0.5]


def test_what_is_apart_is_looked_at_again_once_it_can_have_come(monkeypatch):
    _, sinking, asked = meeting(monkeypatch, "wall", DeepestPlace(-0.01, PLACE, DOWN))
    for _ in range(4):
        sinking.stop(0.004)
    assert len(asked) == 2
