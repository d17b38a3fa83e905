"""Every command that README and docs name and that needs processes runs, in a quick form; see `lines`."""

import pytest

from tests.doc_commands.lines import ELSEWHERE, run_command, run_module


@pytest.mark.parametrize("line", ELSEWHERE)
def test_it_runs(line, empty):
    (run_module if line.startswith("python") else run_command)(line)
