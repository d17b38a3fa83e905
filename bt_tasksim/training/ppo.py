"""Training: every `Train` node of a tree in its turn, with PPO over worker processes."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.errors import InputError
from bt_tasksim.files import whole_file, write_text
from bt_tasksim.network import Network
from bt_tasksim.policy import LearnedPolicy, Policy
from bt_tasksim.policy_files import PolicyCard, load_policy, save_policy
from bt_tasksim.poses import Array
from bt_tasksim.robot import load_robot
from bt_tasksim.scene import Scene
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.decorator import Train, train_nodes
from bt_tasksim.training.episode import EpisodeEnv, find_train, shared_layout
from bt_tasksim.training.rollouts import Lane, Task, Workers

CHECKPOINT = "checkpoint.safetensors"
HISTORY = "history.json"
FINE_TUNING = 0.25
"""Share of the steps that a backward pass takes for each node."""
CLEARLY = 0.02
"""Share of held-apart draws by which an earlier policy must have been better than the last one."""
WARM_UP = 64
"""Decisions of each lane before the first rollout, from which features are normalised."""


@dataclass(frozen=True)
class Progress:
    """Where a training stands, after each rollout.

    Attributes:
        train: Name of the Train node.
        steps: Decisions so far, and in all.
        success: Share of successes among the last episodes, exploration included.
        held_apart: Successes and draws of the last evaluation on held-apart draws; None before the first.
        lesson: Name of the lesson.
        rate: Decisions per second.
        seconds_left: Estimate.
    """

    train: str
    steps: tuple[int, int]
    success: float
    held_apart: tuple[int, int] | None
    lesson: str
    rate: float
    seconds_left: float


def train(
    tree: Behaviour,
    scene: Scene,
    steps: int | None = None,
    out: str | Path | None = None,
    config: TrainConfig | None = None,
    workers: int | None = None,
    resume: bool = False,
    options: EngineOptions | None = None,
    backward: bool = False,
    report: Callable[[Progress], None] | None = None,
    name: str | None = None,
) -> LearnedPolicy:
    """Train what a tree's `Train` nodes mark, one after the other, each with the ones before it frozen.

    Args:
        tree: The tree; worker processes are forked with it, so it need not be importable.
        scene: The scene, with its lessons.
        steps: Decisions for each node; by default those of ``config``.
        out: The policy's folder, or with several nodes the folder that holds one for each. Beside it,
            ``<out>.training`` keeps checkpoint, history and TensorBoard's events. None: nothing is kept.
        config: The settings.
        workers: Worker processes; by default one for each core.
        resume: Go on from the checkpoint.
        options: Engines; by default SAPIEN with the noise model ``original``.
        backward: Afterwards, from the last node to the first, fine-tune each to what its followers need now.
        report: Called after each rollout.
        name: Name of the tree in the cards; by default the root's.

    Returns:
        The policy of the first node.

    Raises:
        InputError: The tree has nothing to train, the settings are no good, ``out`` cannot be written, or
            there is no checkpoint to go on from.
    """
    config = config or TrainConfig()
    if steps is not None:
        config = dataclasses.replace(config, steps=steps)
    workers = workers or os.cpu_count() or 1
    options = options or EngineOptions(noise="original")
    find_train(tree)
    nodes = train_nodes(tree)
    for node in nodes:
        shared_layout(node, node.learners(), load_robot(scene.robot))
    places = {} if out is None else policy_folders(tree, out)
    if resume and places:
        beside = training_folder(places[nodes[0]])
        if not (beside / CHECKPOINT).is_file():
            raise InputError(f"there is no checkpoint in '{beside}' to go on from: train without resuming")
    trained: dict[str, Policy] = {}
    networks: dict[str, Network] = {}
    first: LearnedPolicy | None = None
    passes = [(node, config, "") for node in nodes]
    if backward and len(nodes) > 1:
        fewer = dataclasses.replace(config, steps=max(1, round(FINE_TUNING * config.steps)))
        passes += [(node, fewer, "-backward") for node in reversed(nodes)]
    for node, settings, suffix in passes:
        folder = places.get(node)
        run = _Run(tree, scene, node, settings, folder, workers, options, dict(trained), name, suffix)
        run.start_from = networks.get(node.name)
        policy = run.go(resume, report)
        networks[node.name] = policy.network
        trained |= {leaf.name: policy for leaf in node.learners()}
        if node is nodes[0]:
            first = policy
    assert first is not None
    return first


def policy_folders(tree: Behaviour, out: str | Path) -> dict[Train, Path]:
    """Where the policy of each Train node goes: ``out`` itself, or with several nodes a folder in it."""
    nodes = train_nodes(tree)
    return {node: Path(out) if len(nodes) == 1 else Path(out) / _slug(node.name) for node in nodes}


def training_folder(policy: Path, suffix: str = "") -> Path:
    """The folder beside a policy's own that keeps checkpoint, history and TensorBoard's events."""
    return policy.with_name(f"{policy.name}.training{suffix}")


class _Run:
    """The training of one Train node."""

    def __init__(
        self,
        tree: Behaviour,
        scene: Scene,
        node: Train,
        config: TrainConfig,
        out: Path | None,
        workers: int,
        options: EngineOptions,
        trained: Mapping[str, Policy],
        name: str | None,
        suffix: str,
    ) -> None:
        self.tree, self.scene, self.node, self.config = tree, scene, node, config
        self.out, self.workers, self.options, self.trained = out, workers, options, trained
        self.name = name or tree.name
        self.folder = None if out is None else training_folder(out, suffix)
        self.start_from: Network | None = None
        self.lesson = 0
        self.recent: deque[bool] = deque(maxlen=config.success_window)
        self.history: list[dict[str, Any]] = []
        self.best: tuple[float, dict[str, Array]] | None = None
        self.seconds = 0.0
        self.iteration = 0

    def go(self, resume: bool, report: Callable[[Progress], None] | None) -> LearnedPolicy:
        if self.folder is not None and not resume and (self.folder / CHECKPOINT).exists():
            raise InputError(
                f"there is a training in '{self.folder}' already: go on with --resume, or remove the folder"
            )
        tree, scene, node = self.tree, self.scene, self.node

        def make() -> EpisodeEnv:
            return EpisodeEnv(tree, scene, node.name, self.options, self.config.reward, policies=self.trained)

        pool = Workers(make, self.workers)  # before torch starts threads of its own
        try:
            return self._learn(pool, resume, report)
        finally:
            pool.close()

    def _learn(self, pool: Workers, resume: bool, report: Callable[[Progress], None] | None) -> LearnedPolicy:
        import gymnasium
        import torch

        from bt_tasksim.training.learner import Learner

        torch.set_num_threads(1)
        config = self.config
        leaves = self.node.learners()
        layout = shared_layout(self.node, leaves, load_robot(self.scene.robot))
        n, m = sum(layout.values()), leaves[0].actions + 1
        checkpoint = self._read_checkpoint() if resume else None
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
        learner = Learner(
            gymnasium.spaces.Box(-np.inf, np.inf, (n,), np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, (m,), np.float32),
            config,
            self.folder,
        )
        if self.start_from is not None:
            learner.begin_with(self.start_from)
        if checkpoint is not None:
            learner.restore(checkpoint, self.iteration * config.rollout)
        elif self.start_from is None:
            self._warm_up(pool, learner)
        while self.iteration < config.rollouts:
            began = time.perf_counter()
            lanes = self._collect(pool, learner, config.lane_steps)
            learner.update(lanes, self.iteration + 1)
            self.iteration += 1
            row = self._row(lanes)
            last = self.iteration == config.rollouts
            if last or (config.evaluate_every and self.iteration % config.evaluate_every == 0):
                row["held_apart"] = self._evaluate(pool, learner)
            spent = time.perf_counter() - began
            self.seconds += spent
            row |= {"seconds": round(self.seconds, 2), "rate": config.rollout / spent}
            self.history.append(row)
            self._next_lesson()
            self._log(learner, row)
            if self.folder is not None and (last or self.iteration % config.checkpoint_every == 0):
                self._checkpoint(learner)
            if report is not None:
                report(self._progress(row))
        network = self._chosen(learner)
        return self._finish(network, layout, m - 1)

    def _chosen(self, learner: Any) -> Network:
        """The last policy, which has seen most, unless an earlier one was clearly better on other draws."""
        network: Network = learner.decisive
        last = self.history[-1].get("held_apart") if self.history else None
        if self.best is None or not last or last["successes"] / last["draws"] >= self.best[0] - CLEARLY:
            return network
        return Network.from_arrays(self.best[1])

    # ---- one rollout ------------------------------------------------------------------------------------

    def _collect(self, pool: Workers, learner: Any, decisions: int, warm: bool = False) -> list[Lane]:
        arrays, deviation = learner.network.arrays(), learner.deviation
        lesson = self.lesson if self.scene.lessons else None
        tasks = [
            Task(
                "lane", arrays, deviation, (self.config.seed, int(warm), self.iteration, k), decisions, lesson
            )
            for k in range(self.config.lanes)
        ]
        found = dict(pool.each(tasks))
        return [found[k] for k in range(self.config.lanes)]

    def _warm_up(self, pool: Workers, learner: Any) -> None:
        lanes = self._collect(pool, learner, WARM_UP, warm=True)
        learner.statistics.update(np.concatenate([lane.features for lane in lanes]))

    def _evaluate(self, pool: Workers, learner: Any) -> dict[str, Any]:
        """Successes on held-apart draws, the same ones each time; keeps the best policy so far."""
        arrays = learner.decisive.arrays()
        tasks = [
            Task("draw", arrays, learner.deviation, (), 0, None, draw=k)
            for k in range(self.config.evaluation_draws)
        ]
        found = [result for _, result in pool.each(tasks)]
        if not found:
            return {}
        wins = sum(success for _, success, _ in found)
        if self.best is None or wins / len(found) >= self.best[0]:
            self.best = (wins / len(found), arrays)
        reasons = Counter(reason for _, success, reason in found if not success)
        return {"successes": wins, "draws": len(found), "failures": dict(reasons.most_common())}

    def _row(self, lanes: list[Lane]) -> dict[str, Any]:
        ends = [end for lane in lanes for end in lane.ends]
        self.recent.extend(end[0] for end in ends)
        lessons = self.scene.lessons
        return {
            "steps": self.iteration * self.config.rollout,
            "episodes": len(ends),
            "success": float(np.mean([e[0] for e in ends])) if ends else 0.0,
            "return": float(np.mean([e[2] for e in ends])) if ends else 0.0,
            "length": float(np.mean([e[1] for e in ends])) if ends else 0.0,
            "ends": dict(Counter(e[3] for e in ends).most_common()),
            "redrawn": sum(lane.redrawn for lane in lanes),
            "lesson": lessons[self.lesson].name if lessons else "",
        }

    def _next_lesson(self) -> None:
        lessons = self.scene.lessons
        if not lessons or self.lesson >= len(lessons) - 1:
            return
        lesson = lessons[self.lesson]
        spent = sum(row["lesson"] == lesson.name for row in self.history)
        late = spent >= self.config.lesson_share * self.config.rollouts
        enough = len(self.recent) >= self.config.success_window
        if late or (enough and float(np.mean(self.recent)) >= lesson.until):
            self.lesson += 1
            self.recent.clear()

    def _progress(self, row: Mapping[str, Any]) -> Progress:
        config = self.config
        held = next((r["held_apart"] for r in reversed(self.history) if r.get("held_apart")), None)
        return Progress(
            train=self.node.name,
            steps=(self.iteration * config.rollout, config.rollouts * config.rollout),
            success=float(np.mean(self.recent)) if self.recent else row["success"],
            held_apart=None if held is None else (held["successes"], held["draws"]),
            lesson=row["lesson"],
            rate=row["rate"],
            seconds_left=self.seconds / self.iteration * (config.rollouts - self.iteration),
        )

    def _log(self, learner: Any, row: Mapping[str, Any]) -> None:
        logger = learner.logger
        for key in ("success", "return", "length", "rate", "episodes"):
            logger.record(f"episodes/{key}", row[key])
        logger.record("episodes/lesson", self.lesson)
        for reason, count in row["ends"].items():
            logger.record(f"ends/{reason}", count / max(row["episodes"], 1))
        for k, value in enumerate(learner.deviation.tolist()):
            logger.record(f"deviation/{k}", value)
        if row.get("held_apart"):
            held = row["held_apart"]
            logger.record("held apart/success", held["successes"] / held["draws"])
        logger.dump(row["steps"])

    # ---- files ------------------------------------------------------------------------------------------

    def _checkpoint(self, learner: Any) -> None:
        from safetensors.numpy import save_file

        assert self.folder is not None
        tensors = {k: np.ascontiguousarray(v) for k, v in learner.tensors().items()}
        if self.best is not None:
            tensors |= {f"best/{k}": v for k, v in self.best[1].items()}
        facts = {
            "config": self.config.to_dict(),
            "iteration": self.iteration,
            "lesson": self.lesson,
            "recent": [bool(v) for v in self.recent],
            "best": None if self.best is None else self.best[0],
            "seconds": self.seconds,
            "history": self.history,
        }
        with whole_file(self.folder / CHECKPOINT) as path:
            save_file(tensors, path, metadata={"facts": json.dumps(facts)})
        write_text(self.folder / HISTORY, json.dumps(self.history, indent=1) + "\n")

    def _read_checkpoint(self) -> dict[str, Array] | None:
        """Go back to where the checkpoint was written, and return the learner's part of it."""
        from safetensors import SafetensorError, safe_open

        if self.folder is None or not (self.folder / CHECKPOINT).is_file():
            return None
        path = self.folder / CHECKPOINT
        try:
            with safe_open(path, framework="np") as file:
                tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
                facts = json.loads((file.metadata() or {})["facts"])
            config = TrainConfig.from_dict(facts["config"])
            iteration, lesson, recent = facts["iteration"], facts["lesson"], facts["recent"]
            seconds, history, rate = facts["seconds"], facts["history"], facts["best"]
        except (SafetensorError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"checkpoint '{path}' is damaged ({error}): remove it and train anew") from error
        if dataclasses.replace(config, steps=self.config.steps) != self.config:
            raise InputError(
                f"checkpoint '{path}' was written with other settings: resume with the same, or train anew"
            )
        self.iteration, self.lesson, self.seconds, self.history = iteration, lesson, seconds, history
        self.recent.extend(recent)
        best = {k.removeprefix("best/"): v for k, v in tensors.items() if k.startswith("best/")}
        self.best = (rate, best) if best else None
        return tensors

    def _finish(self, network: Network, layout: Mapping[str, int], actions: int) -> LearnedPolicy:
        leaf = self.node.learners()[0]
        concept = type(leaf).__name__.lower()
        if self.out is None:
            return LearnedPolicy(network, f"{concept} learned in {self.name}")
        lessons = [dataclasses.asdict(lesson) for lesson in self.scene.lessons]
        card = PolicyCard(
            concept=concept,
            robot=load_robot(self.scene.robot).name,
            features=tuple(layout.items()),
            actions=actions,
            tree=self.name,
            scene=self.scene.name,
            noise=", ".join(sorted({n for le in self.scene.lessons for n in le.noise})) or self.options.noise,
            algorithm="PPO (stable-baselines3)",
            steps=self.iteration * self.config.rollout,
            seeds=(self.config.seed,),
            wall_seconds=round(self.seconds, 1),
            configuration={"training": self.config.to_dict(), "lessons": lessons, "workers": self.workers},
        )
        save_policy(self.out, network, card)
        _, card = load_policy(self.out)
        return LearnedPolicy(network, f"{self.out.name}@{card.hash}")


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
