"""The model is the world as it was drawn: masses, centres of mass, inertia, poses, limits and drives."""

import numpy as np
import pinocchio
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.engines.physics.mujoco_contacts import TIMESTEP
from bt_tasksim.engines.physics.mujoco_model import GRAVITY, build_world
from bt_tasksim.engines.physics.mujoco_robot import drive_armature
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.urdf_links import load_links
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.shapes import KINDS
from bt_tasksim.scene.specs import FixtureSpec, ObjectSpec

mujoco = pytest.importorskip("mujoco")


def drawn(kind, seed=3, **scene):
    bottle = {"mesh": str(asset("objects", "bottle.obj")), "size": ((0.056, 0.042, 0.146),) * 2}
    spec = ObjectSpec(kinds=(kind,), on="table", **(bottle if kind == "mesh" else {}))
    return Scene(**{"objects": {"thing": spec}, **scene}).sample(seed)


@pytest.mark.parametrize("kind", KINDS)
def test_an_object_has_its_mass_and_shape(kind):
    configuration = drawn(kind)
    actor, world = configuration.objects[0], build_world(mujoco, load_robot("panda"), configuration)
    model, body = world.model, world.object_body[0]
    mass = actor.shape().mass
    assert model.body_mass[body] == pytest.approx(actor.mass)
    assert np.allclose(model.body_ipos[body], mass.pose[:3], atol=1e-9)
    assert np.allclose(model.body_inertia[body], actor.mass * mass.inertia, rtol=1e-3)
    assert world.weight == pytest.approx([actor.mass * GRAVITY])
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    corners = []
    for g in np.flatnonzero(model.geom_bodyid == body):
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH:
            k = model.geom_dataid[g]
            start, n = model.mesh_vertadr[k], model.mesh_vertnum[k]
            local = model.mesh_vert[start : start + n]
        else:
            local = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T * model.geom_size[g]
        corners.append(data.geom_xpos[g] + local @ data.geom_xmat[g].reshape(3, 3).T)
    in_object = poses.transform(poses.inverse(np.array(actor.pose)), np.concatenate(corners))
    pieces = np.concatenate([piece.corners() for piece in actor.shape().collision])
    assert np.allclose(in_object.min(axis=0), pieces.min(axis=0), atol=1e-6)
    assert np.allclose(in_object.max(axis=0), pieces.max(axis=0), atol=1e-6)


def test_fixtures_stand_where_they_were_drawn():
    apart = [FixtureSpec("trash_bin", at=(-0.1, -0.6)), FixtureSpec("stand", at=(-0.1, 0.6))]
    configuration = drawn("cup", fixtures=["shelf", *apart])
    world = build_world(mujoco, load_robot("panda"), configuration)
    data = mujoco.MjData(world.model)
    mujoco.mj_kinematics(world.model, data)
    for k, fixture in enumerate(configuration.fixtures):
        for j, box in enumerate(fixture.boxes):
            geom = world.model.geom(f"fixture/{k}/{j}").id
            pose = poses.multiply(fixture.pose_array(), np.array(box.pose))
            assert np.allclose(data.geom_xpos[geom], pose[:3])
            assert np.allclose(data.geom_xmat[geom].reshape(3, 3), poses.to_matrix(pose[3:]), atol=1e-9)
            assert np.allclose(2 * world.model.geom_size[geom], box.size)
            assert world.bodies[geom].name == fixture.name
            assert world.bodies[geom].index == len(configuration.objects) + k


@pytest.mark.parametrize("name", ["panda", "xarm7_ability", "so100"])
def test_drives_are_those_of_the_robots_file(name):
    robot = load_robot(name)
    model = build_world(mujoco, robot, Scene(robot=name).sample(0)).model
    for what, column in (("stiffness", 1), ("damping", 2)):
        assert np.allclose(model.actuator_biasprm[:, column], -robot.drive_array(what))
    assert np.allclose(model.actuator_forcerange[:, 1], robot.drive_array("force_limit"))
    assert np.allclose(model.actuator_forcerange[:, 0], -robot.drive_array("force_limit"))
    armature = drive_armature(robot)
    assert np.all(armature >= robot.drive_array("damping") * TIMESTEP)
    for i, joint in enumerate(robot.joints):
        assert model.joint(joint).damping[0] == 0.0
        assert model.dof_armature[model.joint(joint).dofadr[0]] == pytest.approx(armature[i])


@pytest.mark.parametrize(
    ("name", "within"),
    [("panda", 1e-12), ("so100", 1e-12), ("xarm7_ability", 1.1e-3)],  # two links of that hand cannot be
)
def test_inertia_is_that_of_the_urdf(name, within):
    """Joint-space inertia beside Pinocchio's, kg m^2 (for sliding joints kg)."""
    robot = load_robot(name)
    world = build_world(mujoco, robot, Scene(robot=name).sample(0))
    theirs, rng = pinocchio.buildModelFromUrdf(str(robot.urdf)), np.random.default_rng(0)
    joints = [theirs.joints[theirs.getJointId(joint)] for joint in robot.joints]
    data, at = mujoco.MjData(world.model), [joint.idx_v for joint in joints]
    low = np.concatenate([robot.arm_lower, robot.hand_open])
    high = np.concatenate([robot.arm_upper, robot.hand_closed])
    for _ in range(5):
        position, q = rng.uniform(np.minimum(low, high), np.maximum(low, high)), pinocchio.neutral(theirs)
        for joint, value in zip(joints, position, strict=True):
            turns = joint.nq == 2  # of a joint without limits Pinocchio has cosine and sine
            q[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(value), np.sin(value)) if turns else value
        data.qpos[world.joint_qpos] = position
        mujoco.mj_forward(world.model, data)
        whole = np.zeros((world.model.nv, world.model.nv))
        mujoco.mj_fullM(world.model, data, whole)
        ours = whole[np.ix_(world.joint_dof, world.joint_dof)] - np.diag(drive_armature(robot))
        upper = np.triu(pinocchio.crba(theirs, theirs.createData(), q))
        expected = (upper + np.triu(upper, 1).T)[np.ix_(at, at)]
        assert np.abs(ours - expected).max() < within


def test_only_an_inertia_that_cannot_be_is_changed():
    robot = load_robot("xarm7_ability")
    model = build_world(mujoco, robot, Scene(robot="xarm7_ability").sample(0)).model
    changed = []
    for link in load_links(robot.urdf):
        if link.inertial is not None:
            xx, yy, zz, xy, xz, yz = link.inertial.inertia
            principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            if not np.allclose(np.sort(model.body(f"robot/{link.link}").inertia), principal, rtol=1e-3):
                changed.append(link.link)
    assert changed == ["base", "thumb_base"]
    assert model.body("robot/base").inertia == pytest.approx([0.89e-3] * 3, rel=0.01)


def test_the_pandas_hand_keeps_the_armature_of_its_file():
    robot = load_robot("panda")
    assert drive_armature(robot)[-2:] == pytest.approx([robot.hand_drive.armature] * 2)


def test_links_that_the_urdf_lacks_are_refused_by_name(tmp_path):
    text = (
        asset("robots", "panda.yaml").read_text().replace("wrist_link: panda_hand", "wrist_link: panda_hnd")
    )
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(InputError, match=r"the URDF has no link 'panda_hnd'; did you mean 'panda_hand'"):
        build_world(mujoco, load_robot(str(tmp_path / "mine.yaml")), Scene().sample(0))
