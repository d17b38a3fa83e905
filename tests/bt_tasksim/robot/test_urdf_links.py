"""Links and joints of a URDF: those of the bundled robots, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.urdf_links import Mimic, links_below, load_links, root_pose, still_links

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
JOINT = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>{4}</joint>'
LIMIT = '<limit lower="-1" upper="2"/>'


@pytest.fixture
def urdf(tmp_path):
    def write(*parts):
        path = tmp_path / "robot.urdf"
        path.write_text(f"<robot name='r'>{''.join(parts)}</robot>")
        return path

    return write


@pytest.mark.parametrize("robot", ["panda", "panda_wristcam", "xarm7_ability", "so100"])
def test_masses_and_places_agree_with_pinocchio(robot):
    description = load_robot(robot)
    links = load_links(description.urdf)
    model = pin.buildModelFromUrdf(str(description.urdf))
    data = model.createData()
    assert sum(item.inertial.mass for item in links if item.inertial) == pytest.approx(
        sum(inertia.mass for inertia in model.inertias)
    )
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    pin.updateFramePlacements(model, data)
    seen = {}
    for item in links:
        pose = np.array(item.pose)
        seen[item.link] = poses.multiply(seen[item.parent], pose) if item.parent else pose
        placement = data.oMf[model.getBodyId(item.link)]
        assert np.allclose(seen[item.link][:3], placement.translation, atol=1e-9)
        assert np.allclose(poses.to_matrix(seen[item.link][3:]), placement.rotation, atol=1e-9)


def test_parents_stand_before_what_they_carry_and_mimics_are_read():
    links = load_links(load_robot("xarm7_ability").urdf)
    known = set()
    for item in links:
        assert not item.parent or item.parent in known
        known.add(item.link)
    by_joint = {item.joint: item for item in links}
    assert by_joint["index_q2"].mimic == Mimic("index_q1", 1.05851325, 0.72349796)
    assert by_joint["joint1"].mimic is None and by_joint["joint1"].limits == (-6.28318530718, 6.28318530718)
    assert still_links(links) == {"link_base"}
    assert {"base", "thumb_L2", "index_tip"} <= links_below(links, "base")
    assert "link7" not in links_below(links, "base")


def test_a_base_link_above_the_root_shifts_the_root(urdf):
    raised = JOINT.format("foot", "fixed", "floor", "base", '<origin xyz="0 0 0.5" rpy="0 0 1"/>')
    path = urdf(LINK.format("floor"), LINK.format("base"), raised)
    pose = root_pose(load_links(path), "base")
    assert np.allclose(poses.multiply(pose, poses.pose([0, 0, 0.5], poses.yaw(1.0))), poses.pose([0, 0, 0]))
    with pytest.raises(InputError, match="base_link 'arm' is no link"):
        root_pose(load_links(path), "arm")


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ([LINK.format("a"), LINK.format("b")], "should have one root link, found 2: a, b"),
        ([LINK.format("a"), JOINT.format("j", "fixed", "a", "c", "")], "joint 'j' carries 'c'"),
        (
            [LINK.format("a"), LINK.format("b"), JOINT.format("j", "planar", "a", "b", "")],
            "joint 'j' is of the kind 'planar'",
        ),
        (
            [LINK.format("a"), LINK.format("b"), JOINT.format("j", "revolute", "a", "b", "")],
            "joint 'j' has no limits",
        ),
        (
            [LINK.format("a"), LINK.format("b"), JOINT.format("j", "fixed", "x", "b", "")],
            "joint 'j' hangs on 'x'",
        ),
        (
            [
                LINK.format("a"),
                LINK.format("b"),
                JOINT.format("j", "revolute", "a", "b", LIMIT + '<axis xyz="0 0 0"/>'),
            ],
            "the axis of joint 'j' has no direction",
        ),
        (
            [
                LINK.format("a"), LINK.format("b"), LINK.format("c"),
                JOINT.format("j", "fixed", "b", "c", ""), JOINT.format("k", "fixed", "c", "b", ""),
            ],
            "its joints run in a circle",
        ),
        (['<link name="a"><inertial><mass value="1"/></inertial></link>'], "no mass or no inertia"),
    ],
)  # fmt: skip
def test_what_is_no_tree_of_links_is_refused(urdf, parts, sentence):
    with pytest.raises(InputError, match=sentence):
        load_links(urdf(*parts))


def test_a_file_that_is_no_xml_is_refused(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text("<robot")
    with pytest.raises(InputError, match="cannot be read"):
        load_links(path)
