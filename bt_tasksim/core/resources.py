"""Where the bundled data files are."""

from __future__ import annotations

from importlib import resources
from pathlib import Path


def asset(*parts: str) -> Path:
    """Path of a bundled file or folder of the package ``assets``."""
    return Path(str(resources.files("assets"))).joinpath(*parts)
