"""A URDF's links and joints: what a rigid-body simulator needs beside the shapes."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.robot.urdf_visuals import origin, read_urdf

MOVING = ("revolute", "continuous", "prismatic")
"""Kinds of joints that move; every other one but ``fixed`` is refused."""
LIMITED = ("revolute", "prismatic")
"""Those of them that have limits."""


@dataclass(frozen=True)
class Inertial:
    """Mass in kg, pose ``(7,)`` of the inertial frame in the link's, and the inertia in it, kg m^2.

    The inertia is ``(xx, yy, zz, xy, xz, yz)``.
    """

    mass: float
    pose: tuple[float, ...]
    inertia: tuple[float, ...]


@dataclass(frozen=True)
class Mimic:
    """The joint follows another one: ``position = offset + multiplier * position of joint``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class LinkJoint:
    """A link and the joint that carries it.

    Attributes:
        link: Name of the link.
        inertial: Its mass and inertia; None for a frame without mass.
        parent: Name of the link that carries it; empty for the root.
        pose: Pose ``(7,)`` of the joint, and of the link at joint position 0, in the parent's frame.
        joint: Name of the joint; empty for the root.
        kind: ``fixed``, or one of `MOVING`.
        axis: Unit vector ``(3,)`` in the link's frame; of no meaning where the joint is fixed.
        limits: Lower and upper position, rad or m; None for a joint without limits.
        mimic: What it follows, if anything.
    """

    link: str
    inertial: Inertial | None
    parent: str
    pose: tuple[float, ...]
    joint: str
    kind: str
    axis: tuple[float, float, float]
    limits: tuple[float, float] | None
    mimic: Mimic | None

    @property
    def moves(self) -> bool:
        """It is carried by a joint that moves."""
        return self.kind in MOVING


@lru_cache(maxsize=32)
def load_links(urdf: Path) -> tuple[LinkJoint, ...]:
    """The links of a URDF from the root on: parents before what they carry.

    Raises:
        InputError: The file is no URDF, or not one tree of links with fixed, turning and sliding joints.
    """
    root = read_urdf(urdf)
    try:
        inertials = {str(link.get("name")): _inertial(link) for link in root.findall("link")}
        carried = [_link_joint(joint, inertials) for joint in root.findall("joint")]
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"URDF '{urdf}': bad link or joint: {error}") from error
    children: dict[str, list[LinkJoint]] = {name: [] for name in inertials}
    for item in carried:
        if item.parent not in children:
            raise InputError(
                f"URDF '{urdf}': joint '{item.joint}' hangs on '{item.parent}', which is no link"
            )
        children[item.parent].append(item)
    roots = sorted(set(inertials) - {item.link for item in carried})
    if len(roots) != 1:
        raise InputError(f"URDF '{urdf}' should have one root link, found {len(roots)}: {', '.join(roots)}")
    still = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    queue = [LinkJoint(roots[0], inertials[roots[0]], "", still, "", "fixed", (1.0, 0.0, 0.0), None, None)]
    ordered = []
    while queue:
        item = queue.pop()
        ordered.append(item)
        queue.extend(reversed(children.pop(item.link, [])))
    if len(ordered) != len(inertials):
        raise InputError(f"URDF '{urdf}': its joints run in a circle")
    return tuple(ordered)


def joint_limits(urdf: Path) -> dict[str, tuple[float, float]]:
    """Lower and upper position, rad or m, of those joints of a URDF that state both.

    Raises:
        InputError: The file is no URDF, or a limit is no number.
    """
    found = {}
    for joint in read_urdf(urdf).findall("joint"):
        limit = joint.find("limit")
        if joint.get("type") in LIMITED and limit is not None and {"lower", "upper"} <= limit.attrib.keys():
            try:
                found[str(joint.get("name"))] = (float(limit.get("lower", "")), float(limit.get("upper", "")))
            except ValueError as error:
                raise InputError(f"URDF '{urdf}': limit of joint '{joint.get('name')}': {error}") from error
    return found


def joint_speeds(urdf: Path) -> dict[str, float]:
    """Largest speed, rad/s or m/s, of those joints of a URDF that state one; 0 states none.

    Raises:
        InputError: The file is no URDF, or a speed is no number.
    """
    found = {}
    for joint in read_urdf(urdf).findall("joint"):
        limit = joint.find("limit")
        try:
            speed = 0.0 if limit is None else float(limit.get("velocity", "0"))
        except ValueError as error:
            raise InputError(f"URDF '{urdf}': limit of joint '{joint.get('name')}': {error}") from error
        if speed > 0.0:
            found[str(joint.get("name"))] = speed
    return found


def joint_depths(urdf: Path) -> dict[str, int]:
    """How many joints each joint of a URDF hangs on: what carries another one has fewer.

    Raises:
        InputError: The file is no URDF.
    """
    parents, carriers = {}, {}
    for joint in read_urdf(urdf).findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            parents[str(joint.get("name"))] = parent.get("link", "")
            carriers[child.get("link", "")] = str(joint.get("name"))
    depths = {}
    for name in parents:
        above, seen = carriers.get(parents[name]), {name}
        while above is not None and above not in seen:  # a circle is said where the links are read
            seen.add(above)
            above = carriers.get(parents[above])
        depths[name] = len(seen) - 1
    return depths


def links_below(links: tuple[LinkJoint, ...], root: str) -> set[str]:
    """Names of a link and of all links that it carries."""
    names = {root}
    for item in links:
        if item.parent in names:
            names.add(item.link)
    return names


def still_links(links: tuple[LinkJoint, ...]) -> set[str]:
    """Names of the links that no joint moves."""
    names: set[str] = set()
    for item in links:
        if not item.moves and (item.parent in names or not item.parent):
            names.add(item.link)
    return names


def _inertial(link: ElementTree.Element) -> Inertial | None:
    element = link.find("inertial")
    if element is None:
        return None
    mass, inertia = element.find("mass"), element.find("inertia")
    if mass is None or inertia is None:
        raise ValueError(f"link '{link.get('name')}' has no mass or no inertia")
    values = tuple(float(inertia.get(f"i{axes}", "0")) for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
    return Inertial(float(mass.get("value", "")), tuple(float(v) for v in origin(element)), values)


def _link_joint(joint: ElementTree.Element, inertials: dict[str, Inertial | None]) -> LinkJoint:
    name, kind = str(joint.get("name")), str(joint.get("type"))
    if kind not in ("fixed", *MOVING):
        raise ValueError(f"joint '{name}' is of the kind '{kind}'; fixed, turning and sliding ones are known")
    parent, child = (str(_child(joint, tag).get("link")) for tag in ("parent", "child"))
    if child not in inertials:
        raise ValueError(f"joint '{name}' carries '{child}', which is no link")
    limit, mimic = joint.find("limit"), joint.find("mimic")
    limits = None
    if kind in LIMITED:
        if limit is None:
            raise ValueError(f"joint '{name}' has no limits")
        limits = (float(limit.get("lower", "0")), float(limit.get("upper", "0")))
    return LinkJoint(
        link=child,
        inertial=inertials[child],
        parent=parent,
        pose=tuple(float(v) for v in origin(joint)),
        joint=name,
        kind=kind,
        axis=_axis(joint) if kind in MOVING else (1.0, 0.0, 0.0),
        limits=limits,
        mimic=None
        if mimic is None
        else Mimic(
            str(mimic.get("joint")), float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
        ),
    )


def _axis(joint: ElementTree.Element) -> tuple[float, float, float]:
    element = joint.find("axis")
    x, y, z = (float(v) for v in (element.get("xyz", "") if element is not None else "1 0 0").split())
    length = (x * x + y * y + z * z) ** 0.5
    if length < 1e-6:
        raise ValueError(f"the axis of joint '{joint.get('name')}' has no direction")
    return x / length, y / length, z / length


def _child(element: ElementTree.Element, tag: str) -> ElementTree.Element:
    found = element.find(tag)
    if found is None:
        raise ValueError(f"joint '{element.get('name')}' has no {tag}")
    return found


def root_pose(links: tuple[LinkJoint, ...], base: str) -> poses.Array:
    """Pose ``(7,)`` of the root link where the link ``base``, which must not move, is the origin.

    Raises:
        InputError: There is no such link, or it moves.
    """
    by_name = {item.link: item for item in links}
    if base not in still_links(links):
        raise InputError(f"base_link '{base}' is no link of the URDF, or moves with a joint")
    pose, item = poses.pose((0.0, 0.0, 0.0)), by_name[base]
    while item.parent:
        pose = poses.multiply(np.array(item.pose), pose)
        item = by_name[item.parent]
    return poses.inverse(pose)
