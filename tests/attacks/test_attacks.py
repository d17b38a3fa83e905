"""A few cases of each kind; ``make attacks`` runs a minute of each, and issue by issue thousands."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.attacks.__main__ import KINDS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_inputs_are_clear_errors_or_right_results(kind: str) -> None:
    """In a process of its own: an audit hook cannot be taken off again."""
    words = ["-m", "tests.attacks", kind, "--cases", "25", "--seconds", "10", "--seed", "5"]
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    assert " 0 violations" in done.stdout
