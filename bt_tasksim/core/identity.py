"""Which bt-tasksim this is: version, source, and the packages whose versions change numbers."""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path

from bt_tasksim.core.resources import HOME

PACKAGES = (
    "bt-tasksim",
    "numpy",
    "py-trees",
    "pin",
    "sapien",
    "mani-skill",
    "mujoco",
    "mujoco-warp",
    "warp-lang",
    "coal",
    "scipy",
    "torch",
    "array-api-compat",
    "opencv-python-headless",
)
"""Packages whose versions a log names, where they are installed."""
SUFFIXES = frozenset((".py", ".xml", ".yaml", ".json", ".urdf", ".obj", ".stl", ".glb"))
ELSEWHERE = (Path("assets/demonstrations"), Path("assets/policies"))
"""Folders of the package that are not its source: what is used of them is compared by itself."""


def package_versions() -> dict[str, str]:
    """Versions of `PACKAGES`, of those that are installed."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


@functools.cache
def source_hash() -> str:
    """First digits of a SHA-256 of the package's files, the same for a checkout and an installed wheel."""
    found = hashlib.sha256()
    for path in sorted(_files(), key=lambda p: p.as_posix()):
        found.update(f"{path.as_posix()}\0".encode())
        found.update(hashlib.sha256((HOME / path).read_bytes()).digest())
    return found.hexdigest()[:16]


def identity() -> dict[str, str]:
    """Versions of the packages and ``source``, by name: where they are the same, so are results.

    (On processors of one kind: another one may round differently.)
    """
    return {**package_versions(), "source": source_hash()}


def differences(theirs: Mapping[str, str], ours: Mapping[str, str]) -> str:
    """In what two identities differ: ``sapien 3.0.2, here 3.0.3``; empty where they do not."""
    names = [name for name in {**ours, **theirs} if theirs.get(name) != ours.get(name)]
    shown = [f"{_short(name, theirs)}, here {ours.get(name, 'none')}" for name in names]
    return "; ".join(shown)


def differing(then: Mapping[str, str], now: Mapping[str, str]) -> str:
    """In what two mappings of hashes differ: ``tree and another scene``; empty where they do not."""
    names = [name for name in {**now, **then} if then.get(name) != now.get(name)]
    return " and another ".join(names)


def _short(name: str, versions: Mapping[str, str]) -> str:
    return f"{'another source of bt-tasksim' if name == 'source' else name} {versions.get(name, 'none')}"


def _files() -> Iterator[Path]:
    for folder, folders, names in os.walk(HOME, followlinks=True):
        here = Path(folder).relative_to(HOME)
        folders[:] = [n for n in folders if n != "__pycache__" and here / n not in ELSEWHERE]
        yield from (here / name for name in names if Path(name).suffix in SUFFIXES)
