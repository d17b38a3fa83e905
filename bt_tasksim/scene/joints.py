"""The joint of a part of a fixture as it truly is: friction, damping, spring and latch besides its axis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from bt_tasksim.core.joints import JointModel, Joints
from bt_tasksim.core.poses import Array

LATCHED = {"slide": 0.006, "hinge": 0.03}
"""Metres or radians from shut within which a latch pulls the part shut."""


@dataclass(frozen=True)
class Joint(JointModel):
    """A joint as drawn, see `JointModel`.

    Attributes:
        friction: What it takes to move it, N or Nm.
        damping: N or Nm for each metre or radian a second.
        stiffness: Of its spring, N/m or Nm/rad.
        rest: Value at which the spring is at rest.
        latch: Force or torque with which a latch holds it shut, N or Nm.
    """

    friction: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    latch: float = 0.0

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Joint:
        """From what JSON holds of it, lists as tuples."""
        return cls(**data)

    def model(self) -> JointModel:
        """What is known of it beforehand."""
        told = asdict(self)
        return JointModel(**{name: told[name] for name in JointModel.__dataclass_fields__})

    def pose(self, value: float) -> Array:
        """Pose ``(7,)`` of the part in the robot base frame, by its value."""
        import numpy as np

        found: Array = Joints.of([self]).pose(np.array([value]))[0]
        return found

    def hold(self, value: float) -> float:
        """Force or torque with which the latch pulls the part shut, N or Nm, by how far it is open."""
        near = 1.0 - (value - self.limits[0]) / LATCHED[self.kind]
        return -self.latch * min(max(near, 0.0), 1.0)

    def pull(self, value: float, speed: float, inertia: float, seconds: float) -> float:
        """Force or torque of spring, latch and damping on the part, N or Nm.

        Damping is that of the mean speed over the step, ``v (1 - exp(-d t / m)) m / (d t)``, which never
        turns the motion round, however strong it is. What else acts in the step is not known here, so it is
        weaker than it should be where ``d t / m`` is not small: by a twentieth where that is 0.1.

        Args:
            value: How far it is open.
            speed: How fast it opens.
            inertia: Its mass, or its moment of inertia about the axis.
            seconds: How long a step is.
        """
        pull = self.stiffness * (self.rest - value) + self.hold(value)
        if self.damping > 0.0:
            pull += speed * inertia / seconds * math.expm1(-self.damping * seconds / inertia)
        return pull
