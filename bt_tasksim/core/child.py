"""What every Python process that this one starts has in its environment."""

from __future__ import annotations

VARIABLES = {"PYTHONSAFEPATH": "1"}
"""The current folder holds no modules for it: a ``queue.py`` or ``json.py`` there is somebody else's."""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Besides, for one of several that work side by side: it takes one thread for linear algebra."""
