"""A run by hand: one control period at a time, with everything to look at in between.

```python
with Session(tree, scene, seed=7) as session:
    while session.step():
        print(session.time, session.active.name, session.feedback)
print(session.result)
```
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import ExitStack
from inspect import GEN_CREATED, getgeneratorstate
from typing import Any, Self

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.closing import Closing
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.interrupts import terminable
from bt_tasksim.core.markup import html_pairs
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command, Hidden, Observation
from bt_tasksim.execution.given import checked_policies, checked_root, checked_tree
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.runner import BROKEN_OFF, LONGEST, Runner, Step
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.trees.load import with_policies

CAMERA = "overview"
"""The camera of `Session.image`, where nobody names one."""
_ENGINES = tuple(f.name for f in dataclasses.fields(EngineOptions))


class Session(Closing):
    """One run, stepped by hand. What becomes of a seed is what `bt_tasksim.run` makes of it, bit for bit.

    Args:
        tree: The tree's root; or what makes it, and then each `reset` has a new one.
        scene: The scene; None for the world that the engines bring.
        seed: Seed of the draw.
        policy: Policies by concept, as for `bt_tasksim.run`.
        options: Which engines; or name them by keyword, such as ``noise="none"``, ``rendering=True``.
        longest: Seconds of an episode after which it is stopped.
        **engines: See `EngineOptions`.

    Attributes:
        runner: What runs it, with the engines in ``runner.pipeline``.
        seed: Seed of the draw.

    Raises:
        InputError: The tree, the scene, a policy or an option is no good.
        MachineError: An engine cannot start.
    """

    def __init__(
        self,
        tree: Behaviour | Callable[[], Behaviour],
        scene: WorldSource | None = None,
        seed: int = 0,
        *,
        policy: Mapping[str, str] | None = None,
        options: EngineOptions | None = None,
        longest: float = LONGEST,
        **engines: Any,
    ) -> None:
        options = engine_options(options, engines, ("seed", "policy", "options", "longest"))
        given = checked_tree(tree)
        made = with_policies(
            lambda: given if isinstance(given, Behaviour) else checked_root(given()),
            checked_policies(policy).items(),
        )
        self._makes, self._closed = None if isinstance(given, Behaviour) else made, False
        self.runner = Runner(made() if self._makes is None else made, scene, options, longest=longest)
        self.seed, self._fresh, self._signals = seed, True, ExitStack()
        self._periods: Generator[None, None, Result] | None = None
        try:
            self.reset()
        except BaseException:
            self.runner.close()
            raise

    def reset(self, seed: int | None = None) -> Observation:
        """Begin anew, whatever the run has come to.

        Args:
            seed: Seed of the draw; by default the same again.

        Returns:
            The first observation.

        Raises:
            InputError: The seed is none, the scene cannot be drawn, or the session is closed.
        """
        self._check_open()
        self._end()
        self.seed = self.seed if seed is None else seed
        if self._makes is not None and not self._fresh:
            self.runner.plant(self._makes)
        self._fresh, started = False, time.perf_counter()
        self._result: Result | None = None
        self._command, self._ended = Command(), False
        self._active: Behaviour | None = None
        configuration, world = self.runner.begin(self.seed)
        self._periods = self.runner.periods(configuration, world, started, self._note)
        return self.observation

    def step(self) -> bool:
        """One control period: the tree is ticked, and what it commands is carried out.

        In the period in which the tree ends things come to rest, and the run is judged: then there is a
        `result`.

        Returns:
            Whether the run goes on. False once it is over, however often it is asked.

        Raises:
            LeafError: A leaf raised an exception; every node has ended and the robot holds.
            MachineError: An engine failed; likewise.
        """
        if self._periods is None:
            return False
        periods, self._periods = self._periods, None
        with self.runner.blackboard:
            try:
                next(periods)
            except StopIteration as end:
                self._result = end.value
                return False
            except BaseException:
                periods.close()
                raise
        self._periods = periods
        return True

    def close(self) -> None:
        """End the run where it goes on (a real robot holds), and close the engines.

        What was seen last and the result stay; nothing can be begun anew.
        """
        self._closed = True
        try:
            self._end()
        finally:
            self._signals.close()
            self.runner.close()

    def __enter__(self) -> Self:
        self._check_open()
        if self.runner.pipeline.real:
            self._signals.enter_context(terminable())
        return self

    # ---- what there is to look at ------------------------------------------------------------------------

    @property
    def tree(self) -> Behaviour:
        """The tree's root."""
        return self.runner.tree

    @property
    def status(self) -> Status:
        """The tree's status after the last step; INVALID before the first one."""
        return self.tree.status

    @property
    def observation(self) -> Observation:
        """What is observed now; no leading axis of worlds."""
        return self.runner.observation

    @property
    def hidden(self) -> Hidden | None:
        """What only a simulator knows, now; None on a real robot."""
        return self.runner.pipeline.hidden()

    @property
    def time(self) -> float:
        """Seconds since the run began, of the simulation or on the robot's clock."""
        return float(self.observation.time)

    @property
    def configuration(self) -> ActorConfiguration:
        """The world as drawn."""
        configuration = self.runner.configuration
        assert configuration is not None
        return configuration

    @property
    def command(self) -> Command:
        """What the tree has commanded in the last step; a part is None that nobody wrote."""
        return self._command

    @property
    def active(self) -> Behaviour | None:
        """The leaf that acted in the last step: that moved the tool, or else was decided last."""
        return self._active

    @property
    def feedback(self) -> str:
        """What that leaf says, one sentence; empty where it says nothing."""
        return "" if self._active is None else self._active.feedback_message

    @property
    def result(self) -> Result:
        """What became of the run.

        Raises:
            InputError: It goes on, or broke off.
        """
        if self._result is None:
            why = "goes on: step until step() gives False" if self._periods is not None else "has broken off"
            raise InputError(f"there is no result: the run {why}")
        return self._result

    def image(self, camera: str = CAMERA) -> Array:
        """A picture of now, ``(height, width, 3)``, numbers from 0 to 255.

        Args:
            camera: Name of the camera, see `bt_tasksim.engines.cameras`.

        Raises:
            InputError: There is no such camera, or this session draws nothing, or is closed.
        """
        self._check_open()
        if self.runner.pipeline.rendering is None:
            raise InputError("this session draws nothing: make it with Session(..., rendering=True)")
        return self.runner.pipeline.render(camera).colour

    def __repr__(self) -> str:
        return f"<Session '{self.tree.name}' seed={self.seed}: {self._state()}>"

    def _repr_html_(self) -> str:
        """A small table, for notebooks."""
        return html_pairs(
            {
                "tree": self.tree.name,
                "seed": str(self.seed),
                "state": self._state(),
                "says": self.feedback if self._result is None else self._result.why,
            }
        )

    # ---- inside ------------------------------------------------------------------------------------------

    def _check_open(self) -> None:
        if self._closed:
            raise InputError("this session is closed: make a new one")

    def _state(self) -> str:
        if self._result is not None:
            return f"{'SUCCESS' if self._result.success else 'FAILURE'} after {self._result.sim_time:.2f} s"
        if self._periods is None:
            return f"broken off at {self.time:.2f} s"
        at = "" if self._active is None else f" at '{self._active.name}'"
        return f"{self.status.name}{at}, {self.time:.2f} s"

    def _note(self, step: Step) -> None:
        if self._ended or step.tree_status == Status.INVALID:
            return  # the tree has ended, and things come to rest
        self._ended = step.tree_status != Status.RUNNING
        self._command = step.command
        self._active = self.runner.context.tool_writer() or self.tree.tip()

    def _end(self) -> None:
        """End every node of a run that goes on; a real robot holds."""
        periods, self._periods = self._periods, None
        if periods is None:
            return
        if getgeneratorstate(periods) == GEN_CREATED:  # then closing it runs nothing
            self.runner.pipeline.stop(BROKEN_OFF)
        with self.runner.blackboard:
            periods.close()


def engine_options(
    options: EngineOptions | None, engines: Mapping[str, Any], others: Iterable[str] = ()
) -> EngineOptions:
    """The engines that a call names, by ``options=`` or by keyword.

    Args:
        options: The options, or None.
        engines: What was given by keyword.
        others: What else the call takes by keyword, for the nearest names.

    Raises:
        InputError: A keyword is unknown, or both were given.
    """
    unknown = next((name for name in engines if name not in _ENGINES), None)
    if unknown is not None:
        raise InputError(f"unknown option '{unknown}'{nearest(unknown, (*_ENGINES, *others))}")
    if options is not None and engines:
        raise InputError(f"give options= or {next(iter(engines))}=, not both")
    return EngineOptions(**engines) if options is None else options
