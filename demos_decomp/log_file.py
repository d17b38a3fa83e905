"""Demonstration logs in HDF5, read and written whole or not at all."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from bt_tasksim.errors import InputError, MachineError, nearest
from bt_tasksim.files import write_bytes
from demos_decomp.log import MOST_SAMPLES, Demonstration, Log, Surface, Track, Utterance, Video, checked_log

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
    with opened(path) as file:
        _check_conventions(file, path)
        if not isinstance(file.get("demonstrations"), h5py.Group):
            raise InputError(f"'{path}' has no group demonstrations; nothing can be learned from it")
        names = sorted(file["demonstrations"])
        read = tuple(_read_demonstration(_group(file["demonstrations"], n, path), n, path) for n in names)
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


@contextlib.contextmanager
def opened(path: Path) -> Any:
    """An HDF5 file open for reading; everything that goes wrong inside is one clear sentence.

    Raises:
        InputError: The file is missing, empty, cut off or no HDF5 file.
    """
    if not path.exists():
        raise InputError(f"there is no file '{path}'; check the path")
    if path.is_dir():
        raise InputError(f"'{path}' is a folder; name the log file in it")
    if path.stat().st_size == 0:
        raise InputError(f"'{path}' is empty; record or copy it again")
    if not h5py.is_hdf5(path):
        raise InputError(f"'{path}' is not an HDF5 file; see docs/demonstrations.md for the log format")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError, KeyError) as error:
        if isinstance(error, (InputError, MachineError)):
            raise
        reason = " ".join(str(error).split())
        raise InputError(f"'{path}' is cut off or damaged ({reason}); record or copy it again") from error


def _check_conventions(file: Any, path: Path) -> None:
    if _text(file, "format") != FORMAT:
        raise InputError(f"'{path}' has format '{_text(file, 'format')}' instead of '{FORMAT}'")
    version = file.attrs.get("version")
    if version != VERSION:
        raise InputError(f"'{path}' has version {version} of the log format; this program reads {VERSION}")
    for name, expected in CONVENTIONS.items():
        if _text(file, name) != expected:
            raise InputError(f"'{path}' has {name} '{_text(file, name)}' instead of '{expected}'; convert it")


def _read_demonstration(group: Any, name: str, path: Path) -> Demonstration:
    where = f"'{path}': demonstrations/{name}"
    time = _data(group, "time", where)
    objects = {}
    for key in sorted(group["objects"]) if "objects" in group else ():
        track = _group(group["objects"], key, path)
        at = f"{where}/objects/{key}"
        objects[key] = Track(
            _data(track, "pose", at), _attribute(track, "kind", at), _attribute(track, "size", at)
        )
    places = {}
    for key in sorted(group["places"]) if "places" in group else ():
        place = _group(group["places"], key, path)
        at = f"{where}/places/{key}"
        places[key] = Surface(
            np.asarray(_attribute(place, "pose", at)),
            np.asarray(_attribute(place, "extent", at)),
            _attribute(place, "kind", at),
            place.attrs.get("fixture"),
            np.asarray(place.attrs.get("centre", (0.0, 0.0))),
            float(place.attrs.get("height", 0.0)),
        )
    seed = group.attrs.get("seed")
    return Demonstration(
        name=name,
        time=time,
        hand_pose=_data(group, "hand/pose", where),
        hand_opening=_data(group, "hand/opening", where),
        objects=objects,
        places=places,
        task=_text(group, "task"),
        seed=None if seed is None else int(seed),
        narration=_narration(group, where),
        video=_video(group, where),
        extra=_extra(group),
        notes={k: str(v) for k, v in group.attrs.items() if k not in ("task", "seed")},
    )


def _narration(group: Any, where: str) -> tuple[Utterance, ...]:
    if "narration" not in group:
        return ()
    times, texts = _data(group, "narration/time", where), _data(group, "narration/text", where)
    if times.shape != texts.shape or times.ndim != 1:
        raise InputError(f"{where}/narration has {times.size} times but {texts.size} texts; give one each")
    return tuple(
        Utterance(float(t), s.decode("utf-8", "replace") if isinstance(s, bytes) else str(s))
        for t, s in zip(times, texts, strict=True)
    )


def _video(group: Any, where: str) -> Video | None:
    if "video" not in group:
        return None
    video = group["video"]
    at = f"{where}/video"
    return Video(str(_attribute(video, "path", at)), float(_attribute(video, "fps", at)))


def _extra(group: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if name.split("/")[0] not in _OWN and isinstance(item, h5py.Dataset):
            found[name] = item[()]

    group.visititems(keep)
    return found


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


def _put(group: Any, name: str, values: Any) -> None:
    packed = {"compression": "gzip", "shuffle": True} if np.ndim(values) and np.size(values) > 64 else {}
    group.create_dataset(name, data=values, **packed)


def _group(parent: Any, name: str, path: Path) -> Any:
    if not isinstance(parent.get(name, getlink=True), h5py.HardLink):
        raise InputError(f"'{path}': {parent.name}/{name} points outside itself; copy the data into the file")
    item = parent[name]
    if not isinstance(item, h5py.Group):
        raise InputError(f"'{path}': {parent.name}/{name} is not a group; see docs/demonstrations.md")
    return item


def _data(group: Any, name: str, where: str) -> Any:
    item = group.get(name)
    if not isinstance(item, h5py.Dataset):
        raise InputError(f"{where}/{name} is missing{nearest(name.split('/')[0], group)}")
    outside = item.is_virtual or item.external
    if outside or not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise InputError(f"{where}/{name} points outside itself; copy the data into the file")
    if item.size is None or item.size > 16 * MOST_SAMPLES:
        raise InputError(f"{where}/{name} holds {item.size} numbers; split the log")
    return item[()]


def _attribute(group: Any, name: str, where: str) -> Any:
    if name not in group.attrs:
        raise InputError(f"{where} has no attribute {name}{nearest(name, group.attrs)}")
    return group.attrs[name]


def _text(group: Any, name: str) -> str:
    value = group.attrs.get(name, "")
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
