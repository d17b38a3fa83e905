"""The tool that makes the twin's environment: where Python's shared library comes from."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PROJECT / "tools"))
import make_twin  # noqa: E402
from private_apt import UnavailableError  # noqa: E402

from bt_tasksim.core.errors import MachineError  # noqa: E402
from bt_tasksim.hardware.twin import environment  # noqa: E402

VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
LIBRARY = f"libpython{VERSION}.so.1.0"


@pytest.fixture
def bare(monkeypatch, tmp_path):
    """A machine whose Python has it built in, as Debian's and Ubuntu's have."""
    folder = tmp_path / "twin"
    folder.mkdir()

    def own_only(folder):
        if not (folder / "libpython" / LIBRARY).is_file():
            raise MachineError(f"the bridge needs '{LIBRARY}', which is not there")
        return folder / "libpython" / LIBRARY

    monkeypatch.setattr(make_twin, "python_library", own_only)
    return folder


def apt_with(tmp_path, holds):
    """In the place of apt-get: a package with such a file in it, or none."""

    class Apt:
        def __init__(self, folder, sources, suite):
            self.debs = folder / "debs"
            self.debs.mkdir(parents=True)

        def __call__(self, *arguments):
            if "download" in arguments:
                if not holds:
                    raise UnavailableError("apt-get download said 'Unable to locate package'")
                assert arguments[-1] == f"libpython{VERSION}"
                package = tmp_path / "package"
                (package / "DEBIAN").mkdir(parents=True)
                control = "Package: a\nVersion: 1\nArchitecture: all\nMaintainer: a <a@b>\nDescription: a\n"
                (package / "DEBIAN" / "control").write_text(control)
                inside = package / "usr" / "lib" / "x86_64-linux-gnu"
                inside.mkdir(parents=True)
                (inside / holds).write_text("a library")
                subprocess.run(
                    ["dpkg-deb", "-b", package, self.debs / "a.deb"], check=True, capture_output=True
                )
            return ""

    return Apt


@pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="no dpkg on this machine")
def test_a_missing_library_is_fetched_into_the_environment(bare, monkeypatch, tmp_path):
    monkeypatch.setattr(make_twin, "Apt", apt_with(tmp_path, LIBRARY))
    make_twin.provide_library(bare)
    assert environment.python_library(bare) == bare / "libpython" / LIBRARY
    assert [p.name for p in bare.iterdir()] == ["libpython"]


@pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="no dpkg on this machine")
@pytest.mark.parametrize(
    ("holds", "why"), [("", "Unable to locate package"), ("other.so", f"package libpython{VERSION}")]
)
def test_one_that_cannot_be_had_is_said_before_the_environment_counts_as_made(
    bare, monkeypatch, tmp_path, capsys, holds, why
):
    monkeypatch.setattr(make_twin, "Apt", apt_with(tmp_path, holds))
    monkeypatch.setattr(make_twin, "make_venv", lambda arguments: 0)
    monkeypatch.setattr(make_twin, "put_right", lambda folder: None)
    run = subprocess.run
    monkeypatch.setattr(make_twin.subprocess, "run", lambda c, **k: None if "pip" in c else run(c, **k))
    assert make_twin.main([str(bare)]) == 1
    said = capsys.readouterr().err
    assert why in said and LIBRARY in said and not bare.exists()


def test_without_apt(bare, monkeypatch):
    monkeypatch.setattr(make_twin.shutil, "which", lambda tool: None)
    with pytest.raises(UnavailableError, match="this machine has no apt-get to fetch it with"):
        make_twin.provide_library(bare)


def test_one_that_is_there_is_not_fetched(tmp_path):
    (tmp_path / "libpython").mkdir()
    (tmp_path / "libpython" / LIBRARY).touch()
    make_twin.provide_library(tmp_path)
