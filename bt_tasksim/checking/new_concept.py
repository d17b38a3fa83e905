"""``bt-tasksim new concept``: a concept of one's own to begin with, its training tree and its test."""

from __future__ import annotations

import keyword
from pathlib import Path

from bt_tasksim.checking.new_files import NAME, check_free, check_new, write_new
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.resources import asset
from bt_tasksim.policy.policy import concept_name

FILES = {"concept.py.txt": "{}.py", "train.py.txt": "train_{}.py", "test.py.txt": "test_{}.py"}
"""Templates, and what they become."""
PLAIN = "plain"
"""The folder of the frame to fill in; the other folders are worked examples."""
TAKEN = ("train_", "test_")
"""How the names of the other files begin."""


def examples() -> list[str]:
    """Names of the worked examples that a new concept may begin as."""
    return sorted(p.name for p in asset("new_concept").iterdir() if p.is_dir() and p.name != PLAIN)


def write_concept(name: str, folder: str | Path = ".", like: str | None = None) -> str:
    """Write a concept that runs as it is, with its training tree and its test.

    Args:
        name: Its name, lower-case words joined by underscores.
        folder: Where to; it is made where there is none.
        like: The worked example that it begins as; by default a frame to fill in.

    Returns:
        What was written, and what to do next.

    Raises:
        InputError: The name is no good or taken, there is no such example, or a file is there
            already; then nothing is written.
        MachineError: The disk is full or not writable; then nothing is written.
    """
    folder = Path(folder)
    class_name = "".join(word.capitalize() for word in name.split("_"))
    paths = {template: folder / file.format(name) for template, file in FILES.items()}
    _check_name(name, class_name)
    if like is not None and like not in examples():
        raise InputError(f"there is no example '{like}' to begin with{nearest(like, examples())}")
    check_new(folder, dict.fromkeys(paths.values()))
    check_free(name)
    texts = {template: _filled(template, like or PLAIN, name, class_name) for template in paths}
    write_new(folder, {path: texts[template] for template, path in paths.items()})
    concept, tree, _ = paths.values()
    return (
        f"wrote {', '.join(map(str, paths.values()))}\n"
        f"next: bt-tasksim check {concept}; bt-tasksim run {tree} --video; bt-tasksim train {tree}"
    )


def _check_name(name: str, class_name: str) -> None:
    from bt_tasksim.concept.model import ConceptModel
    from bt_tasksim.concept_nodes import catalogue

    good = NAME.fullmatch(name) and not keyword.iskeyword(name)
    if not good or name.startswith(TAKEN):
        raise InputError(
            f"a concept's name should be lower-case words joined by '_', such as push or wipe_table, "
            f"and begin neither with 'train_' nor with 'test_': found '{name}'"
        )
    known = {concept_name(c): n for n, c in catalogue().items() if issubclass(c, ConceptModel)}
    if class_name.lower() in known:
        raise InputError(f"there is a concept {known[class_name.lower()]} already: choose another name")


def _filled(template: str, kind: str, name: str, class_name: str) -> str:
    own = asset("new_concept", kind, template)
    text = (own if own.is_file() else asset("new_concept", template)).read_text(encoding="utf-8")
    return (
        text.replace("@name@", name).replace("@Class@", class_name).replace("@words@", name.replace("_", " "))
    )
