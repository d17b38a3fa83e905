"""What the packages import is what pyproject.toml declares, pinned in constraints.txt."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[1]
PACKAGES = ["bt_tasksim", "concept_nodes", "trees", "demos_decomp", "assets"]
PYPROJECT = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))


def normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def declared(requirements: list[str]) -> set[str]:
    return {normalised(re.match(r"[\w.-]+", requirement).group()) for requirement in requirements}


CORE = declared(PYPROJECT["project"]["dependencies"])
EXTRAS = {name: declared(listed) for name, listed in PYPROJECT["project"]["optional-dependencies"].items()}


def imported(tree: ast.AST) -> set[str]:
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(node.module.partition(".")[0])
    return (
        names - set(sys.stdlib_module_names) - set(PACKAGES) - {"_typeshed"}
    )  # known to type checkers alone


BROUGHT = {"pinocchio": {"pin"}, "eigenpy": {"pin"}, "pydantic_core": {"pydantic"}}
"""Modules that a distribution brings from a place of its own, or from one that it pins itself."""


TWIN = declared(
    [
        line
        for line in (PROJECT / "tools" / "twin_packages.txt").read_text().splitlines()
        if line[:1].isalpha()
    ]
)
"""Packages of the twin's own environment, where only its node runs."""


INSTALLED = packages_distributions()


def distributions(module: str) -> set[str]:
    if module in BROUGHT:
        return BROUGHT[module]
    return {normalised(name) for name in INSTALLED.get(module, [module])}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_is_declared(package):
    known = CORE.union(*(EXTRAS[name] for name in EXTRAS if name != "dev"))
    undeclared = {
        f"{path.relative_to(PROJECT)}: {module}"
        for path in (PROJECT / package).rglob("*.py")
        for module in imported(ast.parse(path.read_text(encoding="utf-8")))
        if not distributions(module) & known
        and not (path.name == "node.py" and normalised(f"ros-{module}") in TWIN)
    }
    assert not undeclared


def test_a_robot_computer_needs_no_simulator_and_no_torch():
    assert not CORE & (EXTRAS["sim"] | EXTRAS["train"])


def test_every_dependency_is_pinned_once():
    lines = (PROJECT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [normalised(line.partition("==")[0]) for line in lines if line and not line.startswith("#")]
    assert all("==" in line for line in lines if line and not line.startswith("#"))
    assert len(pins) == len(set(pins))
    missing = CORE.union(*EXTRAS.values()) - set(pins)
    assert not missing


def test_torch_is_pinned_without_a_build():
    lines = (PROJECT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith("torch==")] == ["torch==2.13.0"]
