"""Chores with furniture whose parts slide and turn."""

from __future__ import annotations

import numpy as np

from benchmarks.chores.chore import Chore, Slot, kind
from bt_tasksim.concept_nodes import (
    AdjustDoor,
    AdjustDrawer,
    CloseDoor,
    CloseDrawer,
    Grasp,
    OpenDoor,
    OpenDrawer,
    Release,
)
from bt_tasksim.scene import FixtureSpec, Goal
from bt_tasksim.scene.specs import Parameter

TURNED = 0.15
"""Radians by which furniture is turned from facing the robot, at most."""


def furniture(slot: Slot, made: str, name: str, rng: np.random.Generator, **sizes: Parameter) -> FixtureSpec:
    """A piece of furniture that faces the robot from a slot, or nearly so."""
    x, y = slot.centre
    turn = float(rng.uniform(-TURNED, TURNED))
    x += float(rng.uniform(0.0, 0.06))
    return FixtureSpec(made, at=(x, y), yaw=slot.heading + turn, name=name, parameters=sizes)


@kind(front=True)
def open_drawer(slot: Slot, rng: np.random.Generator) -> Chore:
    """By 10 to 18 cm."""
    name, far = f"{slot.name}_drawer", round(float(rng.uniform(0.10, 0.18)), 3)
    return Chore(
        "open_drawer",
        f"{name} by {far:.2f} m",
        lambda: [Grasp(name), OpenDrawer(name, distance=far), Release(name)],
        [Goal(name, relation="open", value=far - 0.01)],
        fixtures=[furniture(slot, "drawer", name, rng)],
    )


@kind(front=True)
def close_drawer(slot: Slot, rng: np.random.Generator) -> Chore:
    """From 8 to 16 cm."""
    name, value = f"{slot.name}_drawer", round(float(rng.uniform(0.08, 0.16)), 3)
    return Chore(
        "close_drawer",
        f"{name}, open by {value:.2f} m",
        lambda: [Grasp(name), CloseDrawer(name), Release(name)],
        [Goal(name, relation="shut")],
        fixtures=[furniture(slot, "drawer", name, rng, value=value)],
    )


@kind(front=True)
def adjust_drawer(slot: Slot, rng: np.random.Generator) -> Chore:
    """From one half-open place to another."""
    name = f"{slot.name}_drawer"
    value, wanted = (round(float(v), 3) for v in rng.uniform((0.05, 0.11), (0.10, 0.16)))
    return Chore(
        "adjust_drawer",
        f"{name} from {value:.2f} to {wanted:.2f} m",
        lambda: [Grasp(name), AdjustDrawer(name, distance=wanted), Release(name)],
        [Goal(name, relation="set", value=wanted, position_tolerance=0.015)],
        fixtures=[furniture(slot, "drawer", name, rng, value=value)],
    )


@kind(front=True)
def open_door(slot: Slot, rng: np.random.Generator) -> Chore:
    """By 40 to 70 degrees."""
    name, far = f"{slot.name}_door", round(float(rng.uniform(0.7, 1.2)), 2)
    return Chore(
        "open_door",
        f"{name} by {far:.2f} rad",
        lambda: [Grasp(name), OpenDoor(name, angle=far), Release(name)],
        [Goal(name, relation="open", value=far - 0.05)],
        fixtures=[furniture(slot, "door", name, rng)],
    )


@kind(front=True)
def close_door(slot: Slot, rng: np.random.Generator) -> Chore:
    """From 20 to 60 degrees."""
    name, value = f"{slot.name}_door", round(float(rng.uniform(0.4, 1.0)), 2)
    return Chore(
        "close_door",
        f"{name}, open by {value:.2f} rad",
        lambda: [Grasp(name), CloseDoor(name), Release(name)],
        [Goal(name, relation="shut")],
        fixtures=[furniture(slot, "door", name, rng, value=value)],
    )


@kind(front=True)
def adjust_door(slot: Slot, rng: np.random.Generator) -> Chore:
    """From one half-open place to another."""
    name = f"{slot.name}_door"
    value, wanted = (round(float(v), 2) for v in rng.uniform((0.3, 0.7), (0.6, 1.1)))
    return Chore(
        "adjust_door",
        f"{name} from {value:.2f} to {wanted:.2f} rad",
        lambda: [Grasp(name), AdjustDoor(name, angle=wanted), Release(name)],
        [Goal(name, relation="set", value=wanted, angle_tolerance=0.08)],
        fixtures=[furniture(slot, "door", name, rng, value=value)],
    )


@kind(front=True)
def open_panel(slot: Slot, rng: np.random.Generator) -> Chore:
    """Aside, by 8 to 14 cm."""
    name, far = f"{slot.name}_panel", round(float(rng.uniform(0.08, 0.14)), 3)
    return Chore(
        "open_panel",
        f"{name} by {far:.2f} m",
        lambda: [Grasp(name), OpenDrawer(name, distance=far), Release(name)],
        [Goal(name, relation="open", value=far - 0.01)],
        fixtures=[furniture(slot, "panel", name, rng)],
    )
