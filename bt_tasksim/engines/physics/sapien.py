"""Physics by SAPIEN (PhysX 5), one fresh scene an episode, without any rendering."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bt_tasksim import poses
from bt_tasksim.engines.disturbance import Knock
from bt_tasksim.engines.urdf_links import links_below, load_links
from bt_tasksim.engines.urdf_visuals import load_collisions
from bt_tasksim.engines.vulkan import use_software_driver
from bt_tasksim.errors import MachineError
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.scene import ActorConfiguration
from bt_tasksim.shapes import BoxPiece
from bt_tasksim.world import Hidden, JointTarget, WorldState

CONTACT_OFFSET = {"robot": 0.001, "object": 0.003, "fixture": 0.027}
"""Metres by body; PhysX looks for contacts of two bodies within the sum of theirs. It must exceed what a
falling object covers in one step (2.2 m/s after 25 cm: 22 mm), or the object is stopped only inside."""
SKIN = 5e-4
"""Metres at which what touches the hand comes to rest before it. PhysX knows the exact distance of bodies
that are apart; of bodies that overlap, where edge meets edge, its estimate is now and then wrong by
millimetres for one step, and kicks what is light."""
FALLING = (0.1, 1.5)
"""Speeds in m/s and rad/s of an object that the hand does not touch, from which steps are `FINE` times
shorter: a tilted object that lands spins so fast that it would be millimetres deep within one step."""
FINE = 8
WATCHED = 4
"""Control periods after the hand closed fast or a contact came or went, in which overlaps are looked for at
every step; at other times at the period's end."""
FAST = 0.6
"""Share of the hand's own speed from which it closes fast."""
TOUCH_DISTANCE = 0.002
"""Metres of separation beyond which a contact of PhysX carries no force and counts for nothing."""
SUPPORT_DISTANCE = 5e-4
"""Metres of separation within which two bodies touch."""

_ROBOT = ("arm", "hand")
_ARM_BIT = 1 << 8  # shapes that share a bit of group 2 do not collide with each other


class SapienPhysics:
    """The physics engine on SAPIEN.

    The arm's links do not collide with one another; hands, fingers, objects and fixtures do. Links carry no
    weight, as the controllers of real arms compensate it, so the wrist's wrench needs no correction.

    Args:
        robot: The robot.

    Raises:
        MachineError: SAPIEN is not installed.
    """

    def __init__(self, robot: RobotDescription) -> None:
        use_software_driver()
        try:
            import sapien
            import sapien.physx as physx
        except ImportError as error:
            raise MachineError(
                f"SAPIEN physics cannot start: {error}; "
                "install the simulation extra: pip install 'bt-tasksim[sim]'"
            ) from error
        self._sapien = sapien
        self._physx = physx
        self.robot = robot
        self._scene: Any = None
        self._builder: Any = None

    # ---- building ---------------------------------------------------------------------------------------

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        sapien, physx = self._sapien, self._physx
        physx.set_scene_config(enable_enhanced_determinism=False, bounce_threshold=2.0)
        physx.set_body_config(
            solver_position_iterations=self.robot.solver_iterations, solver_velocity_iterations=0
        )
        physx.set_shape_config(contact_offset=CONTACT_OFFSET["object"], rest_offset=0.0)
        physx.set_default_material(0.5, 0.5, 0.0)
        self._system = physx.PhysxCpuSystem()
        self._scene = sapien.Scene([self._system])
        self._scene.set_timestep(1.0 / configuration.physics_frequency)
        self._dt = 1.0 / configuration.physics_frequency
        self._substeps = configuration.physics_frequency // configuration.control_frequency
        self._time = 0.0
        self._materials: dict[float, Any] = {}
        self._bodies: dict[Any, tuple[str, int]] = {}
        self._keep: list[Any] = []
        self._penetration = 0.0
        self.deepest_pair: tuple[str, str, float, float] | None = None
        self._falling = False
        self._watch = 0
        self._touched: list[bool] = []
        self._support: set[tuple[int, int]] = set()
        self._last_dt = self._dt
        self._build_fixtures(configuration)
        self._build_objects(configuration)
        self._build_robot(configuration)
        disturbance, names = configuration.disturbance, [actor.name for actor in configuration.objects]
        self._knock = Knock(disturbance)
        self._knocked = names.index(disturbance.object) if disturbance is not None else -1
        self._n_bodies = len(configuration.objects) + len(configuration.fixtures)
        return self._state()

    def _material(self, friction: float) -> Any:
        if friction not in self._materials:
            self._materials[friction] = self._physx.PhysxMaterial(friction, friction, 0.0)
        return self._materials[friction]

    def _pose(self, pose: Any) -> Any:
        p = [float(v) for v in pose]
        return self._sapien.Pose(p[:3], p[3:])

    def _build_fixtures(self, configuration: ActorConfiguration) -> None:
        n = len(configuration.objects)
        for k, fixture in enumerate(configuration.fixtures):
            body = self._physx.PhysxRigidStaticComponent()
            for box in fixture.boxes:
                shape = self._physx.PhysxCollisionShapeBox(
                    [s / 2 for s in box.size], self._material(box.friction)
                )
                shape.set_local_pose(self._pose(box.pose))
                shape.set_contact_offset(CONTACT_OFFSET["fixture"])
                body.attach(shape)
            self._add(body, fixture.name, fixture.pose)
            self._bodies[body] = ("fixture", n + k)

    def _build_objects(self, configuration: ActorConfiguration) -> None:
        self._objects: list[Any] = []
        for k, actor in enumerate(configuration.objects):
            geometry = actor.shape()
            body = self._physx.PhysxRigidDynamicComponent()
            material = self._material(actor.friction)
            for piece in geometry.collision:
                if isinstance(piece, BoxPiece):
                    shape = self._physx.PhysxCollisionShapeBox(list(piece.half_size), material)
                    shape.set_local_pose(self._pose(piece.pose))
                else:
                    vertices = np.asarray(piece.vertices, np.float32)
                    shape = self._physx.PhysxCollisionShapeConvexMesh(vertices, [1.0, 1.0, 1.0], material)
                body.attach(shape)
            body.set_mass(actor.mass)
            body.set_cmass_local_pose(self._pose(geometry.mass.pose))
            body.set_inertia([float(v) * actor.mass for v in geometry.mass.inertia])
            body.set_max_depenetration_velocity(1.0)
            self._add(body, actor.name, actor.pose)
            self._bodies[body] = ("object", k)
            self._objects.append(body)

    def _add(self, body: Any, name: str, pose: Any) -> None:
        entity = self._sapien.Entity()
        entity.name = name
        entity.add_component(body)
        entity.set_pose(self._pose(pose))
        self._scene.add_entity(entity)
        self._keep.append(entity)

    def _articulation_builder(self) -> Any:
        """The robot's builder; reading the URDF takes milliseconds, so it is read once an engine.

        Frames at a robot's ends, fixed links that nothing can touch, are left out: PhysX would move them.
        """
        if self._builder is None:
            robot = self.robot
            load_collisions(robot.urdf)  # an InputError where a mesh is missing; SAPIEN goes on without it
            loader = self._scene.create_urdf_loader()
            loader.fix_root_link = True
            self._builder = loader.parse(str(robot.urdf))[0][0]
            links = self._builder.link_builders
            for link in links:
                link.visual_records.clear()
            needed = {robot.base_link, robot.wrist_link, *robot.pad_links}
            needed |= {tip.links[0] for tip in robot.tips}
            self._tool_frame = (robot.tool_link, robot.tool_pose)
            while ends := [link for link in links if link.name not in needed and _is_end(link, links)]:
                for link in ends:
                    if link.name == self._tool_frame[0]:
                        joint = link.joint_record
                        frame = poses.multiply(
                            _array(joint.pose_in_parent), poses.inverse(_array(joint.pose_in_child))
                        )
                        self._tool_frame = (link.parent.name, poses.multiply(frame, self._tool_frame[1]))
                links = [link for link in links if link not in ends]
            for index, link in enumerate(links):
                link.index = index
            self._builder.link_builders = links
        return self._builder

    def _build_robot(self, configuration: ActorConfiguration) -> None:
        robot = self.robot
        articulation = self._articulation_builder().set_scene(self._scene).build()
        self._articulation = articulation
        links = {link.name: link for link in articulation.get_links()}
        self._links = links
        pads = self._physx.PhysxMaterial(robot.pads.friction, robot.pads.friction, 0.0)
        hand = links_below(load_links(robot.urdf), robot.wrist_link)
        tip_of = {name: i for i, tip in enumerate(robot.tips) for name in tip.links}
        base = links[robot.base_link]
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
            kind = "base" if link is base else ("hand" if in_hand else "arm")
            self._bodies[link] = (kind, tip_of.get(name, -1))
        joints = {joint.name: joint for joint in articulation.get_active_joints()}
        order = [joint.name for joint in articulation.get_active_joints()]
        self._joints = [joints[name] for name in robot.joints]
        self._index = np.array([order.index(name) for name in robot.joints])
        n_arm = len(robot.arm_joints)
        gains = [robot.drive_array(what).tolist() for what in ("stiffness", "damping", "force_limit")]
        self._gains = gains
        for i, joint in enumerate(self._joints):
            drive = robot.arm_drive if i < n_arm else robot.hand_drive
            joint.set_friction(0.1 if i < n_arm else 0.0)
            joint.set_armature([drive.armature])
            joint.set_drive_properties(gains[0][i], gains[1][i], force_limit=gains[2][i], mode="force")
        start = np.array(configuration.joint_position or np.concatenate([robot.rest, robot.hand_open]))
        q = np.zeros(len(order), np.float32)
        q[self._index] = start
        articulation.set_qpos(q)
        self._asked = [(value, 0.0) for value in start.tolist()]
        span = np.abs(robot.hand_closed - robot.hand_open)
        self._n_arm = n_arm
        self._fast = np.where(span > 0.0, FAST * robot.hand_speed * span, np.inf).tolist()
        for joint, value in zip(self._joints, start, strict=True):
            joint.set_drive_target(float(value))
            joint.set_drive_velocity_target(0.0)
        self._tool_link, self._tool_pose = links[self._tool_frame[0]], self._tool_frame[1].tolist()
        self._wrist = [link.name for link in articulation.get_links()].index(robot.wrist_link)
        wrist = links[robot.wrist_link]
        joint = next(j for j in articulation.get_joints() if j.child_link == wrist)
        self._tool_identity = bool(np.array_equal(self._tool_pose, [0, 0, 0, 1, 0, 0, 0]))
        frame = poses.multiply(_array(wrist.entity_pose), _array(joint.pose_in_child))
        in_joint = poses.multiply(poses.inverse(frame), self._tool())
        self._lever = in_joint[:3].tolist()
        self._to_tool = [0.0, 0.0, 0.0, *(in_joint[3:] * _CONJUGATE).tolist()]
        self._tips = [(links[tip.links[0]], list(tip.point)) for tip in robot.tips]

    # ---- running ----------------------------------------------------------------------------------------

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`."""
        self._last_dt = self._dt
        asked = list(zip(target.position.tolist(), target.velocity.tolist(), strict=True))
        if asked != self._asked:
            for joint, now, before in zip(self._joints, asked, self._asked, strict=True):
                if now != before:
                    joint.set_drive_target(now[0])
                    joint.set_drive_velocity_target(now[1])
            if any(abs(v) > fast for (_, v), fast in zip(asked[self._n_arm :], self._fast, strict=True)):
                self._watch = WATCHED
            self._asked = asked
        if not self._knock.over:
            for _ in range(self._substeps):
                self._disturbed_step()
        elif self._falling:
            self._fine_steps(self._substeps)
        elif self._watch > 0:
            self._watch -= 1
            for k in range(self._substeps):
                if k > 0:
                    self._read_depth()
                self._system.step()
        else:
            step = self._system.step
            for _ in range(self._substeps):
                step()
        self._time += self._dt * self._substeps
        return self._state()

    def _read_depth(self) -> None:
        """Remember the deepest overlap, also between the ends of periods: fingers close within one."""
        for contact in self._system.get_contacts():
            deepest = -min([point.separation for point in contact.points])
            if deepest > self._penetration:
                kinds = [self._bodies.get(body, ("none", 0))[0] for body in contact.bodies]
                if "base" not in kinds:
                    self._penetration = deepest
                    self.deepest_pair = (*(b.entity.name for b in contact.bodies), deepest, self._time)

    def _fine_steps(self, n: int) -> None:
        self._scene.set_timestep(self._dt / FINE)
        self._last_dt = self._dt / FINE
        for _ in range(n * FINE):
            if self._knock.pushing:
                self._push()
            self._system.step()
            self._read_depth()
        self._scene.set_timestep(self._dt)

    def _state(self) -> WorldState:
        articulation = self._articulation
        q, v = articulation.get_qpos()[self._index].tolist(), articulation.get_qvel()[self._index].tolist()
        # The drives' own law; SAPIEN reports no effort of drives.
        effort = [
            max(min(k * (to - x) + d * (speed - u), limit), -limit)
            for k, d, limit, x, u, (to, speed) in zip(*self._gains, q, v, self._asked, strict=True)
        ]
        tool = self._tool()
        tips = np.array([poses.point(_list(link.entity_pose), point) for link, point in self._tips])
        objects = np.array([_list(body.entity_pose) for body in self._objects]).reshape(-1, 7)
        moving = [[*b.linear_velocity.tolist(), *b.angular_velocity.tolist()] for b in self._objects]
        velocities = np.array(moving).reshape(-1, 6)
        self._read_contacts()
        self._falling = any(
            force == 0.0 and (math.hypot(*v[:3]) > FALLING[0] or math.hypot(*v[3:]) > FALLING[1])
            for force, v in zip(self._hand_force, moving, strict=True)
        )
        return WorldState(
            time=np.float64(self._time),
            joint_position=np.array(q),
            joint_velocity=np.array(v),
            joint_effort=np.array(effort),
            tip_force=self._tip_force,
            wrench=self._wrench(),
            tool_pose=tool,
            tips=tips,
            objects=objects,
            velocities=velocities,
        )

    def _wrench(self) -> Array:
        """External wrench at the tool, from the wrist joint's incoming force.

        SAPIEN reports the force that the wrist's parent exerts on it in the joint's frame, which may be
        turned against the link's; at rest the world's force on the hand is its opposite. Moments are moved
        to the tool origin: t' = t - r x f.
        """
        x, y, z, u, v, w = self._articulation.get_link_incoming_joint_forces()[self._wrist].tolist()
        rx, ry, rz = self._lever
        moment = [ry * z - rz * y - u, rz * x - rx * z - v, rx * y - ry * x - w]
        frame = self._to_tool
        return np.array([*poses.point(frame, [-x, -y, -z]), *poses.point(frame, moment)])

    def _tool(self) -> Array:
        tool = _list(self._tool_link.entity_pose)
        return np.array(tool if self._tool_identity else poses.composed(tool, self._tool_pose))

    def _read_contacts(self) -> None:
        n = len(self._objects)
        tip_force = np.zeros((len(self.robot.tips), 3))
        hand_force = [0.0] * n
        distance = [math.inf] * n
        support: set[tuple[int, int]] = set()
        rate = 1.0 / self._last_dt
        deepest = self._penetration
        for contact in self._system.get_contacts():
            a, b = contact.bodies
            kind_a, i = self._bodies.get(a, ("none", 0))
            kind_b, j = self._bodies.get(b, ("none", 0))
            if kind_a == "base" or kind_b == "base":
                continue
            points = contact.points
            separation = min([point.separation for point in points])
            if separation > TOUCH_DISTANCE:
                continue
            if -separation > deepest:
                deepest = -separation
                self.deepest_pair = (a.entity.name, b.entity.name, -separation, self._time)
            if kind_b in _ROBOT:
                a, b, kind_a, kind_b, i, j, sign = b, a, kind_b, kind_a, j, i, -rate
            else:
                sign = rate
            if kind_a not in _ROBOT:  # what stands on what needs no forces
                if separation < SUPPORT_DISTANCE:
                    if kind_a == "object":
                        support.add((i, j))
                    if kind_b == "object":
                        support.add((j, i))
                continue
            x = y = z = 0.0
            for point in points:
                px, py, pz = point.impulse.tolist()
                x, y, z = x + px, y + py, z + pz
            x, y, z = x * sign, y * sign, z * sign  # the impulse acts on the first body
            if kind_a == "hand" and i >= 0:
                tip_force[i] += (x, y, z)
            if kind_b == "hand" and j >= 0:
                tip_force[j] -= (x, y, z)
            if kind_b == "object":
                hand_force[j] += math.sqrt(x * x + y * y + z * z)
                distance[j] = min(distance[j], max(separation - SKIN, 0.0))
        self._tip_force = tip_force
        touched = [force > 0.0 for force in hand_force]
        if touched != self._touched or support != self._support:
            self._watch = WATCHED
        self._touched, self._support = touched, support
        self._hand_force, self._hand_distance = hand_force, distance
        self._penetration = deepest

    def hidden(self) -> Hidden:
        """See `PhysicsEngine.hidden`."""
        support = np.zeros((len(self._objects), self._n_bodies), bool)
        for i, j in self._support:
            support[i, j] = True
        return Hidden(
            time=np.float64(self._time),
            objects=np.array([_array(body.entity_pose) for body in self._objects]).reshape(-1, 7),
            velocities=np.array(
                [[*b.linear_velocity.tolist(), *b.angular_velocity.tolist()] for b in self._objects]
            ).reshape(-1, 6),
            hand_force=np.array(self._hand_force),
            hand_distance=np.array(self._hand_distance),
            support=support,
            penetration=np.float64(self._penetration),
            tool_pose=self._tool(),
        )

    # ---- disturbance ------------------------------------------------------------------------------------

    def _disturbed_step(self) -> None:
        """One physics step, with a push that begins some time after the object was first held clear."""
        k = self._knocked
        held = self._hand_force[k] > 1.0 and not any(i == k for i, _ in self._support)
        self._knock.watch(self._time, held)
        if self._knock.pushing or self._falling:
            self._fine_steps(1)
        else:
            self._system.step()

    def _push(self) -> None:
        """Push the object until it has left the hand, no faster than the disturbance says."""
        self._read_contacts()
        body = self._objects[self._knocked]
        touched = self._hand_force[self._knocked] > 0.0
        force = self._knock.force(self._time, touched, body.linear_velocity)
        if force.any():
            body.wake_up()
            body.add_force_at_point(force.tolist(), body.entity_pose.p)


_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


def _list(pose: Any) -> list[float]:
    return [*pose.p.tolist(), *pose.q.tolist()]


def _array(pose: Any) -> Array:
    return np.array(_list(pose))


def _is_end(link: Any, links: list[Any]) -> bool:
    """A fixed link without shapes that carries no other."""
    carries = any(other.parent is link for other in links)
    return link.joint_record.joint_type == "fixed" and not link.collision_records and not carries
