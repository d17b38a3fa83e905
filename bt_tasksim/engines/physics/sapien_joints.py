"""Parts of fixtures in SAPIEN: each is the one link of an articulation whose root stands still."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.scene.configuration import ObjectActor
from bt_tasksim.scene.joint_inertia import inertia_about, value_of
from bt_tasksim.scene.joints import Joint

if TYPE_CHECKING:
    import sapien
    from sapien import physx

KINDS = {"slide": "prismatic", "hinge": "revolute"}
"""SAPIEN's names of joints."""
STICKING = 2e-5
"""Metres or radians a second with which a part creeps under the force that just moves it."""


class JointedBody:
    """A part as a body of its world, which PhysX moves on its joint alone.

    What is not said here is the link's.

    Args:
        link: The link.
        root: What it hangs on, which PhysX would let go of.
        joint: Its joint.
        inertia: Its mass, or its moment of inertia about the axis.
    """

    def __init__(
        self,
        link: physx.PhysxArticulationLinkComponent,
        root: sapien.Entity,
        joint: Joint,
        inertia: float,
    ) -> None:
        self._root, self.joint, self._inertia = root, joint, inertia
        self._articulation = link.articulation
        self.link = link
        self._pulled = bool(joint.stiffness or joint.damping or joint.latch)

    def __getattr__(self, name: str) -> Any:
        if name == "link":  # before it is there
            raise AttributeError(name)
        return getattr(self.link, name)

    @property
    def is_sleeping(self) -> bool:
        """As of a rigid body: it rests."""
        return bool(self.link.sleeping)

    def get_solver_position_iterations(self) -> int:
        """As of a rigid body."""
        return int(self._articulation.get_solver_position_iterations())

    def set_solver_position_iterations(self, iterations: int) -> None:
        """As of a rigid body."""
        self._articulation.set_solver_position_iterations(iterations)

    def set_angular_damping(self, damping: float) -> None:
        """Nothing: what is on a joint does not roll."""

    def act(self, seconds: float) -> None:
        """Spring, latch and damping act for the next step of so many seconds."""
        if not self._pulled:
            return
        value, speed = float(self._articulation.get_qpos()[0]), float(self._articulation.get_qvel()[0])
        pull = self.joint.pull(value, speed, self._inertia, seconds)
        self._articulation.set_qf(np.array([pull], np.float32))  # it acts until another one is set


def add_part(
    scene: sapien.Scene, actor: ObjectActor, joint: Joint, link_shapes: list[Any], iterations: int
) -> JointedBody:
    """A part in a scene, as far open as it was drawn.

    Args:
        scene: The scene.
        actor: What was drawn.
        joint: Its joint.
        link_shapes: What collides.
        iterations: Position iterations of PhysX's solver.
    """
    import sapien
    from sapien import physx

    root, link_entity = sapien.Entity(), sapien.Entity()
    still = physx.PhysxArticulationLinkComponent(None)
    root.add_component(still)
    root.name = f"{joint.fixture} frame"
    link = physx.PhysxArticulationLinkComponent(still)
    for shape in link_shapes:
        link.attach(shape)
    geometry = actor.shape()
    link.set_mass(actor.mass)
    link.set_cmass_local_pose(_pose(geometry.mass.pose))
    moments = np.asarray(geometry.mass.inertia, float) * actor.mass
    link.set_inertia(moments.tolist())
    link.set_linear_damping(0.0)
    link.set_angular_damping(0.0)
    link_entity.add_component(link)
    link_entity.name = actor.name
    still.joint.type = "fixed"
    x, z = np.eye(3)[0], np.eye(3)[2]
    axis = poses.from_rotation_vector(poses.shortest_turn(x, np.array(joint.axis), z))
    link.joint.type = KINDS[joint.kind]
    at = poses.pose(joint.origin, axis)
    link.joint.set_pose_in_parent(_pose(poses.multiply(np.array(joint.zero), at)))
    link.joint.set_pose_in_child(_pose(at))
    link.joint.set_limit([list(joint.limits)])
    link.joint.set_friction(0.0)
    link.joint.set_armature([0.0])
    link.joint.set_drive_properties(0.0, joint.friction / STICKING, force_limit=joint.friction, mode="force")
    scene.add_entity(root)
    scene.add_entity(link_entity)
    articulation = link.articulation
    articulation.set_solver_position_iterations(iterations)
    articulation.set_root_pose(sapien.Pose())
    value = value_of(actor, joint)
    articulation.set_qpos(np.array([value], np.float32))
    articulation.set_qvel(np.zeros(1, np.float32))
    return JointedBody(link, root, joint, inertia_about(actor, joint))


def _pose(pose: Any) -> sapien.Pose:
    import sapien

    p = [float(v) for v in pose]
    return sapien.Pose(p[:3], p[3:])
