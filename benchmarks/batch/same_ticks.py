"""Random trees with random outcomes: the batch executor, py_trees and BehaviorTree.CPP, tick by tick.

A case is one tree in a few worlds. Each world has its own outcomes of leaves, begins anew at times of its
own, and is ticked with others in an order of its own; in some cases leaves let their ticks stand still and go
on later. Compared are, for every tick of every world: the statuses of all nodes, which leaves were ticked in
which order and whether they began, which were stopped, and why the tree failed. BehaviorTree.CPP shows the
root's status, which leaves were ticked in which order, and which were halted; it is left out where a tree has
a time-out (its clock is the wall's) or a node that it does not have, and refuses reactive nodes in which two
children are RUNNING.
"""

from __future__ import annotations

import argparse
import functools
import importlib.util
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from defusedxml.ElementTree import fromstring
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim import trees
from bt_tasksim.concept.condition import Condition, ConditionNode
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.reporting import speaker, whole_outcome
from bt_tasksim.core.batch_leaf import FAILURE, PENDING, RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import DONE, FAILED, Outcome
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.execution.world_by_world import CODES, LOG
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees.nodes.batch import Arrays
from bt_tasksim.trees.nodes.train import Train
from bt_tasksim.trees.walk import nodes_of

SCRIPT = 24
"""Outcomes of a leaf, over and over."""
PERIOD = 0.05
TREES = 10_000
STATUS = {RUNNING: Status.RUNNING, SUCCESS: Status.SUCCESS, FAILURE: Status.FAILURE}
COMPOSITES = ("sequence", "fallback", "reactive_sequence", "reactive_fallback", "any_order")
ROUNDS = ("retry", "repeat", "retry_while_acting")
DECORATORS = ("invert", "force_success", "force_failure", "subtree", "train", *ROUNDS, "timeout")
OWN = ("timeout", "any_order", "retry_while_acting")
"""Nodes that BehaviorTree.CPP does not have, or that ask a clock, which is the wall's there."""

Trace = list[list[tuple[list[str], list[int], Outcome | None]]]
"""For each world and each of its ticks: what happened to leaves, all statuses, why the tree failed."""


@dataclass
class Case:
    """A tree, its worlds and what happens in them.

    Attributes:
        shape: The tree, nested.
        outcomes: ``(leaves, worlds, SCRIPT)`` what the leaves answer, one after the other.
        anew: ``(worlds, ticks)`` whether the world begins anew before the tick.
        seed: For the order in which worlds are ticked, and where ticks stand still.
    """

    shape: Any
    outcomes: np.ndarray
    anew: np.ndarray
    seed: int

    @property
    def is_own(self) -> bool:
        """Whether BehaviorTree.CPP does not know a part of it, or asks another clock."""
        return any(f"'{name}'" in repr(self.shape) for name in OWN)


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes."""
    parser.add_argument("--trees", type=int, metavar="N", help=f"random trees in same-ticks ({TREES})")


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Compare on random trees; stops at the first difference, which is the entry ``differs``."""
    wanted = options.trees if options.trees is not None else 200 if options.quick else TREES
    if wanted < 1:
        raise InputError(f"--trees should be at least 1, found {wanted}")
    found: dict[str, Any] = {"trees": 0, "ticks": 0, "interrupted": 0, "cpp_trees": 0, "cpp_ticks": 0}
    started = time.perf_counter()
    for seed in range(wanted):
        case = draw(seed)
        ours = by_py_trees(case)
        why = difference(case, ours, by_executor(case))
        with warned_of():
            found_so = by_executor(case, standing=0.3, know=partial(known, seed))
        why = why or difference(case, ours, found_so)
        if why is None and not case.is_own and cpp_is_there():
            why, ticks = difference_to_cpp(case, ours)
            found["cpp_trees"] += 1
            found["cpp_ticks"] += ticks
        if why is not None:
            found["differs"] = why
            break
        found["trees"] += 1
        found["ticks"] += sum(map(len, ours))
        found["interrupted"] += sum(any("halted" in e for e in log) for world in ours for log, *_ in world)
        if seed % 1000 == 999:
            print(f"{seed + 1} trees, {time.perf_counter() - started:.0f} s", flush=True)
    print(
        f"{found['trees']} trees, {found['ticks']} ticks, leaves stopped in {found['interrupted']} of them: "
        f"executor and py_trees are {'not ' if 'differs' in found else ''}the same; BehaviorTree.CPP: "
        f"{found['cpp_trees']} trees, {found['cpp_ticks']} ticks"
    )
    if "differs" in found:
        print(found["differs"])
    return found


def known(seed: int, name: str) -> bool:
    """Whether a leaf is known in a case: four of five are, and the others are ticked world by world."""
    return (seed + int(name[1:])) % 5 > 0


@contextmanager
def warned_of() -> Iterator[None]:
    """No warnings that leaves are ticked world by world: here they are so on purpose."""
    before = LOG.level
    LOG.setLevel(logging.ERROR)
    yield
    LOG.setLevel(before)


def cpp_is_there() -> bool:
    """Whether BehaviorTree.CPP's Python binding is installed."""
    return importlib.util.find_spec("behaviortreepy") is not None


def draw(seed: int, worlds: int = 4, ticks: int = 16, interrupts: float = 0.06) -> Case:
    """A random case."""
    rng = np.random.default_rng(seed)
    shape = _shape(rng, depth=int(rng.integers(1, 6)), budget=[int(rng.integers(2, 12))])
    leaves = repr(shape).count("'leaf'")
    odds = rng.dirichlet([2.0, 2.0, 2.0], size=leaves)
    outcomes = np.stack([rng.choice([RUNNING, SUCCESS, FAILURE], size=(worlds, SCRIPT), p=p) for p in odds])
    anew = rng.random((worlds, ticks)) < interrupts
    return Case(shape, outcomes.astype(np.int8), anew, seed)


def _shape(rng: np.random.Generator, depth: int, budget: list[int]) -> Any:
    kind = rng.random()
    if depth == 0 or budget[0] <= 0 or kind < 0.1:
        budget[0] -= 1
        return ("leaf",)
    if kind < 0.45:
        name = str(rng.choice(DECORATORS))
        child = _shape(rng, depth - 1, budget)
        if name in ROUNDS:
            return (name, int(rng.choice([-1, 1, 2, 3])), child)
        if name == "timeout":
            return (name, float(rng.integers(1, 8)) * PERIOD, child)
        return (name, child)
    children = [_shape(rng, depth - 1, budget) for _ in range(int(rng.integers(1, 5)))]
    if kind < 0.6:
        counts = [int(rng.choice([c for c in range(-len(children), len(children) + 1) if c])) for _ in "SF"]
        return ("parallel", *counts, children)
    return (str(rng.choice(COMPOSITES)), children)


class Leaf(ConditionNode):
    """A leaf that answers by a script and writes down what happens to it; py_trees' form."""

    def __init__(self) -> None:
        super().__init__()
        self.script: list[int] = []
        self.log: list[str] = []
        self.asked = 0

    def setup(self, **kwargs: Any) -> None:
        """Nothing."""

    def initialise(self) -> None:
        """Write it down."""
        self.log.append(f"{type(self).__name__} begins")

    def update(self) -> Status:
        """The next answer."""
        answer = self.script[self.asked % SCRIPT]
        self.asked += 1
        self.log.append(f"{type(self).__name__} {STATUS[answer].name}")
        self.report(said(answer, self.asked))
        return STATUS[answer]

    def terminate(self, new_status: Status) -> None:
        """Write it down."""
        if new_status == Status.INVALID and self.status == Status.RUNNING:
            self.log.append(f"{type(self).__name__} halted")


class Question(Condition):
    """What such a leaf is a leaf of."""

    leaf_base = Leaf

    def holds(self, seen: Any) -> Any:
        """Not asked."""
        raise NotImplementedError


def said(answer: int, asked: int) -> Outcome | None:
    """What a leaf says about its so-manieth answer."""
    if answer == RUNNING:
        return None
    return DONE(elapsed=asked) if answer == SUCCESS else FAILED(text=f"answer {asked}")


@functools.cache
def question(number: int) -> type[Question]:
    """The class of a leaf, by its number from left to right: its name is its name in XML."""
    return type(f"L{number}", (Question,), {"__doc__": "A leaf of its own."})


def build(shape: Any) -> Behaviour:
    """The tree of a shape; its leaves are of classes ``L0``, ``L1`` ..."""
    count = [0]

    def node(part: Any) -> Behaviour:
        kind, *rest = part
        if kind == "leaf":
            count[0] += 1
            return question(count[0] - 1)()
        if kind in (*ROUNDS, "timeout"):
            return getattr(trees, kind)(rest[0], node(rest[1]))
        if kind == "parallel":
            return trees.parallel("p", *map(node, rest[2]), success=rest[0], failure=rest[1])
        if kind == "subtree":
            return trees.subtree("s", node(rest[0]))
        if kind == "train":
            return Train(node(rest[0]))
        if kind in COMPOSITES:
            return getattr(trees, kind)("n", *map(node, rest[0]))
        return getattr(trees, kind)(node(rest[0]))

    return node(shape)


def by_py_trees(case: Case) -> Trace:
    """What py_trees does in each world."""
    out: Trace = []
    for world in range(case.anew.shape[0]):
        tree, context = build(case.shape), Context(load_robot("panda"))
        for node in tree.iterate():
            node.setup(context=context)
        nodes, log = nodes_of(tree), []
        for k, leaf in enumerate(n for n in nodes if isinstance(n, Leaf)):
            leaf.script, leaf.log = case.outcomes[k, world].tolist(), log
        ticks: list[tuple[list[str], list[int], Outcome | None]] = []
        for anew in case.anew[world]:
            log.clear()
            if anew:
                tree.stop(Status.INVALID)
                context.times = np.zeros(1)
            tree.tick_once()
            context.times = context.times + PERIOD
            why = whole_outcome(found) if tree.status == Status.FAILURE and (found := speaker(tree)) else None
            ticks.append((list(log), [CODES[n.status] for n in nodes], why))
        out.append(ticks)
    return out


@dataclass
class BatchedLeaf(BatchLeaf):
    """The same leaf in all worlds at once; ``halts`` says where its tick stands still.

    ``put`` makes an array of the batch's library and device of one of NumPy's.
    """

    name: str
    script: np.ndarray
    logs: list[list[str]]
    put: Callable[[np.ndarray], Any]
    halts: Callable[[int], np.ndarray]
    asked: np.ndarray = field(init=False)
    outcomes: dict[int, Outcome | None] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.asked = np.zeros(len(self.logs), int)

    def tick(self, rows: Any, fresh: Any) -> Any:
        """The next answers, or PENDING."""
        if sorted(rows.tolist()) != rows.tolist():
            raise AssertionError("rows should ascend")
        for row, begins in zip(rows.tolist(), fresh.tolist(), strict=True):
            if begins:
                self.logs[row].append(f"{self.name} begins")
        halts = self.halts(len(rows))
        out = np.full(len(rows), PENDING, np.int8)
        out[~halts] = self._answers(np.asarray(rows.tolist(), int)[~halts])
        return self._given(out)

    def resume(self, rows: Any) -> Any:
        """The answers."""
        return self._given(self._answers(np.asarray(rows.tolist(), int)))

    def stop(self, rows: Any) -> None:
        """Write it down."""
        for row in rows.tolist():
            self.logs[row].append(f"{self.name} halted")

    def outcome(self, row: int) -> Outcome | None:
        """What it said last."""
        return self.outcomes.get(row)

    def _answers(self, rows: np.ndarray) -> np.ndarray:
        answers = self.script[rows, self.asked[rows] % SCRIPT]
        self.asked[rows] += 1
        for row, answer in zip(rows.tolist(), answers.tolist(), strict=True):
            self.outcomes[row] = said(answer, int(self.asked[row]))
            self.logs[row].append(f"{self.name} {STATUS[answer].name}")
        return answers

    def _given(self, statuses: np.ndarray) -> Any:
        return self.put(statuses.astype(np.int8, copy=False))


def by_executor(
    case: Case,
    xp: Any = np,
    standing: float = 0.0,
    know: Callable[[str], bool] | None = None,
    device: Any = None,
) -> Trace:
    """What the executor does: worlds are ticked with others that are elsewhere in their episodes.

    Args:
        case: The case.
        xp: The array library.
        standing: How often the tick of a leaf stands still, for others to go on meanwhile.
        know: Whether it knows a leaf; the others are ticked world by world.
        device: One of the library's devices; None: its default.
    """
    rng = np.random.default_rng(case.seed)
    worlds, ticks = case.anew.shape
    logs: list[list[str]] = [[] for _ in range(worlds)]
    count = [0]
    copies: list[Behaviour] = []
    contexts = [Context(load_robot("panda")) for _ in range(worlds)]

    def leaf(node: Behaviour) -> BatchLeaf | None:
        k = count[0]
        count[0] += 1
        name = type(node).__name__
        if know is not None and not know(name):
            return None
        return BatchedLeaf(name, case.outcomes[k], logs, put, lambda n: rng.random(n) < standing)

    def copy() -> Behaviour:
        tree = build(case.shape)
        for k, one in enumerate(n for n in nodes_of(tree) if isinstance(n, Leaf)):
            one.script, one.log = case.outcomes[k, len(copies)].tolist(), logs[len(copies)]
        copies.append(tree)
        return tree

    put = partial(Arrays(1, xp).xp.asarray, device=device)
    tree = BatchTree(
        build(case.shape), worlds, leaf, build=copy, contexts=contexts.__getitem__, xp=xp, device=device
    )
    out: Trace = [[] for _ in range(worlds)]
    done, now = np.zeros(worlds, int), np.zeros(worlds)
    waits = np.zeros(worlds, bool)

    def rows_of(numbers: np.ndarray) -> Any:
        return put(numbers.astype(np.int64, copy=False))

    def took(numbers: np.ndarray, found: Any) -> None:
        status = tree.status
        for world, code in zip(numbers.tolist(), found.tolist(), strict=True):
            waits[world] = code == PENDING
            if code != PENDING:
                codes = status[world].tolist()
                if codes[0] != code:
                    raise AssertionError("the root's status is not what the tick gave")
                why = tree.outcome(world) if code == FAILURE else None
                out[world].append((list(logs[world]), codes, why))
                logs[world].clear()
                done[world] += 1
                now[world] += PERIOD

    while (done < ticks).any():
        free = np.flatnonzero(~waits & (done < ticks))
        free = rng.permutation(free[rng.random(len(free)) < rng.choice([0.5, 1.0])])
        if len(free):
            anew = free[case.anew[free, done[free]]]
            tree.reset(rows_of(anew))
            now[anew] = 0.0
            for world in free:
                contexts[world].times = now[[world]]
            took(free, tree.tick(rows_of(free), put(now[free])))
        stand = np.flatnonzero(waits)
        stand = rng.permutation(stand[rng.random(len(stand)) < rng.choice([0.5, 1.0])])
        if len(stand):
            took(stand, tree.resume(rows_of(stand)))
    return out


def by_cpp(case: Case) -> list[list[tuple[list[str], str]] | None]:
    """What BehaviorTree.CPP does: for each tick what happened to leaves, and the root's status.

    Returns:
        For each world; what was done until it refused.
    """
    import behaviortreepy as cpp

    numbers = {
        RUNNING: cpp.NodeStatus.RUNNING,
        SUCCESS: cpp.NodeStatus.SUCCESS,
        FAILURE: cpp.NodeStatus.FAILURE,
    }
    text = trees.tree_to_xml(build(case.shape))
    main = fromstring(text).get("main_tree_to_execute")
    out: list[list[tuple[list[str], str]] | None] = []
    for world in range(case.anew.shape[0]):
        factory, log = cpp.BehaviorTreeFactory(), []
        for k in range(len(case.outcomes)):
            _register(factory, f"L{k}", [numbers[int(a)] for a in case.outcomes[k, world]], log)
        factory.register_simple_decorator("Train", lambda status, node: status)
        factory.register_behavior_tree_from_text(text)
        tree = factory.create_tree(main)
        ticks: list[tuple[list[str], str]] = []
        for anew in case.anew[world]:
            log.clear()
            if anew:
                tree.halt_tree()
            try:
                status = tree.tick_exactly_once()
            except RuntimeError as error:
                if "only a single child can return RUNNING" not in str(error):
                    raise
                break
            ticks.append((list(log), status.name))
        out.append(ticks)
    return out


def _register(factory: Any, name: str, answers: list[Any], log: list[str]) -> None:
    asked = [0]

    def answer(node: Any) -> Any:
        found = answers[asked[0] % SCRIPT]
        asked[0] += 1
        log.append(f"{name} {found.name}")
        return found

    factory.register_simple_stateful_action(name, answer, answer, lambda node: log.append(f"{name} halted"))


def difference(case: Case, wanted: Trace, found: Trace) -> str | None:
    """Where two traces differ, in words; None where they do not."""
    for world, (a, b) in enumerate(zip(wanted, found, strict=True)):
        for tick, (x, y) in enumerate(zip(a, b, strict=True)):
            if x != y:
                return f"case {case.seed}, world {world}, tick {tick}:\n{case.shape}\nwanted {x}\nfound  {y}"
    return None


def difference_to_cpp(case: Case, ours: Trace) -> tuple[str | None, int]:
    """Where BehaviorTree.CPP does something else, in words or None; and how many ticks were compared."""
    compared = 0
    for world, (a, b) in enumerate(zip(ours, by_cpp(case), strict=True)):
        for tick, ((log, statuses, _), (cpp_log, status)) in enumerate(zip(a, b or [], strict=False)):
            said = [e for e in log if "begins" not in e]
            ours_here = (sorted(said), [e for e in said if "halted" not in e], STATUS[statuses[0]].name)
            theirs = (sorted(cpp_log), [e for e in cpp_log if "halted" not in e], status)
            if ours_here != theirs:
                where = f"case {case.seed}, world {world}, tick {tick}"
                return f"{where}:\n{case.shape}\n{theirs}\nhere {ours_here}", compared
            compared += 1
    return None, compared
