"""A robot in a world of SAPIEN: its links and their surfaces, its drives, and where its frames are."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.physics.sapien_world import CONTACT_OFFSET, World, array, floats, sapien_pose
from bt_tasksim.engines.physics.sapien_wrist import WristSensor
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.urdf_links import links_below, load_links, root_pose, still_links
from bt_tasksim.robot.urdf_visuals import load_collisions

if TYPE_CHECKING:
    import sapien
    from sapien import physx
    from sapien.wrapper.articulation_builder import ArticulationBuilder, LinkBuilder

SKIN = 5e-4
"""Metres at which what touches the hand comes to rest before it. PhysX knows the exact distance of bodies
that are apart; of bodies that overlap, where edge meets edge, its estimate is now and then wrong by
millimetres for one step, and kicks what is light."""
FAST = 0.6
"""Share of the hand's own speed from which it closes fast."""
_ARM_BIT = 1 << 8  # shapes that share a bit of group 2 do not collide with each other


class RobotBuilder:
    """Puts a robot into one world after the other; reading its URDF takes milliseconds, so it is read once.

    Frames at a robot's ends, fixed links that nothing can touch, are left out: PhysX would move them.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: RobotDescription) -> None:
        self.robot = robot
        self._builder: ArticulationBuilder | None = None
        self._tool_frame = (robot.tool_link, robot.tool_pose)

    def build(self, world: World, joint_position: Array) -> Robot:
        """The robot in a world, at joints ``(n_joints,)`` and told to stay there.

        Raises:
            InputError: A mesh is missing.
        """
        if self._builder is None:
            self._builder = self._read(world.scene)
        return Robot(
            self.robot, self._builder.set_scene(world.scene).build(), world, joint_position, self._tool_frame
        )

    def _read(self, scene: sapien.Scene) -> ArticulationBuilder:
        robot = self.robot
        load_collisions(robot.urdf)  # an InputError where a mesh is missing; SAPIEN goes on without it
        loader = scene.create_urdf_loader()
        loader.fix_root_link = True
        builder = loader.parse(str(robot.urdf))[0][0]
        links = builder.link_builders
        for link in links:
            link.visual_records.clear()
        needed = {robot.base_link, robot.wrist_link, *robot.pad_links}
        needed |= {tip.links[0] for tip in robot.tips}
        while ends := [link for link in links if link.name not in needed and _is_end(link, links)]:
            for link in ends:
                if link.name == self._tool_frame[0]:
                    joint = link.joint_record
                    frame = poses.multiply(
                        array(joint.pose_in_parent), poses.inverse(array(joint.pose_in_child))
                    )
                    self._tool_frame = (link.parent.name, poses.multiply(frame, self._tool_frame[1]))
            links = [link for link in links if link not in ends]
        for index, link in enumerate(links):
            link.index = index
        builder.link_builders = links
        return builder


class Robot:
    """A robot in one world: what is asked of its drives, and what is read of its joints and frames.

    Args:
        robot: The robot.
        articulation: Its articulation in the world.
        world: The world, which learns what each link is.
        joint_position: Joints ``(n_joints,)`` to begin with.
        tool_frame: Link that carries the tool, and the tool's pose ``(7,)`` in it.
    """

    def __init__(
        self,
        robot: RobotDescription,
        articulation: physx.PhysxArticulation,
        world: World,
        joint_position: Array,
        tool_frame: tuple[str, Array],
    ) -> None:
        self._articulation = articulation
        tree = load_links(robot.urdf)
        if robot.base_link != tree[0].link:
            articulation.set_root_pose(sapien_pose(root_pose(tree, robot.base_link)))
        links = {link.name: link for link in articulation.get_links()}
        hand = links_below(tree, robot.wrist_link)
        _set_surfaces(robot, world, links, still_links(tree), hand)
        self._set_drives(robot, joint_position)
        self._tool_link, self._tool_pose = links[tool_frame[0]], tool_frame[1].tolist()
        self._tool_identity = bool(np.array_equal(self._tool_pose, [0, 0, 0, 1, 0, 0, 0]))
        self._sensor = WristSensor(articulation, links[robot.wrist_link], self.tool())
        self._tips = [(links[tip.links[0]], list(tip.point)) for tip in robot.tips]

    def _set_drives(self, robot: RobotDescription, joint_position: Array) -> None:
        articulation = self._articulation
        joints = {joint.name: joint for joint in articulation.get_active_joints()}
        order = [joint.name for joint in articulation.get_active_joints()]
        self._joints = [joints[name] for name in robot.joints]
        self._index = np.array([order.index(name) for name in robot.joints])
        self._n_arm = n_arm = len(robot.arm_joints)
        self._gains = [robot.drive_array(what).tolist() for what in ("stiffness", "damping", "force_limit")]
        stiffness, damping, limit = self._gains
        for i, joint in enumerate(self._joints):
            drive = robot.arm_drive if i < n_arm else robot.hand_drive
            joint.set_friction(0.1 if i < n_arm else 0.0)
            joint.set_armature([drive.armature])
            joint.set_drive_properties(stiffness[i], damping[i], force_limit=limit[i], mode="force")
        q = np.zeros(len(order), np.float32)
        q[self._index] = joint_position
        articulation.set_qpos(q)
        self._target = [(value, 0.0) for value in joint_position.tolist()]
        span = np.abs(robot.hand_closed - robot.hand_open)
        self._fast = np.where(span > 0.0, FAST * robot.hand_speed * span, np.inf).tolist()
        for joint, value in zip(self._joints, joint_position, strict=True):
            joint.set_drive_target(float(value))
            joint.set_drive_velocity_target(0.0)

    def drive_to(self, target: JointTarget) -> bool:
        """Tell the drives where to go, as far as it is news.

        Returns:
            It is news, and the hand closes or opens fast.
        """
        wanted = list(zip(target.position.tolist(), target.velocity.tolist(), strict=True))
        if wanted == self._target:
            return False
        for joint, now, before in zip(self._joints, wanted, self._target, strict=True):
            if now != before:
                joint.set_drive_target(now[0])
                joint.set_drive_velocity_target(now[1])
        self._target = wanted
        return any(abs(v) > fast for (_, v), fast in zip(wanted[self._n_arm :], self._fast, strict=True))

    def joints(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and drives' efforts ``(n_joints,)`` each.

        SAPIEN reports no effort of drives, so theirs is computed by the drives' own law.
        """
        articulation = self._articulation
        q, v = articulation.get_qpos()[self._index].tolist(), articulation.get_qvel()[self._index].tolist()
        effort = [
            max(min(k * (to - x) + d * (speed - u), limit), -limit)
            for k, d, limit, x, u, (to, speed) in zip(*self._gains, q, v, self._target, strict=True)
        ]
        return np.array(q), np.array(v), np.array(effort)

    def tool(self) -> Array:
        """Pose of the tool ``(7,)``."""
        tool = floats(self._tool_link.entity_pose)
        return np.array(tool if self._tool_identity else poses.composed(tool, self._tool_pose))

    def tips(self) -> Array:
        """Positions of the fingertips ``(n_tips, 3)``."""
        return np.array([poses.point(floats(link.entity_pose), point) for link, point in self._tips])

    def wrench(self) -> Array:
        """External wrench ``(6,)`` at the tool, see `WristSensor.wrench`."""
        return self._sensor.wrench()


def _set_surfaces(
    robot: RobotDescription,
    world: World,
    links: dict[str, physx.PhysxArticulationLinkComponent],
    still: Collection[str],
    hand: Collection[str],
) -> None:
    """What each link is, what it can touch, and how it grips."""
    from sapien import physx

    pads = physx.PhysxMaterial(robot.pads.friction, robot.pads.friction, 0.0)
    tip_of = {name: i for i, tip in enumerate(robot.tips) for name in tip.links}
    for name, link in links.items():
        link.set_disable_gravity(True)
        in_hand = name in hand
        for shape in link.get_collision_shapes():
            bits = 0 if name in tip_of else _ARM_BIT
            shape.set_collision_groups([1, 1, bits, 0])
            skin = SKIN if in_hand else 0.0
            shape.set_contact_offset(CONTACT_OFFSET["robot"] + skin)
            shape.set_rest_offset(skin)
            if name in robot.pad_links:
                shape.set_physical_material(pads)
                shape.set_patch_radius(robot.pads.patch_radius)
                shape.set_min_patch_radius(robot.pads.min_patch_radius)
        kind = "base" if name in still else ("hand" if in_hand else "arm")
        world.bodies[link] = (kind, tip_of.get(name, -1))


def _is_end(link: LinkBuilder, links: list[LinkBuilder]) -> bool:
    """A fixed link without shapes that carries no other."""
    carries = any(other.parent is link for other in links)
    return link.joint_record.joint_type == "fixed" and not link.collision_records and not carries
