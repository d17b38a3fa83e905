"""The fixtures of the package: each is a data file in ``assets/fixtures``, which announces itself here."""

from bt_tasksim.core.registry import register
from bt_tasksim.core.resources import asset

for _file in sorted(asset("fixtures").glob("*.yaml")):
    register("fixture", _file.stem)(_file)
