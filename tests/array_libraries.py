"""One law of arrays in several libraries, in single precision, and on a device that is not the default."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import array_api_strict
import numpy as np

from bt_tasksim.core.bundles import mapped, parts
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.poses import Array, host


def strict(values: Array) -> Array:
    """An array of nothing but the standard."""
    return array_api_strict.asarray(values)


def elsewhere(values: Array) -> Array:
    """The same on a device that no constant is on which nobody has put there; to mix devices raises."""
    return array_api_strict.asarray(values, device=array_api_strict.Device("device1"))


def tensor(values: Array) -> Array:
    """A tensor of torch."""
    import torch

    return torch.from_numpy(np.array(values))


def single(values: Array) -> Array:
    """Floating-point numbers in single precision; others as they are."""
    values = np.asarray(values)
    return values.astype(np.float32) if values.dtype == np.float64 else values


LIBRARIES: Mapping[str, Callable[[Array], Array]] = {
    "array_api_strict": strict,
    "another device": elsewhere,
    **({"torch": tensor} if importlib.util.find_spec("torch") else {}),
}


def agree(
    function: Callable[..., Any], *arguments: Any, close: float = 1e-9, single_close: float | None = 1e-4
) -> Any:
    """What a function of bundles gives in NumPy, after all others were seen to give it, too.

    Every array stays in its library, on its device and of its type; `single_close` None compares no numbers
    of single precision.
    """
    wanted = function(*arguments)
    for name, put in LIBRARIES.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # torch's words about read-only constants
            found = function(*(_changed(put, a) for a in arguments))
        _near(name, wanted, found, put(np.zeros(1)), close)
    found = function(*(_changed(single, a) for a in arguments))
    _near("float32", wanted, found, np.zeros(1, np.float32), single_close)
    return wanted


def _changed(put: Callable[[Array], Array], bundle: Any) -> Any:
    return bundle.map(put) if isinstance(bundle, WorldFacts) else mapped(put, bundle)


def _near(name: str, wanted: Any, found: Any, like: Array, close: float | None, where: str = "") -> None:
    inner = parts(wanted)
    if inner is not None:
        others = parts(found) or {}
        assert inner.keys() == others.keys(), f"{name}{where}"
        for key, value in inner.items():
            _near(name, value, others[key], like, close, f"{where}.{key}")
        return
    if wanted is None or isinstance(wanted, str):
        assert wanted == found, f"{name}{where}"
        return
    assert isinstance(found, type(like) | np.generic), f"{name}{where} is a {type(found)}"
    assert found.device == like.device, f"{name}{where} is on {found.device}"
    numbers, wanted = host(found), np.asarray(wanted)
    kind = np.float32 if host(like).dtype == np.float32 and wanted.dtype == np.float64 else wanted.dtype
    assert numbers.dtype == kind, f"{name}{where} is of {numbers.dtype}"
    if close is not None:
        np.testing.assert_allclose(numbers, wanted, rtol=close, atol=close, err_msg=f"{name}{where}")
