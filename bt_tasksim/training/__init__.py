"""Training and evaluation; registers the environments with gymnasium, where that is installed."""

from __future__ import annotations

from importlib.util import find_spec

ENVIRONMENTS = {"bt_tasksim/GraspThenPick-v0": "bt_tasksim.training.ready_made:grasp_then_pick"}
"""Registered environments: ``gymnasium.make("bt_tasksim.training:bt_tasksim/GraspThenPick-v0")``.

For ``gymnasium.make_vec`` there is beside each maker a ``MAKER_worlds``: many worlds in one process.
"""

if find_spec("gymnasium") is not None:
    import gymnasium

    for _name, _maker in ENVIRONMENTS.items():
        if _name not in gymnasium.registry:
            gymnasium.register(id=_name, entry_point=_maker, vector_entry_point=f"{_maker}_worlds")
