"""The robot of an environment: what it is told by ManiSkill's controller, and what is read of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.maniskill.environment import Environment
from bt_tasksim.engines.physics.sapien_world import array, floats
from bt_tasksim.engines.physics.sapien_wrist import external_wrench, wrist_frame
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.urdf_links import links_below, load_links, still_links


class EnvironmentRobot:
    """A robot in an environment's present scene.

    Args:
        environment: The environment.
        robot: Our description of it.

    Attributes:
        bodies: What each of its links is (``base``, ``arm`` or ``hand``) and its fingertip's index or -1.
        to_base: ManiSkill's world as seen from the robot base frame ``(7,)``.

    Raises:
        InputError: The description is not of this robot, or its controller takes something else.
    """

    def __init__(self, environment: Environment, robot: RobotDescription) -> None:
        agent = environment.base.agent
        owner = f"ManiSkill's '{environment.file.environment}'"
        articulation = agent.robot
        self._articulation = articulation._objs[0]
        links = {name: link._objs[0] for name, link in articulation.links_map.items()}
        order = [joint.name for joint in articulation.active_joints]
        for kind, names, known in (
            ("joint", robot.joints, order),
            ("link", (robot.base_link, robot.tool_link, robot.wrist_link), links),
        ):
            for name in names:
                if name not in known:
                    raise InputError(f"{owner}: its robot has no {kind} '{name}', and '{robot.name}' has")
        self._index = np.array([order.index(name) for name in robot.joints])
        self._base = links[robot.base_link]
        self._tool_link, self._tool_pose = links[robot.tool_link], robot.tool_pose.tolist()
        self._tips = [(links[tip.links[0]], list(tip.point)) for tip in robot.tips]
        self._controls = Controls(agent.controller, robot.joints, owner)
        wrist = links[robot.wrist_link]
        self._wrist = self._articulation.get_links().index(wrist)
        lever, to_tool = wrist_frame(self._articulation, wrist, self._world_tool())
        self._lever, self._to_tool = lever[None], to_tool[None, None]
        tree = load_links(robot.urdf)
        hand, still = links_below(tree, robot.wrist_link), still_links(tree)
        tip_of = {name: i for i, tip in enumerate(robot.tips) for name in tip.links}
        self.bodies = {
            link: ("base" if name in still else "hand" if name in hand else "arm", tip_of.get(name, -1))
            for name, link in links.items()
        }
        drives = [articulation.active_joints[i]._objs[0] for i in self._index]
        self._stiffness = np.array([float(joint.stiffness) for joint in drives])
        self._damping = np.array([float(joint.damping) for joint in drives])
        described = robot.drive_array("force_limit")
        limits = [min(float(j.force_limit), own) for j, own in zip(drives, described, strict=True)]
        self._limit = np.array(limits)
        lag = np.divide(
            self._damping, self._stiffness, out=np.zeros(len(drives)), where=self._stiffness > 0.0
        )
        self._lead = lag * environment.frequencies[1] - 0.5
        self.begin()

    def begin(self) -> None:
        """A new episode in the same scene: the robot may stand elsewhere, and is told to stay as it is."""
        self.to_base = poses.inverse(array(self._base.entity_pose))
        self._from_world = self.to_base.tolist()
        self._target = self._wanted = self.position()

    def action(self, target: JointTarget) -> Array:
        """What the controller is told, for a target of all joints.

        It takes positions alone, one for a whole period. A drive of stiffness k and damping d that is told to
        be at q + v d/k pulls exactly as one that is told to be at q with speed v; from the last target to
        this one, the mean of that over the period is told.
        """
        told = target.position + self._lead * (target.position - self._wanted)
        self._wanted = target.position
        action, self._target = self._controls.action(told)
        return action

    def position(self) -> Array:
        """Joint positions ``(n_joints,)``."""
        return np.asarray(self._articulation.get_qpos()[self._index], float)

    def joints(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and drives' efforts ``(n_joints,)`` each.

        SAPIEN reports no effort of drives, so theirs is computed by the drives' own law, within the limits of
        the robot's description.
        """
        q, v = self.position(), np.asarray(self._articulation.get_qvel()[self._index], float)
        effort = self._stiffness * (self._target - q) - self._damping * v
        return q, v, np.minimum(np.maximum(effort, -self._limit), self._limit)

    def tool(self) -> Array:
        """Pose of the tool ``(7,)``, robot base frame."""
        return np.array(poses.composed(self._from_world, self._world_tool().tolist()))

    def tips(self) -> Array:
        """Positions of the fingertips ``(n_tips, 3)``, robot base frame."""
        frame = self._from_world
        return np.array(
            [poses.point(frame, poses.point([*floats(link.entity_pose)], at)) for link, at in self._tips]
        )

    def wrench(self) -> Array:
        """External wrench ``(6,)`` at the tool, tool frame; ManiSkill's links carry no weight."""
        incoming = self._articulation.get_link_incoming_joint_forces()[None, self._wrist].astype(float)
        return external_wrench(incoming, self._lever, self._to_tool)[0]

    def _world_tool(self) -> Array:
        return np.array(poses.composed([*floats(self._tool_link.entity_pose)], self._tool_pose))


class Controls:
    """How joint positions become an action of ManiSkill's controller, which may scale and clip it.

    Args:
        controller: The agent's controller, a combined one.
        joints: Our joints.
        owner: Whose it is, for errors.

    Raises:
        InputError: The controller takes other joints, or something else than positions.
    """

    def __init__(self, controller: Any, joints: Sequence[str], owner: str) -> None:
        self._n = int(np.prod(controller.single_action_space.shape))
        sources = np.full(self._n, -1)
        self._low, self._high = np.empty(self._n), np.empty(self._n)
        self._scaled = np.zeros(self._n, bool)
        followers: list[tuple[int, int, float, float]] = []
        driven: set[int] = set()
        for name, part in controller.controllers.items():
            if not part.sets_target_qpos or getattr(part.config, "use_delta", False):
                raise InputError(f"{owner}: the controller of '{name}' does not take joint positions")
            start, end = controller.action_mapping[name]
            names = [joint.name for joint in part.joints]
            if missing := [joint for joint in names if joint not in joints]:
                raise InputError(f"{owner}: its controller moves '{missing[0]}', no joint of our description")
            mimics = getattr(part.config, "mimic", {})
            leaders = [joint for joint in names if joint not in mimics]
            if len(leaders) != end - start:
                raise InputError(f"{owner}: the controller of '{name}' takes {end - start} numbers")
            scaled = bool(part._normalize_action)
            space = part._original_single_action_space if scaled else part.single_action_space
            for k, joint in enumerate(leaders, start):
                sources[k] = joints.index(joint)
                self._scaled[k] = scaled
            self._low[start:end], self._high[start:end] = space.low, space.high
            for joint, how in mimics.items():
                followers.append(
                    (
                        joints.index(joint),
                        joints.index(how["joint"]),
                        float(how.get("multiplier", 1.0)),
                        float(how.get("offset", 0.0)),
                    )
                )
            driven |= {joints.index(joint) for joint in names}
        if idle := [joint for i, joint in enumerate(joints) if i not in driven]:
            raise InputError(f"{owner}: its controller does not move '{idle[0]}'")
        self._sources, self._followers = sources, followers
        self._span = np.where(self._scaled, self._high - self._low, 1.0)

    def action(self, told: Array) -> tuple[Array, Array]:
        """The action for positions of all joints.

        Args:
            told: Positions ``(n_joints,)``; those of joints that follow others do not count.

        Returns:
            The action ``(n,)``, and the positions ``(n_joints,)`` that the drives are told in the end.
        """
        clipped = np.minimum(np.maximum(told[self._sources], self._low), self._high)
        action = np.where(self._scaled, 2.0 * (clipped - self._low) / self._span - 1.0, clipped)
        target = told.copy()
        target[self._sources] = clipped
        for joint, leader, factor, offset in self._followers:
            target[joint] = factor * target[leader] + offset
        return action.astype(np.float32), target
