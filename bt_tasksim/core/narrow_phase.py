"""coal, asked once, so that its answers do not depend on what a process asked it first.

Import coal from here, also before Pinocchio's collision checking is used.

In coal 3.0.3 `getShapeSupport` of a box (`narrowphase/support_functions.cpp`) makes the box larger by 1e-10
of its size if the direction has a component of zero. It keeps that in a static variable, so the first
direction that anybody asks for holds for all boxes and directions of the process from then on: depths
differed by 5e-12 m where a process had planned before it measured.
"""

import coal
import numpy as np


def _ask_first() -> None:
    """A first question, which begins along x: boxes are larger by 1e-10 from then on."""
    box, here = coal.Box(1.0, 1.0, 1.0), coal.Transform3s.Identity()
    aside = coal.Transform3s(np.eye(3), np.array([3.0, 0.0, 0.0]))
    coal.distance(box, here, box, aside, coal.DistanceRequest(), coal.DistanceResult())


_ask_first()
__all__ = ["coal"]
