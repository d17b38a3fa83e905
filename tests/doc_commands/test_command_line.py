"""Every ``bt-tasksim`` command that README and docs name runs, in a quick form; see `lines`."""

import pytest

from tests.doc_commands.lines import OWN, run_command


@pytest.mark.parametrize("line", OWN)
def test_it_runs(line, workplace):
    run_command(line)
