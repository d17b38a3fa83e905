"""Files appear whole or not at all."""

import errno
import fcntl
import os
import resource
import signal
import subprocess
import sys

import pytest

from bt_tasksim.core import files
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import (
    alone,
    check_folder,
    check_writable,
    whole_file,
    whole_folder,
    write_bytes,
    write_text,
)


def names(folder):
    return sorted(p.name for p in folder.iterdir())


@pytest.fixture
def small_disk():
    """Files can hold no more than 4096 bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def test_text_and_bytes(tmp_path):
    write_text(tmp_path / "a.txt", "7 °")
    write_bytes(tmp_path / "b", b"\x00\x01")
    assert (tmp_path / "a.txt").read_bytes() == "7 °".encode()
    assert (tmp_path / "b").read_bytes() == b"\x00\x01"
    write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "new"
    assert names(tmp_path) == ["a.txt", "b"]


def test_permissions_are_the_users_own(tmp_path):
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "a", "x")
    finally:
        os.umask(before)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_the_unfinished_file_keeps_the_suffix_and_the_folder(tmp_path):
    with whole_file(tmp_path / "run.mp4") as path:
        assert path.suffix == ".mp4" and path.parent == tmp_path and not path.exists()
        path.write_bytes(b"x")
    assert names(tmp_path) == ["run.mp4"]


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt, ValueError, OSError(errno.ENOSPC, "No space left on device")]
)
def test_after_any_failure_the_old_file_is_there(tmp_path, error):
    (tmp_path / "a").write_text("old")
    expected = MachineError if isinstance(error, OSError) else error
    with pytest.raises(expected), whole_file(tmp_path / "a") as path:
        path.write_text("half")
        raise error
    assert names(tmp_path) == ["a"] and (tmp_path / "a").read_text() == "old"


def test_full_disk(tmp_path, small_disk):
    (tmp_path / "a").write_text("old")
    with pytest.raises(MachineError, match=r"cannot write '.*a': File too large; nothing was written"):
        write_bytes(tmp_path / "a", bytes(100_000))
    assert names(tmp_path) == ["a"] and (tmp_path / "a").read_text() == "old"


def test_full_disk_in_a_folder(tmp_path, small_disk):
    with pytest.raises(MachineError, match="File too large"), whole_folder(tmp_path / "run") as folder:
        (folder / "good").write_text("x")
        (folder / "large").write_bytes(bytes(100_000))
    assert names(tmp_path) == []


def test_no_folder_to_write_in(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        write_text(tmp_path / "no" / "a", "x")
    with pytest.raises(InputError, match="is a folder"):
        write_text(tmp_path, "x")


def test_a_block_that_writes_nothing(tmp_path):
    with pytest.raises(MachineError), whole_file(tmp_path / "a"):
        pass
    assert names(tmp_path) == []


def test_folder(tmp_path):
    with whole_folder(tmp_path / "run") as folder:
        (folder / "a").write_text("1")
        assert not (tmp_path / "run").exists()
    assert names(tmp_path) == ["run"] and names(tmp_path / "run") == ["a"]


def test_folders_above_are_made_and_unmade(tmp_path):
    with whole_folder(tmp_path / "runs" / "today" / "run") as folder:
        (folder / "a").write_text("1")
    assert names(tmp_path / "runs" / "today" / "run") == ["a"]
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "others" / "today" / "run") as folder:
        (folder / "a").write_text("1")
        raise KeyboardInterrupt
    assert names(tmp_path) == ["runs"]
    with pytest.raises(InputError, match="is a file"):
        check_folder(tmp_path / "runs" / "today" / "run" / "a" / "b")


def test_folder_replaces_only_what_it_may(tmp_path):
    with whole_folder(tmp_path / "run", {"a", "b"}) as folder:
        (folder / "a").write_text("1")
    with whole_folder(tmp_path / "run", {"a", "b"}) as folder:
        (folder / "b").write_text("2")
    assert names(tmp_path / "run") == ["b"]
    (tmp_path / "run" / "thesis.tex").write_text("mine")
    with pytest.raises(InputError, match=r"it holds other things, such as 'thesis.tex'"):
        check_folder(tmp_path / "run", {"a", "b"})
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="there is a file of this name"):
        check_folder(tmp_path / "file")


def test_something_that_came_meanwhile_is_kept(tmp_path):
    with pytest.raises(InputError), whole_folder(tmp_path / "run", {"a"}) as folder:
        (folder / "a").write_text("new")
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "thesis.tex").write_text("mine")
    assert names(tmp_path) == ["run"] and names(tmp_path / "run") == ["thesis.tex"]


def test_interrupted_folder_leaves_the_old_one(tmp_path):
    with whole_folder(tmp_path / "run", {"a"}) as folder:
        (folder / "a").write_text("old")
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "run", {"a"}) as folder:
        (folder / "a").write_text("new")
        raise KeyboardInterrupt
    assert names(tmp_path) == ["run"] and (tmp_path / "run" / "a").read_text() == "old"


def test_rename_that_fails_half_way_brings_the_old_folder_back(tmp_path, monkeypatch):
    with whole_folder(tmp_path / "run", {"a"}) as folder:
        (folder / "a").write_text("old")
    rename, calls = os.rename, []

    def failing(source, target):
        calls.append(source)
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "rename", failing)
    with pytest.raises(MachineError, match="No space left"), whole_folder(tmp_path / "run", {"a"}) as folder:
        (folder / "a").write_text("new")
    assert names(tmp_path) == ["run"] and (tmp_path / "run" / "a").read_text() == "old"


WRITING = """
import sys, time
from pathlib import Path
from bt_tasksim.core.files import whole_file, whole_folder
kind, path = sys.argv[1:]
with (whole_folder(path, ["a.txt"]) if kind == "folder" else whole_file(path)) as inside:
    (inside / "a.txt" if kind == "folder" else inside).write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


def writing(kind, path):
    """A process that writes a file or a folder and does not come to an end."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITING, kind, str(path)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout.readline() == b"writing\n"
    return process


def test_what_a_killed_process_left_is_cleared_by_the_next_one(tmp_path):
    path = tmp_path / "one.d"
    process = writing("file", path)
    other = writing("file", path)
    process.kill()
    process.wait()
    assert len(os.listdir(tmp_path)) == 2
    write_text(path, "whole")
    assert len(os.listdir(tmp_path)) == 2
    other.kill()
    other.wait()
    write_text(tmp_path / "two.d", "another name clears nothing")
    assert len(os.listdir(tmp_path)) == 3
    process.stdout.close()
    other.stdout.close()


def test_what_a_killed_process_left_of_a_folder_is_cleared_by_the_next_one(tmp_path):
    path = tmp_path / "one.d"
    process = writing("folder", path)
    process.kill()
    process.wait()
    process.stdout.close()
    assert len(os.listdir(tmp_path)) == 2
    with whole_folder(path):
        assert len(os.listdir(tmp_path)) == 2  # this process's folder, and its lock
    assert os.listdir(tmp_path) == ["one.d"]


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_sigterm_clears_up(tmp_path, kind):
    process = writing(kind, tmp_path / "one")
    process.terminate()
    process.wait(10)
    process.stdout.close()
    assert os.listdir(tmp_path) == []


def test_a_folder_that_was_moved_away_by_a_killed_process_comes_back(tmp_path):
    path = tmp_path / "one"
    with whole_folder(path) as inside:
        (inside / "a.txt").write_text("mine")
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait()
    files._beside(path, files._OLD)
    path.rename(tmp_path / files._beside(path, files._OLD).name.replace(str(os.getpid()), str(killed.pid)))
    with pytest.raises(InputError, match="other things"), whole_folder(path, ["b.txt"]):
        pass
    assert (path / "a.txt").read_text() == "mine"


def test_a_folder_of_a_files_name_is_no_such_file(tmp_path):
    (tmp_path / "one" / "run.h5").mkdir(parents=True)
    with pytest.raises(InputError, match=r"a folder named run\.h5"):
        check_folder(tmp_path / "one", ["run.h5"])


def test_whether_a_file_can_be_written_is_known_beforehand(tmp_path):
    check_writable(tmp_path / "a.json")
    for path in (tmp_path / "no" / "a.json", tmp_path):
        with pytest.raises(InputError):
            check_writable(path)
    assert os.listdir(tmp_path) == []


WRITE = """
import sys
from bt_tasksim.core.files import alone, whole_folder
with (whole_folder(sys.argv[2]) if sys.argv[1] == "folder" else alone(sys.argv[2])) as inside:
    print("writing", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_of_two_processes_that_write_to_one_place_the_second_is_refused(tmp_path, kind):
    path = tmp_path / "new" / "one"
    first = subprocess.Popen(
        [sys.executable, "-c", WRITE, kind, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert first.stdout.readline() == b"writing\n"
    for place in (whole_folder, alone):
        with pytest.raises(InputError, match=r"another process is writing '.*one'"), place(path):
            pass
    (tmp_path / "other name").symlink_to(path)
    said = "another process is writing '.*other name'"
    with pytest.raises(InputError, match=said), alone(tmp_path / "other name"):
        pass
    first.communicate(b"")
    assert first.returncode == 0
    with whole_folder(path) as inside:
        (inside / "a").write_text("a")
    assert sorted(p.name for p in path.parent.iterdir()) == ["one"]


def test_a_file_system_without_locks_is_written_to(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "lockf", none)
    with whole_folder(tmp_path / "one") as inside:
        (inside / "a").write_text("a")
    assert (tmp_path / "one" / "a").read_text() == "a"
