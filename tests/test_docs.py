"""The documentation: code runs, command lines parse, links and pictures exist, tables are made."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from bt_tasksim.cli import _parser

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(
    r"(?:<!-- (?P<mark>[^>]*) -->\n)?(?P<indent> *)```(?P<kind>\w*)\n(?P<text>.*?)\n *```", re.S
)
LINK = re.compile(r"\]\((?P<link>[^)\s]+)\)|src=\"(?P<source>[^\"]+)\"")
COMMAND = re.compile(r"^(?:\$ )?(?:\.venv/bin/)?bt-tasksim (.+)$", re.M)
WHOLE = re.compile(r"`bt-tasksim ([^`]+)`")


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Mark, kind and text of each code block of a page."""
    out = []
    for found in BLOCK.finditer(page.read_text(encoding="utf-8")):
        lines = found["text"].split("\n")
        cut = len(found["indent"])
        out.append((found["mark"] or "", found["kind"], "\n".join(line[cut:] for line in lines)))
    return out


PYTHON = [(p, i, m, t) for p in PAGES for i, (m, k, t) in enumerate(blocks(p)) if k == "python"]
RUNS = [(p, i, m, t) for p, i, m, t in PYTHON if m.startswith("run")]
FILES = {m.removeprefix("file: "): t for _, _, m, t in PYTHON if m.startswith("file: ")}


def label(case: tuple[Path, int, str, str]) -> str:
    return f"{case[0].name}-{case[1]}"


@pytest.mark.parametrize("case", PYTHON, ids=label)
def test_python_compiles(case):
    page, number, _, text = case
    compile(text, f"{page.name}, block {number}", "exec")


@pytest.mark.parametrize("case", RUNS, ids=label)
def test_marked_code_runs_and_prints_what_it_says(case, tmp_path):
    _, _, mark, text = case
    for name in mark.removeprefix("run after:").split() if "after:" in mark else []:
        (tmp_path / name).write_text(FILES[name], encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", text], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    for said in re.findall(r"^print\(.*\)  # (.*)$", text, re.M):
        assert all(part.strip() in done.stdout for part in said.split("..."))


@pytest.mark.parametrize(("name", "seed"), [("shelf.py", 7), ("wipe.py", 3)])
def test_trees_in_files_succeed(name, seed, tmp_path):
    from bt_tasksim import Runner
    from trees.load import load_source

    path = tmp_path / name
    path.write_text(FILES[name], encoding="utf-8")
    source = load_source(str(path))
    result = Runner(source.build(), source.scene).run(seed)
    assert result.success, result.why
    assert result.verdict is not None
    assert "no goal" not in result.why


def command_lines() -> list[tuple[str, str]]:
    out = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        found = [m for _, _, block in blocks(page) for m in COMMAND.findall(block)]
        prose = BLOCK.sub("", text)
        found += re.findall(r"(?m)^ {4}bt-tasksim (.+)$", prose)
        found += [line for line in WHOLE.findall(prose) if line != "log"]  # the name of the log format
        out += [(page.name, line) for line in dict.fromkeys(found)]
    return out


@pytest.mark.parametrize(("page", "line"), command_lines())
def test_command_lines_parse(page, line, capsys):
    words = shlex.split(line, comments=True)
    if words == ["--help"]:
        pytest.skip("prints and exits")
    if len(words) == 1 and words[0] != "demo":  # a command's bare name, in running text
        words += ["--help"]
        with pytest.raises(SystemExit) as ended:
            _parser().parse_args(words)
        assert ended.value.code == 0
    else:
        _parser().parse_args(words)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_and_pictures_are_there(page):
    text = page.read_text(encoding="utf-8")
    for found in LINK.finditer(text):
        link = (found["link"] or found["source"]).split("#")[0]
        if link and not link.startswith(("http://", "https://", "mailto:")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_pictures_are_small():
    for picture in (ROOT / "docs" / "pictures").iterdir():
        assert picture.stat().st_size < 500_000, picture.name


def test_concepts_page_names_every_leaf_and_its_parameters():
    from concept_nodes import catalogue

    text = (ROOT / "docs" / "concepts.md").read_text(encoding="utf-8")
    for name, leaf in catalogue().items():
        row = re.search(rf"^\| `{name}\(([^)]*)\)` \|([^|]*)\|", text, re.M)
        assert row is not None, f"{name} is not on the page"
        said = set(re.findall(r"\w+", row[1])) | set(re.findall(r"`(\w+)`", row[2]))
        assert said == set(leaf.parameters()), name


def test_tables_are_made_from_results():
    sys.path.insert(0, str(ROOT))
    try:
        from benchmarks import tables
    finally:
        sys.path.remove(str(ROOT))
    results = tables.load()
    for page in tables.PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        assert tables.filled(text, results) == text, f"{page}: run python -m benchmarks.tables"
    names = set(re.findall(r"<!-- table: (\w+) -->", "".join((ROOT / p).read_text() for p in tables.PAGES)))
    assert names == set(tables.TABLES)
