"""Write the JSON schemas of the files that people write into docs/schemas: ``python -m tools.schemas``.

They are made from the models that the files are checked with, so editors complete fields and say what they
mean. ``--check`` writes nothing and exits 1 where one is not up to date.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bt_tasksim.core.registry import parts
from bt_tasksim.core.resources import asset
from bt_tasksim.core.typed_file import Model, record_model
from bt_tasksim.engines.maniskill.schema import EnvironmentFile
from bt_tasksim.hardware.ros.schema import CellFile
from bt_tasksim.hardware.twin.gap_schema import GapFile
from bt_tasksim.robot.schema import RobotFile
from bt_tasksim.scene.fixture_schema import FixtureFile
from bt_tasksim.scene.object_schema import COLOURS, ObjectFile
from bt_tasksim.scene.scene_schema import SceneFile
from bt_tasksim.scene.shapes import KINDS
from bt_tasksim.training.config import TrainConfig

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "schemas"
MODELS: dict[str, Callable[[], type[Model]]] = {
    "robot": lambda: RobotFile,
    "scene": lambda: SceneFile,
    "object": lambda: ObjectFile,
    "fixture": lambda: FixtureFile,
    "maniskill": lambda: EnvironmentFile,
    "settings": lambda: record_model(TrainConfig),
    "twin": lambda: GapFile,
    "ros": lambda: CellFile,
}
"""Models by the name of the schema."""


def schema(name: str) -> dict[str, Any]:
    """The JSON schema of one kind of file."""
    made = MODELS[name]().model_json_schema()
    if name in ("scene", "object"):
        thing = made["$defs"]["ObjectEntry"] if name == "scene" else made
        _suggest(thing["properties"]["kind"], sorted(KINDS))
        _suggest(thing["properties"]["colour"], list(COLOURS))
    if name == "scene":
        entries = made["$defs"]
        objects = sorted(path.name for path in asset("objects").glob("*.yaml"))
        _suggest(entries["ObjectEntry"]["properties"]["object"], objects)
        _suggest(entries["GoalEntry"]["properties"]["relation"], sorted(parts("goal relation")))
        _suggest(made["properties"]["robot"], _bundled("robots"))
        _suggest(made["properties"]["fixtures"]["items"], _bundled("fixtures"))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **made}


def _bundled(folder: str) -> list[str]:
    return sorted(path.stem for path in asset(folder).glob("*.yaml"))


def _suggest(entry: dict[str, Any], names: list[str]) -> None:
    """Offer names for a text; others are allowed, for there may be parts of one's own."""
    entry["examples"] = names


def text(name: str) -> str:
    """The schema's file."""
    return json.dumps(schema(name), indent=2, ensure_ascii=False) + "\n"


def main() -> int:
    """Write or check all of them."""
    stale = []
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in MODELS:
        file = FOLDER / f"{name}.schema.json"
        if file.is_file() and file.read_text(encoding="utf-8") == text(name):
            continue
        stale.append(file.name)
        if "--check" not in sys.argv[1:]:
            file.write_text(text(name), encoding="utf-8")
    if stale and "--check" in sys.argv[1:]:
        print(f"not up to date: {', '.join(stale)}; run: python -m tools.schemas", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
