"""Makes `toys`, which the tests of training share, importable by its name."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "bt_tasksim" / "training"))
