"""A robot in a world of SAPIEN: its links and their surfaces, its drives, and which frames are read."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_solving import Solving
from bt_tasksim.engines.physics.sapien_twist import Twist
from bt_tasksim.engines.physics.sapien_world import CONTACT_OFFSET, World, array, sapien_pose
from bt_tasksim.engines.physics.sapien_wrist import wrist_frame
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


class HandMotion(NamedTuple):
    """How a hand is told to move.

    Attributes:
        fast: With more than `FAST`.
        opens: It opens; None: it does not move.
    """

    fast: bool
    opens: bool | None


STANDS = HandMotion(False, None)


class Robot:
    """A robot in one world: what is asked of its drives, and where its frames are.

    Args:
        robot: The robot.
        articulation: Its articulation in the world.
        world: The world, which learns what each link is.
        joint_position: Joints ``(n_joints,)`` to begin with.
        tool_frame: Link that carries the tool, and the tool's pose ``(7,)`` in it.

    Attributes:
        articulation: The articulation.
        index: Where the robot's joints stand in it ``(n_joints,)``.
        arm: Where those of the arm stand.
        wrist: Number of the wrist's link in it.
        frames: The links that carry the tool and the fingertips, in this order.
        tool_pose: Pose ``(7,)`` of the tool in the first of them.
        lever: Position ``(3,)`` of the tool in the frame of the wrist's joint.
        to_tool: Rotation ``(4,)`` from that frame into the tool's.
        twist: What its pads do against what turns between them.
        solving: How long the solver works on what it holds.
    """

    def __init__(
        self,
        robot: RobotDescription,
        articulation: physx.PhysxArticulation,
        world: World,
        joint_position: Array,
        tool_frame: tuple[str, Array],
    ) -> None:
        self.articulation = articulation
        tree = load_links(robot.urdf)
        if robot.base_link != tree[0].link:
            articulation.set_root_pose(sapien_pose(root_pose(tree, robot.base_link)))
        links = {link.name: link for link in articulation.get_links()}
        hand = links_below(tree, robot.wrist_link)
        _set_surfaces(robot, world, links, still_links(tree), hand)
        self._set_drives(robot, joint_position)
        tool_link, self.tool_pose = links[tool_frame[0]], np.array(tool_frame[1], float)
        self.frames = [tool_link, *(links[tip.links[0]] for tip in robot.tips)]
        self.wrist = [link.name for link in articulation.get_links()].index(robot.wrist_link)
        tool = poses.multiply(array(tool_link.entity_pose), self.tool_pose)
        self.lever, self.to_tool = wrist_frame(articulation, links[robot.wrist_link], tool)
        closing = poses.rotate(self.tool_pose[3:], np.array([0.0, 1.0, 0.0]))
        self.twist = Twist(robot.pads, robot.opposition, tool_link, closing, world.objects, world.inertia)
        self.solving = Solving(tool_link, self.tool_pose[:3], world.objects, robot.many_fingers)

    def _set_drives(self, robot: RobotDescription, joint_position: Array) -> None:
        articulation = self.articulation
        by_name = {joint.name: joint for joint in articulation.get_active_joints()}
        order = list(by_name)
        joints = [by_name[name] for name in robot.joints]
        self.index = np.array([order.index(name) for name in robot.joints])
        self._n_arm = n_arm = len(robot.arm_joints)
        self.arm = self.index[:n_arm].tolist()
        gains = [robot.drive_array(what).tolist() for what in ("stiffness", "damping", "force_limit")]
        for i, (joint, stiffness, damping, limit) in enumerate(zip(joints, *gains, strict=True)):
            drive = robot.arm_drive if i < n_arm else robot.hand_drive
            joint.set_friction(0.1 if i < n_arm else 0.0)
            joint.set_armature([drive.armature])
            joint.set_drive_properties(stiffness, damping, force_limit=limit, mode="force")
        q = np.zeros(len(order), np.float32)
        q[self.index] = joint_position
        articulation.set_qpos(q)
        span = np.abs(robot.hand_closed - robot.hand_open)
        self._opens = np.sign(robot.hand_open - robot.hand_closed).tolist()
        self._fast = np.where(span > 0.0, FAST * robot.hand_speed * span, np.inf).tolist()
        self._lead = [damping / stiffness for stiffness, damping in zip(*gains[:2], strict=True)]
        self._tell = [joint.set_drive_target for joint in joints]
        self._told: list[float] = joint_position.tolist()
        for joint, value in zip(joints, self._told, strict=True):
            joint.set_drive_target(value)
            joint.set_drive_velocity_target(0.0)

    def drive_to(self, position: list[float], velocity: list[float]) -> HandMotion:
        """Tell the drives where to go, as far as it is news: a call costs as much as all the rest of it.

        A drive of stiffness k and damping d that is told to be at x with the speed v pushes with
        ``k (x - q) + d (v - q')``: the same as when it is told to be at ``x + (d / k) v`` and at rest.

        Returns:
            What the hand is told to do.
        """
        told = [x + lead * v for x, v, lead in zip(position, velocity, self._lead, strict=True)]
        for tell, now, before in zip(self._tell, told, self._told, strict=True):
            if now != before:
                tell(now)
        self._told = told
        closing = velocity[self._n_arm :]
        if not any(closing):
            return STANDS
        fast = any(abs(v) > most for v, most in zip(closing, self._fast, strict=True))
        opens = any(v * way > 0.0 for v, way in zip(closing, self._opens, strict=True))
        return HandMotion(fast, opens)


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
