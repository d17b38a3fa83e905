"""Bundles of arrays: what a concept is shown, remembers and answers, taken apart, stacked and compared.

A bundle is an array or number, or a dataclass, tuple, list or mapping of bundles.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.core.poses import Array

TOLERANCE = 1e-6
"""Difference of two numbers, in double precision, up to which they count as the same."""


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


def shapes(bundle: Any) -> object:
    """The shapes of a bundle's arrays, to be compared with those of another one."""
    inner = parts(bundle)
    if inner is not None:
        return tuple((k, shapes(v)) for k, v in inner.items())
    return None if bundle is None or isinstance(bundle, str) else np.shape(numbers(bundle))


def different(
    name: str,
    one: Sequence[Any],
    many: Any,
    n: int,
    tolerance: float = TOLERANCE,
    library: type | None = None,
    one_for_all: bool = False,
) -> list[str]:
    """How an answer to a batch differs from those one by one.

    Args:
        name: What is compared, for the sentences.
        one: Answers one by one.
        many: The answer to the batch.
        n: Size of the batch.
        tolerance: Largest difference.
        library: Type that arrays should have.
        one_for_all: The answer to a batch may be a single one.
    """
    inner = parts(one[0])
    if inner is not None:
        whole = parts(many)
        if whole is None or set(whole) != set(inner):
            return [f"{name}: a batch gives a {type(many).__name__}, not a {type(one[0]).__name__}"]
        each = [parts(o) or {} for o in one]
        out: list[str] = []
        for k, value in whole.items():
            out += different(f"{name}.{k}", [o[k] for o in each], value, n, tolerance, library, one_for_all)
        return out
    if one[0] is None or isinstance(one[0], str):
        return [] if many == one[0] or many is None else [f"{name}: a batch gives {many!r}, not {one[0]!r}"]
    alone: Array = np.stack([numbers(o) for o in one])
    together = numbers(many)
    if together.ndim == 0 and not one_for_all:
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
