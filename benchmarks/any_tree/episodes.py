"""One draw: its task is made, its tree is run, and what became of it is written down."""

from __future__ import annotations

import time
import traceback
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from benchmarks.any_tree.tasks import Task, task
from bt_tasksim import EngineOptions, Runner, load_robot
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.errors import BtTasksimWarning, InputError, LostEngine, MachineError
from bt_tasksim.engines.pipeline import EnginePipeline
from bt_tasksim.execution.pipelines import build_pipeline
from bt_tasksim.policy.policy import concept_name
from bt_tasksim.training.evaluation import episode

LONGEST = (60.0, 60.0)
"""Seconds of an episode, and more for each object that is moved."""


@dataclass(frozen=True)
class Conditions:
    """What is measured.

    Attributes:
        robot: Name of the robot.
        tree: One of `benchmarks.any_tree.trees.TREES`.
        grasp: Policy of the grasps; None for the pinned one.
        options: The engines.
        folder: Where meshes are written.
        stream: Stream of the scene's draw.
        oracle: Seconds that the oracle has for each draw that failed; 0: it is not asked.
        twin: On the twin, over ROS and in real time, instead of the engines of the options.
        colours: In how many colours objects are; 0: each has one of its own, if it can.
    """

    robot: str
    tree: str
    grasp: str | None
    options: EngineOptions
    folder: Path
    stream: str = "evaluation"
    oracle: float = 0.0
    twin: bool = False
    colours: int = 0

    def to_data(self) -> dict[str, Any]:
        """What results say of it, and by which they are told apart."""
        options = {key: getattr(self.options, key) for key in ("engines", "perception", "noise")}
        if self.twin:  # whose noise is its own
            options |= {"engines": "twin", "noise": "fine"}
        options |= {"colours": self.colours} if self.colours else {}
        return {"robot": self.robot, "tree": self.tree, "grasp": self.grasp, "stream": self.stream, **options}


class Player:
    """Runs one draw after the other in one pipeline.

    Args:
        conditions: What is measured.
    """

    def __init__(self, conditions: Conditions) -> None:
        self._conditions = conditions
        self._pipeline: EnginePipeline | None = None

    def close(self) -> None:
        """Close the engines."""
        if self._pipeline is not None:
            self._pipeline.close()
            self._pipeline = None

    def play(self, seed: int) -> dict[str, Any]:
        """What became of a draw, as plain data.

        An exception that is no error of the input or of a machine is a failure like others.
        """
        asked, started = self._conditions, time.perf_counter()
        known: dict[str, Any] = {"seed": seed}
        try:
            drawn = task(seed, asked.robot, asked.folder, asked.stream)
            drawn = drawn.in_colours(asked.colours) if asked.colours else drawn
        except InputError as error:
            return {
                **known,
                "success": False,
                "reason": "no_task",
                "why": str(error),
                "leaf": "",
                "concept": "",
            }
        known |= {
            "words": drawn.words,
            "arrangement": drawn.arrangement,
            "objects": len(drawn.scene.objects),
            "moved": len(drawn.steps),
            "density": round(drawn.density, 3),
            "gap": drawn.gap,
        }
        try:
            known |= self._ran(drawn)
        except (LostEngine, KeyboardInterrupt):
            raise
        except Exception as error:
            self.close()
            known |= {
                "success": False,
                "status": "INVALID",
                "leaf": "",
                "concept": "",
                "reason": f"exception:{type(error).__name__}",
                "why": str(error)[:400],
                "traceback": traceback.format_exc()[-3000:],
            }
        ended_well = known.get("status") == "SUCCESS" and not known["success"]
        known["overlap"] = ended_well and known["reason"] == "penetration"
        known["lie"] = ended_well and not known["overlap"]
        if not known["success"] and asked.oracle > 0.0:
            known["oracle"] = judged(drawn, asked.oracle)
        known["seconds"] = round(time.perf_counter() - started, 2)
        return known

    def _ran(self, drawn: Task) -> dict[str, Any]:
        asked = self._conditions
        if self._pipeline is None:
            self._pipeline = build_pipeline(load_robot(asked.robot), asked.options)
        runner = Runner(
            lambda: drawn.tree(asked.tree, asked.grasp),
            drawn.scene,
            asked.options,
            self._pipeline,
            longest(drawn),
        )
        outcome = replace(episode(runner, drawn.seed, drawn.stream), wall_time=0.0)
        return {**outcome.to_data(), "concept": self.concept_of(runner, outcome.leaf)}

    @staticmethod
    def concept_of(runner: Runner, leaf: str) -> str:
        """Name of the concept of a leaf; empty for anything else."""
        node = {node.name: node for node in runner.tree.iterate()}.get(leaf)
        return concept_name(type(node.model)) if isinstance(node, ConceptNode) else ""


def longest(drawn: Task) -> float:
    """Seconds after which an episode is stopped."""
    return LONGEST[0] + LONGEST[1] * len(drawn.steps)


def judged(drawn: Task, seconds: float) -> Mapping[str, Any]:
    """What the oracle says of a task."""
    try:
        from benchmarks.any_tree.oracle import judge

        return judge(drawn, seconds).to_data()
    except (MachineError, KeyboardInterrupt):
        raise
    except Exception as error:
        return {"possible": True, "why": f"the oracle failed: {error!r}", "failed": True}


def play_one(asked: Conditions, seed: int) -> dict[str, Any]:
    """What becomes of a draw, in a worker process, which keeps its engines."""
    warnings.simplefilter("ignore", BtTasksimWarning)
    return _player(asked).play(seed)


def player_of(asked: Conditions) -> Player:
    """What runs draws under these conditions."""
    if not asked.twin:
        return Player(asked)
    from benchmarks.any_tree.on_twin import TwinPlayer

    return TwinPlayer(asked)


@lru_cache(maxsize=1)
def _player(asked: Conditions) -> Player:
    """The player of a worker process."""
    return player_of(asked)
