"""What docs/fixtures.md shows of the fixtures that are made by numbers: a picture, and their parameters.

``python -m tools.fixtures_page`` writes both.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
from pydantic.fields import FieldInfo

from bt_tasksim.core.joints import Joints
from bt_tasksim.core.registry import parts
from bt_tasksim.core.resources import asset
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.cameras import CameraSpec
from bt_tasksim.engines.rendering.sapien import SapienRendering
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.fixture_maker import FixtureMaker
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec

SHOWN = {
    "door": {"side": "left", "handle": "bar"},
    "drawer": {"handle": "knob"},
    "panel": {"side": "right", "handle": "bar"},
    "lidded_box": {"handle": "edge"},
    "knob": {"facing": "up"},
    "valve": {"facing": "front", "wheel": "wheel"},
    "lever": {"facing": "front", "side": "left"},
    "button": {"facing": "up"},
    "socket": {"facing": "up"},
}
"""Of each fixture, what is not left to the draw."""
OTHERWISE = {"socket": {"facing": "front"}}
"""The same of the second picture of one that has no parts to be opened."""
SEED, SIZE, COLUMNS = 1, (200, 160), 4
CAMERA = CameraSpec((0.05, 0.5, 0.6), (0.58, 0.0, 0.16), SIZE)
BEGIN, END = "<!-- made by tools/fixtures_page.py -->", "<!-- end -->"
ASIDE = -1.2
"""Radians by which the arm's base is turned out of the picture."""


def tables() -> str:
    """The parameters of each fixture, as the page has them."""
    text = []
    for name in SHOWN:
        maker = parts("fixture")[name]
        assert issubclass(maker, FixtureMaker)
        text += [f"### `{name}`", "", f"{(maker.__doc__ or '').strip()}", ""]
        text += ["| parameter | what it is | if left out |", "|---|---|---|"]
        for parameter, field in maker.model_fields.items():
            text.append(f"| `{parameter}` | {(field.description or '').rstrip('.')} | {_usual(field)} |")
        text.append("")
    return "\n".join(text)


def _usual(field: FieldInfo) -> str:
    extra = field.json_schema_extra
    assert isinstance(extra, dict)
    usual = extra["usual"]
    if not isinstance(usual, list):
        return f"{usual:g}" if isinstance(usual, float) else f"`{usual}`"
    if isinstance(usual[0], str):
        return " or ".join(f"`{word}`" for word in usual)
    return " to ".join(f"{value:g}" for value in usual)


def main() -> None:
    """Write the picture, and the tables into the page."""
    docs = asset("fixtures").parents[1] / "docs"
    page = docs / "fixtures.md"
    head, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    page.write_text(head + begin + "\n\n" + tables() + END + rest.partition(END)[2], encoding="utf-8")
    shown = picture()[:, :, ::-1]
    cv2.imwrite(str(docs / "pictures" / "fixtures.jpg"), shown, [cv2.IMWRITE_JPEG_QUALITY, 85])


def picture() -> np.ndarray:
    """Each fixture, shut and half open, as RGB."""
    engine, robot = SapienRendering({"near": CAMERA}), load_robot("panda")
    posture = np.concatenate([robot.rest, robot.hand_open])
    posture[0] = ASIDE
    pairs = []
    for name, parameters in SHOWN.items():
        for share, given in ((0.0, parameters), (0.6, OTHERWISE.get(name, parameters))):
            world = Scene(fixtures=[FixtureSpec(name, parameters=given)]).sample(SEED)
            engine.reset(world)
            joints = Joints.of([actor.joint for actor in world.objects if actor.joint is not None])
            value = joints.limits @ np.array([1.0 - share, share])
            state = SimpleNamespace(joint_position=posture, objects=joints.pose(value))
            pairs.append(engine.render(cast("WorldState", state), "near").colour)
    pairs += [np.full_like(pairs[0], 255)] * (-len(pairs) % COLUMNS)
    rows = [np.concatenate(pairs[k : k + COLUMNS], axis=1) for k in range(0, len(pairs), COLUMNS)]
    return np.concatenate(rows)


if __name__ == "__main__":
    main()
