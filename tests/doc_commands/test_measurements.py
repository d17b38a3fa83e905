"""Every measurement that README and docs name runs, in a quick form; see `lines`."""

import pytest

from tests.doc_commands.lines import HERE, run_module


@pytest.mark.parametrize("line", HERE)
def test_it_runs(line, empty):
    run_module(line)
