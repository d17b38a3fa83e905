"""Which engines a run has, and how it gets at those that are elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import typer

from bt_tasksim.core.errors import InputError

if TYPE_CHECKING:
    from bt_tasksim.execution.pipelines import EngineOptions

Policy = Annotated[
    list[str],
    typer.Option(
        metavar="CONCEPT=P",
        help="Use this policy in every leaf of a concept, whatever the tree says: programmed, or the name or "
        "folder of one; repeatable.",
    ),
]


def policies(words: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Pairs of a concept's name and a policy, as in ``grasp=programmed``.

    Raises:
        InputError: A word does not read so.
    """
    pairs = []
    for word in words:
        concept, _, name = word.partition("=")
        if not concept or not name:
            raise InputError(
                f"--policy should be CONCEPT=POLICY, such as grasp=programmed, found '{word[:40]}'"
            )
        pairs.append((concept, name))
    return tuple(pairs)


@dataclass(frozen=True)
class EngineFlags:
    """The words of the command line from which `EngineOptions` are made; the defaults are the same."""

    engines: Annotated[
        str,
        typer.Option(
            metavar="E",
            help="Physics: sapien, mujoco, mujoco_warp, maniskill:ENV (which brings its world), "
            "remote:HOST:PORT or a plugin's; or a robot: ros:HOST:PORT.",
        ),
    ] = "sapien"
    perception: Annotated[str, typer.Option(metavar="P", help="state, camera, or remote:HOST:PORT.")] = (
        "state"
    )
    kinematics: Annotated[str, typer.Option(metavar="K", help="pinocchio, or remote:HOST:PORT.")] = (
        "pinocchio"
    )
    rendering: Annotated[str, typer.Option(metavar="R", help="sapien, or remote:HOST:PORT.")] = "sapien"
    key: Annotated[
        str, typer.Option(metavar="FILE", show_default=False, help="The client's key, for remote engines.")
    ] = ""
    ros: Annotated[
        str,
        typer.Option(metavar="FILE", show_default=False, help="A robot's topics, if not the bundled ones."),
    ] = ""
    timeout: Annotated[float, typer.Option(metavar="S", help="Time limit of a remote step, seconds.")] = 2.0
    connect_timeout: Annotated[
        float, typer.Option(metavar="S", help="Time limit of connecting, seconds.")
    ] = 5.0
    device: Annotated[
        str, typer.Option(metavar="D", help="What mujoco_warp runs on: cpu, cuda or cuda:N.")
    ] = "cpu"
    laws: Annotated[
        str,
        typer.Option(
            metavar="L",
            help="What a batch of worlds computes concepts and joints with: numpy, or torch on --device; "
            "auto: torch on cuda.",
        ),
    ] = "auto"
    noise: Annotated[
        str,
        typer.Option(
            metavar="N", help="Error of the pose estimates: fine, none, original, hard, or a plugin's."
        ),
    ] = "fine"
    safety: Annotated[
        bool, typer.Option("--safety", help="Apply the robot's safety limits in simulation, too.")
    ] = False
    policy: Policy = field(default_factory=list)

    def options(self, rendering: bool = False, real_time: bool = False) -> EngineOptions:
        """The options of a pipeline.

        Args:
            rendering: The run is drawn.
            real_time: A simulation, too, keeps the control rate.

        Raises:
            InputError: There is no such engine or noise model, or a time-out is no good.
        """
        from bt_tasksim.execution.pipelines import EngineOptions

        return EngineOptions(
            engines=self.engines,
            perception=self.perception,
            noise=self.noise,
            rendering=rendering,
            safety=self.safety,
            real_time=real_time,
            kinematics=self.kinematics,
            renderer=self.rendering,
            key=self.key,
            ros=self.ros,
            timeout=self.timeout,
            connect_timeout=self.connect_timeout,
            device=self.device,
            laws=self.laws,
        )
