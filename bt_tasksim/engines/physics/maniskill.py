"""Physics by an environment of ManiSkill, which brings its world and says itself what success is.

What its things are called stands in one file for each environment (`bt_tasksim.engines.maniskill.schema`).
"""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.engines.base import EngineSetup, PhysicsEngine, RenderingEngine
from bt_tasksim.engines.maniskill.draw import DrawnActor, body_of, configuration, things
from bt_tasksim.engines.maniskill.environment import Environment
from bt_tasksim.engines.maniskill.files import bundled, environment_of
from bt_tasksim.engines.maniskill.rendering import ManiSkillRendering
from bt_tasksim.engines.maniskill.robot import EnvironmentRobot
from bt_tasksim.engines.maniskill.verdict import verdict
from bt_tasksim.engines.maniskill.world import EnvironmentWorld, environment_seed
from bt_tasksim.engines.physics.sapien_contacts import ContactReader, Touch
from bt_tasksim.engines.physics.sapien_world import World
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.scene.success import Verdict

SAME_WORLD = 1e-4
"""Metres and parts of a quaternion by which a world drawn again may differ from itself."""


@register("engine/physics", "maniskill")
class ManiSkillPhysics(PhysicsEngine):
    """The physics engine on an environment of ManiSkill, one world on the CPU.

    The arm is moved by ManiSkill's controller of joint positions, at its rate. Contacts, wrench and hidden
    state mean what they mean in `bt_tasksim.engines.physics.sapien`.

    Args:
        robot: The robot.
        environment: Id of the environment, or path of its file.

    Raises:
        InputError: There is no such environment, or its file does not name the robot.
    """

    _robot: EnvironmentRobot
    _things: dict[str, DrawnActor]
    _reader: ContactReader
    _touch: Touch

    def __init__(self, robot: RobotDescription, environment: str) -> None:
        self.robot = robot
        self.world = EnvironmentWorld(environment, str(robot.source))
        self._environment: Environment | None = None
        self._drawn = False
        self._scene: Any = None
        self._configuration: ActorConfiguration | None = None

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`."""
        return cls(robot, environment_of(setup.name))

    @classmethod
    def check_name(cls, name: str) -> None:
        """See `Engine.check_name`: the name of an environment follows."""
        environment_of(name)

    @classmethod
    def in_logs(cls, name: str) -> bool:
        """See `Engine.in_logs`: an environment whose file is bundled."""
        return environment_of(name) in bundled()

    @classmethod
    def own_world(cls, name: str) -> WorldSource:
        """See `PhysicsEngine.own_world`."""
        return EnvironmentWorld(environment_of(name))

    def worlds(self, scene: WorldSource) -> WorldSource:
        """See `PhysicsEngine.worlds`.

        Raises:
            InputError: The scene is another one, or the environment is none for this robot.
            MachineError: ManiSkill does not start on this machine.
        """
        if not isinstance(scene, EnvironmentWorld) or scene.file != self.world.file:
            raise InputError(
                f"ManiSkill's '{self.world.name}' brings its own world, which is no '{scene.name}': "
                "name no scene"
            )
        self._open()
        return scene.drawn_by(lambda seed, stream: self._draw(seed, stream, scene.robot))

    def rendering(self) -> RenderingEngine:
        """See `PhysicsEngine.rendering`: ManiSkill's own pictures, for which it is opened otherwise."""
        if not self._drawn:
            self.close()
        self._drawn = True
        return ManiSkillRendering(self.robot, self._open, lambda: poses.inverse(self._robot.to_base))

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`.

        Raises:
            InputError: The world is none of this environment's draws.
        """
        c = configuration
        physics, control = self._open().frequencies
        self._begin(environment_seed(c.seed, c.stream))
        objects = [thing.pose(self._robot.to_base) for thing in self._things.values()]
        same = (
            c.disturbance is None
            and [actor.name for actor in c.objects] == list(self._things)
            and np.allclose([actor.pose for actor in c.objects], objects, rtol=0.0, atol=SAME_WORLD)
        )
        if not same:
            raise InputError(
                f"ManiSkill's '{self.world.name}' draws its worlds by seed, and seed {c.seed} does not "
                "give the one that was asked for"
            )
        self._time, self._period, self._step = 0.0, 1.0 / control, 1.0 / physics
        world = World(self._open().base.scene.sub_scenes[0], self._open().base.scene.px)
        world.bodies.update(self._robot.bodies)
        for k, thing in enumerate(self._things.values()):
            world.bodies[thing.body] = ("object", k)
            world.objects.append(thing.body)
        n = len(self._things)
        for k, (name, entry) in enumerate(self.world.file.fixture_entries.items()):
            world.bodies[body_of(self._open().actor(entry.actor or name))] = ("fixture", n + k)
        self._n_bodies = n + len(self.world.file.fixtures)
        self._reader = ContactReader(world, len(self.robot.tips), skin=0.0)
        self._touch = self._reader.nothing
        self._configuration = c
        return self._state(np.zeros(6))  # SAPIEN's sensor still has the force of the last episode's last step

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`."""
        assert self._environment is not None
        self._environment.step(self._robot.action(target))
        self._time += self._period
        self._touch = self._reader.read(self._time, self._step)
        return self._state(self._robot.wrench())

    def hidden(self) -> Hidden:
        """See `PhysicsEngine.hidden`."""
        state, touch = self._now, self._touch
        assert state.objects is not None and state.velocities is not None
        support = np.zeros((len(self._things), self._n_bodies), bool)
        for i, j in touch.support:
            support[i, j] = True
        return Hidden(
            time=state.time,
            objects=state.objects.copy(),
            velocities=state.velocities.copy(),
            hand_force=np.array(touch.hand_force),
            hand_distance=np.array(touch.hand_distance),
            support=support,
            penetration=np.float64(self._reader.penetration),
            tool_pose=state.tool_pose.copy(),
        )

    def verdict(self) -> Verdict:
        """See `PhysicsEngine.verdict`: the environment's own ``evaluate`` of this instant."""
        return verdict(
            self.world.name, self._open().evaluate(), self._distance(), float(self._reader.penetration)
        )

    def close(self) -> None:
        """See `Engine.close`."""
        if self._environment is not None:
            self._environment.close()
            self._environment = self._scene = None

    # ---- inside -----------------------------------------------------------------------------------------

    def _open(self) -> Environment:
        if self._environment is None:
            self._environment = Environment(self.world.file, self.world.agent, self._drawn)
        return self._environment

    def _begin(self, seed: int) -> None:
        """Reset the environment, and find its things where it has built its scene anew."""
        environment = self._open()
        environment.reset(seed)
        if environment.base.scene is not self._scene:
            self._scene = environment.base.scene
            self._robot = EnvironmentRobot(environment, self.robot)
            self._things = things(environment)
        self._robot.begin()

    def _draw(self, seed: int, stream: str, robot: str) -> ActorConfiguration:
        self._begin(environment_seed(seed, stream))
        here = self._robot
        return configuration(self._open(), robot, here.to_base, here.position(), seed, stream)

    def _state(self, wrench: Array) -> WorldState:
        robot = self._robot
        q, v, effort = robot.joints()
        turn = robot.to_base[3:]
        velocities = [
            [
                *poses.rotate(turn, np.asarray(thing.body.linear_velocity, float)),
                *poses.rotate(turn, np.asarray(thing.body.angular_velocity, float)),
            ]
            for thing in self._things.values()
        ]
        self._now = WorldState(
            time=np.float64(self._time),
            joint_position=q,
            joint_velocity=v,
            joint_effort=effort,
            tip_force=poses.rotate(turn, np.array(self._touch.tip_force).reshape(-1, 3)),
            wrench=wrench,
            tool_pose=robot.tool(),
            tips=robot.tips(),
            objects=np.array([t.pose(robot.to_base) for t in self._things.values()]).reshape(-1, 7),
            velocities=np.array(velocities).reshape(-1, 6),
        )
        return self._now

    def _distance(self) -> tuple[str, str, float] | None:
        """How far an object is from where it would stand on a place, where the environment's file asks."""
        asked, c = self.world.file.distance, self._configuration
        if asked is None or c is None:
            return None
        k = next(i for i, actor in enumerate(c.objects) if actor.name == asked.object)
        place = next(place for place in c.places if place.name == asked.place)
        stands = poses.transform(place.pose, np.array([0.0, 0.0, c.objects[k].size[2] / 2]))
        assert self._now.objects is not None
        return asked.object, asked.place, float(np.linalg.norm(self._now.objects[k, :3] - stands))
