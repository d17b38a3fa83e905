"""The tick loop: one tree, one scene, one episode after the other.

One tick is one control period. The tree writes a command, the pipeline carries it out and observes, and so
on until the tree ends. In simulation the outcome is then judged by the physics state (`bt_tasksim.judge`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept import ConceptNode
from bt_tasksim.context import Context
from bt_tasksim.engines.pipeline import EnginePipeline
from bt_tasksim.engines.registry import EngineOptions, build_pipeline
from bt_tasksim.errors import BtTasksimError, LeafError, SafetyStop, UnreachableError
from bt_tasksim.interrupts import ending, terminable
from bt_tasksim.judge import Verdict, at_rest, judge
from bt_tasksim.pacing import Timing
from bt_tasksim.robot import load_robot
from bt_tasksim.scene import ActorConfiguration, Scene
from bt_tasksim.world import Command, Observation, WorldModel

LONGEST = 120.0
"""Seconds of an episode after which it is stopped."""
SETTLE = 4.0
"""Longest time in seconds for which things may come to rest after the tree has ended."""


@dataclass(frozen=True)
class Step:
    """One tick, as a recorder gets it."""

    observation: Observation
    command: Command
    tree_status: Status
    pipeline: EnginePipeline


@dataclass
class Result:
    """What became of an episode.

    Attributes:
        status: The tree's own status at the end.
        why: One sentence: the judged outcome, or the reason why the tree failed.
        success: The tree ended SUCCESS and the physics state agrees.
        reason: A short, countable reason for failure; empty on success.
        verdict: The judgement by the physics state, None on a real robot.
        seed: Seed of the episode.
        control_steps: Control periods until the tree ended.
        sim_time: Seconds of the episode until the tree ended.
        wall_time: Seconds it took.
        policies: Policy in use by leaf.
        configuration: The world as drawn.
        timing: How well the control rate was kept; None where there was none to keep.
    """

    status: Status
    why: str
    success: bool
    reason: str
    verdict: Verdict | None
    seed: int
    control_steps: int
    sim_time: float
    wall_time: float
    policies: dict[str, str]
    configuration: ActorConfiguration
    timing: Timing | None = None


@dataclass
class Runner:
    """Runs one tree in one scene.

    Args:
        tree: The tree's root.
        scene: The scene.
        options: Which engines.
        pipeline: A pipeline of one's own, instead of ``options``.
        longest: Seconds of an episode after which it is stopped.

    Raises:
        InputError: The tree, the scene or the options do not fit.
    """

    tree: Behaviour
    scene: Scene
    options: EngineOptions = field(default_factory=EngineOptions)
    pipeline: EnginePipeline | None = None
    longest: float = LONGEST

    def __post_init__(self) -> None:
        from trees.authoring import check_tree

        check_tree(self.tree)
        self.robot = load_robot(self.scene.robot)
        if self.pipeline is None:
            self.pipeline = build_pipeline(self.robot, self.options)
        self.context = Context(self.robot)
        for node in self.tree.iterate():
            node.setup(context=self.context)

    def begin(self, seed: int, stream: str = "evaluation") -> tuple[ActorConfiguration, WorldModel]:
        """Draw a world, reset the engines and the tree."""
        configuration = self.scene.sample(seed, stream)
        return configuration, self.reset(configuration)

    def reset(self, configuration: ActorConfiguration) -> WorldModel:
        """Reset the engines and the tree to a world."""
        assert self.pipeline is not None
        world = configuration.world_model([tip.name for tip in self.robot.tips], self.robot.opening)
        self.tree.stop(Status.INVALID)
        self.context.hidden = self.pipeline.hidden
        self.context.begin(world, self.pipeline.reset(configuration, world))
        return world

    def run(
        self, seed: int, stream: str = "evaluation", record: Callable[[Step], None] | None = None
    ) -> Result:
        """One episode.

        Args:
            seed: Seed of the draw.
            stream: Stream of draws.
            record: Called after every tick.

        Raises:
            LeafError: A leaf raised an exception; every node has ended and the robot holds.
        """
        assert self.pipeline is not None
        started = time.perf_counter()
        with terminable() if self.pipeline.real else nullcontext():
            configuration, world = self.begin(seed, stream)
            return self.finish(configuration, world, started, record)

    def finish(
        self,
        configuration: ActorConfiguration,
        world: WorldModel,
        started: float | None = None,
        record: Callable[[Step], None] | None = None,
    ) -> Result:
        """Tick until the tree ends, let things come to rest, and judge.

        However it ends, every node has ended then, and a real robot holds.
        """
        assert self.pipeline is not None
        started = time.perf_counter() if started is None else started
        pipeline, tree = self.pipeline, self.tree
        try:
            steps, reason, why = self._loop(configuration, record)
            status = tree.status
            sim_time, timing = self.context.now, pipeline.timing()
            verdict = self._settle_and_judge(configuration, world, record)
            pipeline.stop("the run is over")
        except BaseException as error:
            with ending():
                try:
                    pipeline.stop(f"{type(error).__name__}: {error}".removesuffix(": "))
                finally:
                    end_all(tree, None)
            if pipeline.real and isinstance(error, KeyboardInterrupt):
                raise type(error)(f"every node has ended, and {_holding(pipeline)}") from error
            raise
        if status == Status.SUCCESS:
            why = "the tree succeeded; there is no ground truth to judge it by"
            if verdict is not None:
                reason, why = verdict.reason, verdict.why
        elif not reason:
            leaf = failed_leaf(tree)
            reason = f"{leaf.name} failed" if leaf is not None else "tree failed"
            if leaf is not None and leaf.feedback_message.startswith("out of reach"):
                reason = "out of reach"
            why = f"{leaf.name}: {leaf.feedback_message}" if leaf is not None else tree.feedback_message
            if note := pipeline.unseen().get(getattr(leaf, "actor", "")):
                why = f"{why}; {note}"
        return Result(
            status=status,
            why=why,
            success=status == Status.SUCCESS and not reason,
            reason=reason,
            verdict=verdict,
            seed=configuration.seed,
            control_steps=steps,
            sim_time=sim_time,
            wall_time=time.perf_counter() - started,
            policies={
                leaf.name: leaf.policy_in_use.name for leaf in tree.iterate() if isinstance(leaf, ConceptNode)
            },
            configuration=configuration,
            timing=timing,
        )

    def _loop(
        self, configuration: ActorConfiguration, record: Callable[[Step], None] | None
    ) -> tuple[int, str, str]:
        """Tick and step until the tree ends or is ended.

        Returns:
            Steps, and where the tree was ended the countable reason and the sentence.
        """
        context, pipeline, tree = self.context, self.pipeline, self.tree
        assert pipeline is not None
        steps, limit = 0, round(self.longest * configuration.control_frequency)
        while True:
            command = self.tick()
            if record is not None:
                record(Step(context.observation, command, tree.status, pipeline))
            if tree.status != Status.RUNNING:
                return steps, "", ""
            if steps >= limit:
                tree.stop(Status.INVALID)
                return steps, "time over", f"not done within {self.longest:g} s"
            try:
                self.step(command)
            except SafetyStop as stop:
                leaf = context.tool_writer or tree.tip() or tree
                end_all(tree, None)
                why = f"{leaf.name}: {stop}; {_holding(pipeline)}"
                return steps, f"safety stop, {stop.limit.replace('_', ' ')}", why
            steps += 1

    def step(self, command: Command) -> None:
        """Carry a command out for one control period, and observe.

        Where it is out of reach the robot holds, and the leaf that wrote it fails at its next tick.
        """
        context, pipeline = self.context, self.pipeline
        assert pipeline is not None
        try:
            context.advance(pipeline.step(command, look=context.look))
        except UnreachableError as error:
            writer = context.tool_writer
            context.advance(pipeline.step(Command()))
            context.refused = (writer, str(error))

    def tick(self) -> Command:
        """Tick the tree once; returns the command that its leaves have written.

        Raises:
            LeafError: A leaf raised; every node has ended.
            BtTasksimError: A leaf found an error of its own kind; every node has ended.
        """
        try:
            for _ in self.tree.tick():
                pass
            return self.context.command
        except BaseException as error:
            culprit = raising_leaf(error, self.tree)
            end_all(self.tree, culprit)
            if isinstance(error, BtTasksimError) or not isinstance(error, Exception):
                raise
            name = culprit.name if culprit is not None else self.tree.name
            raise LeafError(f"leaf '{name}' raised {type(error).__name__}: {error}") from error

    def _settle_and_judge(
        self, configuration: ActorConfiguration, world: WorldModel, record: Callable[[Step], None] | None
    ) -> Verdict | None:
        pipeline = self.pipeline
        assert pipeline is not None
        hidden = pipeline.hidden()
        if hidden is None:
            return None
        quiet = 0
        for _ in range(round(SETTLE * configuration.control_frequency)):
            quiet = quiet + 1 if at_rest(hidden) else 0
            if quiet >= 4:
                break
            try:
                self.context.advance(pipeline.step(Command()))
            except UnreachableError:
                break
            except SafetyStop:  # the guard brakes from the next step on
                continue
            if record is not None:
                record(Step(self.context.observation, Command(), self.tree.status, pipeline))
            hidden = pipeline.hidden()
            assert hidden is not None
        return judge(configuration, world, hidden)


def _holding(pipeline: EnginePipeline) -> str:
    """What the arm does after a stop."""
    return "the arm holds" if pipeline.told else "nobody could tell the arm to hold: its last command expires"


def raising_leaf(error: BaseException, tree: Behaviour) -> Behaviour | None:
    """The innermost behaviour of a tree in whose methods an exception was raised."""
    nodes = {id(node) for node in tree.iterate()}
    found = None
    trace = error.__traceback__
    while trace is not None:
        owner = trace.tb_frame.f_locals.get("self")
        if isinstance(owner, Behaviour) and id(owner) in nodes:
            found = owner
        trace = trace.tb_next
    return found


def end_all(tree: Behaviour, culprit: Behaviour | None) -> None:
    """End every running node and the one that raised; py_trees' own `stop` misses some of them."""
    for node in tree.iterate():
        if node.status == Status.RUNNING or node is culprit:
            if not node.children:
                node.stop(Status.INVALID)
            else:
                node.terminate(Status.INVALID)
                node.status = Status.INVALID
                node.iterator = node.tick()


def failed_leaf(tree: Behaviour) -> Behaviour | None:
    """The node that made the tree fail: the one that was decided last, with a reason."""
    found = tree.tip()
    if found is not None and found.feedback_message:
        return found
    failed = [n for n in tree.iterate() if n.status == Status.FAILURE and n.feedback_message]
    return failed[-1] if failed else found
