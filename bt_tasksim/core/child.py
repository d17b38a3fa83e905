"""What every Python process that this one starts has in its environment."""

from __future__ import annotations

VARIABLES = {"PYTHONSAFEPATH": "1"}
"""The current folder holds no modules for it: a ``queue.py`` or ``json.py`` there is somebody else's."""
