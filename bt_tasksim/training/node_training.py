"""The training of one `Train` node: rollouts, evaluations, stages, checkpoints, and its policy."""

from __future__ import annotations

import dataclasses
import json
import logging
import math
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.core.cluster import Cluster
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.files import write_text
from bt_tasksim.core.fleet import Fleet, Here
from bt_tasksim.core.poses import Array
from bt_tasksim.core.workers import Workers
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.files import CHECKPOINT, PolicyCard, load_policy, save_policy, training_folder
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import LearnedPolicy, Policy
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.checkpoint import (
    Facts,
    check_same,
    check_tensors,
    damaged,
    read_checkpoint,
    write_checkpoint,
)
from bt_tasksim.training.collectors import LENGTH, DrawResult, DrawTask, EnvironmentRollout, RolloutTask
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.episode_batch import EpisodeBatch
from bt_tasksim.training.evaluation import usual_batch
from bt_tasksim.training.keepers import KeeperElsewhere, Keeping
from bt_tasksim.training.learning_leaves import shared_layout
from bt_tasksim.training.learning_tree import why_alone_in
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.training.on_cluster import actor_memory
from bt_tasksim.training.record import CLEARLY, HISTORY, Progress
from bt_tasksim.training.rollouts import results
from bt_tasksim.training.subject import own_code, training_subject
from bt_tasksim.trees.nodes.train import Train

if TYPE_CHECKING:
    from bt_tasksim.training.learner import Learner

LOG = logging.getLogger(__name__)

WARM_UP = 64
"""Decisions of each environment before the first rollout, from which features are normalised."""


@dataclass(frozen=True)
class TrainingTask:
    """What the trainings of a tree's nodes have in common.

    Attributes:
        tree: The tree.
        scene: The scene, with its stages.
        options: Engines.
        workers: Processes, each with a batch of worlds; one is this process itself. Or actors of a cluster.
        name: Name of the tree in the cards.
        cluster: Address of a cluster.
        source: Where its actors find tree and scene.
        build: Makes one more tree of the same shape.
    """

    tree: Behaviour
    scene: WorldSource
    options: EngineOptions
    workers: int
    name: str
    cluster: str | None = None
    source: NamedTree | None = None
    build: Callable[[], Behaviour] | None = None


class NodeTraining:
    """The training of one Train node.

    Args:
        task: What all nodes of the tree have in common.
        node: The node.
        config: Its settings.
        out: Folder of its policy; None: nothing is kept.
        trained: Policies of other leaves by name, which stay as they are.
        start_from: A network to go on learning from.
        suffix: Of the name of the folder that keeps checkpoint and history.
    """

    def __init__(
        self,
        task: TrainingTask,
        node: Train,
        config: TrainConfig,
        out: Path | None,
        trained: Mapping[str, Policy],
        start_from: Network | None = None,
        suffix: str = "",
    ) -> None:
        self.task, self.node, self.config, self.out, self.trained = task, node, config, out, trained
        self.start_from = start_from
        self.folder = None if out is None else training_folder(out, suffix)
        self.stage = 0
        self.recent: deque[bool] = deque(maxlen=config.success_window)
        self.history: list[dict[str, Any]] = []
        self.best: tuple[float, dict[str, Array]] | None = None
        self.seconds = 0.0
        self.iteration = 0

    def run(self, resume: bool, report: Callable[[Progress], None] | None) -> LearnedPolicy:
        """Train, and write the policy.

        Args:
            resume: Go on from the checkpoint.
            report: Called after each rollout.

        Raises:
            InputError: There is a training already, its checkpoint is no good, or the training diverges.
        """
        if self.folder is not None and not resume and (self.folder / CHECKPOINT).exists():
            raise InputError(
                f"there is a training in '{self.folder}' already: go on with --resume, or remove the folder"
            )

        task, reward = self.task, self.config.reward
        members = min(task.workers, self.config.n_envs)
        alone = why_alone_in(task.tree, task.scene, task.options, task.build)
        worlds = 1 if alone else self._worlds(members)
        keeping = Keeping(self.node.name, task.options, reward, self.trained, worlds)

        def make() -> EpisodeBatch:
            return keeping.keeper(task.tree, task.scene, task.build)

        if alone:
            LOG.warning("the episodes run one by one: %s", alone)
        self._members = members
        if task.cluster is not None and task.source is not None:
            elsewhere = KeeperElsewhere.of(keeping, task.source, task.tree, task.scene)
            pictures = task.options.rendering or task.options.perception != "state"
            memory = actor_memory(worlds, pictures)
            with Cluster(elsewhere, task.cluster, members, memory) as actors:
                return self._learn(actors, resume, report)
        if members > 1:  # before torch starts threads of its own
            with Workers(make, members) as pool:
                return self._learn(pool, resume, report)
        kept = make()
        try:
            return self._learn(Here(kept), resume, report)
        finally:
            kept.close()

    def _worlds(self, members: int) -> int:
        """How many worlds a member of the fleet has: as many as it has use and room for."""
        config = self.config
        episodes = -(-config.n_envs // members) * math.ceil(config.n_steps / LENGTH + 1.0)
        draws = -(-config.evaluation_draws // members)
        here = 1 if self.task.cluster is not None else members
        return min(max(episodes, draws), usual_batch(self.task.options, here))

    def _learn(
        self, pool: Fleet[EpisodeBatch], resume: bool, report: Callable[[Progress], None] | None
    ) -> LearnedPolicy:
        import gymnasium
        import torch

        from bt_tasksim.training.learner import Learner

        torch.set_num_threads(1)
        config = self.config
        leaves = self.node.learners()
        layout = shared_layout(self.node, leaves, load_robot(self.task.scene.robot))
        n, m = sum(layout.values()), leaves[0].model.actions + 1
        kept = self._kept() if resume else None
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
        learner = Learner(
            gymnasium.spaces.Box(-np.inf, np.inf, (n,), np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, (m,), np.float32),
            config,
            self.folder,
        )
        checkpoint = None if kept is None else self._take_up(*kept, learner)
        if self.start_from is not None:
            learner.begin_with(self.start_from)
        if checkpoint is not None:
            learner.restore(checkpoint, self.iteration * config.rollout)
        elif self.start_from is None:
            self._warm_up(pool, learner)
        while self.iteration < config.rollouts:
            began = time.perf_counter()
            rollouts = self._collect(pool, learner, config.n_steps)
            learner.update(rollouts, self.iteration + 1)
            self.iteration += 1
            row = self._row(rollouts)
            learned = time.perf_counter() - began
            last = self.iteration == config.rollouts
            if last or (config.evaluate_every and self.iteration % config.evaluate_every == 0):
                row["held_apart"] = self._evaluate(pool, learner)
            self.seconds += time.perf_counter() - began
            row |= {"seconds": round(self.seconds, 2), "rate": config.rollout / learned}
            self.history.append(row)
            self._next_stage()
            self._log(learner, row)
            if self.folder is not None and (last or self.iteration % config.checkpoint_every == 0):
                self._checkpoint(learner)
            if report is not None:
                report(self._progress(row))
        network = self._chosen(learner)
        return self._finish(network, layout, m - 1)

    def _chosen(self, learner: Learner) -> Network:
        """The last policy, which has seen most, unless an earlier one was clearly better on other draws."""
        network: Network = learner.decisive
        last = self.history[-1].get("held_apart") if self.history else None
        if self.best is None or not last or last["successes"] / last["draws"] >= self.best[0] - CLEARLY:
            return network
        return Network.from_arrays(self.best[1])

    # ---- one rollout ------------------------------------------------------------------------------------

    def _collect(
        self, pool: Fleet[EpisodeBatch], learner: Learner, decisions: int, warm: bool = False
    ) -> list[EnvironmentRollout]:
        arrays, std = learner.network.arrays(), learner.std
        stage = self.stage if self.task.scene.stages else None
        length = (self.history[-1]["length"] if self.history else 0.0) or LENGTH
        tasks = [
            RolloutTask(
                arrays, std, (self.config.seed, int(warm), self.iteration, k), decisions, stage, length
            )
            for k in range(self.config.n_envs)
        ]
        return results(pool, tasks, self._members)

    def _warm_up(self, pool: Fleet[EpisodeBatch], learner: Learner) -> None:
        rollouts = self._collect(pool, learner, WARM_UP, warm=True)
        learner.statistics.update(np.concatenate([rollout.features for rollout in rollouts]))

    def _evaluate(self, pool: Fleet[EpisodeBatch], learner: Learner) -> dict[str, Any]:
        """Successes on held-apart draws, the same ones each time; keeps the best policy so far."""
        arrays = learner.decisive.arrays()
        tasks = [DrawTask(arrays, draw) for draw in range(self.config.evaluation_draws)]
        found: list[DrawResult] = results(pool, tasks, self._members)
        if not found:
            return {}
        wins = sum(result.success for result in found)
        if self.best is None or wins / len(found) >= self.best[0]:
            self.best = (wins / len(found), arrays)
        reasons = Counter(result.reason for result in found if not result.success)
        return {"successes": wins, "draws": len(found), "failures": dict(reasons.most_common())}

    def _row(self, rollouts: list[EnvironmentRollout]) -> dict[str, Any]:
        ends = [end for rollout in rollouts for end in rollout.ends]
        self.recent.extend(end.success for end in ends)
        stages = self.task.scene.stages
        return {
            "steps": self.iteration * self.config.rollout,
            "episodes": len(ends),
            "success": float(np.mean([end.success for end in ends])) if ends else 0.0,
            "return": float(np.mean([end.total for end in ends])) if ends else 0.0,
            "length": float(np.mean([end.decisions for end in ends])) if ends else 0.0,
            "ends": dict(Counter(end.reason for end in ends).most_common()),
            "redrawn": sum(rollout.redrawn for rollout in rollouts),
            "stage": stages[self.stage].name if stages else "",
        }

    def _next_stage(self) -> None:
        stages = self.task.scene.stages
        if not stages or self.stage >= len(stages) - 1:
            return
        stage = stages[self.stage]
        spent = sum(row["stage"] == stage.name for row in self.history)
        late = spent >= self.config.stage_share * self.config.rollouts
        enough = len(self.recent) >= self.config.success_window
        if late or (enough and float(np.mean(self.recent)) >= stage.until):
            self.stage += 1
            self.recent.clear()

    def _progress(self, row: Mapping[str, Any]) -> Progress:
        config = self.config
        held = next((r["held_apart"] for r in reversed(self.history) if r.get("held_apart")), None)
        return Progress(
            train=self.node.name,
            steps=(self.iteration * config.rollout, config.rollouts * config.rollout),
            success=float(np.mean(self.recent)) if self.recent else row["success"],
            held_apart=None if held is None else (held["successes"], held["draws"]),
            stage=row["stage"],
            rate=row["rate"],
            seconds_left=self.seconds / self.iteration * (config.rollouts - self.iteration),
        )

    def _log(self, learner: Learner, row: Mapping[str, Any]) -> None:
        logger = learner.logger
        for key in ("success", "return", "length", "rate", "episodes"):
            logger.record(f"episodes/{key}", row[key])
        logger.record("episodes/stage", self.stage)
        for reason, count in row["ends"].items():
            logger.record(f"ends/{reason}", count / max(row["episodes"], 1))
        for k, value in enumerate(learner.std.tolist()):
            logger.record(f"deviation/{k}", value)
        if row.get("held_apart"):
            held = row["held_apart"]
            logger.record("held apart/success", held["successes"] / held["draws"])
        logger.dump(row["steps"])

    # ---- files ------------------------------------------------------------------------------------------

    def _checkpoint(self, learner: Learner) -> None:
        assert self.folder is not None
        tensors = learner.tensors()
        if self.best is not None:
            tensors |= {f"best/{k}": v for k, v in self.best[1].items()}
        facts = Facts(
            config=self.config,
            about=self._about(),
            iteration=self.iteration,
            stage=self.stage,
            recent=[bool(v) for v in self.recent],
            best=None if self.best is None else self.best[0],
            seconds=self.seconds,
            history=self.history,
        )
        write_checkpoint(self.folder / CHECKPOINT, tensors, facts)
        write_text(self.folder / HISTORY, json.dumps(self.history, indent=1) + "\n")

    def _about(self) -> dict[str, str]:
        """What this is a training of, see `bt_tasksim.training.subject.training_subject`."""
        robot = load_robot(self.task.scene.robot)
        layouts = {
            leaf.name: [list(shared_layout(self.node, [leaf], robot).items()), leaf.model.actions]
            for leaf in self.node.learners()
        }
        task, source = self.task, self.task.source
        named = () if source is None else (source.tree, source.plugins)
        code = own_code(task.tree, *named)
        return training_subject(task.tree, task.scene, layouts, self.node.name, task.options, code)

    def _kept(self) -> tuple[Path, dict[str, Array], Facts] | None:
        """The checkpoint to go on from, one of this training; nothing is written before it is known to be."""
        if self.folder is None or not (self.folder / CHECKPOINT).is_file():
            return None
        path = self.folder / CHECKPOINT
        tensors, facts = read_checkpoint(path)
        check_same(path, facts, self.config, self._about())
        return path, tensors, facts

    def _take_up(
        self, path: Path, tensors: dict[str, Array], facts: Facts, learner: Learner
    ) -> dict[str, Array]:
        """Go back to where the checkpoint was written, and return the learner's part of it."""
        check_tensors(path, tensors, learner.tensors())
        if facts.stage >= max(len(self.task.scene.stages), 1):
            raise damaged(path, f"there is no stage {facts.stage}")
        best = {k.removeprefix("best/"): v for k, v in tensors.items() if k.startswith("best/")}
        if best:
            try:
                network = Network.from_arrays(best)
            except InputError as error:
                raise damaged(path, str(error)) from error
            if (network.inputs, network.outputs) != (learner.network.inputs, learner.network.outputs):
                raise damaged(path, "its best policy is another one's")
        self.iteration, self.stage, self.seconds = facts.iteration, facts.stage, facts.seconds
        self.history = [dict(row) for row in facts.history]
        self.recent.extend(facts.recent)
        self.best = (facts.best, best) if best and facts.best is not None else None
        return tensors

    def _finish(self, network: Network, layout: Mapping[str, int], actions: int) -> LearnedPolicy:
        leaf, task, scene = self.node.learners()[0], self.task, self.task.scene
        concept = type(leaf.model).__name__.lower()
        if self.out is None:
            return LearnedPolicy(network, f"{concept} learned in {task.name}")
        stages = [dataclasses.asdict(stage) for stage in scene.stages]
        card = PolicyCard(
            concept=concept,
            robot=load_robot(scene.robot).name,
            features=tuple(layout.items()),
            actions=actions,
            tree=task.name,
            scene=scene.name,
            noise=", ".join(sorted({n for le in scene.stages for n in le.noise})) or task.options.noise,
            algorithm="PPO (stable-baselines3)",
            steps=self.iteration * self.config.rollout,
            seeds=(self.config.seed,),
            wall_seconds=round(self.seconds, 1),
            configuration={
                "training": self.config.to_dict(),
                "stages": stages,
                "workers": task.workers,
            },
        )
        save_policy(self.out, network, card)
        _, card = load_policy(self.out)
        return LearnedPolicy(network, f"{self.out.name}@{card.hash}")
