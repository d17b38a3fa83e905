"""HDF5 files from anybody: read in a process that can be lost, and never led elsewhere."""

from __future__ import annotations

import os
import signal
import threading
import time

import h5py
import numpy as np
import pytest

from bt_tasksim.core import hdf5
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset


def file_of(path, fill):
    with h5py.File(path, "w") as file:
        fill(file)
    return path


def fill(file):
    file["a/numbers"] = np.arange(6.0).reshape(2, 3)
    file["a/fixed"] = np.array([b"one", b"two"])
    file["a/texts"] = np.array(["one", "zwölf", ""], dtype=h5py.string_dtype())
    file["a/text"] = "a whole text"
    file["b/c/count"] = 7
    file["b/c/none"] = np.zeros((0, 7))
    file["a"].attrs.update(
        {"word": "yes", "words": ["x", "y"], "size": [1.0, 2.0], "count": 3, "nan": np.nan}
    )
    file["b"].attrs["fixed"] = np.bytes_(b"latin \xe9")


def test_what_was_written_is_read(tmp_path):
    root = hdf5.read(file_of(tmp_path / "a.h5", fill))
    assert root.names() == ["a", "b"]
    a = root.groups["a"]
    assert np.array_equal(a.data["numbers"], np.arange(6.0).reshape(2, 3))
    assert a.data["fixed"].tolist() == [b"one", b"two"]
    assert a.data["texts"].tolist() == [b"one", "zwölf".encode(), b""]
    assert a.data["text"].item() == b"a whole text"
    assert root.dataset("b/c/count") == 7
    assert root.dataset("b/c/none").shape == (0, 7)
    assert root.dataset("b/d/none") is None
    assert a.attributes["word"] == "yes"
    assert a.attributes["words"] == ["x", "y"]
    assert a.attributes["size"].tolist() == [1.0, 2.0]
    assert a.attributes["count"] == 3
    assert np.isnan(a.attributes["nan"])
    assert root.groups["b"].attributes["fixed"] == "latin �"
    assert sorted(path for path, _ in root.walk())[-1] == "b/c/none"


def test_only_what_is_wanted_is_read(tmp_path):
    root = hdf5.read(file_of(tmp_path / "a.h5", fill), ["a/t*", "b/**"])
    assert sorted(path for path, _ in root.walk()) == ["a/text", "a/texts", "b/c/count", "b/c/none"]
    assert root.groups["a"].skipped == {"numbers", "fixed"}
    assert hdf5.read(tmp_path / "a.h5", []).names() == ["a", "b"]


def test_values_that_are_neither_numbers_nor_text_are_left_out(tmp_path):
    def odd(file):
        file["pairs"] = np.zeros(3, [("x", "f8"), ("y", "i4")])
        file["reference"] = file["/"].ref
        file["nothing"] = h5py.Empty("f8")
        file["ragged"] = np.array([np.zeros(1), np.zeros(2)], dtype=object).astype(
            h5py.vlen_dtype(np.float64)
        )
        file["type"] = np.dtype("f8")
        file.attrs["pair"] = np.zeros((), [("x", "f8"), ("y", "i4")])
        file.attrs["reference"] = file["/"].ref
        file.attrs["nothing"] = h5py.Empty("f8")

    root = hdf5.read(file_of(tmp_path / "a.h5", odd))
    assert root.names() == ["nothing", "pairs", "ragged", "reference", "type"]
    assert not root.data
    assert not root.attributes


def soft(file):
    file["a/b"] = h5py.SoftLink("/c")


def external(file):
    file["a"] = h5py.ExternalLink("other.h5", "/")


def external_below(file):
    file["a/b/c"] = h5py.ExternalLink("other.h5", "/x")


def virtual(file):
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (10,))
    file.create_virtual_dataset("a/b", layout)


def raw(file):
    file.create_dataset("a/b", (4,), "f8", external=[("/etc/passwd", 0, 32)])


@pytest.mark.parametrize("lead", [soft, external, external_below, virtual, raw])
def test_nothing_outside_of_the_file_is_read(tmp_path, lead):
    file_of(tmp_path / "other.h5", lambda file: file.__setitem__("x", np.ones(10)))
    with pytest.raises(InputError, match="points outside itself"):
        hdf5.read(file_of(tmp_path / "a.h5", lead))


def test_declared_sizes_count_before_anything_is_read(tmp_path):
    def huge(file):
        file.create_dataset("a", (10**11,), "f8", chunks=(1 << 16,), compression="gzip")

    def many(file):
        for i in range(5):
            file.create_dataset(f"{i}", (20_000_000,), "f8", chunks=(1 << 16,), compression="gzip")

    for fault in (huge, many):
        started = time.monotonic()
        with pytest.raises(InputError, match="too many to read"):
            hdf5.read(file_of(tmp_path / "a.h5", fault))
        assert time.monotonic() - started < hdf5.PATIENCE * hdf5.SECONDS


def test_groups_within_themselves_end(tmp_path):
    def circle(file):
        file["a/b"] = 1
        file["a/c"] = file["/"]

    def fans(file):
        for i in range(20):
            group = file.create_group(f"g{i}")
            for k in range(8):
                if i:
                    group[f"k{k}"] = file[f"g{i - 1}"]

    for fault in (circle, fans):
        with pytest.raises(InputError, match="groups"):
            hdf5.read(file_of(tmp_path / "a.h5", fault))


@pytest.mark.parametrize("name", ["a\nb", "a\x1b[2Jb", "a" * 300])
def test_names_that_cannot_be_printed_are_refused(tmp_path, name):
    with pytest.raises(InputError, match="names that can be printed") as caught:
        hdf5.read(file_of(tmp_path / "a.h5", lambda file: file.__setitem__(name, 1)))
    assert str(caught.value).isprintable()


@pytest.fixture
def endless(tmp_path):
    """A log with one flipped bit over which libhdf5 loops for ever."""
    content = bytearray(asset("demonstrations", "shelf_to_shelf", "08.h5").read_bytes())
    content[1041] ^= 4
    path = tmp_path / "endless.h5"
    path.write_bytes(content)
    return path


def test_a_file_over_which_the_library_hangs_is_refused_in_time(endless, tmp_path):
    started = time.monotonic()
    with pytest.raises(InputError, match="is damaged or holds too much: reading it takes more than"):
        hdf5.read(endless)
    assert time.monotonic() - started < hdf5.PATIENCE * hdf5.SECONDS
    assert hdf5.read(file_of(tmp_path / "a.h5", fill)).names() == ["a", "b"]


def test_the_process_is_kept_and_replaced_where_it_is_lost(tmp_path, endless):
    reader = hdf5.Reader()
    try:
        path = file_of(tmp_path / "a.h5", fill)
        reader.read(path, ["**"], 5.0)
        first = reader._process
        reader.read(path, ["**"], 5.0)
        assert reader._process is first
        with pytest.raises(InputError):
            reader.read(endless, ["**"], 0.3)
        assert first.poll() is not None
        reader.read(path, ["**"], 5.0)
        os.kill(reader._process.pid, 9)
        reader._process.wait()
        assert reader.read(path, ["**"], 5.0).names() == ["a", "b"]
    finally:
        reader.close()


def test_a_process_that_dies_over_a_file_is_a_sentence(tmp_path, endless):
    reader = hdf5.Reader()
    try:
        reader.read(file_of(tmp_path / "a.h5", fill), ["**"], 5.0)
        process = reader._process
        killer = threading.Timer(0.5, process.kill)
        killer.start()
        with pytest.raises(InputError, match="breaks down"):
            reader.read(endless, ["**"], 20.0)
        killer.join()
    finally:
        reader.close()


def test_a_file_is_not_damaged_where_others_keep_the_machine_busy(tmp_path):
    reader, path = hdf5.Reader(), file_of(tmp_path / "a.h5", fill)
    reader.read(path, ["**"], 5.0)
    os.kill(reader._process.pid, signal.SIGSTOP)
    goes_on = threading.Timer(1.5, os.kill, (reader._process.pid, signal.SIGCONT))
    goes_on.start()
    assert reader.read(path, ["**"], 1.0).names() == ["a", "b"]
    goes_on.join()
    reader.close()


def test_no_process_is_left_without_its_parent(tmp_path):
    reader = hdf5.Reader()
    reader.read(file_of(tmp_path / "a.h5", fill), ["**"], 5.0)
    process = reader._process
    process.stdin.close()
    assert process.wait(5.0) == 0
    reader.close()


def test_the_process_opens_no_other_file(tmp_path):
    """What stands in `/proc` while it reads: the pipes, and limits that leave room for one file."""
    reader = hdf5.Reader()
    reader.read(file_of(tmp_path / "a.h5", fill), ["**"], 5.0)
    process = f"/proc/{reader._process.pid}"
    open_files = len(os.listdir(f"{process}/fd"))
    with open(f"{process}/limits") as file:
        limits = {line[:25].strip(): line[26:].split()[0] for line in file}
    assert int(limits["Max open files"]) == open_files + 1
    assert int(limits["Max address space"]) <= 2 << 30
    reader.close()
