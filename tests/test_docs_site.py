"""The documentation as a site: `make docs` builds it without a network, and a dead link stops it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
pytest.importorskip("mkdocs")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of what the site is made from; the code is the checkout's own."""
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    shutil.copy(ROOT / "mkdocs.yml", tmp_path)
    (tmp_path / "bt_tasksim").symlink_to(ROOT / "bt_tasksim")
    return tmp_path


def build(folder: Path) -> subprocess.CompletedProcess[str]:
    """The command of `make docs`, with proxies that lead nowhere."""
    (words,) = re.findall(r"^docs:.*\n\t.*/bin/mkdocs (.*)$", (ROOT / "Makefile").read_text(), re.M)
    nowhere = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", *words.split()],
        cwd=folder, env={**os.environ, **nowhere}, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip


def test_the_site_is_built_and_refers_to_nothing_outside(folder):
    done = build(folder)
    assert done.returncode == 0, done.stderr
    page = (folder / "site" / "index.html").read_text(encoding="utf-8")
    loaded = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"(https?://[^\"]+)", page)
    assert not loaded
    assert "javascripts/iframe-worker.js" in page
    assert (folder / "site" / "search" / "search_index.js").is_file(), "files are read without a server"


def test_a_dead_link_stops_it(folder):
    """To a page that is not there, and to a part of one: each is an error of its own."""
    links = ("there_is_none.md", "glossary.md#there-is-none")
    with (folder / "docs" / "tutorial.md").open("a", encoding="utf-8") as page:
        page.writelines(f"\n[dead]({link})\n" for link in links)
    done = build(folder)
    said = [line for line in done.stderr.splitlines() if line.startswith("WARNING") and "tutorial.md" in line]
    assert done.returncode != 0 and len(said) == len(links), done.stderr
    assert all(any(link in line for line in said) for link in links)
    assert "Aborted with 2 warnings in strict mode" in done.stdout
