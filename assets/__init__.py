"""Objects, scenes, robots, demonstrations and policies, found by `bt_tasksim.core.resources.asset`."""
