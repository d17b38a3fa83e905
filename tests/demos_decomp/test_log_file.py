"""Logs are read as they were written; faulty files are refused; files are written whole or not at all."""

from __future__ import annotations

import dataclasses
import errno
import os

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.demos_decomp.log import Log, Utterance, Video
from bt_tasksim.demos_decomp.log_file import read_log, write_log
from bt_tasksim.demos_decomp.readers import open_log
from bt_tasksim.demos_decomp.synthetic import make


@pytest.fixture(scope="module")
def log():
    shown, _ = make("pick_and_throw", 3, talk=True)
    extra = {"commands/tool": np.arange(21.0).reshape(3, 7), "statuses/name": np.array([b"Grasp"])}
    shown = dataclasses.replace(
        shown, extra=extra, notes={"configuration": '{"seed": 7}'}, video=Video("a.mp4", 30.0)
    )
    return Log(
        "synthetic", (shown, dataclasses.replace(shown, name="001", seed=None, video=None)), "two cups"
    )


@pytest.fixture
def path(log, tmp_path):
    write_log(tmp_path / "log.h5", log)
    return tmp_path / "log.h5"


def assert_same(a, b):
    assert (a.name, a.task, a.seed, a.video) == (b.name, b.task, b.seed, b.video)
    assert a.notes == b.notes
    assert [(u.time, u.text) for u in a.narration] == [(u.time, u.text) for u in b.narration]
    for x, y in ((a.time, b.time), (a.hand_pose, b.hand_pose), (a.hand_opening, b.hand_opening)):
        np.testing.assert_allclose(x, y, rtol=0, atol=1e-12)
    assert a.objects.keys() == b.objects.keys()
    assert a.places.keys() == b.places.keys()
    for name in a.objects:
        np.testing.assert_allclose(a.objects[name].pose, b.objects[name].pose, rtol=0, atol=1e-12)
        assert a.objects[name].kind == b.objects[name].kind
    for name in a.places:
        for key, value in vars(a.places[name]).items():
            assert np.array_equal(value, getattr(b.places[name], key))
    assert a.extra.keys() == b.extra.keys()
    for name in a.extra:
        assert np.array_equal(a.extra[name], b.extra[name])


def test_round_trip(log, path):
    again = read_log(path)
    assert (again.source, again.description, again.path) == (log.source, log.description, str(path))
    for a, b in zip(log.demonstrations, again.demonstrations, strict=True):
        assert_same(a, b)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    said=st.lists(
        st.tuples(st.floats(-1e6, 1e6), st.text(st.characters(exclude_characters="\0", codec="utf-8"))),
        max_size=4,
    ),
    seed=st.integers(0, 2**40),
    task=st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=20),
)
def test_round_trip_of_any_words(tmp_path, log, said, seed, task):
    words = tuple(sorted((Utterance(t, s) for t, s in said), key=lambda u: u.time))
    shown = dataclasses.replace(log.demonstrations[0], narration=words, seed=seed, task=task)
    write_log(tmp_path / "words.h5", Log("human", (shown,)))
    assert_same(shown, read_log(tmp_path / "words.h5").demonstrations[0])


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9, 0.999])
def test_cut_off_files_are_refused(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(
        InputError, match=r"log\.h5' is (cut off or damaged|not an HDF5 file)|no log of a known kind"
    ):
        open_log(path)


def test_damaged_data_are_refused(path):
    content = bytearray(path.read_bytes())
    start = content.find(b"\x78\x5e")  # a compressed chunk
    start = start if start > 0 else len(content) // 2
    content[start : start + 400] = bytes(400)
    path.write_bytes(bytes(content))
    with pytest.raises(InputError):
        open_log(path)


def test_files_that_are_no_logs_are_refused(tmp_path):
    (tmp_path / "empty.h5").touch()
    (tmp_path / "text.h5").write_text("grasp, pick")
    for reader in (open_log, read_log):
        with pytest.raises(InputError, match="is empty"):
            reader(tmp_path / "empty.h5")
        with pytest.raises(InputError, match="there is no file"):
            reader(tmp_path / "absent.h5")
        with pytest.raises(InputError, match="is a folder"):
            reader(tmp_path)
        with pytest.raises(InputError, match=r"no log of a known kind|not an HDF5 file"):
            reader(tmp_path / "text.h5")


def rewritten(path, change):
    with h5py.File(path, "a") as file:
        change(file)
    return path


def _instead(file, name, values):
    del file[name]
    file[name] = values


def _scaled(file, factor):
    times = file["demonstrations/000/time"]
    times[...] = times[()] * factor


def _virtual():
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (10,))
    return layout


FAULTS = {
    "format": (lambda f: f.attrs.__setitem__("format", "other"), "format 'other'"),
    "version": (lambda f: f.attrs.__setitem__("version", 9), "version 9"),
    "units": (lambda f: f.attrs.__setitem__("units", "mm"), "units 'mm' instead of 'm rad s N'"),
    "quaternion": (lambda f: f.attrs.__setitem__("quaternion", "xyzw"), "quaternion 'xyzw'"),
    "source": (lambda f: f.attrs.__setitem__("source", "robott"), "did you mean 'robot'"),
    "no demonstrations": (lambda f: f.__delitem__("demonstrations"), "no group demonstrations"),
    "empty demonstrations": (
        lambda f: [f["demonstrations"].__delitem__(n) for n in ("000", "001")],
        "no demonstrations",
    ),
    "no time": (lambda f: f.__delitem__("demonstrations/000/time"), "demonstrations/000/time is missing"),
    "no hand": (lambda f: f.__delitem__("demonstrations/000/hand/pose"), "hand/pose is missing"),
    "no opening": (lambda f: f.__delitem__("demonstrations/000/hand/opening"), "hand/opening is missing"),
    "no objects": (lambda f: f.__delitem__("demonstrations/000/objects"), "000 has no objects"),
    "no object pose": (
        lambda f: f.__delitem__("demonstrations/000/objects/cup/pose"),
        "objects/cup/pose is missing",
    ),
    "no size": (lambda f: f["demonstrations/000/objects/cup"].attrs.__delitem__("size"), "no attribute size"),
    "no place pose": (
        lambda f: f["demonstrations/000/places/table"].attrs.__delitem__("pose"),
        "no attribute pose",
    ),
    "narration without text": (
        lambda f: f.__delitem__("demonstrations/000/narration/text"),
        "narration/text is missing",
    ),
    "video without path": (
        lambda f: f["demonstrations/000/video"].attrs.__delitem__("path"),
        "no attribute path",
    ),
    "data elsewhere": (
        lambda f: (
            f.__delitem__("demonstrations/000/time"),
            f.__setitem__("demonstrations/000/time", h5py.ExternalLink("other.h5", "/time")),
        ),
        "points outside itself|is missing",
    ),
    "demonstration elsewhere": (
        lambda f: f.__setitem__("demonstrations/002", h5py.ExternalLink("other.h5", "/")),
        "points outside itself",
    ),
    "external link above": (
        lambda f: (
            f.__delitem__("demonstrations/000/hand"),
            f.__setitem__("demonstrations/000/hand", h5py.ExternalLink("other.h5", "/hand")),
        ),
        "points outside itself",
    ),
    "external storage": (
        lambda f: f["demonstrations/000"].create_dataset(
            "secret", (4,), "f8", external=[("/etc/passwd", 0, 32)]
        ),
        "secret points outside itself",
    ),
    "virtual data": (
        lambda f: f["demonstrations/000"].create_virtual_dataset("far", _virtual()),
        "far points outside itself",
    ),
    "declared size": (
        lambda f: f["demonstrations/000"].create_dataset("big", (10**11,), "f8", chunks=(1000,)),
        "big holds 100000000000 values",
    ),
    "text as numbers": (
        lambda f: _instead(f, "demonstrations/000/hand/opening", np.array([b"1.0"] * 3)),
        "does not hold numbers",
    ),
    "numbers as text": (
        lambda f: _instead(
            f, "demonstrations/000/narration/text", np.zeros(len(f["demonstrations/000/narration/time"]))
        ),
        "narration should hold",
    ),
    "seed in words": (
        lambda f: f["demonstrations/000"].attrs.__setitem__("seed", "seven"),
        "seed is 'seven'",
    ),
    "seeds": (lambda f: f["demonstrations/000"].attrs.__setitem__("seed", [1, 2]), "attribute seed"),
    "size in words": (
        lambda f: f["demonstrations/000/objects/cup"].attrs.__setitem__("size", "small"),
        "attribute size is 'small'; write numbers",
    ),
    "height in words": (
        lambda f: f["demonstrations/000/places/table"].attrs.__setitem__("height", "high"),
        "attribute height is 'high'; write numbers",
    ),
    "heights": (
        lambda f: f["demonstrations/000/places/table"].attrs.__setitem__("height", [1.0, 2.0]),
        "holds 2 numbers",
    ),
    "rate in words": (
        lambda f: f["demonstrations/000/video"].attrs.__setitem__("fps", "fast"),
        "attribute fps is 'fast'",
    ),
    "objects as data": (
        lambda f: _instead(f, "demonstrations/000/objects", np.zeros(3)),
        "objects is not a group",
    ),
    "versions": (lambda f: f.attrs.__setitem__("version", [1, 1]), r"version \[1, 1\]"),
    "odd words": (lambda f: f.attrs.__setitem__("units", "m\x1b[2J"), r"units 'm\?\[2J'"),
    "far away": (
        lambda f: f["demonstrations/000/hand/pose"].__setitem__((3, 0), 1e150),
        "more than 1000 m away at index 3",
    ),
    "nanoseconds": (lambda f: _scaled(f, 1e9), "looks like nanoseconds"),
    "microseconds": (lambda f: _scaled(f, 1e6), "looks like microseconds"),
    "milliseconds": (lambda f: _scaled(f, 1e3), "looks like milliseconds"),
    "a gap of years": (
        lambda f: f["demonstrations/000/time"].__setitem__(-1, 1e9),
        "more than 86400",
    ),
    "zero quaternion": (
        lambda f: f["demonstrations/000/hand/pose"].__setitem__((2, slice(3, 7)), 0.0),
        r"log\.h5': demonstrations/000/hand/pose has a zero quaternion at index 2",
    ),
    "time backwards": (
        lambda f: f["demonstrations/001/time"].__setitem__(9, -1.0),
        r"log\.h5': demonstrations/001/time runs backwards at index 9",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faulty_content_is_refused_in_one_sentence(path, name):
    change, message = FAULTS[name]
    with pytest.raises(InputError, match=message) as caught:
        open_log(rewritten(path, change))
    assert "\n" not in str(caught.value)
    assert "log.h5" in str(caught.value)


def test_a_full_disk_leaves_what_was_there(path, log, monkeypatch):
    before = path.read_bytes()

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MachineError, match="No space left on device"):
        write_log(path, Log("human", log.demonstrations[:1]))
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == ["log.h5"]


def test_an_interrupt_leaves_what_was_there(path, log, monkeypatch):
    before = path.read_bytes()

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_log(path, Log("human", log.demonstrations[:1]))
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == ["log.h5"]


def test_nothing_is_written_of_a_faulty_log_or_into_no_folder(tmp_path, log):
    with pytest.raises(InputError):
        write_log(tmp_path / "a.h5", Log("human", ()))
    with pytest.raises(InputError, match=r"folder .* does not exist"):
        write_log(tmp_path / "no" / "a.h5", log)
    assert os.listdir(tmp_path) == []
