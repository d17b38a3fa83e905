"""A small arm of one's own: its URDF and its file, with what other people's URDFs have and ours have not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

AXES = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
MAST = (0.05, -0.1, 0.38)
"""Where the base link stands in the root link's frame, m; turned by 0.5 rad about z."""


def link(name: str, size: str = "0.04 0.04 0.04") -> str:
    box = f'<origin xyz="0 0 0.02"/><geometry><box size="{size}"/></geometry>'
    inertia = '<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    return (
        f'<link name="{name}"><inertial><mass value="0.5"/>{inertia}</inertial>'
        f"<visual>{box}</visual><collision>{box}</collision></link>"
    )


def joint(name: str, kind: str, parent: str, child: str, xyz: str, rest: str = "") -> str:
    turn = 'rpy="0 0 0.5"' if name == "mast" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" {turn}/>{rest}</joint>'
    )


def urdf() -> str:
    """Six joints, of which the first turns without end, on a mast: a fixed joint whose axis is zero."""
    parts = [link("floor"), link("base")]
    parts.append(joint("mast", "fixed", "floor", "base", " ".join(map(str, MAST)), '<axis xyz="0 0 0"/>'))
    before = "base"
    for i, axis in enumerate(AXES):
        limit = '<limit lower="-3" upper="3" effort="50" velocity="2"/>' if i else ""
        parts.append(link(f"l{i}"))
        parts.append(
            joint(f"j{i}", "revolute" if i else "continuous", before, f"l{i}", "0 0 0.12",
                  f'<axis xyz="{axis}"/>{limit}')
        )  # fmt: skip
        before = f"l{i}"
    for side, sign in (("left", 1), ("right", -1)):
        parts.append(link(side, "0.01 0.01 0.04"))
        slide = f'<axis xyz="0 {sign} 0"/><limit lower="0" upper="0.04" effort="50" velocity="1"/>'
        parts.append(joint(f"{side}_slide", "prismatic", before, side, "0 0 0.06", slide))
    return f'<robot name="small">{"".join(parts)}</robot>'


def data(base_link: str) -> dict[str, Any]:
    drive = {"stiffness": 1000, "damping": 100, "force_limit": 100}
    return {
        "name": "small",
        "urdf": "small.urdf",
        "base_link": base_link,
        "arm": {
            "joints": [f"j{i}" for i in range(6)],
            "lower": [-3.0] * 6,
            "upper": [3.0] * 6,
            "velocity": [2.0] * 6,
            "acceleration": [10.0] * 6,
            "rest": [0.3, 0.5, 0.8, 0.1, 0.7, 0.2],
            "drive": drive,
        },
        "hand": {
            "joints": ["left_slide", "right_slide"],
            "open": [0.04, 0.04],
            "closed": [0.0, 0.0],
            "drive": drive,
            "speed": 2.0,
        },
        "tool": {"link": "l5", "pose": [0, 0, 0.1, 1, 0, 0, 0], "closing": [0, 1, 0]},
        "wrist_link": "l5",
        "tips": [
            {"name": "left", "links": ["left"], "point": [0, 0, 0.02]},
            {"name": "right", "links": ["right"], "point": [0, 0, 0.02]},
        ],
        "opposition": [[0], [1]],
        "opening": 0.08,
        "depth": 0.03,
        "pads": {
            "links": ["left", "right"],
            "surface": {"friction": 1.0, "patch_radius": 0.01, "min_patch_radius": 0.005},
        },
        "envelope": [{"position": [0, 0, 0], "size": [0.1, 0.1, 0.1]}],
    }


def write(folder: Path, base_link: str = "base") -> str:
    """Write both files; returns the path of the robot's."""
    (folder / "small.urdf").write_text(urdf())
    file = folder / "small.yaml"
    file.write_text(yaml.safe_dump(data(base_link)))
    return str(file)
