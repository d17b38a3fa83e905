"""Each thing that the check can find, in a concept that is broken on purpose; and nothing in a sound one."""

from __future__ import annotations

import random
from typing import Any, NamedTuple

import numpy as np
import pytest

from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.functions import ConceptFunctions, zeros
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, ObjectName, Radians
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.poses import array_namespace
from bt_tasksim.core.world import Command

calls: list[int] = []
FAR_OFF = register_reason("far_off", "it is far off")


class Memory(NamedTuple):
    start: Any
    ticks: Any


class Sound(ConceptModel):
    """Move the tool over the target.

    Args:
        target: The object.
        reach: How far above.
    """

    target: ObjectName
    reach: Metres = 0.1
    is_task_model = False
    actions = 1
    observables = ("tool_pose", "contacts", "objects")

    def begin(self, seen):
        return Memory(seen.tool, zeros(seen.tool))

    def advance(self, action, seen, memory):
        return memory._replace(ticks=memory.ticks + 1)

    @classmethod
    def layout(cls, robot):
        return {"gap": 3, "contacts": len(robot.tips)}

    def features(self, seen, memory):
        xp = array_namespace(seen.tool)
        gap = (seen.tool[..., :3] - seen.object(self.target)[..., :3]) / 0.1
        gap = gap + (seen.tool[..., :1] - 0.4) / 0.1
        return xp.concat([gap, xp.astype(seen.contacts, seen.tool.dtype)], axis=-1)

    def command(self, action, seen, memory):
        xp = array_namespace(seen.tool)
        up = 0.01 * action[..., :1] * poses.constant([0.0, 0.0, 1.0], seen.tool)
        hand = poses.clip(seen.closure, 0.0, 1.0)[..., None]
        return Command(tool=xp.concat([seen.tool[..., :3] + up, memory.start[..., 3:]], axis=-1), hand=hand)

    def done(self, seen, memory):
        return self.necessary_cost(seen, memory) < 0.45

    def violated(self, seen, memory):
        return poses.norm(seen.wrench[..., :3]) > 60.0

    def necessary_cost(self, seen, memory):
        """Distance of the tool from the target, metres."""
        return poses.norm(seen.tool[..., :3] - seen.object(self.target)[..., :3])

    def sufficient_cost(self, known, memory):
        """How far it was moved, over 10 mm."""
        return poses.norm(known.object(self.target)[..., :3] - known.began.objects[..., 0, :3]) / 0.01


def broken(name="", function=None, base=Sound, **others):
    """A concept like `Sound`, with one function or declaration of its own."""
    own = {"__doc__": Sound.__doc__, "__module__": __name__, **others}
    if function is not None:
        function.__doc__ = getattr(Sound, name).__doc__
        own[name] = function
    return type(base)("Broken", (base,), own)


def test_a_sound_concept_has_no_finding(found):
    assert found(Sound) == []


def change_seen(self, seen, memory):
    seen.tool[..., 2] += 1.0
    return seen.tool[..., 2] > 2.0


def change_memory(self, seen, memory):
    memory.start[..., 2] += 1.0
    return seen.tool[..., 2] > 2.0


def change_self(self, seen, memory):
    self.count = getattr(self, "count", 0) + 1
    return seen.tool[..., 2] > 2.0


def change_module(self, seen, memory):
    calls.append(1)
    return seen.tool[..., 2] > 2.0


def change_hidden(self, known, memory):
    known.hidden.objects[..., 2] += 1.0
    return poses.norm(known.object(self.target)[..., :3])


def global_numpy(self, seen, memory):
    return seen.tool[..., 2] + np.random.rand() > 2.0  # noqa: NPY002


def global_random(self, seen, memory):
    return seen.tool[..., 2] + random.random() > 2.0


def own_dice(self, seen, memory):
    return poses.norm(seen.tool[..., :3]) + np.random.default_rng().random()


def begin_on_seen(self, seen):
    seen.tool[..., 2] += 1.0
    return Memory(seen.tool, zeros(seen.tool))


def begin_on_self(self, seen):
    self.count = getattr(self, "count", 0) + 1
    return Memory(seen.tool, zeros(seen.tool))


@pytest.mark.parametrize(
    ("name", "function", "words"),
    [
        ("begin", begin_on_seen, "changes what it is shown in 'seen'; work on a copy"),
        ("begin", begin_on_self, "changes itself or its class; keep nothing on self"),
        ("done", change_seen, "changes what it is shown in 'seen'; work on a copy"),
        ("done", change_memory, "changes the memory it is given; return a new one from advance"),
        ("done", change_self, "changes itself or its class; keep nothing on self"),
        ("done", change_module, "changes a global variable; keep nothing there"),
        ("sufficient_cost", change_hidden, "changes the hidden state"),
        ("done", global_numpy, "draws from global random numbers"),
        ("done", global_random, "draws from global random numbers"),
        ("necessary_cost", own_dice, "gives different answers to the same question"),
    ],
)
def test_functions_that_are_not_pure(found, name, function, words):
    lines = found(broken(name, function))
    assert any(line.startswith(f"ERROR Broken.{name} (test_findings.py:") and words in line for line in lines)


def first_row_only(self, seen, memory):
    return abs(seen.tool.reshape(-1, 7)[0, 2] + 0.0 * seen.tool[..., 2])


def one_number(self, seen, memory):
    return np.abs(np.asarray(seen.tool)).max()


def neighbours(self, seen, memory):
    return abs(seen.tool[::-1, 2])


def branches(self, seen, memory):
    return seen.tool[..., 2] if seen.tool[..., 2] > 0.4 else 2.0 * seen.tool[..., 2]


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (first_row_only, "a batch is not the loop over it: "),
        (one_number, "gives float64 of shape ()"),
        (neighbours, "a batch is not the loop over it: "),
        (branches, "raises ValueError for a batch: The truth value of an array"),
    ],
)
def test_a_batch_unlike_the_loop_over_it(found, function, words):
    assert any(words in line for line in found(broken("necessary_cost", function)))


def numpy_alone(self, seen, memory):
    return np.sqrt(np.sum(np.square(seen.tool[..., :3]), axis=-1))


def single_precision(self, seen, memory):
    xp = array_namespace(seen.tool)
    return xp.where(seen.tool[..., 0] > -9.0, 1e3 / 3.0, 0.0)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (numpy_alone, ("torch and NumPy differ", "for tensors")),
        (single_precision, ("torch and NumPy differ",)),
    ],
)
def test_numpy_unlike_torch(found, function, words):
    lines = found(broken("necessary_cost", function))
    assert any(word in line for line in lines for word in words)


def reaches_hidden(self, seen, memory):
    return self.context.hidden().objects[..., 0, :3]


def looks_for_hidden(self, seen, memory):
    extra = getattr(seen.observation, "hidden", None)
    return Sound.features(self, seen, memory) + (0.0 if extra is None else extra)


def test_a_policy_that_reads_the_hidden_state(found):
    for name in ("features", "done"):
        lines = found(broken(name, reaches_hidden))
        assert any("raises AttributeError" in line and "no attribute 'context'" in line for line in lines)
    words = "looks for 'hidden' in the observation; a robot does not see it"
    assert any(words in line for line in found(broken("features", looks_for_hidden)))


def reads(field):
    def features(self, seen, memory):
        xp = array_namespace(seen.tool)
        more = getattr(seen.observation, field)
        flat = xp.astype(more, seen.tool.dtype).reshape((*seen.tool.shape[:-1], -1))
        return xp.concat([Sound.features(self, seen, memory)[..., :-2], flat[..., :2]], axis=-1)

    return features


def test_observables_that_are_read_and_not_declared(found):
    lines = found(broken("features", reads("tips")))
    assert any("reads 'tips', which is not declared; add it" in line for line in lines)
    lines = found(broken(observables=(*Sound.observables, "closure")))
    assert any("declares 'closure', which features never uses" in line for line in lines)


def keeps_wrench(self, action, seen, memory):
    return memory._replace(ticks=memory.ticks + 1, start=memory.start + 0.001 * seen.wrench[..., :1])


def from_memory(self, seen, memory):
    return Sound.features(self, seen, memory) + memory.start[..., :1]


def test_observables_with_a_large_gap(found):
    lines = found(broken(observables=("tool_pose", "objects", "contacts", "wrench", "heat")))
    assert any(
        "declares 'wrench', of which simulation and reality differ (simulated" in line for line in lines
    )
    assert any("names 'heat', which is none" in line for line in lines)
    lines = found(broken("features", reads("hand_effort")))
    assert any("reads 'hand_effort', which is not declared, and of which" in line for line in lines)
    lines = found(broken("features", from_memory, advance=keeps_wrench))
    assert any("carries the size of 'wrench' through the memory" in line for line in lines)


def wide(self, seen, memory):
    xp = array_namespace(seen.tool)
    found = Sound.features(self, seen, memory)
    return xp.concat([found, found], axis=-1)


def commands(**parts):
    def command(self, action, seen, memory):
        usual = Sound.command(self, action, seen, memory)
        changes = {k: v(getattr(usual, k)) for k, v in parts.items()}
        return Command(**({"tool": usual.tool, "hand": usual.hand} | changes))

    return command


def scaled(factor, part):
    def change(tool):
        xp = array_namespace(tool)
        a, b = tool[..., :3], tool[..., 3:]
        return xp.concat([factor * a, b] if part == "position" else [a, factor * b], axis=-1)

    return change


@pytest.mark.parametrize(
    ("name", "function", "words"),
    [
        ("features", wide, "gives the shape (1, 10) for one world, and layout says (1, 5)"),
        ("command", commands(tool=lambda t: t[..., :6]), "tool target of shape (1, 6) for one world"),
        ("command", commands(hand=lambda h: h[..., 0]), "hand target of shape (1,) for one world"),
        ("command", commands(tool=scaled(1.1, "rotation")), "quaternion of length 1.1"),
        ("command", commands(tool=scaled(1000.0, "position")), "positions are in metres"),
        ("command", commands(tool=scaled(np.nan, "position")), "tool target that is not finite"),
        ("command", commands(hand=lambda h: 50.0 + h), "gives a closure of 50"),
        ("command", lambda self, action, seen, memory: seen.tool, "gives a ndarray; return Command("),
        ("done", lambda self, seen, memory: 1.0 * (seen.tool[..., 2] > 2.0), "gives float64 of shape (1,)"),
        ("violated", lambda self, seen, memory: seen.contacts, "gives bool of shape (1, 2)"),
        ("necessary_cost", lambda self, seen, memory: seen.tool[..., :3], "gives float64 of shape (1, 3)"),
        ("necessary_cost", lambda self, seen, memory: seen.tool[..., 2] - 9.0, "never negative"),
        ("sufficient_cost", lambda self, k, memory: k.hidden.objects[..., 0, 0] * np.inf, "gives inf"),
        ("features", lambda self, seen, memory: [][0], "raises IndexError: list index out of range"),
        ("explain", lambda self, seen, memory: 3, "gives a int; give a Form"),
        ("initial_state", lambda self, seen: False, "gives False"),
        ("initial_state", lambda self, seen: "it is too far", "gives 'it is too far'"),
        ("initial_state", lambda self, seen: FAR_OFF.where(np.array(True)), "bool of shape () for one world"),
        ("begin", lambda self, seen: seen.nothing, "raises AttributeError"),
        ("begin", lambda self, seen: Memory(seen.tool, 0), "memory.ticks is a int for one world"),
        (
            "advance",
            lambda self, action, seen, memory: memory._replace(ticks=3),
            "memory.ticks is a int for one world",
        ),
    ],
)
def test_shapes_units_and_exceptions(found, name, function, words):
    lines = found(broken(name, function))
    assert any(
        line.startswith(f"ERROR Broken.{name} (test_findings.py:") and words in line for line in lines
    ), lines


class Degrees(Sound):
    """Turn the target by an angle, from a reach.

    Args:
        target: The object.
        reach: How far.
        angle: By how much.
        width: How wide.
    """

    angle: Radians = 90.0
    reach: Metres = 250.0
    width: float = 0.1


def test_parameters_in_other_units(found):
    lines = found(Degrees)
    assert any("'angle' is 90 rad; angles are in radians: math.radians(90)" in line for line in lines)
    assert any("'reach' is 250 m; lengths are in metres" in line for line in lines)
    assert any(
        "'width: float' has no unit, so it is no parameter; declare it as Metres" in line for line in lines
    )


def test_features_that_teach_badly(found):
    lines = found(broken("features", lambda self, seen, memory: 1e4 * Sound.features(self, seen, memory)))
    assert any(
        line.startswith("WARNING") and "is as large as" in line and "divide it" in line for line in lines
    )
    lines = found(broken("features", lambda self, seen, memory: 0.0 * Sound.features(self, seen, memory)))
    assert any(line.startswith("WARNING") and "was always 0; leave it out" in line for line in lines)


def saturating(self, action, seen, memory):
    return Sound.command(self, poses.clip(1e6 * action, -1.0, 1.0), seen, memory)


def test_actions_without_effect(found):
    assert any("action 1 changes nothing; use it" in line for line in found(broken(actions=2)))
    lines = found(broken("command", saturating))
    assert any("action 0 at 0.5 does as much as at 1" in line for line in lines)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda self, action, seen, memory: tuple(memory), "memory was a Memory, and is a tuple"),
        (
            lambda self, action, seen, memory: memory._replace(start=memory.start[..., :3]),
            "memory.start was float64 (1, 7), and is float64 (1, 3)",
        ),
        (lambda self, action, seen, memory: None, "memory was a Memory, and is a NoneType"),
    ],
)
def test_an_advance_that_loses_the_memorys_structure(found, function, words):
    assert any(
        "loses the memory's structure: " + words in line for line in found(broken("advance", function))
    )


def test_what_a_learner_lacks(found):
    lines = found(broken(sufficient_cost=ConceptModel.sufficient_cost))
    assert [line for line in lines if "whether the completion signal was right is never judged" in line]
    lines = found(
        broken(necessary_cost=ConceptModel.necessary_cost, done=lambda s, seen, m: seen.contacts[..., 0])
    )
    assert any("nothing shows a learner the way" in line for line in lines)
    assert any(
        "layout" in line and "is missing" in line for line in found(broken(layout=ConceptModel.layout))
    )
    lines = found(broken(features=ConceptModel.features, layout=ConceptFunctions.__dict__["layout"]))
    assert any("nothing to learn from" in line for line in lines)
    assert any("says that nothing is unknown" in line for line in found(broken(is_task_model=True)))
    lines = found(broken(is_programmed=False, is_task_model=True))
    assert any("neither programmed nor to be learned" in line for line in lines)


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        (ConditionOf("Holdin", target="target"), "the condition 'Holdin', which does not exist"),
        (ConditionOf("Holding", thing="target"), "gives Holding a 'thing', which it does not take"),
        (ConditionOf("Holding", target="thing"), "its parameter 'thing', which it does not have"),
    ],
)
def test_conditions_that_do_not_exist(found, declared, words):
    sound = found(broken(establishes=(ConditionOf("Holding", target="target"),)))
    assert not any("'establishes'" in line for line in sound)
    for name in ("establishes", "requires"):
        assert any(f"'{name}'" in line and words in line for line in found(broken(**{name: (declared,)})))


def test_words_and_units_in_docstrings(found):
    assert any("has no docstring" in line for line in found(broken(__doc__=None)))
    assert any(
        "does not describe the parameter 'reach'" in line for line in found(broken(__doc__="Moves target."))
    )
    own = {"__module__": __name__, "necessary_cost": lambda self, seen, memory: seen.tool[..., 2]}
    lines = found(type(Sound)("Broken", (Sound,), {"__doc__": Sound.__doc__, **own}))
    assert any("necessary_cost" in line and "its docstring names no unit" in line for line in lines)


def test_a_programmed_policy_that_never_ends(found):
    lines = found(broken("done", lambda self, seen, memory: seen.tool[..., 2] > 9.0))
    assert any("is never true in 1 runs (the last one ended: it ended)" in line for line in lines)
