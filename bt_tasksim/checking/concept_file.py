"""``bt-tasksim check``: the concepts and conditions that a Python file defines, checked in real runs."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bt_tasksim.checking.bundles import numbers
from bt_tasksim.checking.condition_check import check_condition
from bt_tasksim.checking.declaration import check_declaration
from bt_tasksim.checking.findings import ERROR, FAILED, WARNING, Case
from bt_tasksim.checking.purity import check_batches, check_beginning, check_purity
from bt_tasksim.checking.recording import Recording, record
from bt_tasksim.checking.report import Report
from bt_tasksim.checking.situations import RecordedDecision, Situations, alike
from bt_tasksim.checking.values import check_values
from bt_tasksim.checking.watching import check_observables, check_watching
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import InputError
from bt_tasksim.trees.nodes.train import concepts_in, follower_of, train_nodes

RUNS = 3
"""Runs from which situations are taken; from the second on, actions explore."""
MOST = 24
"""Situations of a concept that are taken from real runs."""
BESIDE = "train_"
"""How the file begins, beside a concept's own, that holds its training tree."""


def check(file: str | Path, tree: str | None = None) -> Report:
    """Check the concepts and conditions that a Python file defines.

    Args:
        file: The file; one of the shipped concepts' own, too.
        tree: The tree in which they are seen at work: a scenario, or a ``.py`` or ``.xml`` file. By default
            the file's own ``build()``, or that of the file ``train_...`` beside it, or a scenario with it.

    Raises:
        InputError: The file is missing, fails or defines none; or the tree is no good.
    """
    from bt_tasksim.trees.load import own_nodes

    path = Path(file)
    found = own_nodes(str(path)).values()
    concepts = [c for c in found if issubclass(c, ConceptModel) and not inspect.isabstract(c)]
    conditions = [c for c in found if issubclass(c, Condition) and not inspect.isabstract(c)]
    if not concepts and not conditions:
        half = [c for c in found if inspect.isabstract(c)]
        if half:
            missing = ", ".join(f"{name}()" for name in sorted(half[0].__abstractmethods__))
            raise InputError(f"'{file}': {half[0].__name__} has no {missing}: write it")
        raise InputError(f"'{file}' defines no concept and no condition: a class that derives from one")
    source = _own_tree(path, (*concepts, *conditions)[0]) if tree is None else tree
    report = Report()
    if conditions:
        _check_conditions(conditions, source, report)
    recorded: dict[str, tuple[Any, Recording]] = {}
    names: dict[str, list[type[ConceptModel]]] = {}
    for concept in concepts:
        names.setdefault(source or _scenario_with(concept), []).append(concept)
    for name, group in names.items():
        recorded[name] = _record(name, group) if name else (None, Recording({}, [], []))
        for concept in group:
            case, checked = check_concept(concept, name, *recorded[name])
            report.findings += case.findings
            report.done(checked)
    return report


def check_concept(concept: type[ConceptModel], name: str, root: Any, runs: Recording) -> tuple[Case, str]:
    """Check one concept.

    Args:
        concept: The concept.
        name: Name or file of the tree in which it was seen at work; empty where there is none.
        root: That tree's root.
        runs: What was recorded there.

    Returns:
        What was found, and what was checked.
    """
    leaves = [leaf for leaf in runs.decisions if _same(leaf.model_class, concept)]
    leaf = max(leaves, key=lambda leaf: len(runs.decisions[leaf]), default=None)
    decisions = runs.decisions[leaf] if leaf is not None else []
    case = Case(leaf.model_class if leaf is not None else concept, decisions, _followed(root, leaf))
    check_declaration(case)
    if not decisions:
        _never_acted(case, name, leaves, runs)
        check_observables(case)
        return case, f"{concept.__name__}, its declaration alone"
    situations = Situations(spread(decisions, MOST), model=case.model)
    compared = ""
    for part in (check_watching, check_values, check_beginning, check_purity):
        part(case, situations)
    if check_batches(case, Situations(spread(alike(decisions), MOST), model=case.model)):
        compared = ", torch"
    if case.model is not None and case.model.is_programmed and "done" in case.functions:
        _check_done(case, runs)
    programmed = f"{len(case.functions)} functions in {len(situations)} situations of {len(runs.ends)} runs"
    return case, f"{concept.__name__}, {programmed} of {Path(name).name}, one by one, in batches{compared}"


def _check_conditions(conditions: Sequence[type[Condition]], source: str | None, report: Report) -> None:
    """Check conditions in the tree of their file, or in another one.

    Raises:
        InputError: The tree is no good.
    """
    from bt_tasksim.trees.load import load_source

    if source is None:
        for kind in conditions:
            what = "stands in no tree that is known, so it was not asked"
            report.add(WARNING, kind.__name__, "", what, "give the file build() and scene()")
            report.done(f"{kind.__name__}, no run")
        return
    loaded = load_source(source)
    root = loaded.build()
    runs = record(root, loaded.scene, None, range(1, RUNS + 1))
    every = (decision for notes in runs.decisions.values() for decision in notes)
    decisions = alike([decision._replace(memory=None) for decision in every])
    if not decisions:
        raise InputError(f"in the tree '{source}' no concept ever acts: {runs.ends[-1]}")
    situations = Situations(spread(decisions, MOST))
    for kind in conditions:
        case, checked = check_condition(kind, root, situations)
        report.findings += case.findings
        report.done(checked)


def spread(decisions: Sequence[RecordedDecision], n: int) -> list[RecordedDecision]:
    """At most about ``n`` decisions, as many of each run, spread evenly from its first to its last.

    A run that explores may go on for long without getting anywhere; one that does not shows every phase.
    """
    runs: dict[int, list[RecordedDecision]] = {}
    for decision in decisions:
        runs.setdefault(decision.run, []).append(decision)
    each = max(2, n // len(runs))
    return [run[k] for run in runs.values() for k in _even(len(run), each)]


def _even(count: int, n: int) -> list[int]:
    """At most ``n`` positions of ``count``, evenly, the first and the last among them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(n, count))})


def _own_tree(path: Path, concept: type) -> str | None:
    if callable(getattr(sys.modules[concept.__module__], "build", None)):
        return str(path)
    beside = path.with_name(f"{BESIDE}{path.name}")
    return str(beside) if beside.is_file() else None


def _scenario_with(concept: type[ConceptModel]) -> str:
    """A scenario that uses a concept, one that trains it first; empty where none does."""
    from bt_tasksim.trees.load import load_source, scenarios

    found = ""
    for name in scenarios():
        root = load_source(name).build()
        if any(_same(leaf.model_class, concept) for node in train_nodes(root) for leaf in concepts_in(node)):
            return name
        if not found and any(_same(leaf.model_class, concept) for leaf in concepts_in(root)):
            found = name
    return found


def _record(name: str, concepts: Sequence[type[ConceptModel]]) -> tuple[Any, Recording]:
    from bt_tasksim.trees.load import load_source

    source = load_source(name)
    root = source.build()
    present = [leaf.model_class for leaf in concepts_in(root)]
    watched = [kind for kind in present if any(_same(kind, c) for c in concepts)]
    if not watched:
        known = ", ".join(sorted({kind.__name__ for kind in present})) or "none"
        wanted = " or ".join(c.__name__ for c in concepts)
        raise InputError(f"the tree '{name}' has no leaf of {wanted}; its concepts: {known}")
    stream = "training" if source.scene.stages else "evaluation"
    return root, record(root, source.scene, watched, range(1, RUNS + 1), explore=True, stream=stream)


def _same(a: type, b: type) -> bool:
    """Two classes are one, though their file may have been loaded twice."""
    return a is b or (a.__name__ == b.__name__ and _file(a) == _file(b))


def _file(concept: type) -> Path:
    return Path(inspect.getsourcefile(concept) or "").resolve()


def _followed(root: Any, leaf: ConceptNode | None) -> bool:
    if root is None or leaf is None:
        return False
    return any(leaf in concepts_in(node) and follower_of(node) is not None for node in train_nodes(root))


def _never_acted(case: Case, name: str, leaves: Sequence[ConceptNode], runs: Recording) -> None:
    if not name:
        what = "stands in no tree that is known, so its functions were not run"
        remedy = f"give the file build() and scene(), or write {BESIDE}{case.file.name}, or name a --tree"
        case.add(WARNING, "", what, remedy)
        return
    for error in runs.errors:
        cause = error.__cause__ or error
        blamed = _blamed(cause, case.file)
        case.raised(blamed, cause)
    if not runs.errors:
        case.add(
            ERROR, "", f"never acted in {len(runs.ends)} runs: {runs.ends[-1]}", "see what stands before it"
        )


def _blamed(error: BaseException, file: Path) -> str:
    """The function of a concept's file in which an exception was raised."""
    name, trace = "", error.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        if Path(code.co_filename).resolve() == file.resolve() and not name:
            name = code.co_name
        trace = trace.tb_next
    return name


def _check_done(case: Case, runs: Recording) -> None:
    """The programmed policy ends at least once."""
    model = case.model
    assert model is not None
    for decision in case.decisions:
        found = case.call("done", lambda d=decision: model.done(d.seen, d.memory))  # type: ignore[misc]
        if found is FAILED or bool(np.any(numbers(found))):
            return
    what = f"is never true in {len(runs.ends)} runs (the last one ended: {runs.ends[-1]})"
    case.add(WARNING, "done", what, "see with bt-tasksim run whether the goal is ever reached")
