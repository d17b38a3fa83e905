"""Physics by SAPIEN (PhysX 5), one fresh scene an episode, without any rendering.

The world is built in `sapien_world` and `sapien_robot`, and contacts are read in `sapien_contacts`.
"""

from __future__ import annotations

import math

import numpy as np

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.engines.physics.disturbance import DisturbanceForce
from bt_tasksim.engines.physics.sapien_contacts import ContactReader, Touch, resist_rolling
from bt_tasksim.engines.physics.sapien_robot import Robot, RobotBuilder
from bt_tasksim.engines.physics.sapien_world import DAMPING, World, array, build_world, floats
from bt_tasksim.engines.vulkan import use_software_driver
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

FALLING = (0.1, 1.5)
"""Speeds in m/s and rad/s of an object that the hand does not touch, from which steps are `FINE` times
shorter: a tilted object that lands spins so fast that it would be millimetres deep within one step."""
FINE = 8
ROLLING = 0.02
"""Speed in rad/s of an object that the hand does not touch, from which its supports resist rolling."""
WATCHED = 4
"""Control periods after the hand closed fast or a contact came or went, in which overlaps are looked for at
every step; at other times at the period's end."""


@register("engine/physics", "sapien")
class SapienPhysics(PhysicsEngine):
    """The physics engine on SAPIEN.

    The arm's links do not collide with one another; hands, fingers, objects and fixtures do. Links carry no
    weight, as the controllers of real arms compensate it, so the wrist's wrench needs no correction.

    Args:
        robot: The robot.

    Raises:
        MachineError: SAPIEN is not installed.
    """

    _world: World
    _robot: Robot
    _reader: ContactReader
    _touch: Touch

    def __init__(self, robot: RobotDescription) -> None:
        use_software_driver()
        try:
            import sapien  # noqa: F401  # here, so that an engine that cannot start says so at once
        except ImportError as error:
            raise MachineError(
                f"SAPIEN physics cannot start: {error}; "
                "install the simulation extra: pip install 'bt-tasksim[sim]'"
            ) from error
        self.robot = robot
        self._builder = RobotBuilder(robot)

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        robot = self.robot
        self._dt = self._last_dt = 1.0 / configuration.physics_frequency
        self._substeps = configuration.physics_frequency // configuration.control_frequency
        self._time = 0.0
        self._falling = self._rolling = False
        self._watch = 0
        self._world = build_world(configuration, robot.solver_iterations)
        start = np.array(configuration.joint_position or np.concatenate([robot.rest, robot.hand_open]))
        self._robot = self._builder.build(self._world, start)
        self._reader = ContactReader(self._world, len(robot.tips))
        self._touch = Touch(np.zeros((len(robot.tips), 3)), [], [], set())
        disturbance, names = configuration.disturbance, [actor.name for actor in configuration.objects]
        self._disturbance = DisturbanceForce(disturbance)
        self._pushed = names.index(disturbance.object) if disturbance is not None else -1
        self._n_bodies = len(configuration.objects) + len(configuration.fixtures)
        return self._state()

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """Names of the bodies that overlapped most, metres, and seconds; None before any."""
        return self._reader.deepest_pair

    # ---- running ----------------------------------------------------------------------------------------

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`."""
        self._last_dt = self._dt
        if self._robot.drive_to(target):
            self._watch = WATCHED
        step = self._world.system.step
        if not self._disturbance.over:
            for _ in range(self._substeps):
                self._disturbed_step()
        elif self._falling:
            self._fine_steps(self._substeps)
        elif self._watch > 0 or self._rolling:
            watched, self._watch = self._watch > 0, max(self._watch - 1, 0)
            for k in range(self._substeps):
                if watched and k > 0:
                    self._reader.read_depth(self._time)
                if self._rolling:
                    resist_rolling(self._world, self._last_dt, self._touch.hand_force)
                step()
        else:
            for _ in range(self._substeps):
                step()
        self._time += self._dt * self._substeps
        return self._state()

    def _fine_steps(self, n: int) -> None:
        world = self._world
        world.scene.set_timestep(self._dt / FINE)
        self._last_dt = self._dt / FINE
        for _ in range(n * FINE):
            if self._disturbance.pushing:
                self._push()
            if self._rolling:
                resist_rolling(world, self._last_dt, self._touch.hand_force)
            world.system.step()
            self._reader.read_depth(self._time)
        world.scene.set_timestep(self._dt)

    def _state(self) -> WorldState:
        robot, bodies = self._robot, self._world.objects
        q, v, effort = robot.joints()
        objects = np.array([floats(body.entity_pose) for body in bodies]).reshape(-1, 7)
        moving = [[*b.linear_velocity.tolist(), *b.angular_velocity.tolist()] for b in bodies]
        self._feel()
        self._note_motion(moving)
        return WorldState(
            time=np.float64(self._time),
            joint_position=q,
            joint_velocity=v,
            joint_effort=effort,
            tip_force=self._touch.tip_force,
            wrench=robot.wrench(),
            tool_pose=robot.tool(),
            tips=robot.tips(),
            objects=objects,
            velocities=np.array(moving).reshape(-1, 6),
        )

    def _feel(self) -> None:
        """Read what touches what; look closely for some time where that has changed."""
        before, now = self._touch, self._reader.read(self._time, self._last_dt)
        touched = [force > 0.0 for force in now.hand_force]
        if touched != [force > 0.0 for force in before.hand_force] or now.support != before.support:
            self._watch = WATCHED
        self._touch = now

    def _note_motion(self, moving: list[list[float]]) -> None:
        """See whether what the hand does not touch falls or rolls; the air alone slows what rolls no more."""
        free = [v for force, v in zip(self._touch.hand_force, moving, strict=True) if force == 0.0]
        self._falling = any(math.hypot(*v[:3]) > FALLING[0] or math.hypot(*v[3:]) > FALLING[1] for v in free)
        rolled, self._rolling = self._rolling, any(math.hypot(*v[3:]) > ROLLING for v in free)
        if rolled and not self._rolling:
            for body in self._world.objects:
                body.set_angular_damping(DAMPING)

    def hidden(self) -> Hidden:
        """See `PhysicsEngine.hidden`."""
        bodies, touch = self._world.objects, self._touch
        support = np.zeros((len(bodies), self._n_bodies), bool)
        for i, j in touch.support:
            support[i, j] = True
        return Hidden(
            time=np.float64(self._time),
            objects=np.array([array(body.entity_pose) for body in bodies]).reshape(-1, 7),
            velocities=np.array(
                [[*b.linear_velocity.tolist(), *b.angular_velocity.tolist()] for b in bodies]
            ).reshape(-1, 6),
            hand_force=np.array(touch.hand_force),
            hand_distance=np.array(touch.hand_distance),
            support=support,
            penetration=np.float64(self._reader.penetration),
            tool_pose=self._robot.tool(),
        )

    # ---- disturbance ------------------------------------------------------------------------------------

    def _disturbed_step(self) -> None:
        """One physics step, with a push that begins some time after the object was first held clear."""
        k = self._pushed
        held = self._touch.hand_force[k] > 1.0 and not any(i == k for i, _ in self._touch.support)
        self._disturbance.watch(self._time, held)
        if self._disturbance.pushing or self._falling:
            self._fine_steps(1)
        else:
            self._world.system.step()

    def _push(self) -> None:
        """Push the object until it has left the hand, no faster than the disturbance says."""
        self._feel()
        body = self._world.objects[self._pushed]
        touched = self._touch.hand_force[self._pushed] > 0.0
        force = self._disturbance.force(self._time, touched, body.linear_velocity)
        if force.any():
            body.wake_up()
            body.add_force_at_point(force.tolist(), body.entity_pose.p)
