"""The documentation: code runs, command lines parse, links and pictures exist, tables are made."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from pathlib import Path

import pytest
from draws import successes

from bt_tasksim.cli.app import NAME, application
from bt_tasksim.cli.main import main
from bt_tasksim.cli.options.plugins import taken

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
BLOCK = re.compile(
    r"(?:<!-- (?P<mark>[^>]*) -->\n)?(?P<indent> *)```(?P<kind>\w*)\n(?P<text>.*?)\n *```", re.S
)
LINK = re.compile(r"\]\((?P<link>[^)\s]+)\)|src=\"(?P<source>[^\"]+)\"")
COMMAND = re.compile(r"^(?:\$ )?(?:\.venv/bin/)?bt-tasksim (.+)$", re.M)
DOTTED = re.compile(r"\b(?:bt_tasksim|trees|concept_nodes|demos_decomp|benchmarks|tests)(?:\.\w+)+")
FOLDERS = (
    "bt_tasksim",
    "trees",
    "concept_nodes",
    "demos_decomp",
    "assets",
    "benchmarks",
    "docs",
    "examples",
    "tests",
    "tools",
)
PLACE = re.compile(rf"`((?:{'|'.join(FOLDERS)})/[a-z0-9_./-]*|[a-z0-9_./-]+/[a-z0-9_-]+\.py)`")
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
    return f"{case[0].relative_to(ROOT).as_posix()}-{case[1]}"


@pytest.mark.parametrize("case", PYTHON, ids=label)
def test_python_compiles(case):
    page, number, _, text = case
    compile(text, f"{page.name}, block {number}", "exec")


@pytest.mark.parametrize("case", RUNS, ids=label)
def test_marked_code_runs_and_prints_what_it_says(case, tmp_path, monkeypatch, capsys):
    """Each in a program's own space; libraries that take seconds to load are loaded once."""
    page, number, mark, text = case
    for name in mark.removeprefix("run after:").split() if "after:" in mark else []:
        (tmp_path / name).write_text(FILES[name], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    capsys.readouterr()
    exec(compile(text, f"{page.name}, block {number}", "exec"), {"__name__": "__main__"})
    printed = capsys.readouterr().out
    for said in re.findall(r"^print\(.*\)  # (.*)$", text, re.M):
        assert re.search(form(said), printed), f"{said} in {printed}"


def form(said: str) -> str:
    """A pattern of what is printed, with any numbers in the place of those that one run had."""
    parts = [re.escape(part.strip()) for part in re.split(r"\.\.\.", said)]
    return r"[\s\S]*".join(re.sub(r"-?\d+(?:\\\.\d+)?", r"-?\\d+(?:\\.\\d+)?", part) for part in parts)


def test_printed_numbers_may_differ_and_words_may_not():
    said = "cup stands on lower_board, 2 mm and 0.0 degrees off ... (8.7 s)"
    assert re.search(form(said), "cup stands on lower_board, 13 mm and 1.25 degrees off, so (9 s)")
    assert not re.search(form(said), "cup stands on upper_board, 2 mm and 0.0 degrees off, so (8.7 s)")


def test_a_log_is_decomposed_as_the_pages_print_it(capsys):
    line = "decompose assets/demonstrations/shelf_to_shelf/00.h5"
    assert main([str(ROOT / word) if "/" in word else word for word in line.split()]) == 0
    rows = [row for row in capsys.readouterr().out.splitlines() if " s  " in row]
    assert len(rows) == 5
    for page in ("README.md", "docs/demonstrations.md"):
        (said,) = [text for _, _, text in blocks(ROOT / page) if line in text]
        assert [row.rstrip() for row in said.splitlines() if " s  " in row] == [row.rstrip() for row in rows]


@pytest.mark.physical
@pytest.mark.parametrize("name", sorted(name for name, text in FILES.items() if "goal=" in text))
def test_trees_in_files_succeed(name, tmp_path):
    from bt_tasksim import Runner
    from bt_tasksim.trees.load import load_source

    path = tmp_path / name
    path.write_text(FILES[name], encoding="utf-8")
    source = load_source(str(path))
    successes(Runner(source.build(), source.scene).run, range(3, 7), n=2)


def command_lines() -> list[tuple[str, str]]:
    out = []
    for page in PAGES:
        if page.parent.name == "parts":
            continue  # tests/parts runs what these pages say
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
    if words[-1] == "--help" and words[0] in ("--help", "COMMAND"):
        pytest.skip("prints and exits")
    if len(words) == 1 and words[0] != "demo":  # a command's bare name, in running text
        assert main([*words, "--help"]) == 0
    else:
        group, (_, words) = application(), taken(words)
        context = group.make_context(NAME, words)
        name, command, rest = group.resolve_command(context, words)
        command.make_context(name, rest, parent=context)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links_and_pictures_are_there(page):
    text = page.read_text(encoding="utf-8")
    for found in LINK.finditer(text):
        link = (found["link"] or found["source"]).split("#")[0]
        if link and not link.startswith(("http://", "https://", "mailto:")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def exists(dotted: str) -> bool:
    """Whether a dotted name is a module or something in one."""
    if dotted.rpartition(".")[2] in ("py", "md", "yaml", "json"):
        return True  # the name of a file
    parts = dotted.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            value: object = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for name in parts[cut:]:
            if not hasattr(value, name) and name not in getattr(value, "__annotations__", ()):
                return False
            value = getattr(value, name, None)
        return True
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_names_and_paths_on_the_page_exist(page):
    text = page.read_text(encoding="utf-8")
    dotted = set(DOTTED.findall(text)) - {"bt_tasksim.parts"}  # the group of entry points
    assert not [name for name in sorted(dotted) if not exists(name)]
    places = [ROOT, ROOT / "bt_tasksim"]
    assert not [
        name for name in sorted(set(PLACE.findall(text))) if not any((p / name).exists() for p in places)
    ]


def test_pictures_are_small():
    for picture in (ROOT / "docs" / "pictures").iterdir():
        assert picture.stat().st_size < 500_000, picture.name


def test_concepts_page_names_every_leaf_and_its_parameters():
    from bt_tasksim.concept_nodes import catalogue

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
