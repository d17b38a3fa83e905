"""Real environments of ManiSkill, where this machine can start them."""

import pytest

from bt_tasksim.core.errors import MachineError
from bt_tasksim.engines.maniskill.environment import Environment
from bt_tasksim.engines.maniskill.files import load_environment_file


@pytest.fixture(scope="session")
def maniskill():
    """Skips where ManiSkill does not start, and says why."""
    file = load_environment_file("PickCube-v1")
    try:
        Environment(file, "panda").close()
    except MachineError as error:
        pytest.skip(str(error))
