"""One world of SAPIEN as it goes on: how finely it is stepped, when contacts are looked at, what is read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.body_contacts import BodyContacts
from bt_tasksim.engines.physics.disturbance import DisturbanceForce
from bt_tasksim.engines.physics.layout import body_column
from bt_tasksim.engines.physics.sapien_contacts import ContactReader, Touch, resist_rolling
from bt_tasksim.engines.physics.sapien_overlap import Solids
from bt_tasksim.engines.physics.sapien_phantoms import Before, Phantoms, among_meshes
from bt_tasksim.engines.physics.sapien_readings import SapienReadings
from bt_tasksim.engines.physics.sapien_robot import Robot
from bt_tasksim.engines.physics.sapien_sinking import Sinking
from bt_tasksim.engines.physics.sapien_world import DAMPING, PARTING, World, floats
from bt_tasksim.engines.physics.threaded import FALLING
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.shapes import BallPiece

if TYPE_CHECKING:
    import sapien
    from sapien import physx

FLYING = 8
"""How many times shorter steps are while something moves that the hand does not hold, or that it lets go of:
a throw's path is off by 4 mm after a second in steps of 1.25 ms, and by 30 in those of 10."""
STRIDE = 6e-4
"""Metres that its surface goes in one step, at most, where it is within PhysX's reach of something else than
the robot: a book that lands flat at 2.2 m/s sinks in by 3.3 mm in steps of 1.4 mm, and by 1.1 mm in half of
those."""
BALLS = 0.3
"""Speed in m/s of a ball up to which steps are not shorter for it: where it meets something is known exactly,
and it goes 3 mm in a step, which is PhysX's reach. What is carried in a vessel is that fast."""
PARTING_FINELY = 0.1
"""As `PARTING`, in the shorter steps: PhysX leaves bodies the speed at which it parts them, and they jump."""
CLOSING = 2
"""How many times shorter they are while the hand closes fast, and `WATCHED` periods on: the fingers of the
Ability hand, each a kilogram with its motor's inertia, meet on the stick of a ladle and sink in by 2.8 mm at
100 Hz, and by 1.0 at 200. Not for as long as something is held: twice the steps would cost twice the time."""
SLIGHT, LIGHTEST = 0.05, 4
"""Kilograms below which they are shorter by as much as something is lighter, and by how much at most, while
the hand closes, however slowly, and as long as it holds something: the solver alone does not do enough there.
At 100 Hz a jaw of the SO-100 that presses with 30 N on a cup of 12 g sinks in by 2 mm as this leaves the
table; and of 40 tasks with things of 10 to 50 g 37 are done with shorter steps at closing, and 33 with up to
250 iterations instead."""
ROLLING = 0.02
"""Speed in rad/s of an object that the hand does not touch, from which its supports resist rolling."""
NEAR = 0.15
"""Metres from the tool to an object's surface within which the hand may touch it in the next period."""
WATCHED = 4
"""Control periods from the beginning, and after the hand closed fast or a contact came or went, in which
overlaps are looked for at every step; at other times at the period's end."""


class SapienWorld:
    """A world of SAPIEN, see `bt_tasksim.engines.physics.threaded.SimulatedWorld`.

    Args:
        world: The world, with its robot.
        robot: The robot in it.
        configuration: What was drawn.
        n_tips: Number of fingertips.
        readings: Where its readings are written.
        row: In which row.

    Attributes:
        world: The world.
        robot: The robot in it.
    """

    def __init__(
        self,
        world: World,
        robot: Robot,
        configuration: ActorConfiguration,
        n_tips: int,
        readings: SapienReadings,
        row: int,
    ) -> None:
        self.world, self.robot = world, robot
        self.n_objects, self.n_fixtures = len(configuration.objects), len(configuration.fixtures)
        self._dt = self._last_dt = 1.0 / configuration.physics_frequency
        self._substeps = configuration.physics_frequency // configuration.control_frequency
        self._time = 0.0
        self._falling = self._rolling = self._asleep = False
        self._watch, self._letting_go, self._closing, self._shorter = WATCHED, 0, 0, 1
        self._lights = [min(math.ceil(SLIGHT / actor.mass), LIGHTEST) for actor in configuration.objects]
        self._light = max(self._lights, default=1)
        self._reader = ContactReader(world, n_tips)
        self._touch = self._reader.nothing
        self._readings, self._row = readings, row
        self._written: Touch | None = None
        self._felt: list[Array] = []  # newtons and newton metres, times seconds
        disturbance, names = configuration.disturbance, [actor.name for actor in configuration.objects]
        articulation, self._twist = robot.articulation, robot.twist
        self._joints = (
            articulation.get_qpos,
            articulation.get_qvel,
            articulation.get_link_incoming_joint_forces,
        )
        self._frames = [link.get_entity_pose for link in robot.frames]
        self._hand = [body for body, (kind, _) in world.bodies.items() if kind == "hand"]
        self._solids: Solids = {}
        self._phantoms, self._near = Phantoms(world, self._solids, articulation, robot.arm), list[int]()
        self._jointed = {k for k, actor in enumerate(configuration.objects) if actor.joint is not None}
        meshes = [k for k in among_meshes(world) if k not in self._jointed]
        self._watched = [(k, world.radius[k] + NEAR) for k in meshes]
        self._disturbance = DisturbanceForce(disturbance)
        self._balls = {
            k
            for k, actor in enumerate(configuration.objects)
            if all(isinstance(piece, BallPiece) for piece in actor.shape().collision)
        }
        self._pushed = names.index(disturbance.object) if disturbance is not None else -1

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        return self._reader.deepest_pair

    def drive_to(self, position: list[float], velocity: list[float]) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        hand = self.robot.drive_to(position, velocity)
        if hand.opens:
            self._twist.let_go()
        if hand.fast:
            self._watch = WATCHED
        if hand.fast and hand.opens and any(self._touch.hand_force):
            self._letting_go = WATCHED
        elif hand.opens is False and (hand.fast or self._light > 1):
            self._closing, self._shorter = WATCHED, max(self._light, CLOSING if hand.fast else 1)

    def advance(self) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        free = [force == 0.0 or self._letting_go > 0 for force in self._touch.hand_force]
        loose = self._falling or self._rolling or self._letting_go > 0
        shorter = self._shorter if self._closing else 1
        watched = self._falling or self._letting_go > 0 or self._watch > 0
        self._letting_go, self._closing = max(self._letting_go - 1, 0), max(self._closing - 1, 0)
        self._watch = max(self._watch - 1, 0)
        self._felt = []
        for k in range(self._substeps):
            last = k + 1 == self._substeps
            # What rocks to and fro is slow where it turns, and lands before the period ends.
            moving = self._moving(free) if loose else []
            if not self._disturbance.over and self._disturbs():
                moving.append(self._pushed)
            if moving:
                self._fine_steps(moving, last)
            else:
                # What lies as it was read has been looked at then.
                self._usual_steps(shorter, watched, watched and k > 0, last)
        self._time += self._dt * self._substeps

    def _usual_steps(self, shorter: int, watched: bool, anew: bool, last: bool) -> None:
        """One of the scene's steps, in so many equal ones; in the last one of a period the wrist feels."""
        self._last_dt = self._dt / shorter
        if shorter > 1:
            self.world.scene.set_timestep(self._last_dt)
        if anew or self._rolling:
            self._look_down()
        for _ in range(shorter):
            self._step(self._last_dt, watched or last)
            if shorter > 1 and last:
                self._feel_wrist()
        if shorter > 1:
            self.world.scene.set_timestep(self._dt)

    def _feel_wrist(self) -> None:
        """Remember what the joints bear in one of the shorter steps that make up a usual one.

        What a hard blow gives in a quarter of a step is four times the force that a sensor feels over it.
        """
        self._felt.append(self._last_dt * self._joints[2]())

    def _look_down(self) -> None:
        """See how deep things are in each other, and slow down what rolls."""
        lying = self._reader.read_depth(self._time)
        if self._rolling:
            resist_rolling(self.world, lying, self._last_dt, self._touch.hand_force)

    def _step(self, seconds: float, looked_at: bool = True) -> None:
        """One step of PhysX so long, with what it does not know; contacts are looked at after it, or not."""
        if self._twist.holds:
            self._twist.resist(seconds)
        for part in self.world.jointed:
            part.act(seconds)
        before = self._phantoms.look(self._near)
        self._reader.before = self._places(before) if looked_at and before else {}
        self.world.system.step()
        self._phantoms.undo(before, seconds)

    def _places(self, near: Sequence[Before]) -> dict[physx.PhysxRigidBaseComponent, sapien.Pose]:
        """Where these objects and the hand's links are before a step."""
        found = {self.world.objects[each.which]: each.pose for each in near}
        return found | {link: link.entity_pose for link in self._hand}

    def _fine_steps(self, moving: list[int], last: bool) -> None:
        """One of the scene's steps, in shorter ones while these objects move; see `_usual_steps`."""
        world, reader = self.world, self._reader
        for body in world.objects:
            body.set_max_depenetration_velocity(PARTING_FINELY)
        sinking = Sinking(world, moving, self._solids)
        for _ in range(FLYING):
            self._look_down()
            way = max(self._speed(k) for k in moving) * self._dt / FLYING
            finer = max(1, math.ceil(way / STRIDE)) if reader.within_reach(moving) else 1
            self._last_dt = self._dt / (FLYING * finer)
            world.scene.set_timestep(self._last_dt)
            for _ in range(finer):
                if self._disturbance.pushing:
                    self._push()
                sinking.stop(2.0 * way / finer)
                self._phantoms.forget()
                self._step(self._last_dt)
                if last:
                    self._feel_wrist()
        for body in world.objects:
            body.set_max_depenetration_velocity(PARTING)
        world.scene.set_timestep(self._dt)

    def _speed(self, which: int) -> float:
        """Metres a second of an object's surface, at most."""
        body = self.world.objects[which]
        linear, angular = body.linear_velocity.tolist(), body.angular_velocity.tolist()
        return math.hypot(*linear) + math.hypot(*angular) * self.world.radius[which]

    def _moving(self, free: Sequence[bool]) -> list[int]:
        """Those objects of free ones that move so fast that steps have to be finer."""
        found = []
        for k, body in enumerate(self.world.objects):
            if free[k] and k not in self._jointed:
                linear, angular = body.linear_velocity.tolist(), body.angular_velocity.tolist()
                speed = math.hypot(*linear)
                if speed > (BALLS if k in self._balls else FALLING[0]) or (
                    math.hypot(*angular) > FALLING[1] and k not in self._balls
                ):
                    found.append(k)
        return found

    # ---- reading ----------------------------------------------------------------------------------------

    def read(self) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        out, row, bodies = self._readings, self._row, self.world.objects
        slept, self._asleep = self._asleep, all(body.is_sleeping for body in bodies)
        still = slept and self._asleep
        self._feel(still)
        if self._touch is not self._written:
            self._write_touch()
        position, velocity, incoming = self._joints
        out.time[row], out.penetration[row] = self._time, self._reader.penetration
        out.position[row], out.velocity[row] = position(), velocity()
        if not self._reader.made_up:  # what is not there is not felt
            out.incoming[row] = sum(self._felt) / self._dt if self._felt else incoming()
        out.frames[row] = [floats(pose()) for pose in self._frames]
        if not still:
            for k, body in enumerate(bodies):
                out.objects[row, k] = floats(body.entity_pose)
                out.linear[row, k], out.angular[row, k] = body.linear_velocity, body.angular_velocity
        tool, places = out.frames[row, 0, :3], out.objects[row]
        self._near = [k for k, way in self._watched if math.dist(places[k, :3], tool) < way]

    def contact_points(self) -> BodyContacts:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        return self._reader.points()

    def _write_touch(self) -> None:
        out, row, n, now, before = self._readings, self._row, self.n_objects, self._touch, self._written
        if before is None:
            out.clear(row)
        out.tip_force[row] = now.tip_force
        out.hand_force[row, :n], out.hand_distance[row, :n] = now.hand_force, now.hand_distance
        if before is None or now.support != before.support:
            support = out.support[row]
            support[:] = False
            for i, j in now.support:
                support[i, body_column(j, n, len(support))] = True
        self._written = now

    def _feel(self, asleep: bool = False) -> None:
        """Read what touches what; look closely for some time where that has changed."""
        before, now = self._touch, self._reader.read(self._time, self._last_dt, asleep)
        if now.touched != before.touched or now.support != before.support:
            self._watch = WATCHED
        self._touch = now
        light = max((n for n, f in zip(self._lights, now.hand_force, strict=True) if f), default=1)
        if light > 1:
            self._shorter = max(self._shorter, light) if self._closing else light
            self._closing = max(self._closing, 1)
        self._twist.look(now.tip_force, now.hand_force)
        self.robot.solving.look(now.hand_force)

    def note_motion(self, falling: bool, spin: float) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`; air alone slows what rolls no more."""
        self._falling = falling
        rolled, self._rolling = self._rolling, spin > ROLLING
        if rolled and not self._rolling:
            for body in self.world.objects:
                body.set_angular_damping(DAMPING)

    # ---- disturbance ------------------------------------------------------------------------------------

    def _disturbs(self) -> bool:
        """An object is pushed now: from some time after it was first held clear."""
        k = self._pushed
        held = self._touch.hand_force[k] > 1.0 and not any(i == k for i, _ in self._touch.support)
        self._disturbance.watch(self._time, held)
        return self._disturbance.pushing

    def _push(self) -> None:
        """Push the object until it has left the hand, no faster than the disturbance says."""
        self._feel()
        body = self.world.objects[self._pushed]
        touched = self._touch.hand_force[self._pushed] > 0.0
        force = self._disturbance.force(self._time, touched, body.linear_velocity)
        if force.any():
            body.wake_up()
            body.add_force_at_point(force.tolist(), body.entity_pose.p)
