"""The fetched Vulkan driver, and the tool that fetches it."""

import subprocess
import sys
from pathlib import Path

import pytest

from bt_tasksim.engines import vulkan

PROJECT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PROJECT / "tools"))
import fetch_vulkan_driver as tool  # noqa: E402
import private_apt  # noqa: E402

DEB822 = """Types: deb
# a comment
URIs: http://mirror.example/debian
Suites: bookworm bookworm-updates
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg

Types: deb
URIs: http://elsewhere.example
Suites: nodistro
Components: main
"""


def apt_folder(tmp_path: Path, **files: str) -> Path:
    (tmp_path / "sources.list.d").mkdir()
    for name, text in files.items():
        place = tmp_path if name == "list" else tmp_path / "sources.list.d"
        (place / {"list": "sources.list", "deb822": "debian.sources"}[name]).write_text(text)
    return tmp_path


def test_paragraph_sources_keep_their_mirror_and_gain_the_suite(tmp_path):
    copied = private_apt.own_sources(apt_folder(tmp_path, deb822=DEB822), "bookworm", "bookworm-backports")
    assert copied == {
        "own.sources": "Types: deb\nURIs: http://mirror.example/debian\n"
        "Suites: bookworm bookworm-updates bookworm-backports\nComponents: main\n"
        "Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg\n"
    }


def test_line_sources_keep_their_options_and_gain_the_suite(tmp_path):
    text = (
        "deb [arch=amd64 signed-by=/k.gpg] http://mirror.example/debian bookworm main # here\n"
        "deb-src http://mirror.example/debian bookworm main\n"
        "deb http://security.example bookworm-security main\n"
        "deb http://other.example cloud-sdk-bookworm main\n"
    )
    copied = private_apt.own_sources(apt_folder(tmp_path, list=text), "bookworm", "bookworm-backports")
    assert copied["own.list"].splitlines() == [
        "deb [arch=amd64 signed-by=/k.gpg] http://mirror.example/debian bookworm main",
        "deb [arch=amd64 signed-by=/k.gpg] http://mirror.example/debian bookworm-backports main",
        "deb http://security.example bookworm-security main",
    ]


def test_a_release_with_a_new_mesa_is_taken_as_it_is(tmp_path):
    text = "deb http://mirror.example/debian trixie main\n"
    assert private_apt.own_sources(apt_folder(tmp_path, list=text), "trixie", None) == {"own.list": text}


def test_the_closure_leaves_out_what_every_machine_has():
    printed = "\n".join(
        f"'http://mirror.example/{name}' {name} 1 SHA256:0"
        for name in (
            "libc6_2.36-9_amd64.deb",
            "gcc-12-base_12.2.0-14_amd64.deb",
            "libx11-data_2%3a1.8.4-2_all.deb",
            "libx11-6_2%3a1.8.4-2_amd64.deb",
        )
    )
    assert tool.closure(printed) == ["libx11-6=2:1.8.4-2"]


def test_no_apt_is_one_sentence_and_no_failure(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tool, "renders", lambda folder=None: (False, "no device"))
    monkeypatch.setattr(tool.shutil, "which", lambda name: None)
    stamp = tmp_path / "stamp"
    assert tool.main(["--folder", str(tmp_path / "driver"), "--stamp", str(stamp)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("No rendering: this machine has no apt-get")
    assert said.count("\n") == 1
    assert not stamp.exists()
    assert not (tmp_path / "driver").exists()


def test_no_network_is_one_sentence_and_no_failure(tmp_path, monkeypatch, capsys):
    sources = {"own.list": "deb http://127.0.0.1:9/debian bookworm main\n"}
    monkeypatch.setattr(tool, "renders", lambda folder=None: (False, "no device"))
    monkeypatch.setattr(tool, "own_sources", lambda apt, codename, backports: sources)
    if tool.shutil.which("apt-get") is None:
        pytest.skip("no apt-get here")
    assert tool.main(["--folder", str(tmp_path / "driver")]) == 0
    said = capsys.readouterr().out
    assert said.startswith("No rendering: apt-get ")
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_nothing_happens_without_a_fetched_driver(tmp_path, monkeypatch):
    monkeypatch.setenv(vulkan.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.delenv("VK_DRIVER_FILES", raising=False)
    assert vulkan.driver_folder() is None
    assert vulkan.use_software_driver() is False
    monkeypatch.setenv(vulkan.FOLDER_VARIABLE, "")
    assert vulkan.driver_folder() is None


def test_a_driver_chosen_by_the_caller_is_left_alone(tmp_path, monkeypatch):
    (tmp_path / vulkan.LIBRARY_LIST).write_text("libc.so.6\n")
    monkeypatch.setenv(vulkan.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setenv("VK_DRIVER_FILES", "/chosen.json")
    assert vulkan.use_software_driver() is False
    monkeypatch.delenv("VK_DRIVER_FILES")
    monkeypatch.delenv("VK_ICD_FILENAMES", raising=False)
    assert vulkan.use_software_driver() is True
    assert vulkan.use_software_driver() is True


def test_a_fresh_process_renders_with_the_fetched_driver():
    folder = vulkan.driver_folder()
    if folder is None:
        pytest.skip("no software driver was fetched on this machine")
    ok, why = tool.renders(folder)
    assert ok, why


def test_the_runtime_module_imports_nothing_heavy():
    code = (
        "import bt_tasksim.engines.vulkan, sys; print([m for m in ('sapien', 'torch') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PROJECT)
    assert done.stdout.strip() == "[]", done.stderr
