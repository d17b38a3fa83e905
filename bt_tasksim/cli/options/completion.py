"""How a word of the command line may go on: names of what is bundled, and files.

A shell waits for this at every press of a key, so names are looked up as files and nothing is imported.
"""

from __future__ import annotations

from pathlib import Path

from bt_tasksim.core.resources import HOME, asset


def trees(incomplete: str) -> list[str]:
    """Scenarios, and files of trees."""
    return [*_scenarios(incomplete), *_files(incomplete, ".py", ".xml")]


def scenes(incomplete: str) -> list[str]:
    """Scenarios, and scene files."""
    return [*_scenarios(incomplete), *_files(incomplete, ".yaml", ".yml", ".py")]


def robots(incomplete: str) -> list[str]:
    """Bundled robots, and robot files."""
    return [*_stems(asset("robots"), ".yaml", incomplete), *_files(incomplete, ".yaml", ".yml")]


def _scenarios(incomplete: str) -> list[str]:
    return _stems(HOME / "trees" / "scenarios", ".py", incomplete)


def _stems(folder: Path, suffix: str, incomplete: str) -> list[str]:
    names = (file.stem for file in folder.glob(f"*{suffix}") if not file.name.startswith("_"))
    return sorted(name for name in names if name.startswith(incomplete))


def _files(incomplete: str, *suffixes: str) -> list[str]:
    """Files of these kinds, and folders in which there may be some, whose paths begin so."""
    folder, _, begin = incomplete.rpartition("/")
    within = Path(folder or ("/" if incomplete.startswith("/") else "."))
    found = []
    try:
        for path in sorted(within.iterdir()):
            if path.name.startswith(begin) and (begin or not path.name.startswith(".")):
                shown = incomplete[: len(incomplete) - len(begin)] + path.name
                if path.is_dir():
                    found.append(f"{shown}/")
                elif path.suffix in suffixes:
                    found.append(shown)
    except OSError:
        return []
    return found
