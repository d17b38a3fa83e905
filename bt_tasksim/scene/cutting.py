"""The process that cuts a mesh of many triangles into convex parts, for `bt_tasksim.scene.convex_parts`.

How long CoACD takes nobody knows beforehand: a smooth torus of 40,000 triangles takes seconds, a rough sphere
of 5,000 did not end in minutes. So it cuts those here, where the kernel stops it after as many seconds of
computing as its first argument says. It reads points and triangles from standard input and writes corners to
standard output, both as NumPy's ``.npz`` files without pickled objects. It is started as a script and imports
nothing of this project.
"""

from __future__ import annotations

import io
import json
import resource
import sys
from typing import Any

import coacd
import numpy as np


def cut(points: Any, triangles: Any, threshold: float, search: dict[str, int]) -> list[Any]:
    """Corners ``(n, 3)`` of the convex parts of a surface.

    Args:
        points: ``(n, 3)``, within a box of size 1.
        triangles: Numbers of points ``(k, 3)``.
        threshold: Concavity at which it stops.
        search: How hard it searches for cuts, by CoACD's names.
    """
    coacd.set_log_level("off")
    mesh = coacd.Mesh(points, triangles)
    for mode in ("off", "on"):  # its cuts need a manifold, which a surface that touches itself is not
        found = coacd.run_coacd(
            mesh, threshold=threshold, preprocess_mode=mode, merge=False, seed=0, **search
        )
        if found:
            break
    return [corners for corners, _ in found]


def main() -> None:
    """Cut what standard input holds."""
    most = int(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5))
    asked = np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False)
    parts = cut(asked["points"], asked["triangles"], **json.loads(sys.argv[2]))
    out = io.BytesIO()
    np.savez(out, *parts)
    sys.stdout.buffer.write(out.getvalue())


if __name__ == "__main__":
    main()
