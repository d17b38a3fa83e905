"""Demonstration logs in HDF5, read and written whole or not at all."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core import hdf5
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.files import write_bytes
from bt_tasksim.core.hdf5 import Attribute, Node
from bt_tasksim.demos_decomp.log import (
    Demonstration,
    Log,
    Surface,
    Track,
    Utterance,
    Video,
    checked_log,
)

FORMAT = "bt-tasksim log"
VERSION = 1
CONVENTIONS = {"units": "m rad s N", "quaternion": "wxyz", "frame": "robot base"}

_OWN = {"time", "hand", "objects", "places", "narration", "video"}


def read_log(path: str | Path) -> Log:
    """Reads a log of the format in `docs/demonstrations.md`.

    Args:
        path: An HDF5 file.

    Returns:
        The log, checked; unknown groups and attributes are kept in `Demonstration.extra` and `.notes`.

    Raises:
        InputError: The file is missing, empty, cut off, of another format or version, or its content is
            faulty; the sentence names the file, the data set and the index.
    """
    path = Path(path)
    file = hdf5.read(path)
    _check_conventions(file, path)
    shown = file.groups.get("demonstrations")
    if shown is None:
        raise InputError(f"'{path}' has no group demonstrations; nothing can be learned from it")
    read = tuple(_read_demonstration(_group(shown, name, path), name, path) for name in shown.names())
    log = Log(_text(file, "source"), read, _text(file, "description"), str(path))
    return checked_log(log, f"'{path}'")


def write_log(path: str | Path, log: Log) -> None:
    """Writes a log, whole or not at all: an interrupt or a full disk leaves what was there before.

    Args:
        path: Where to; an existing file is replaced.
        log: What to write; it is checked first.

    Raises:
        InputError: The log is faulty, or the folder does not exist.
        MachineError: The disk is full or not writable.
    """
    log = checked_log(log, f"'{path}'")
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs.update({"format": FORMAT, "version": VERSION, "source": log.source, **CONVENTIONS})
        file.attrs["description"] = log.description
        for demonstration in log.demonstrations:
            _write_demonstration(file.create_group(f"demonstrations/{demonstration.name}"), demonstration)
    write_bytes(path, buffer.getvalue())


def _check_conventions(file: Node, path: Path) -> None:
    if _text(file, "format") != FORMAT:
        raise InputError(
            f"'{path}' has format '{_short(file.attributes.get('format'))}' instead of '{FORMAT}'"
        )
    version = file.attributes.get("version")
    if not isinstance(version, np.ndarray) or version.shape or version != VERSION:
        raise InputError(
            f"'{path}' has version {_short(version)} of the log format; this program reads {VERSION}"
        )
    for name, expected in CONVENTIONS.items():
        found = _short(file.attributes.get(name))
        if found != expected:
            raise InputError(f"'{path}' has {name} '{found}' instead of '{expected}'; convert it")


def _read_demonstration(group: Node, name: str, path: Path) -> Demonstration:
    where = f"'{path}': demonstrations/{name}"
    objects = {}
    for key, track in _groups(group, "objects", path):
        at = f"{where}/objects/{key}"
        objects[key] = Track(_data(track, "pose", at), _text(track, "kind", at), _numbers(track, "size", at))
    return Demonstration(
        name=name,
        time=_data(group, "time", where),
        hand_pose=_data(group, "hand/pose", where),
        hand_opening=_data(group, "hand/opening", where),
        objects=objects,
        places={
            key: _surface(place, f"{where}/places/{key}") for key, place in _groups(group, "places", path)
        },
        task=_text(group, "task"),
        seed=_seed(group, where),
        narration=_narration(group, where),
        video=_video(group, where),
        extra={path: values for path, values in group.walk() if path.split("/")[0] not in _OWN},
        notes={k: _plain(v) for k, v in group.attributes.items() if k not in ("task", "seed")},
    )


def _surface(place: Node, where: str) -> Surface:
    return Surface(
        pose=_numbers(place, "pose", where),
        extent=_numbers(place, "extent", where),
        kind=_text(place, "kind", where),
        fixture=_text(place, "fixture") or None,
        centre=_numbers(place, "centre", where, (0.0, 0.0)),
        height=_number(place, "height", where, 0.0),
    )


def _seed(group: Node, where: str) -> int | None:
    if "seed" not in group.attributes:
        return None
    seed = group.attributes["seed"]
    if not isinstance(seed, np.ndarray) or seed.shape or seed.dtype.kind not in "iu":
        raise InputError(f"{where} attribute seed is '{_short(seed)}'; write a whole number")
    return int(seed)


def _narration(group: Node, where: str) -> tuple[Utterance, ...]:
    if "narration" not in group.names():
        return ()
    times, texts = _data(group, "narration/time", where), _data(group, "narration/text", where)
    if times.shape != texts.shape or times.ndim != 1:
        raise InputError(f"{where}/narration has {times.size} times but {texts.size} texts; give one each")
    if times.dtype.kind not in "iuf" or texts.dtype.kind not in "SO":
        raise InputError(f"{where}/narration should hold times as numbers and texts as text")
    return tuple(
        Utterance(float(t), s.decode("utf-8", "replace"))
        for t, s in zip(times.tolist(), texts.tolist(), strict=True)
    )


def _video(group: Node, where: str) -> Video | None:
    if "video" not in group.names():
        return None
    video = group.groups.get("video", Node())
    at = f"{where}/video"
    return Video(_text(video, "path", at), _number(video, "fps", at))


def _write_demonstration(group: Any, demonstration: Demonstration) -> None:
    group.attrs["task"] = demonstration.task
    if demonstration.seed is not None:
        group.attrs["seed"] = demonstration.seed
    group.attrs.update(demonstration.notes)
    _put(group, "time", demonstration.time)
    _put(group, "hand/pose", demonstration.hand_pose)
    _put(group, "hand/opening", demonstration.hand_opening)
    for name, track in demonstration.objects.items():
        _put(group, f"objects/{name}/pose", track.pose)
        group[f"objects/{name}"].attrs.update({"kind": track.kind, "size": track.size})
    for name, surface in demonstration.places.items():
        attributes = group.create_group(f"places/{name}").attrs
        attributes.update({k: v for k, v in vars(surface).items() if v is not None})
    if demonstration.narration:
        _put(group, "narration/time", np.array([u.time for u in demonstration.narration]))
        texts = [u.text for u in demonstration.narration]
        group.create_dataset("narration/text", data=texts, dtype=h5py.string_dtype())
    if demonstration.video is not None:
        group.create_group("video").attrs.update(vars(demonstration.video))
    for name, values in demonstration.extra.items():
        _put(group, name, values)


def _put(group: h5py.Group, name: str, values: NDArray[Any]) -> None:
    packed = {"compression": "gzip", "shuffle": True} if np.ndim(values) and np.size(values) > 64 else {}
    if np.asarray(values).dtype == object:
        packed["dtype"] = h5py.string_dtype()
    group.create_dataset(name, data=values, **packed)


# ---- what a node should hold ------------------------------------------------------------------------------


def _groups(parent: Node, name: str, path: Path) -> Iterator[tuple[str, Node]]:
    """Groups in a group of groups, with their names; none where that is absent."""
    if name in parent.names():
        above = _group(parent, name, path)
        yield from ((key, _group(above, key, path)) for key in above.names())


def _group(parent: Node, name: str, path: Path) -> Node:
    found = parent.groups.get(name)
    if found is None:
        raise InputError(f"'{path}': {parent.path}/{name} is not a group; see docs/demonstrations.md")
    return found


def _data(group: Node, name: str, where: str) -> NDArray[Any]:
    found = group.dataset(name)
    if found is None:
        raise InputError(f"{where}/{name} is missing{nearest(name.split('/')[0], group.names())}")
    return found


def _attribute(group: Node, name: str, where: str) -> Attribute:
    if name not in group.attributes:
        raise InputError(f"{where} has no attribute {name}{nearest(name, group.attributes)}")
    return group.attributes[name]


def _numbers(
    group: Node, name: str, where: str, default: tuple[float, ...] | None = None
) -> NDArray[np.float64]:
    if default is not None and name not in group.attributes:
        return np.array(default)
    value = _attribute(group, name, where)
    if not isinstance(value, np.ndarray):
        raise InputError(f"{where} attribute {name} is '{_short(value)}'; write numbers")
    return value.astype(np.float64)


def _number(group: Node, name: str, where: str, default: float | None = None) -> float:
    values = _numbers(group, name, where, None if default is None else (default,))
    if values.size != 1:
        raise InputError(f"{where} attribute {name} holds {values.size} numbers; write one")
    return float(values.item())


def _text(group: Node, name: str, where: str | None = None) -> str:
    """An attribute as text; without ``where``, empty where it is absent."""
    value = group.attributes.get(name, "") if where is None else _attribute(group, name, where)
    return _plain(value)


def _plain(value: Attribute) -> str:
    """An attribute in words; numbers as they are written."""
    if isinstance(value, str):
        return value
    return str(value.tolist() if isinstance(value, np.ndarray) else value)


def _short(value: Attribute | None) -> str:
    """An attribute for a message."""
    text = "".join(c if c.isprintable() else "?" for c in _plain("" if value is None else value))
    return text if len(text) <= 60 else f"{text[:57]}..."
