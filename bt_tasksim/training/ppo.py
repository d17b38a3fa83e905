"""Training: every `Train` node of a tree in its turn, with PPO over worker processes or a cluster."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from py_trees.behaviour import Behaviour

from bt_tasksim.core.cluster_process import LOCAL
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.locks import locked
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.files import CHECKPOINT, training_folder
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import LearnedPolicy, Policy
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.learning_leaves import find_train, shared_layout
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.training.node_training import NodeTraining, TrainingTask
from bt_tasksim.training.on_cluster import check_cluster
from bt_tasksim.training.record import Progress
from bt_tasksim.trees.nodes.train import Train, train_nodes

ACTOR_ENVS = 16
"""Environments of a rollout for each actor of a cluster, unless somebody says how many actors there are."""
FINE_TUNING = 0.25
"""Share of the steps that a backward pass takes for each node."""


def train(
    tree: Behaviour,
    scene: WorldSource,
    steps: int | None = None,
    out: str | Path | None = None,
    config: TrainConfig | None = None,
    workers: int | None = None,
    resume: bool = False,
    options: EngineOptions | None = None,
    backward: bool = False,
    report: Callable[[Progress], None] | None = None,
    name: str | None = None,
    cluster: str | None = None,
    source: NamedTree | None = None,
    build: Callable[[], Behaviour] | None = None,
) -> LearnedPolicy:
    """Train what a tree's `Train` nodes mark, one after the other, each with the ones before it frozen.

    Args:
        tree: The tree; worker processes are forked with it, so it need not be importable.
        scene: The scene, with its stages.
        steps: Decisions for each node; by default those of ``config``.
        out: The policy's folder, or with several nodes the folder that holds one for each. Beside it,
            ``<out>.training`` keeps checkpoint, history and TensorBoard's events. None: nothing is kept.
        config: The settings.
        workers: Worker processes; by default one for each core. Or actors of a cluster; by default of
            ``local`` one for each core, of another one for each `ACTOR_ENVS` environments of a rollout.
        resume: Go on from the checkpoint.
        options: Engines; by default SAPIEN with the noise model ``original``.
        backward: Afterwards, from the last node to the first, fine-tune each to what its followers need now.
        report: Called after each rollout.
        name: Name of the tree in the cards; by default the root's.
        cluster: Address of a Ray cluster, or ``local`` for one of this machine, see
            `bt_tasksim.core.cluster`. What comes of the training is the same.
        source: The names by which actors of a cluster find tree and scene, of which each builds its own.
        build: Makes one more tree of the same shape: with it a tree in which something has no form for many
            worlds runs in batches, too, see `bt_tasksim.execution.batch.BatchTree`.

    Returns:
        The policy of the first node.

    Raises:
        InputError: The tree has nothing to train, the settings are no good, ``out`` cannot be written,
            another process trains into it, there is no checkpoint to go on from, it is damaged or of
            another training, or the training diverges; then the last checkpoint stays. Or the cluster has no
            address, is of another version, or its actors find another tree.
        MachineError: A worker ended, or the cluster does not answer.
    """
    config = config or TrainConfig()
    if steps is not None:
        config = dataclasses.replace(config, steps=steps)
    options = options or EngineOptions(noise="original")
    if cluster is not None:
        check_cluster(cluster, options)
        if source is None:
            raise InputError(
                "actors of a cluster build the tree themselves: say by which name or file they find it, "
                "source=NamedTree('my_tree.py')"
            )
    workers = workers or _usual_workers(cluster, config.n_envs)
    find_train(tree)
    nodes = train_nodes(tree)
    for node in nodes:
        shared_layout(node, node.learners(), load_robot(scene.robot))
    task = TrainingTask(tree, scene, options, workers, name or tree.name, cluster, source, build)
    with nullcontext() if out is None else _alone_in(Path(out)):
        return _train(task, out, config, resume, backward, report)


def _usual_workers(cluster: str | None, n_envs: int) -> int:
    """How many processes or actors there are where nobody says it."""
    if cluster is None:
        return os.cpu_count() or 1
    return len(os.sched_getaffinity(0)) if cluster == LOCAL else max(1, n_envs // ACTOR_ENVS)


def _alone_in(out: Path) -> AbstractContextManager[None]:
    return locked(out.with_name(f".{out.name}.lock"), f"training into '{out}'")


def _train(
    task: TrainingTask,
    out: str | Path | None,
    config: TrainConfig,
    resume: bool,
    backward: bool,
    report: Callable[[Progress], None] | None,
) -> LearnedPolicy:
    """The passes over the nodes, see `train`."""
    tree = task.tree
    nodes = train_nodes(tree)
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
        start = networks.get(node.name)
        training = NodeTraining(task, node, settings, places.get(node), dict(trained), start, suffix)
        policy = training.run(resume, report)
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


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
