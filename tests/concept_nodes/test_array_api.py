"""Every function of every shipped concept, for worlds that are unlike, in several array libraries.

What a batch gives for one of its worlds is what that world gets alone: to the last bit in NumPy, whatever the
other worlds are, however many and in which order.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import warnings

import array_api_strict
import numpy as np
import pytest

from bt_tasksim.checking.bundles import different, numbers
from bt_tasksim.checking.perturbation import changed_memory
from bt_tasksim.checking.questions import QUESTIONS, Asked, spoken
from bt_tasksim.checking.situations import alike, perturbed, situation_of, together
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes import (
    AdjustDoor,
    AdjustDrawer,
    Against,
    AtPose,
    Beside,
    Bring,
    Clear,
    ClearOf,
    CloseDoor,
    CloseDrawer,
    CloseLid,
    Emptied,
    Extract,
    Grasp,
    HandEmpty,
    HeldAgainst,
    Hold,
    Holding,
    HoldTurned,
    InContact,
    Insert,
    Inserted,
    Inside,
    IsOpen,
    IsShut,
    JointAt,
    LayDown,
    Lifted,
    Lying,
    OffStop,
    OnEnd,
    OpenDoor,
    OpenDrawer,
    OpenLid,
    Oriented,
    OutOf,
    Over,
    OverBeside,
    Pick,
    Place,
    PointingUp,
    Pour,
    PressButton,
    PressedOn,
    Pull,
    Push,
    Release,
    Settle,
    Slide,
    SlideOff,
    Slides,
    SlideToStop,
    Spin,
    StandsOn,
    TimePassed,
    TipUp,
    Turn,
    TurnedLike,
    TurnKnob,
    TurnOffStop,
    Turns,
    TurnToStop,
    Upright,
    Wait,
    Withdraw,
    catalogue,
)
from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.trees.load import load_source

SEEDS = (1, 2)
"""Draws of which the objects differ in kind and size; leaves begin in the one and in the other in turns."""
PLANNED = 6
"""Of these, so many are asked to begin again and again: a plan takes seconds where there is hardly a way."""
CLOSE = 1e-7
"""The square root of a difference that rounds off may be as much."""
SCENES = {
    "pick_and_place": ("target", "goal"),
    "shelf_to_shelf": ("cup", "lower_board"),
    "pick_and_throw": ("cup", "trash_bin"),
}
DRAWER = ("open_drawer", ("drawer", "chest"))
OWN = {
    "insert": ("insert", ("peg", "hole")),
    "extract": ("extract", ("peg", "hole")),
    "open a drawer": DRAWER,
    "open a drawer wholly": DRAWER,
    "adjust a drawer": DRAWER,
    "close a drawer": DRAWER,
    "open a door": DRAWER,
    "open a door wholly": DRAWER,
    "adjust a door": DRAWER,
    "close a door": DRAWER,
    "turn a knob": DRAWER,
    "hold turned": DRAWER,
    "turn to a stop": DRAWER,
    "open a lid": DRAWER,
    "close a lid": DRAWER,
    "turn off a stop": DRAWER,
    "press a button": ("press_button", ("button", "table")),
}
"""Concepts that begin in no such scene: a scenario of their own, with its target and its place."""
KINDS = ("cube", "box", "cup", "cylinder", "oval", "diamond", "superellipsoid")


def concepts(target="target", place="goal"):
    """The shipped concepts, with parameters that take them through all of their branches."""
    return {
        "grasp": Grasp.value(target),
        "grasp from the side": Grasp.value(target, approach=(1.0, 0.0, 0.0)),
        "grasp closing along x": Grasp.value(target, closing=(1.0, 0.0, 0.0)),
        "pick": Pick.value(target, squeeze=10.0),
        "bring": Bring.value(target, to=place),
        "bring to a position": Bring.value(target, position=(0.5, 0.1, 0.4)),
        "bring anywhere": Bring.value(target, to=place, anywhere=True),
        "bring by the way": Bring.value(target, to=place, via=((0.0, 0.1, 0.2), (0.0, 0.0, 0.2))),
        "place": Place.value(target, on=place),
        "place anywhere": Place.value(target, on=place, anywhere=True),
        "place on what is below": Place.value(target, anywhere=True),
        "place by a distance": Place.value(target, on=place, distance=0.02),
        "pour": Pour.value(target, into=place),
        "extract": Extract.value(target, out_of=place),
        "insert": Insert.value(target, into=place),
        "turn": Turn.value(target, angle=0.5, axis=(0.0, 1.0, 0.0)),
        "turn over": Turn.value(target, up=(1.0, 0.0, 0.0)),
        "spin": Spin.value(target, like=place),
        "spin by an angle": Spin.value(target, angle=0.3),
        "tip up": TipUp.value(target),
        "lay down": LayDown.value(target),
        "release": Release.value(target),
        "wait": Wait.value(1.0),
        "withdraw": Withdraw.value(),
        "withdraw upwards": Withdraw.value(direction=(0.0, 0.0, 1.0)),
        "settle": Settle.value(),
        "open a drawer": OpenDrawer.value(target, distance=0.15),
        "open a drawer wholly": OpenDrawer.value(target),
        "adjust a drawer": AdjustDrawer.value(target, distance=0.1),
        "close a drawer": CloseDrawer.value(target),
        # Of a drawer they are refused at the begin, and asked all the same.
        "open a door": OpenDoor.value(target, angle=0.1),
        "open a door wholly": OpenDoor.value(target),
        "adjust a door": AdjustDoor.value(target, angle=0.1),
        "close a door": CloseDoor.value(target),
        "press a button": PressButton.value(target),
        "turn a knob": TurnKnob.value(target, angle=0.1),
        "hold turned": HoldTurned.value(target),
        "turn to a stop": TurnToStop.value(target),
        "open a lid": OpenLid.value(target, angle=0.1),
        "close a lid": CloseLid.value(target),
        "turn off a stop": TurnOffStop.value(target, angle=0.1),
        # What is there already needs no plan, which takes a second in each world.
        "push": Push.value(target, direction=(1.0, 0.0, 0.0), distance=0.01),
        "pull": Pull.value(target, direction=(-1.0, 0.0, 0.0), distance=0.01),
        "slide": Slide.value(target, direction=(0.0, 1.0, 0.0), distance=0.05, via=((0.02, 0.0, 0.0),)),
        "slide to a stop": SlideToStop.value(target, direction=(1.0, 0.0, 0.0), distance=0.05),
        "slide off": SlideOff.value(target, direction=(-1.0, 0.0, 0.0), distance=0.05),
        "hold": Hold.value(target, direction=(1.0, 0.0, 0.0)),
    }


def conditions(target="target", place="goal"):
    return {
        "holding": Holding.value(target),
        "at pose": AtPose.value(target, on=place),
        "upright": Upright.value(target),
        "time passed": TimePassed.value(2.0),
        "hand empty": HandEmpty.value(),
        "lifted": Lifted.value(target),
        "lifted above": Lifted.value(target, above=place),
        "over": Over.value(target, place),
        "over anywhere": Over.value(target, place, anywhere=True),
        "over beside": OverBeside.value(target, target),
        "in contact": InContact.value(target, place),
        "against": Against.value(target, place),
        "held against": HeldAgainst.value(target, place),
        "clear of": ClearOf.value(target, place),
        "clear of all": ClearOf.value(target),
        "pressed on": PressedOn.value(target, place),
        "turned like": TurnedLike.value(target, like=place),
        "oriented": Oriented.value(target, like=place, angle=0.5, axis=(1.0, 0.0, 0.0)),
        "pointing up": PointingUp.value(target),
        "on end": OnEnd.value(target),
        "lying": Lying.value(target, on=place),
        "emptied": Emptied.value(target),
        "inside": Inside.value(target, place),
        "slides": Slides.value(target),
        "turns": Turns.value(target),
        "open": IsOpen.value(target, by=0.15),
        "open wholly": IsOpen.value(target),
        "shut": IsShut.value(target),
        "set": JointAt.value(target, at=0.1),
        "off its stop": OffStop.value(target),
        "out of": OutOf.value(target, place),
        "inserted": Inserted.value(target, place),
        "on": StandsOn.value(target, place),
        "beside": Beside.value(target, target),
        "clear": Clear.value(place),
        "room for it": Clear.value(place, target),
        "room anywhere": Clear.value(place, target, anywhere=True),
        "nothing on it": Clear.value(target),
    }


def names(scenario):
    """Target and place of a scenario."""
    return SCENES[scenario] if scenario in SCENES else dict(OWN.values())[scenario]


def scenarios_of(concept):
    return [OWN[concept][0]] if concept in OWN else list(SCENES)


class Asking:
    """Unlike worlds about which a concept is asked, each with a memory of its own making."""

    def __init__(self, model, situations, robot):
        self.model, self.robot = model, robot
        rng = np.random.default_rng(0)
        self.single, begun = [], []
        for situation in situations:
            with contextlib.suppress(NoWayError):
                begun.append(self.ask("begin", situation))
                self.single.append(situation._replace(memory=self.remembered(begun[-1], rng)))
        assert self.single, "it begins in none of the worlds"
        self.batch = together(self.single)
        self._alone = {"begin": [begun[k] for k in self.rows("begin")]}

    def rows(self, name):
        """The worlds that a question is about."""
        n = len(self.single)
        few = name == "begin" and n > PLANNED
        return np.linspace(0, n - 1, PLANNED).astype(int) if few else np.arange(n)

    def alone(self, name):
        """What each of these worlds is answered by itself; asked once."""
        if name not in self._alone:
            self._alone[name] = [self.ask(name, self.single[k]) for k in self.rows(name)]
        return self._alone[name]

    def remembered(self, memory, rng):
        return memory if rng.random() < 0.3 else changed_memory(memory, rng)

    def ask(self, name, situation):
        return QUESTIONS[name].ask(self.model, self.asked(situation))

    def asked(self, s):
        seen = Seen(s.observation, s.world, self.robot, s.elapsed)
        return Asked(seen, s.memory, Known(s.hidden, s.world, s.began))


@pytest.fixture(scope="module")
def worlds(recorded_run):
    """Situations of unlike worlds by scenario, and the robot: ``worlds("pick_and_place")``."""
    kept = {}

    def get(scenario):
        if scenario not in kept:
            seeds = SEEDS if scenario in SCENES else SEEDS[:1]
            firsts = [{} for _ in seeds]
            for seed, first in zip(seeds, firsts, strict=True):
                for decision in recorded_run(scenario, seed):
                    first.setdefault(decision.leaf.name, decision._replace(memory=None))
            leaves = enumerate(firsts[0])
            decisions = alike([firsts[k % len(firsts)][leaf] for k, leaf in leaves])
            rng = np.random.default_rng(1)
            real = [situation_of(d) for d in decisions]
            robot, target = decisions[0].seen.robot, names(scenario)[0]
            kinds = [facts_of(kind, target, scenario, robot) for kind in KINDS]
            others = [
                perturbed(real[k % len(real)], rng)._replace(world=kind) for k, kind in enumerate(kinds)
            ]
            kept[scenario] = [*real, *others], robot
        return kept[scenario]

    return get


@pytest.fixture(scope="module")
def asking(worlds):
    kept = {}

    def get(scenario, name):
        if (scenario, name) not in kept:
            situations, robot = worlds(scenario)
            kept[scenario, name] = Asking(concepts(*names(scenario))[name], situations, robot)
        return kept[scenario, name]

    return get


def facts_of(kind, target, scenario, robot):
    """The facts of a scenario's world in which the object is of another kind."""
    drawn = Scene(objects={target: ObjectSpec(kinds=(kind,), on="table")}).sample(KINDS.index(kind))
    tips = [tip.name for tip in robot.tips]
    usual = load_source(scenario).scene.sample(1).world_model(tips, robot.opening)
    other = drawn.world_model(tips, robot.opening)
    return WorldFacts.of([dataclasses.replace(usual, objects=other.objects)])


def test_the_worlds_are_unlike(worlds):
    for scenario, (target, _) in SCENES.items():
        facts = together(worlds(scenario)[0]).world.object(target)
        assert len(np.unique(facts.extent, axis=0)) >= len(KINDS)
        assert facts.revolved.any() and facts.cubic.any() and not (facts.revolved | facts.cubic).all()
        assert len(set(facts.rotation_counts.sum(axis=1).tolist())) > 2
        assert len(set(np.isfinite(facts.grasp_widths).sum(axis=1).tolist())) > 1


def test_all_that_is_shipped_is_asked():
    asked = {type(m).__name__ for kind in (concepts, conditions) for m in kind().values()}
    assert asked == set(catalogue())


def functions(model):
    return [
        n
        for n in QUESTIONS
        if (n != "maintained" or model.maintains) and (n != "features" or model.observables)
    ]


@pytest.mark.parametrize(
    ("concept", "scenario"), [(c, s) for k, c in enumerate(concepts()) for s in scenarios_of(c)[: 1 + k % 3]]
)
def test_a_world_gets_the_same_in_every_batch_to_the_last_bit(asking, scenario, concept):
    at, rng = asking(scenario, concept), np.random.default_rng(2)
    for name in functions(at.model):
        one, rows = at.alone(name), at.rows(name)
        n = len(rows)
        orders = [rng.integers(0, n, 2), np.arange(n)[::-1]]
        if name != "begin":
            orders += [np.arange(n), rng.permutation(n), rng.integers(0, n, 64)]
        for order in orders:
            many = at.ask(name, at.batch.at(rows[order]))
            assert not different(name, [one[k] for k in order.tolist()], many, tolerance=0.0)


@pytest.mark.parametrize("scenario", SCENES)
@pytest.mark.parametrize("condition", conditions())
def test_a_condition_answers_the_same_in_every_batch(worlds, scenario, condition):
    (situations, robot), rng = worlds(scenario), np.random.default_rng(2)
    model = conditions(*SCENES[scenario])[condition]
    batch = together(situations)

    def holds(situation):
        seen = Seen(situation.observation, situation.world, robot, situation.elapsed)
        return {"holds": model.holds(seen), **(spoken(model.explain(seen), seen.tool.shape[0]) or {})}

    one = [holds(s) for s in situations]
    for order in (np.arange(len(one)), rng.permutation(len(one)), rng.integers(0, len(one), 64)):
        assert not different(
            condition, [one[k] for k in order.tolist()], holds(batch.at(order)), tolerance=0.0
        )
    assert not different(condition, one, holds(batch.map(elsewhere)), CLOSE)


def elsewhere(values):
    """A strict array on a device that no constant is on which nobody put there."""
    return array_api_strict.asarray(values, device=array_api_strict.Device("device1"))


def libraries():
    found = {"array_api_strict": (elsewhere, type(array_api_strict.asarray(0)))}
    if importlib.util.find_spec("torch"):
        import torch

        found["torch"] = (lambda v: torch.from_numpy(np.array(v)), torch.Tensor)
    return found


@pytest.mark.parametrize("library", list(libraries()))
@pytest.mark.parametrize("concept", concepts())
def test_every_library_gives_the_same(asking, concept, library):
    at, (change, kind) = asking(scenarios_of(concept)[0], concept), libraries()[library]
    for name in functions(at.model):
        one, batch = at.alone(name), at.batch.at(at.rows(name)).map(change)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # torch's words about read-only constants
            found = at.ask(name, batch)
        assert not different(name, one, found, CLOSE, None if QUESTIONS[name].words else kind)


def single(values):
    return np.asarray(values, np.float32) if np.asarray(values).dtype == np.float64 else np.asarray(values)


@pytest.mark.parametrize("concept", concepts())
def test_single_precision_stays_so_and_a_world_gets_the_same_in_every_batch(asking, concept):
    at = asking(scenarios_of(concept)[0], concept)
    for name in functions(at.model):
        rows = at.rows(name)
        many = at.ask(name, at.batch.at(rows).map(single))
        ones = [at.ask(name, at.single[k].map(single)) for k in rows]
        assert not different(name, ones, many, tolerance=0.0)
        if not QUESTIONS[name].words:
            mapped(lambda v, name=name: pytest.fail(name) if numbers(v).dtype == np.float64 else v, many)
