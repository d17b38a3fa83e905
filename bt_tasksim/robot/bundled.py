"""The robots of the package: each is a data file in ``assets/robots``, which announces itself here."""

from bt_tasksim.core.registry import register
from bt_tasksim.core.resources import asset

for _file in sorted(asset("robots").glob("*.yaml")):
    register("robot", _file.stem)(_file)
