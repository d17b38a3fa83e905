"""Chores with buttons, knobs, valves and levers on consoles."""

from __future__ import annotations

import numpy as np

from benchmarks.chores.chore import Chore, Slot, kind
from benchmarks.chores.opening import furniture
from bt_tasksim.concept_nodes import Grasp, PressButton, Release, TurnKnob, TurnToStop
from bt_tasksim.scene import Goal


@kind()
def press(slot: Slot, rng: np.random.Generator) -> Chore:
    """A button."""
    name = f"{slot.name}_button"
    return Chore(
        "press",
        name,
        lambda: [PressButton(name)],
        [Goal(name, relation="open", when="once")],
        fixtures=[furniture(slot, "button", name, rng)],
    )


@kind()
def turn_knob(slot: Slot, rng: np.random.Generator) -> Chore:
    """By 40 to 100 degrees."""
    return _turned(slot, "knob", round(float(rng.uniform(0.7, 1.7)), 2), rng)


@kind()
def turn_valve(slot: Slot, rng: np.random.Generator) -> Chore:
    """By 30 to 70 degrees."""
    return _turned(slot, "valve", round(float(rng.uniform(0.5, 1.2)), 2), rng)


def _turned(slot: Slot, what: str, far: float, rng: np.random.Generator) -> Chore:
    """To so many radians."""
    name = f"{slot.name}_{what}"
    return Chore(
        f"turn_{what}",
        f"{name} by {far:.2f} rad",
        lambda: [Grasp(name), TurnKnob(name, angle=far), Release(name)],
        [Goal(name, relation="set", value=far, angle_tolerance=0.08)],
        fixtures=[furniture(slot, what, name, rng)],
    )


@kind()
def throw_lever(slot: Slot, rng: np.random.Generator) -> Chore:
    """Onto its other stop."""
    name = f"{slot.name}_lever"
    return Chore(
        "throw_lever",
        name,
        lambda: [Grasp(name), TurnToStop(name), Release(name)],
        [Goal(name, relation="open")],
        fixtures=[furniture(slot, "lever", name, rng, value=(0.0, 0.6))],
    )
