"""Packages that hand names on."""

import subprocess
import sys

import pytest

import bt_tasksim.robot
import bt_tasksim.scene


@pytest.mark.parametrize("package", [bt_tasksim.robot, bt_tasksim.scene])
def test_every_name_of_a_package_is_there_and_no_other(package):
    assert dir(package) == sorted(package.__all__)
    assert all(getattr(package, name).__name__ == name for name in package.__all__ if name != "Lesson")
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = package.nothing


def test_a_package_imports_none_of_its_modules_before_a_name_is_used():
    code = "import sys, bt_tasksim.scene; print('bt_tasksim.scene.scene' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "False"
