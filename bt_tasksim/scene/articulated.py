"""Fixtures from URDF and MJCF files: links on one joint each become parts, and all others stand still.

MuJoCo reads links, joints and shapes alone: all else is left out of the text before, or refused by its name.
So nothing that a file names is opened, and nothing makes many of one.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ParseError, tostring

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.bounded_text import read_text
from bt_tasksim.core.document import Document
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.mujoco_log import write_none
from bt_tasksim.core.names import name_fault
from bt_tasksim.core.plain import Plain, shown
from bt_tasksim.core.poses import Array
from bt_tasksim.core.typed_file import validate
from bt_tasksim.scene.fixture_schema import PartEntry

HANDLES = ("handle", "knob", "grip")
"""What the name of a link or of a shape contains by which two fingers may hold the part."""
WIDEST = 0.07
"""Metres up to which two fingers are taken to hold something."""
UNLIMITED = 3.0
"""Radians either way between which a hinge without limits turns: one that goes round would have no value."""
MOST = 5000
"""Elements that a file may have."""
DEEPEST = 50
"""Elements within one another that a file may have."""
_URDF = (
    "robot link joint collision inertial origin mass inertia geometry box cylinder sphere axis parent child "
    "limit dynamics"
)
_MJCF = "mujoco compiler default asset material worldbody body frame joint freejoint geom inertial"
_READ = {"robot": frozenset(_URDF.split()), "mujoco": frozenset(_MJCF.split())}
"""Elements that are read, by the root's name."""
_URDF_SEEN = "visual material gazebo transmission ros2_control mujoco safety_controller calibration"
_MJCF_SEEN = "visual statistic option size sensor actuator keyframe custom light camera site texture contact"
_LEFT_OUT = {"robot": frozenset(_URDF_SEEN.split()), "mujoco": frozenset(_MJCF_SEEN.split())}
"""Those that do not matter for furniture, and are left out."""
_NOT_FINITE = frozenset({"nan", "inf", "infinity"})
_WORDS = frozenset(["name", "type", "link", "joint", "class", "childclass", "material", "effort", "velocity"])
"""Attributes that hold words, or limits that do not matter for furniture."""
_NAMES_FILE = {"mesh", "include", "model", "plugin", "hfield", "skin"}


def articulated(path: Path) -> dict[str, Plain]:
    """What a fixture's file would say of the furniture in a URDF or MJCF file.

    Raises:
        InputError: It is none, or has in it what a fixture cannot have; one sentence says what.
        MachineError: MuJoCo is not installed.
    """
    try:
        import mujoco
    except ImportError:
        raise MachineError(
            "a fixture from URDF or MJCF needs the package mujoco: install bt-tasksim with 'sim'"
        ) from None
    root = _root(path)
    write_none(mujoco)
    try:
        with warnings.catch_warnings(action="ignore"):  # numbers beyond all bounds are refused later
            model = mujoco.MjSpec.from_string(tostring(root, encoding="unicode")).compile()
    except (ValueError, RuntimeError) as error:
        raise InputError(f"fixture file '{path}': {' '.join(str(error).split())}") from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return _Reader(mujoco, model, data, path).fixture()


def _root(path: Path) -> Element:
    """The file's XML without what is only seen, and with nothing in it that names another file."""
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root: Element = fromstring(read_text(path, "fixture file"))
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise InputError(f"fixture file '{path}' is no XML that can be read: {error}") from None
    if root.tag not in ("robot", "mujoco"):
        raise InputError(f"fixture file '{path}' is neither URDF nor MJCF: its root is '{shown(root.tag)}'")
    if sum(1 for _ in root.iter()) > MOST:
        raise InputError(f"fixture file '{path}' has more than {MOST} elements: make a simpler model of it")
    if _deeper_than(DEEPEST, root):
        raise InputError(
            f"fixture file '{path}' has more than {DEEPEST} elements within one another: make a simpler "
            f"model of it"
        )
    for parent in root.iter():
        for child in [c for c in parent if c.tag in _LEFT_OUT[root.tag]]:
            parent.remove(child)
    for element in root.iter():
        element.attrib.pop("texture", None)
        files = [name for name in element.attrib if name.startswith("file") or name.endswith("dir")]
        if element.tag in _NAMES_FILE or files:
            raise InputError(
                f"fixture file '{path}': '{shown(element.tag)}' names another file, and a fixture's shapes "
                f"are boxes and cylinders: put these in place of meshes"
            )
        if element.tag not in _READ[root.tag]:
            raise InputError(
                f"fixture file '{path}': furniture is made of links, joints and shapes, and "
                f"'{shown(element.tag)}' is none of them: leave it out, or write out what it makes"
            )
    for joint in root.iter("joint"):
        _check_limits(joint, path)
    for element in root.iter():
        _check_finite(element, path)
    if root.tag == "robot":  # links that are fixed to others keep their names, and shapes have different ones
        for link in root.iter("link"):
            for k, shape in enumerate(link.iter("collision")):
                shape.set("name", f"{link.get('name', '')} {shape.get('name', '')} {k}")
        own = Element("mujoco")
        own.append(Element("compiler", {"fusestatic": "false", "discardvisual": "true"}))
        root.append(own)
    return root


def _deeper_than(levels: int, root: Element) -> bool:
    """Whether there are more levels of elements, without a call for each."""
    level = [root]
    for _ in range(levels):
        level = [child for element in level for child in element]
    return bool(level)


def _check_limits(joint: Element, path: Path) -> None:
    """Check that a joint's limits are in order: MuJoCo takes others for none."""
    limit = joint.find("limit")
    if joint.get("type") in ("revolute", "prismatic"):  # URDF
        given = [] if limit is None else [limit.get("lower", "0"), limit.get("upper", "0")]
    else:
        given = (joint.get("range") or "").split()
        if not given:
            return
    try:
        low, high = (float(text) for text in given)
    except ValueError:
        low, high = math.nan, math.nan
    if not low < high:
        said = f"'{shown(joint.get('name', ''))}' {shown(' '.join(given))}".strip()
        raise InputError(
            f"fixture file '{path}': the limits of a joint should be two numbers, the lower one first, found "
            f"{said}: a joint that cannot move is a fixed one"
        )


def _check_finite(element: Element, path: Path) -> None:
    """Check that all numbers of an element are finite: MuJoCo would go on with others."""
    for name, text in element.attrib.items():
        odd = [word for word in text.split() if word.lower().lstrip("+-") in _NOT_FINITE]
        if odd and name not in _WORDS:
            owner = element.get("name") or ""
            raise InputError(
                f"fixture file '{path}': '{name}' of {shown(element.tag)} '{shown(owner)}' should be finite "
                f"numbers, found '{shown(text)}'".replace(" ''", "")
            )


class _Reader:
    def __init__(self, mujoco: Any, model: Any, data: Any, path: Path) -> None:
        self.mujoco, self.model, self.data, self.path = mujoco, model, data, path

    def fixture(self) -> dict[str, Plain]:
        """All of it."""
        parts = {
            body: self._part(body) for body in range(1, self.model.nbody) if self.model.body_jntnum[body]
        }
        still: list[Plain] = []
        for geom in range(self.model.ngeom):
            body = self._carrier(int(self.model.geom_bodyid[geom]))
            boxes = self._boxes(geom)
            if body == 0:
                still += boxes
            else:
                parts[body]["boxes"] += boxes
                parts[body]["grasps"] += self._grasps(geom)
        masses = np.zeros(self.model.nbody)
        for body in range(1, self.model.nbody):
            masses[self._carrier(body)] += self.model.body_mass[body]
        for body, part in parts.items():
            if masses[body] > 0.0:
                part["mass"] = float(masses[body])
            self._check(body, part)
        listed: list[Plain] = list(parts.values())
        return {"name": self.path.stem, "boxes": still, "places": [], "parts": listed}

    def _check(self, body: int, part: dict[str, Any]) -> None:
        """Refuse what no part of a fixture can have, by the names that the file has for it."""
        joint = self.model.joint(int(self.model.body_jntadr[body])).name
        named = f"joint '{shown(joint)}' of link '{part['name']}'" if joint else f"link '{part['name']}'"
        validate(PartEntry, Document(f"fixture file '{self.path}', {named}", part))

    def _carrier(self, body: int) -> int:
        """The body on a joint that a body is fixed to, or 0 where it stands still."""
        while body and not self.model.body_jntnum[body]:
            body = int(self.model.body_parentid[body])
        return body

    def _part(self, body: int) -> dict[str, Any]:
        model, mujoco = self.model, self.mujoco
        name, joint = model.body(body).name, int(model.body_jntadr[body])
        if fault := name_fault(name):
            raise self._error(f"the name of link '{shown(name)}' {fault}")
        if model.body_jntnum[body] > 1 or self._carrier(int(model.body_parentid[body])):
            raise self._error(
                f"'{name}' moves by more than one joint, and a part has one, on what stands still"
            )
        kinds = {mujoco.mjtJoint.mjJNT_HINGE: "hinge", mujoco.mjtJoint.mjJNT_SLIDE: "slide"}
        kind = kinds.get(mujoco.mjtJoint(int(model.jnt_type[joint])))
        if kind is None:
            raise self._error(f"the joint of '{name}' neither slides nor turns about one axis")
        if not model.jnt_limited[joint] and kind == "slide":
            raise self._error(f"the joint of '{name}' slides without limits: give it some")
        qpos, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        zero = float(model.qpos0[qpos])
        limited = bool(model.jnt_limited[joint])
        low, high = (float(v) - zero for v in model.jnt_range[joint]) if limited else (-UNLIMITED, UNLIMITED)
        way = -1.0 if low < 0.0 and high <= 0.0 else 1.0  # values grow as it opens, from where it is shut
        if way < 0.0:
            low, high = -high, -low
        return {
            "name": name,
            "joint": kind,
            "axis": (way * self.data.xaxis[joint]).tolist(),
            "origin": self.data.xanchor[joint].tolist(),
            "limits": [low, high],
            "friction": float(model.dof_frictionloss[dof]),
            "damping": float(np.ravel(model.dof_damping[dof])[0]),
            "stiffness": float(np.ravel(model.jnt_stiffness[joint])[0]),
            "rest": way * (float(model.qpos_spring[qpos]) - zero),
            "value": min(max(0.0, low), high),
            "boxes": [],
            "grasps": [],
        }

    def _placed(self, geom: int) -> Array:
        turn = poses.from_matrix(self.data.geom_xmat[geom].reshape(3, 3))
        found: Array = poses.pose(self.data.geom_xpos[geom], turn)
        return found

    def _boxes(self, geom: int) -> list[Plain]:
        """A shape as boxes: itself, or an octagon for a cylinder."""
        kinds, kind = self.mujoco.mjtGeom, int(self.model.geom_type[geom])
        size, at = self.model.geom_size[geom], self._placed(geom)
        colour: list[Plain] = [float(v) for v in np.clip(self.model.geom_rgba[geom][:3], 0.0, 1.0)]
        seen_only = not (self.model.geom_contype[geom] or self.model.geom_conaffinity[geom])
        if kind == kinds.mjGEOM_PLANE or seen_only:
            return []
        if kind == kinds.mjGEOM_BOX:
            placed = [(at, 2 * size)]
        elif kind == kinds.mjGEOM_CYLINDER:
            side = 2 * size[0] * math.tan(math.pi / 8)
            turns = [poses.pose(np.zeros(3), poses.yaw(k * math.pi / 4)) for k in range(4)]
            placed = [
                (poses.multiply(at, turn), np.array([2 * size[0], side, 2 * size[1]])) for turn in turns
            ]
        else:
            said = self.mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
            raise self._error(f"a {said} is among its shapes, and these are boxes and cylinders")
        return [{"pose": pose.tolist(), "size": full.tolist(), "colour": colour} for pose, full in placed]

    def _grasps(self, geom: int) -> list[Plain]:
        """Where two fingers may hold a handle: across each of its narrow sides but along its longest."""
        body = int(self.model.geom_bodyid[geom])
        names = f"{self.model.geom(geom).name} {self.model.body(body).name}".lower()
        if not any(word in names for word in HANDLES):
            return []
        at, size = self._placed(geom), np.array(self.model.geom_size[geom], float)
        if int(self.model.geom_type[geom]) == self.mujoco.mjtGeom.mjGEOM_CYLINDER:
            size = np.array([size[0], size[0], size[1]])
        found: list[Plain] = []
        for k in np.argsort(size, kind="stable")[:2].tolist():
            if 2 * size[k] <= WIDEST:
                closing = poses.rotate(at[3:], np.eye(3)[k]).tolist()
                found.append({"point": at[:3].tolist(), "closing": closing, "width": float(2 * size[k])})
        return found

    def _error(self, said: str) -> InputError:
        return InputError(f"fixture file '{self.path}': {said}")
