"""Contacts as PhysX lists them: what is read does not depend on their order."""

import itertools
from types import SimpleNamespace

import numpy as np

from bt_tasksim.engines.physics.sapien_contacts import ContactReader


class Body(SimpleNamespace):
    __hash__ = object.__hash__
    __eq__ = object.__eq__


def contact(a, b, impulse):
    point = SimpleNamespace(separation=0.0, impulse=np.array(impulse))
    return SimpleNamespace(bodies=(a, b), points=[point])


def test_sums_of_forces_are_the_same_bits_in_any_order_of_contacts():
    names = ("finger", "thumb", "cup")
    finger, thumb, cup = (Body(entity=SimpleNamespace(name=name)) for name in names)
    contacts = [
        contact(finger, cup, [0.1, 0.0, 0.0]),
        contact(finger, cup, [0.2, 0.0, 0.0]),
        contact(cup, finger, [-0.3, 0.0, 0.0]),
        contact(thumb, cup, [0.0, 0.6, 0.9]),
    ]
    found = set()
    for order in itertools.permutations(contacts):
        world = SimpleNamespace(
            bodies={finger: ("hand", 0), thumb: ("hand", 1), cup: ("object", 0)},
            objects=[cup],
            system=SimpleNamespace(get_contacts=lambda order=order: order),
        )
        touch = ContactReader(world, 2).read(0.0, 1.0)
        found.add((np.array(touch.tip_force).tobytes(), *touch.hand_force))
    assert len(found) == 1
    assert np.allclose(touch.tip_force, [[0.6, 0.0, 0.0], [0.0, 0.6, 0.9]])


def test_contacts_of_what_sleeps_are_read_again_when_a_robot_comes_near():
    """Also one that is too far away to count yet, and one that came as another went."""
    table, cup, finger = (Body(entity=SimpleNamespace(name=name)) for name in ("table", "cup", "finger"))
    standing, near = contact(cup, table, [0.0, 0.0, 0.1]), contact(finger, cup, [0.5, 0.0, 0.0])
    near.points[0].separation = 0.003
    listed = []
    world = SimpleNamespace(
        bodies={table: ("fixture", 1), cup: ("object", 0), finger: ("hand", 0)},
        objects=[cup],
        system=SimpleNamespace(get_contacts=lambda: listed),
    )
    reader = ContactReader(world, 1)
    listed[:] = [standing]
    first = reader.read(0.0, 1.0)
    assert first.support == {(0, 1)} and not any(first.touched)
    assert reader.read(0.1, 1.0, asleep=True) == first
    listed[:] = [standing, near]
    assert not any(reader.read(0.2, 1.0, asleep=True).touched)
    near.points[0].separation = 0.0
    assert reader.read(0.3, 1.0, asleep=True).hand_force == [0.5]
    listed[:] = [near]
    assert reader.read(0.4, 1.0, asleep=True).support == set()
    listed[:] = [standing]
    assert reader.read(0.5, 1.0, asleep=True) == first
    listed[:] = []
    assert reader.read(0.6, 1.0, asleep=True).support == set()
    listed[:] = [near]
    assert reader.read(0.7, 1.0, asleep=True).hand_force == [0.5]
