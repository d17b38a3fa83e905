"""``bt-tasksim bench``: the checkout's benchmarks are found from every folder."""

from __future__ import annotations

import os
import subprocess
import sys

FIND = "from bt_tasksim.cli.commands.bench import measurement as m; print(m().__module__)"


def test_the_benchmarks_are_found_from_every_folder(tmp_path):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-P", "-c", FIND], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.stdout == "benchmarks.speed\n", done.stderr
