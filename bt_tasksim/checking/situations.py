"""Situations that pure functions are asked about: from real runs, changed at random, in batches, in torch."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.context import Known, Seen
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, Observation, WorldModel
from bt_tasksim.robot.description import RobotDescription

TOLERANCE = 1e-6
"""Difference of two numbers, in double precision, up to which they count as the same."""


class RecordedDecision(NamedTuple):
    """A leaf that is about to act in a real run.

    Attributes:
        leaf: The leaf.
        seen: What is seen.
        memory: Its memory.
        hidden: What only the simulator knows.
        began: The same when the leaf became active.
        first: It is the leaf's first one in this activation.
        run: Number of the run.
    """

    leaf: ConceptModel
    seen: Seen
    memory: Any
    hidden: Hidden
    began: Hidden
    first: bool = False
    run: int = 0


class Situation(NamedTuple):
    """What a pure function may be asked about; single, or with leading batch dimensions."""

    observation: Observation
    hidden: Hidden
    began: Hidden
    elapsed: Array
    memory: Any


def parts(bundle: Any) -> dict[str, Any] | None:
    """The parts of a bundle (dataclass, tuple, list or mapping), by name; None for anything else."""
    if dataclasses.is_dataclass(bundle) and not isinstance(bundle, type):
        return {f.name: getattr(bundle, f.name) for f in dataclasses.fields(bundle) if f.init}
    if isinstance(bundle, tuple) and hasattr(bundle, "_asdict"):
        return dict(bundle._asdict())
    if isinstance(bundle, Mapping):
        return {str(k): v for k, v in bundle.items()}
    if isinstance(bundle, tuple | list):
        return {str(k): v for k, v in enumerate(bundle)}
    return None


def mapped(function: Callable[..., Any], *bundles: Any) -> Any:
    """A bundle like the first one, whose arrays are made by ``function`` from those of all of them."""
    first = bundles[0]
    inner = parts(first)
    if first is None or isinstance(first, str):
        return first
    if inner is None:
        return function(*bundles)
    others = [parts(b) or {} for b in bundles]
    made = {k: mapped(function, *(o[k] for o in others)) for k in inner}
    if isinstance(first, Mapping):
        return dict(zip(first, made.values(), strict=True))
    if isinstance(first, tuple | list) and not hasattr(first, "_asdict"):
        return type(first)(made.values())
    return type(first)(**made)


def stacked(bundles: Sequence[Any]) -> Any:
    """One bundle with a leading batch dimension, of several."""
    return mapped(lambda *arrays: np.stack([np.asarray(a) for a in arrays]), *bundles)


def in_torch(bundle: Any) -> Any:
    """The same bundle with tensors."""
    import torch

    return mapped(lambda a: torch.from_numpy(np.array(a)), bundle)


def numbers(value: Any) -> Array:
    """An answer as a NumPy array."""
    return value.detach().numpy() if _is_tensor(value) else np.asarray(value)


def is_array(value: Any) -> bool:
    """It is an array or a number of NumPy's, or a tensor."""
    return isinstance(value, np.ndarray | np.generic) or _is_tensor(value)


def _is_tensor(value: Any) -> bool:
    return "torch" in sys.modules and isinstance(value, sys.modules["torch"].Tensor)


def frozen(value: Any) -> Any:
    """What a value holds, to be compared with what it holds later; what is not data stands for itself."""
    if value is None or isinstance(value, str | bytes | bool | int | float | complex):
        return value
    if is_array(value):
        array = numbers(value)
        return type(value).__name__, array.dtype.str, array.shape, array.tobytes()
    if isinstance(value, set | frozenset):
        return frozenset(frozen(v) for v in value)
    inner = parts(value)
    if inner is not None:
        return type(value).__name__, tuple((k, frozen(v)) for k, v in inner.items())
    return id(value)


def alike(decisions: Sequence[RecordedDecision]) -> list[RecordedDecision]:
    """The most of them whose arrays have the same shapes.

    What a concept remembers may differ in size from run to run, such as a path's number of poses.
    """
    groups: dict[object, list[RecordedDecision]] = {}
    for decision in decisions:
        groups.setdefault(_shapes(_situation(decision)), []).append(decision)
    return max(groups.values(), key=len, default=[])


def _situation(decision: RecordedDecision) -> Situation:
    seen = decision.seen
    return Situation(seen.observation, decision.hidden, decision.began, seen.elapsed, decision.memory)


def _shapes(bundle: Any) -> object:
    inner = parts(bundle)
    if inner is not None:
        return tuple((k, _shapes(v)) for k, v in inner.items())
    return None if bundle is None or isinstance(bundle, str) else np.shape(numbers(bundle))


class Situations:
    """Situations of one leaf, one by one and in batches.

    Args:
        decisions: What the leaf decided on in real runs; not empty, and all of one world model's shapes.
        seed: Of the changes.
        copies: How many changed copies there are of each.
        leaf: The leaf that is asked; by default that of the decisions.
    """

    def __init__(
        self,
        decisions: Sequence[RecordedDecision],
        seed: int = 0,
        copies: int = 2,
        leaf: ConceptModel | Condition | None = None,
    ) -> None:
        rng = np.random.default_rng(seed)
        first = decisions[0]
        self.leaf: Any = first.leaf if leaf is None else leaf
        self.world: WorldModel = first.seen.world
        self.robot: RobotDescription = first.seen.robot
        self.single = [_situation(d) for d in decisions]
        self.real = len(self.single)
        """So many are as they were; those after them are changed."""
        self.single += [perturbed(s, rng) for s in self.single for _ in range(copies)]

    @cached_property
    def batch(self) -> Situation:
        """All of them, with one leading batch dimension."""
        made: Situation = stacked(self.single)
        return made

    @cached_property
    def torch(self) -> Situation:
        """The batch, in torch."""
        made: Situation = in_torch(self.batch)
        return made

    def __len__(self) -> int:
        return len(self.single)

    def ask(self, name: str, situation: Situation, leaf: Any = None) -> Any:
        """What a pure function answers.

        Args:
            name: Its name; ``act`` is the leaf's policy, ``holds`` a condition's answer.
            situation: One or a batch.
            leaf: Another leaf than the situations' own.
        """
        leaf = self.leaf if leaf is None else leaf
        seen = Seen(situation.observation, self.world, self.robot, situation.elapsed)
        memory = situation.memory
        if isinstance(leaf, Condition):
            return leaf.holds(seen)
        if name == "sufficient_cost":
            return leaf.sufficient_cost(Known(situation.hidden, self.world, situation.began), memory)
        if name in ("command", "advance"):
            return getattr(leaf, name)(leaf.programmed_motion(seen, memory), seen, memory)
        if name == "maintained":
            return leaf.maintained(leaf.maintains[0], seen, memory)
        if name == "act":
            return leaf.policy_in_use.act(leaf, seen, memory)
        return getattr(leaf, name)(seen, memory)

    def differences(self, name: str, leaf: Any = None, tolerance: float = TOLERANCE) -> list[str]:
        """How the answers to batches, in NumPy and in torch, differ from those one by one."""
        import torch

        one = [self.ask(name, s, leaf) for s in self.single]
        found = different(name, one, self.ask(name, self.batch, leaf), len(self), tolerance)
        in_torch = self.ask(name, self.torch, leaf)
        return found + different(f"{name} in torch", one, in_torch, len(self), tolerance, torch.Tensor)


SCALAR = ("violated", "maintained", "decides")
"""Functions whose answer to a batch may be a single one."""


def different(
    name: str, one: Sequence[Any], many: Any, n: int, tolerance: float = TOLERANCE, library: Any = None
) -> list[str]:
    """How an answer to a batch differs from those one by one.

    Args:
        name: What is compared, for the sentences.
        one: Answers one by one.
        many: The answer to the batch.
        n: Size of the batch.
        tolerance: Largest difference.
        library: Type that arrays should have.
    """
    inner = parts(one[0])
    if inner is not None:
        whole = parts(many)
        if whole is None or set(whole) != set(inner):
            return [f"{name}: a batch gives a {type(many).__name__}, not a {type(one[0]).__name__}"]
        each = [parts(o) or {} for o in one]
        out: list[str] = []
        for k, value in whole.items():
            out += different(f"{name}.{k}", [o[k] for o in each], value, n, tolerance, library)
        return out
    if one[0] is None or isinstance(one[0], str):
        return [] if many == one[0] or many is None else [f"{name}: a batch gives {many!r}, not {one[0]!r}"]
    alone: Array = np.stack([numbers(o) for o in one])
    together = numbers(many)
    if together.ndim == 0 and not name.startswith(SCALAR):
        return [f"{name}: a batch of {n} gives one number"]
    if library is not None and together.ndim and not isinstance(many, library):
        return [f"{name}: gives a {type(many).__name__}"]
    if together.ndim and together.shape != alone.shape:
        return [f"{name}: a batch gives the shape {together.shape}, one by one it is {alone.shape}"]
    if (together.dtype == bool) != (alone.dtype == bool):
        return [f"{name}: a batch gives {together.dtype}, one by one it is {alone.dtype}"]
    together = np.broadcast_to(together, alone.shape)
    if not np.allclose(together, alone, rtol=0.0, atol=tolerance, equal_nan=True):
        gap = np.abs(together.astype(float) - alone.astype(float))
        wrong = int(np.sum(gap > tolerance))
        return [f"{name}: {wrong} of {gap.size} numbers differ, by up to {np.nanmax(gap):.3g}"]
    return []


def perturbed(situation: Situation, rng: np.random.Generator, memory: bool = True) -> Situation:
    """A situation, changed at random: elsewhere, otherwise felt, at another time.

    Args:
        situation: The one that is changed.
        rng: Random numbers.
        memory: Change the memory too; it may then be one that never happens.
    """
    o, h = situation.observation, situation.hidden
    observation = dataclasses.replace(
        o,
        time=o.time + rng.uniform(0, 1),
        tool_pose=_moved(o.tool_pose, rng),
        objects=_moved(o.objects, rng),
        tips=o.tips + rng.normal(scale=0.01, size=o.tips.shape),
        contacts=rng.random(o.contacts.shape) < 0.6,
        closure=np.float64(rng.choice([0.0, 1.0, np.clip(o.closure + rng.normal(scale=0.2), 0, 1)])),
        wrench=o.wrench + rng.normal(scale=3.0, size=6),
    )
    hidden = dataclasses.replace(
        h,
        objects=_moved(h.objects, rng),
        hand_force=h.hand_force * (rng.random(h.hand_force.shape) < 0.7),
        support=rng.random(h.support.shape) < 0.3,
    )
    elapsed = np.float64(max(0.0, float(situation.elapsed) + rng.normal(scale=0.5)))
    changed = changed_memory(situation.memory, rng) if memory else situation.memory
    return Situation(observation, hidden, situation.began, elapsed, changed)


def _moved(pose: Array, rng: np.random.Generator, metres: float = 0.02, radians: float = 0.2) -> Array:
    turn = poses.from_rotation_vector(rng.normal(scale=radians, size=(*pose.shape[:-1], 3)))
    position = pose[..., :3] + rng.normal(scale=metres, size=(*pose.shape[:-1], 3))
    return np.concatenate([position, poses.quat_multiply(turn, pose[..., 3:])], axis=-1)


def changed_memory(memory: Any, rng: np.random.Generator) -> Any:
    """A memory of the same kind with other numbers."""
    if hasattr(memory, "table") and hasattr(memory, "_replace"):
        table = memory.table.copy()
        table[:, :3] += rng.normal(scale=0.01, size=3)
        return memory._replace(table=table, duration=memory.duration * rng.uniform(0.7, 1.3))
    inner = parts(memory)
    if inner is None:
        return _changed(memory, rng)
    made = {k: changed_memory(v, rng) for k, v in inner.items()}
    if isinstance(memory, Mapping):
        return dict(zip(memory, made.values(), strict=True))
    if isinstance(memory, tuple | list) and not hasattr(memory, "_asdict"):
        return type(memory)(made.values())
    return type(memory)(**made)


def _changed(value: Any, rng: np.random.Generator) -> Any:
    if isinstance(value, bool | np.bool_):
        return np.bool_(rng.random() < 0.5)
    if isinstance(value, int | np.integer):
        return np.int64(rng.integers(0, 5))
    if isinstance(value, float | np.floating):
        return np.float64(value + rng.choice([0.0, 1.0, 2.5]))
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype == bool:
        return rng.random(value.shape) < 0.5
    if value.dtype.kind == "i":
        return rng.integers(0, 5, value.shape)
    if value.shape[-1:] == (7,) and np.allclose(np.linalg.norm(value[..., 3:], axis=-1), 1.0):
        return _moved(value, rng)
    return value + rng.choice([0.0, 1.0, 2.5])
