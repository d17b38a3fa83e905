"""Batches of real and perturbed situations, and the claim that a pure function treats them one by one."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
import torch

from bt_tasksim import poses
from bt_tasksim.concept import ConceptModel, Condition
from bt_tasksim.context import Known, Seen
from bt_tasksim.world import Command, Hidden, Observation

TOLERANCE = 1e-9


def fields(bundle):
    if dataclasses.is_dataclass(bundle):
        return {f.name: getattr(bundle, f.name) for f in dataclasses.fields(bundle)}
    return bundle._asdict()


def remade(bundle, values):
    return type(bundle)(**values)


def mapped(function, *bundles):
    """A bundle of the same kind whose arrays are made from those of one or several bundles."""
    first = bundles[0]
    if first is None:
        return None
    if dataclasses.is_dataclass(first) or hasattr(first, "_asdict"):
        values = [fields(b) for b in bundles]
        return remade(first, {k: mapped(function, *(v[k] for v in values)) for k in values[0]})
    return function(*bundles)


def stacked(bundles):
    return mapped(lambda *arrays: np.stack([np.asarray(a) for a in arrays]), *bundles)


def in_torch(bundle):
    return mapped(lambda a: torch.from_numpy(np.array(a)), bundle)


def numbers(value):
    return value.numpy() if isinstance(value, torch.Tensor) else np.asarray(value)


def perturbed(decision, rng):
    """The situation of a decision, changed at random: elsewhere, otherwise felt, at another time."""
    o, h = decision.seen.observation, decision.hidden

    def moved(p, metres=0.02, radians=0.2):
        turn = poses.from_rotation_vector(rng.normal(scale=radians, size=(*p.shape[:-1], 3)))
        position = p[..., :3] + rng.normal(scale=metres, size=(*p.shape[:-1], 3))
        return np.concatenate([position, poses.quat_multiply(turn, p[..., 3:])], axis=-1)

    observation = dataclasses.replace(
        o,
        time=o.time + rng.uniform(0, 1),
        tool_pose=moved(o.tool_pose),
        objects=moved(o.objects),
        tips=o.tips + rng.normal(scale=0.01, size=o.tips.shape),
        contacts=rng.random(o.contacts.shape) < 0.6,
        closure=np.float64(rng.choice([0.0, 1.0, np.clip(o.closure + rng.normal(scale=0.2), 0, 1)])),
        wrench=o.wrench + rng.normal(scale=3.0, size=6),
    )
    hidden = dataclasses.replace(
        h,
        objects=moved(h.objects),
        hand_force=h.hand_force * (rng.random(h.hand_force.shape) < 0.7),
        support=rng.random(h.support.shape) < 0.3,
    )
    elapsed = np.float64(max(0.0, float(decision.seen.elapsed) + rng.normal(scale=0.5)))
    return observation, hidden, elapsed, changed_memory(decision.memory, rng)


def changed_memory(memory, rng):
    """A memory of the same kind with other numbers."""
    if hasattr(memory, "table"):
        table = memory.table.copy()
        table[:, :3] += rng.normal(scale=0.01, size=3)
        return memory._replace(table=table, duration=memory.duration * rng.uniform(0.7, 1.3))
    if hasattr(memory, "_asdict"):
        return memory._replace(**{k: changed_memory(v, rng) for k, v in memory._asdict().items()})
    if isinstance(memory, np.ndarray | np.generic) and memory.dtype.kind == "i":
        return np.int64(rng.integers(0, 5))
    if isinstance(memory, np.ndarray | np.generic):
        return np.float64(memory + rng.choice([0.0, 1.0, 2.5]))
    return memory


class Situations:
    """Situations of one leaf, one by one and in batches."""

    def __init__(self, decisions, seed=0, copies=2):
        rng = np.random.default_rng(seed)
        first = decisions[0]
        self.leaf, self.world, self.robot = first.leaf, first.seen.world, first.seen.robot
        self.single = [(d.seen.observation, d.hidden, d.seen.elapsed, d.memory) for d in decisions]
        self.single += [perturbed(d, rng) for d in decisions for _ in range(copies)]
        observations, hidden, elapsed, memories = zip(*self.single, strict=True)
        self.batch = (stacked(observations), stacked(hidden), np.stack(elapsed), stacked(memories))
        self.torch = (
            *map(in_torch, self.batch[:2]),
            torch.from_numpy(self.batch[2]),
            in_torch(self.batch[3]),
        )

    def __len__(self) -> int:
        return len(self.single)

    def ask(self, name: str, situation: tuple[Observation, Hidden, Any, Any], leaf: Any = None) -> Any:
        leaf = self.leaf if leaf is None else leaf
        observation, hidden, elapsed, memory = situation
        seen = Seen(observation, self.world, self.robot, elapsed)
        if isinstance(leaf, Condition):
            return leaf.holds(seen)
        if name == "sufficient_cost":
            return leaf.sufficient_cost(Known(hidden, self.world), memory)
        if name == "command":
            return leaf.command(leaf.programmed_motion(seen, memory), seen, memory)
        if name == "maintained":
            return leaf.maintained(leaf.maintains[0], seen, memory)
        if name == "act":
            return leaf.policy_in_use.act(leaf, seen, memory)
        return getattr(leaf, name)(seen, memory)

    def check(self, name: str, leaf: Any = None) -> list[Any]:
        """One by one, as a batch and as a batch in torch the answers are the same, and nothing changes."""
        before = self._bytes()
        one = [self.ask(name, s, leaf) for s in self.single]
        many, tensors = self.ask(name, self.batch, leaf), self.ask(name, self.torch, leaf)
        assert self._bytes() == before, f"{name} changed what it was given"
        _compare(name, one, many, len(self))
        _compare(f"{name} in torch", one, tensors, len(self), library=torch.Tensor)
        return one

    def _bytes(self) -> bytes:
        return pickle.dumps([_plain(s) for s in (*self.single, self.batch, self.torch)])


def _plain(value):
    if value is None or isinstance(value, str | int | float):
        return value
    if dataclasses.is_dataclass(value) or hasattr(value, "_asdict"):
        return {k: _plain(v) for k, v in fields(value).items()}
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    return numbers(value)


def _compare(name, one, many, n, library=None):
    if isinstance(one[0], Command) or hasattr(one[0], "_asdict"):
        for key, value in fields(many).items():
            _compare(f"{name}.{key}", [fields(o)[key] for o in one], value, n, library)
        return
    if one[0] is None:
        assert many is None, name
        return
    each = np.stack([numbers(o) for o in one])
    together = numbers(many)
    if together.ndim == 0 and not name.startswith(("violated", "maintained")):
        raise AssertionError(f"{name}: a batch of {n} gave one number")
    if library is not None and together.ndim:
        assert isinstance(many, library), f"{name}: {type(many).__name__} from torch"
    together = np.broadcast_to(together, each.shape)
    assert (together.dtype == bool) == (each.dtype == bool), f"{name}: {together.dtype} and {each.dtype}"
    np.testing.assert_allclose(together, each, rtol=0, atol=TOLERANCE, err_msg=name)


FUNCTIONS = (
    "command", "done", "necessary_cost", "violated", "maintained", "advance", "sufficient_cost", "act",
)  # fmt: skip


@pytest.fixture(scope="session")
def functions():
    """Names of the pure functions of a concept that answer at every tick."""
    return FUNCTIONS


@pytest.fixture(scope="session")
def situations(recorded_run):
    """Situations of the first leaf of a concept in a scenario: ``situations(Grasp, "pick_and_place")``."""
    kept: dict[Any, Situations] = {}

    def get(concept: type[ConceptModel], scenario: str = "pick_and_place", seed: int = 1) -> Situations:
        key = concept, scenario, seed
        if key not in kept:
            found = [d for d in recorded_run(scenario, seed) if type(d.leaf) is concept]
            kept[key] = Situations([*found[:: max(1, len(found) // 12)], found[-1]])
        return kept[key]

    return get
