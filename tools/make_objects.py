"""Write the bundled meshes of `assets/objects` anew: ``python -m tools.make_objects``.

A mug with a handle and an L bracket, from the forms that benchmarks draw.
"""

from __future__ import annotations

from benchmarks.any_tree.meshes import corner_of, mug_of, obj_text, triangles
from bt_tasksim.core.resources import asset

BY = "in metres, by tools/make_objects.py. CC0."


def texts() -> dict[str, str]:
    """Each mesh file's text, by its name."""
    mug, bracket = mug_of(0.034, 0.082, 0.0045, 0.006), corner_of(0.09, 0.075, 0.028, 0.022)
    return {
        "mug.obj": obj_text(
            *triangles(mug), "A mug with a handle, in metres, by tools/make_objects.py. CC0."
        ),
        "bracket.obj": obj_text(
            *triangles(bracket), "An L bracket, in metres, by tools/make_objects.py. CC0."
        ),
    }


def main() -> None:
    """Write them."""
    for name, text in texts().items():
        asset("objects", name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
