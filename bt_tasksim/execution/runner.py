"""The tick loop: one tree, one scene, one episode after the other.

One tick is one control period. The tree writes a command, the pipeline carries it out and observes, and so
on until the tree ends. In simulation the outcome is then judged by the physics
state (`bt_tasksim.scene.success`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import nullcontext
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.context import Context, one_world
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.planner import Planner
from bt_tasksim.concept.reporting import as_statement, speaker, whole_outcome
from bt_tasksim.core.closing import Closing
from bt_tasksim.core.errors import BtTasksimError, InputError, LeafError, UnreachableError
from bt_tasksim.core.interrupts import ending, terminable
from bt_tasksim.core.outcomes import (
    FAILED,
    TIME_OVER,
    Outcome,
    outcome_of_error,
    register_reason,
)
from bt_tasksim.core.plain import short
from bt_tasksim.core.poses import Array
from bt_tasksim.core.real_time import RealTime
from bt_tasksim.core.units import SECONDS
from bt_tasksim.core.world import Command, Hidden, Observation, WorldModel
from bt_tasksim.engines.pipeline import EnginePipeline
from bt_tasksim.execution.blackboard import WorldBlackboard
from bt_tasksim.execution.clear_start import clear_draw
from bt_tasksim.execution.given import checked_longest, checked_root, checked_scene, checked_tree
from bt_tasksim.execution.leaf_errors import clear, end_all, no_status, set_up, ticking
from bt_tasksim.execution.paths import PathKeeper
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.execution.result import Result
from bt_tasksim.hardware.safety.stop import SafetyStop
from bt_tasksim.planning.prepared import prepare
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.moments import Moments
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.scene.success import Verdict, at_rest, evaluate_success

NOT_JUDGED = register_reason("not_judged", "the tree succeeded; there is no ground truth to judge it by")
RUN_INTERRUPTED = register_reason("run_interrupted", "interrupted after {time:.1f}", time=SECONDS)
SAFETY_STOP = register_reason("safety_stop", "safety stop, {arm}")

LONGEST = 120.0
"""Seconds of an episode after which it is stopped."""
BROKEN_OFF = "the run was ended before its tree"
"""What a robot is told that has to hold since nobody asks for the next control period."""
QUIET = 4
"""Control periods in a row in which everything is at rest, after which an outcome is judged."""
SETTLE = 4.0
"""Longest time in seconds for which things may come to rest after the tree has ended."""


@dataclass(frozen=True)
class Step:
    """One tick, as a recorder gets it."""

    observation: Observation
    command: Command
    tree_status: Status
    pipeline: EnginePipeline


class Runner(Closing):
    """Runs one tree in one scene.

    Each episode has a blackboard of py_trees of its own, which begins with what stands on the process's one.

    Args:
        tree: The tree's root, or what makes it, see `plant`.
        scene: The scene; None for the world that the engines bring.
        options: Which engines; by default those of `EngineOptions`.
        pipeline: A pipeline of one's own, instead of ``options``.
        longest: Seconds of an episode after which it is stopped.

    Attributes:
        blackboard: The blackboard of the episode that began last.

    Raises:
        InputError: The tree, the scene or the options do not fit.
    """

    def __init__(
        self,
        tree: Behaviour | Callable[[], Behaviour],
        scene: WorldSource | None = None,
        options: EngineOptions | None = None,
        pipeline: EnginePipeline | None = None,
        longest: float = LONGEST,
    ) -> None:
        if options is not None and not isinstance(options, EngineOptions):
            raise InputError(f"options are EngineOptions, found {short(options)}")
        self.options = options or EngineOptions()
        tree, longest = checked_tree(tree), checked_longest(longest)
        scene = self.options.own_world() if scene is None else checked_scene(scene)
        if scene is None:
            raise InputError(f"'{self.options.engines}' brings no world of its own: name a scene")
        self.robot = load_robot(scene.robot)
        self.pipeline = pipeline or build_pipeline(self.robot, self.options)
        self.scene, self.longest = self.pipeline.worlds(scene), longest
        self.context = Context(self.robot)
        self._planted: WorldBlackboard | None = None
        self.configuration: ActorConfiguration | None = None
        self._real_time = RealTime() if self.pipeline.real else None
        try:
            if self.pipeline.real:
                self.context.planner = Planner()
            self.plant(tree)
        except BaseException:
            self._close(pipeline is None)
            raise

    def plant(self, tree: Behaviour | Callable[[], Behaviour]) -> None:
        """Run another tree from the next episode on, such as a new one, whose nodes remember nothing.

        Args:
            tree: The tree's root; or what makes it, which is done on a blackboard of its own then.

        Raises:
            InputError: The tree does not fit.
        """
        from bt_tasksim.trees.check import check_tree

        self.blackboard = WorldBlackboard()
        if isinstance(tree, Behaviour):
            self._planted = None
            check_tree(tree)
            set_up(tree, context=self.context)
            self.tree = tree
            return
        with self.blackboard:
            self.tree = checked_root(tree())
            check_tree(self.tree)
            set_up(self.tree, context=self.context)
        self._planted = self.blackboard

    def close(self) -> None:
        """Close the engines."""
        self._close(True)

    def _close(self, engines: bool) -> None:
        try:
            if self.context.planner is not None:
                self.context.planner.close()
            if engines:
                self.pipeline.close()
        finally:
            if self._real_time is not None:
                self._real_time.close()

    def begin(self, seed: int, stream: str = "evaluation") -> tuple[ActorConfiguration, WorldModel]:
        """Draw a world, reset the engines and the tree."""
        configuration = clear_draw(self.scene, seed, stream, self.robot, real=self.pipeline.real)
        return configuration, self.reset(configuration)

    def reset(self, configuration: ActorConfiguration) -> WorldModel:
        """Reset the engines and the tree to a world."""
        self.configuration, self._began = configuration, time.perf_counter()
        world = configuration.world_model([tip.name for tip in self.robot.tips], self.robot.opening)
        if self._real_time is not None:
            prepare(world, self.robot)
            self._real_time.set_aside()
        with self.blackboard:
            clear(self.tree)
        self.blackboard = WorldBlackboard(self._planted)
        self.context.ask_hidden = self._hidden
        self.context.begin([world])
        self._moments = Moments(configuration, world)
        self._observed(self.pipeline.reset(configuration, world))
        return world

    def _observed(self, observation: Observation) -> None:
        """Go on to the next tick with what is seen now."""
        self.observation = observation
        self.context.advance(one_world(observation))
        if self._moments.open and (hidden := self.pipeline.hidden()) is not None:
            self._moments.look(hidden)

    def _hidden(self, rows: Array | None = None) -> Hidden | None:
        """What only a simulator knows, ``(1, ...)``."""
        hidden = self.pipeline.hidden()
        return None if hidden is None else one_world(hidden)

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
        periods = self.periods(configuration, world, started, record)
        try:
            with self.blackboard:
                while True:
                    next(periods)
        except StopIteration as end:
            result: Result = end.value
            return result
        finally:
            periods.close()

    def periods(
        self,
        configuration: ActorConfiguration,
        world: WorldModel,
        started: float | None = None,
        record: Callable[[Step], None] | None = None,
    ) -> Generator[None, None, Result]:
        """What `finish` does, one control period at a time.

        Whoever asks for the next period enters `blackboard`. Closed before its end, it ends every node, and a
        real robot holds.

        Yields:
            Nothing, after every period but the one in which the tree ends.
        """
        pipeline, tree = self.pipeline, self.tree
        started = time.perf_counter() if started is None else started
        keeper = PathKeeper([actor.name for actor in configuration.objects])

        def kept(step: Step) -> None:
            keeper.add(pipeline.state, step.observation)
            if record is not None:
                record(step)

        try:
            steps, stopped, leaf = yield from self._loop(configuration, kept)
            status = tree.status
            sim_time, timing = self.context.now, pipeline.timing()
            verdict = self._settle_and_judge(configuration, world, kept)
            pipeline.stop("the run is over")
        except BaseException as error:
            with ending():
                try:
                    pipeline.stop(
                        BROKEN_OFF
                        if isinstance(error, GeneratorExit)
                        else f"{type(error).__name__}: {error}".removesuffix(": ")
                    )
                finally:
                    end_all(tree)
            if pipeline.real and isinstance(error, KeyboardInterrupt):
                raise type(error)(f"every node has ended, and {_holding(pipeline)}") from error
            raise
        outcome = stopped
        if status == Status.SUCCESS:
            outcome = NOT_JUDGED() if verdict is None else verdict.outcome
        elif outcome is None:
            leaf = speaker(tree)
            outcome = self._failure(leaf)
        return Result(
            status=status,
            success=status == Status.SUCCESS and (verdict is None or verdict.success),
            outcome=outcome,
            leaf="" if leaf is None else leaf.name,
            verdict=verdict,
            seed=configuration.seed,
            control_steps=steps,
            sim_time=sim_time,
            wall_time=time.perf_counter() - started,
            policies=self._policies(),
            configuration=configuration,
            timing=timing,
            paths=keeper.paths(),
        )

    def broken_off(self, steps: int, error: BtTasksimError | None = None) -> Result:
        """What a run comes to that was interrupted, or that an error ended.

        Args:
            steps: Control periods that were run.
            error: The error; None for an interrupt.
        """
        assert self.configuration is not None
        return Result(
            status=Status.INVALID,
            success=False,
            outcome=RUN_INTERRUPTED(time=self.context.now) if error is None else outcome_of_error(error),
            leaf="",
            verdict=None,
            seed=self.configuration.seed,
            control_steps=steps,
            sim_time=self.context.now,
            wall_time=time.perf_counter() - self._began,
            policies=self._policies(),
            configuration=self.configuration,
            timing=self.pipeline.timing(),
        )

    def _policies(self) -> dict[str, str]:
        """Policy in use by leaf."""
        return {
            leaf.name: leaf.policy_in_use.name
            for leaf in self.tree.iterate()
            if isinstance(leaf, ConceptNode)
        }

    def _loop(
        self, configuration: ActorConfiguration, record: Callable[[Step], None]
    ) -> Generator[None, None, tuple[int, Outcome | None, Behaviour | None]]:
        """Tick and step until the tree ends or is ended.

        Returns:
            Steps, and where the tree was ended from outside why, and the node that was acting then.
        """
        context, pipeline, tree = self.context, self.pipeline, self.tree
        steps, limit = 0, round(self.longest * configuration.control_frequency)
        while True:
            command = self.tick()
            record(Step(self.observation, command, tree.status, pipeline))
            if tree.status != Status.RUNNING:
                return steps, None, None
            if steps >= limit:
                clear(tree)
                return steps, TIME_OVER(limit=self.longest), None
            try:
                self.step(command)
            except SafetyStop as stop:
                leaf = context.tool_writer() or tree.tip() or tree
                end_all(tree)
                return steps, SAFETY_STOP(stop.outcome, arm=_holding(pipeline)), leaf
            steps += 1
            yield

    def step(self, command: Command) -> None:
        """Carry a command out for one control period, and observe.

        Where it is out of reach the robot holds, and the leaf that wrote it fails at its next tick.
        """
        context, pipeline = self.context, self.pipeline
        try:
            self._observed(pipeline.step(command))
        except UnreachableError as error:
            refusal = context.refusal(0, error)
            self._observed(pipeline.step(Command()))
            context.refused[0] = refusal

    def tick(self) -> Command:
        """Tick the tree once; returns the command that its leaves have written.

        Raises:
            LeafError: See `ticking` and `no_status`; or a leaf commands what is not finite. Every node has
                ended.
            BtTasksimError: See `ticking`.
        """
        with self.blackboard:
            return self._ticked()

    def _ticked(self) -> Command:
        without = [node for node in ticking(self.tree) if node.status == Status.INVALID]
        if self.tree.status == Status.INVALID:
            end_all(self.tree)
            raise no_status(without[0])
        try:
            return self.context.command
        except LeafError:
            end_all(self.tree)
            raise

    def _failure(self, node: Behaviour | None) -> Outcome:
        """What the node says that made the tree fail, and why its object was not seen, where it was not."""
        outcome = None if node is None else whole_outcome(node)
        if outcome is None:
            return FAILED(text="the tree failed, and no node says why")
        actor = node.model.actor if isinstance(node, ConceptNode) else ""
        unseen = self.pipeline.unseen().get(actor)
        return outcome if unseen is None else outcome.with_detail(as_statement(unseen))

    def _settle_and_judge(
        self, configuration: ActorConfiguration, world: WorldModel, record: Callable[[Step], None]
    ) -> Verdict | None:
        pipeline = self.pipeline
        own = pipeline.verdict()
        if own is not None:
            return own
        hidden = pipeline.hidden()
        if hidden is None:
            return None
        quiet = 0
        for _ in range(round(SETTLE * configuration.control_frequency)):
            quiet = quiet + 1 if at_rest(hidden.velocities) else 0
            if quiet >= QUIET:
                break
            try:
                self._observed(pipeline.step(Command()))
            except UnreachableError:
                break
            except SafetyStop:  # the guard brakes from the next step on
                continue
            record(Step(self.observation, Command(), self.tree.status, pipeline))
            hidden = pipeline.hidden()
            assert hidden is not None
        return evaluate_success(configuration, world, hidden, self._moments, pipeline.physics.deepest_pair)


def _holding(pipeline: EnginePipeline) -> str:
    """What the arm does after a stop, in words."""
    return (
        "the arm holds"
        if pipeline.hold_delivered
        else "nobody could tell the arm to hold: its last command expires"
    )
