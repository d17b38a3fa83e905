"""Pure functions that damage inputs: bytes, plain data, YAML text, and HDF5 files by their structure."""

from __future__ import annotations

import copy
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

Rng = np.random.Generator


@dataclass(frozen=True)
class Bait:
    """What no input may have opened.

    Attributes:
        path: A file outside of everything that belongs to a case.
        address: HOST:PORT of a server that nobody may connect to.
    """

    path: str
    address: str


def one_of(rng: Rng, options: Sequence[Any]) -> Any:
    """One of them, as it is."""
    return options[int(rng.integers(len(options)))]


# ---- bytes ------------------------------------------------------------------------------------------------


def damaged_bytes(content: bytes, rng: Rng) -> bytes:
    """Some bits flipped, or a piece cut off, overwritten, repeated or taken out."""
    if not content:
        return b"\0"
    at, size = int(rng.integers(len(content))), int(rng.integers(1, 200))
    match int(rng.integers(6)):
        case 0:
            return content[:at]
        case 1:
            return content[:at] + bytes(size) + content[at + size :]
        case 2:
            return content[:at] + content[at : at + size] + content[at:]
        case 3:
            return content[:at] + content[at + size :]
        case _:
            out = bytearray(content)
            for place in rng.integers(len(out), size=int(rng.integers(1, 9))).tolist():
                out[place] ^= 1 << int(rng.integers(8))
            return bytes(out)


# ---- plain data -------------------------------------------------------------------------------------------


def deep(levels: int) -> list[Any]:
    """Lists within lists."""
    out: list[Any] = []
    for _ in range(levels):
        out = [out]
    return out


def odd_values(bait: Bait) -> list[Any]:
    """Values that are wrong nearly everywhere."""
    numbers = [0, -1, 1, 1e-300, 1e150, 1e308, -1e308, float("nan"), float("inf"), 2**31, 2**64, 10**30]
    words = ["", " ", "x", "x" * 5000, "\x1b[2J", "a\nb", "ä\ud800"[:1], "nan", "1e5", "true", "..", "%s{0}"]
    outside = [bait.path, f"../../../../../..{bait.path}", f"file://{bait.path}", f"{bait.path}\0.yaml"]
    robots = [f"ros:{bait.address}", f"remote:{bait.address}", f"http://{bait.address}/x.yaml"]
    rest = [None, True, False, [], {}, [[]], [None], {"": None}, [1.0] * 5000, deep(60), {"a": {"b": [1, 2]}}]
    return [*numbers, *words, *outside, *robots, *rest]


def damaged_data(data: Any, rng: Rng, bait: Bait, times: int | None = None) -> Any:
    """Plain data with one to three places changed: another value, a missing, renamed or doubled entry."""
    out = copy.deepcopy(data)
    for _ in range(times or int(rng.integers(1, 4))):
        holders = _holders(out)
        if not holders:
            return one_of(rng, odd_values(bait))
        holder = one_of(rng, holders)
        key = one_of(rng, list(holder) if isinstance(holder, dict) else range(len(holder)))
        value = holder[key]
        match int(rng.integers(8)):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, dict):
                del holder[key]
                holder[f"{key}s"] = value
            case 1:
                holder.insert(key, copy.deepcopy(value))
            case 2 if isinstance(value, int | float) and not isinstance(value, bool):
                holder[key] = value * one_of(rng, [-1, 0, 1e3, 1e9, 1e150])
            case 3:
                holder[key] = [value] if rng.random() < 0.5 else str(value)
            case 4:
                other = one_of(rng, holders)
                holder[key] = copy.deepcopy(other)
            case _:
                holder[key] = copy.deepcopy(one_of(rng, odd_values(bait)))
    return out


def _holders(data: Any) -> list[Any]:
    """Lists and mappings in plain data that hold something."""
    found, stack = [], [data]
    while stack:
        value = stack.pop()
        if isinstance(value, dict | list) and value:
            found.append(value)
            stack.extend(value.values() if isinstance(value, dict) else value[:50])
    return found


# ---- YAML -------------------------------------------------------------------------------------------------


def odd_yaml(rng: Rng, bait: Bait) -> str:
    """YAML that is an attack by itself."""
    levels = int(rng.integers(5, 30))
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, levels)
    )
    many = int(rng.integers(1000, 100_000))
    texts = [
        bomb,
        "[" * many,
        "{a: " * many,
        "- " * many + "x",
        "? " * many,
        f"a: !!python/object/apply:builtins.open ['{bait.path}']",
        f"!!python/object/new:os.system ['cat {bait.path}']",
        "a: &a\n  b: *a",
        "a: 1\na: 2\n",
        "a: &x {b: 1}\n<<: *x\n" * 50,
        "\t- a\n",
        "%YAML 9.9\n---\na",
        "a: !!binary " + "A" * many,
        "1" * many,
        "2026-99-99",
        "\0",
        "a: 1\n" * many,
    ]
    return str(one_of(rng, texts))


# ---- HDF5 -------------------------------------------------------------------------------------------------

Change = Callable[[h5py.File, str, Rng, Bait], None]


def damaged_hdf5(content: bytes, rng: Rng, bait: Bait) -> bytes:
    """A sound HDF5 file with one to three of its parts changed, now and then with bits flipped besides."""
    with h5py.File(io.BytesIO(content), "r") as source:
        buffer = io.BytesIO()
        with h5py.File(buffer, "w") as file:
            for name in source:
                source.copy(name, file)
            file.attrs.update(dict(source.attrs))
            for _ in range(int(rng.integers(1, 4))):
                names: list[str] = []
                file.visit(names.append)
                if names:
                    one_of(rng, CHANGES)(file, one_of(rng, names), rng, bait)
    out = buffer.getvalue()
    return damaged_bytes(out, rng) if rng.random() < 0.1 else out


def _attribute(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    owner = file if rng.random() < 0.2 else file.get(name)
    if owner is None:
        return
    keys = list(owner.attrs) or ["new"]
    key, value = one_of(rng, keys), one_of(rng, HDF5_VALUES)
    if rng.random() < 0.2 and key in owner.attrs:
        del owner.attrs[key]
    else:
        owner.attrs[key] = bait.path if rng.random() < 0.1 else value


def _values(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    item = file.get(name)
    if (
        not isinstance(item, h5py.Dataset)
        or item.dtype.kind != "f"
        or not 0 < (item.size or 0) < 10**6  # none: a data set of no space
        or item.external
        or item.is_virtual
    ):
        _instead(file, name, rng, bait)
        return
    values = item[()]
    flat = np.atleast_1d(values).reshape(-1)
    odd = one_of(rng, [np.nan, np.inf, 1e150, -1e150, 0.0, 1e9])
    match int(rng.integers(4)):
        case 0:
            flat[int(rng.integers(len(flat)))] = odd
        case 1:
            flat[:] = odd
        case 2:
            flat *= one_of(rng, [1e3, 1e6, 1e9, 1e150, -1.0])
        case _:
            flat[:] = rng.permutation(flat)
    item[...] = flat.reshape(values.shape)


def _instead(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    del file[name]
    file[name] = one_of(rng, HDF5_VALUES)


def _gone(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    del file[name]


def _link(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    del file[name]
    links = [h5py.ExternalLink(bait.path, "/time"), h5py.SoftLink("/"), h5py.SoftLink("nowhere"), file["/"]]
    file[name] = one_of(rng, links)


def _elsewhere(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    del file[name]
    if rng.random() < 0.5:
        file.create_dataset(name, (4, 7), "f8", external=[(bait.path, 0, 224)])
        return
    layout = h5py.VirtualLayout((10, 7), "f8")
    layout[:] = h5py.VirtualSource(bait.path, "x", (10, 7))
    file.create_virtual_dataset(name, layout)


def _huge(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    del file[name]
    shape = one_of(rng, [(10**11,), (10**6, 7), (50_000_000,), (5, 10**9)])
    file.create_dataset(name, shape, "f8", chunks=True, compression="gzip")


def _moved(file: h5py.File, name: str, rng: Rng, bait: Bait) -> None:
    names = ["x", "a b", "a" * 300, "\x1b[2J", "ü", f"{name}2", ".", "objects"]
    new = str(one_of(rng, names))
    if new not in file and new != ".":
        file.move(name, new)


CHANGES: tuple[Change, ...] = (
    _attribute, _attribute, _attribute, _values, _values, _values, _instead, _gone, _link, _elsewhere, _huge,
    _moved,
)  # fmt: skip
HDF5_VALUES: tuple[Any, ...] = (
    0, -1, 3.5, np.nan, 1e150, "", "text", "x" * 5000, b"\xff\xfe", "a\nb\x1b[2J", np.zeros(3),
    np.zeros((2, 7)), np.zeros((0, 7)), np.array([b"a", b"bc"]), np.arange(7), np.array([True, False]),
    np.zeros(5, [("x", "f8"), ("y", "S3")]), np.full((10, 7), np.nan), h5py.Empty("f8"),
    np.uint64(2**64 - 1), np.zeros(1000), np.zeros(3, np.complex128),
)  # fmt: skip
