"""The command ``bt-tasksim``."""
