"""The function of a learned policy: a multilayer perceptron, in NumPy alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array, apply, array_namespace, clip, constant

CLIP = 10.0
"""Standard deviations beyond which a normalised feature is cut off."""
_STD_FLOOR = 1e-3
_SIGNAL = "signal_deviation"


class Network:
    """Normalises its input, and runs it through hidden layers of tanh and a linear one.

    Args:
        mean: Means ``(n,)`` of the features.
        std: Their standard deviations ``(n,)``.
        layers: Weights ``(out, in)`` and biases ``(out,)``, in order.
        signal_std: Standard deviation of the noise on the last output in training, where that output
            is a completion signal, see `bt_tasksim.policy.policy.done_share`.

    Raises:
        InputError: The shapes do not fit together, or a number is not finite.
    """

    def __init__(
        self,
        mean: Array,
        std: Array,
        layers: Sequence[tuple[Array, Array]],
        signal_std: float = 0.0,
    ) -> None:
        as_float = [np.ascontiguousarray(a, np.float32) for a in (mean, std)]
        self.mean, self.std = as_float
        self.layers = tuple(
            (np.ascontiguousarray(w, np.float32), np.ascontiguousarray(b, np.float32)) for w, b in layers
        )
        self.signal_std = float(signal_std)
        self._check()
        self._scale = 1.0 / np.maximum(self.std, np.float32(_STD_FLOOR))

    @property
    def inputs(self) -> int:
        """Number of features."""
        return int(self.mean.shape[0])

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return int(self.layers[-1][1].shape[0])

    def normalise(self, features: Array) -> Array:
        """Features ``(..., n)`` as the first layer sees them."""
        xp = array_namespace(features)
        x = xp.astype(features, xp.float32)
        return clip((x - constant(self.mean, x)) * constant(self._scale, x), -CLIP, CLIP)

    def __call__(self, features: Array) -> Array:
        """Outputs ``(..., m)`` for features ``(..., n)``, in the library of the features.

        Each row is multiplied for itself, so that what it comes to does not depend on the others.
        """
        x = self.normalise(features)
        xp = array_namespace(x)
        last = len(self.layers) - 1
        for k, (w, b) in enumerate(self.layers):
            x = apply(constant(w, x), x) + constant(b, x)
            if k < last:
                x = xp.tanh(x)
        return x

    def arrays(self) -> dict[str, Array]:
        """Everything by name, for a file."""
        out = {"mean": self.mean, "deviation": self.std}
        if self.signal_std != 0.0:
            out[_SIGNAL] = np.array([self.signal_std], np.float32)
        for k, (w, b) in enumerate(self.layers):
            out[f"layer{k}.weight"], out[f"layer{k}.bias"] = w, b
        return out

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Array]) -> Network:
        """The network that `arrays` was taken of.

        Raises:
            InputError: An array is missing, is one too many, or does not fit.
        """
        count = sum(1 for name in arrays if name.endswith(".weight"))
        names = {"mean", "deviation"} | ({_SIGNAL} & set(arrays))
        names |= {f"layer{k}.{part}" for k in range(count) for part in ("weight", "bias")}
        if count == 0 or set(arrays) != names:
            wrong = sorted(set(arrays) ^ names) or ["layer0.weight"]
            raise InputError(f"a network's arrays do not fit together, such as '{wrong[0]}'")
        layers = [(arrays[f"layer{k}.weight"], arrays[f"layer{k}.bias"]) for k in range(count)]
        signal = np.asarray(arrays.get(_SIGNAL, [0.0]))
        if signal.shape != (1,):
            raise InputError(f"a network's {_SIGNAL} should be one number, found shape {signal.shape}")
        return cls(arrays["mean"], arrays["deviation"], layers, float(signal[0]))

    def _check(self) -> None:
        if not self.layers:
            raise InputError("a network needs at least one layer")
        n = self.mean.shape[0] if self.mean.ndim == 1 else -1
        if self.std.shape != (n,):
            raise InputError(f"a network's mean {self.mean.shape} and std {self.std.shape} differ")
        for k, (w, b) in enumerate(self.layers):
            if w.ndim != 2 or w.shape[1] != n or b.shape != (w.shape[0],):
                raise InputError(
                    f"a network's layer {k} has weights {w.shape} after {n} inputs, bias {b.shape}"
                )
            n = w.shape[0]
        if self.signal_std < 0.0:
            raise InputError(f"a network's {_SIGNAL} is negative, {self.signal_std:g}")
        if not all(np.isfinite(a).all() for a in self.arrays().values()):
            raise InputError("a network holds a number that is not finite")
