"""``bt-tasksim twin``."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from bt_tasksim.cli import arguments
from bt_tasksim.cli.streams import say
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.registry import register
from bt_tasksim.hardware.ros.address import DEFAULT_PORT


@register("command", "twin")
def twin(
    tree: Annotated[
        str, typer.Argument(metavar="TREE", help="The tree whose scene is set up.")
    ] = "shelf_to_shelf",
    scene: Annotated[str | None, typer.Option(metavar="S", help="Another scene, or a .yaml file.")] = None,
    robot: Annotated[str | None, typer.Option(metavar="R", help="panda, ... or a .yaml file.")] = None,
    seed: Annotated[int, typer.Option(parser=arguments.seed, metavar="S", help="Seed of the world.")] = 0,
    port: Annotated[
        int, typer.Option(parser=arguments.port, metavar="P", help="Port of rosbridge.")
    ] = DEFAULT_PORT,
    ros: Annotated[
        str, typer.Option(metavar="FILE", show_default=False, help="Topics, if not the robot's bundled ones.")
    ] = "",
    gap: Annotated[
        str,
        typer.Option(metavar="FILE", show_default=False, help="How the twin differs from the simulation."),
    ] = "",
    evaluation_port: Annotated[
        int,
        typer.Option(parser=arguments.port, metavar="P", help="Port of the evaluation; 0 takes a free one."),
    ] = 0,
    camera: Annotated[
        bool, typer.Option("--camera", help="Also publish camera images, for --perception camera.")
    ] = False,
    domain: Annotated[
        int, typer.Option(parser=arguments.domain, metavar="D", help="ROS domain, from 0 to 101.")
    ] = 42,
) -> None:
    """Start a twin of a robot's cell.

    To connect to: ROS 2 topics behind rosbridge, and MuJoCo behind them.
    """
    from bt_tasksim.core.interrupts import terminable
    from bt_tasksim.hardware.twin.launch import Twin
    from bt_tasksim.robot.description import load_robot
    from bt_tasksim.trees.load import load_source

    world = load_source(tree, robot, scene).scene
    with (
        terminable(),
        Twin(
            load_robot(world.robot),
            world.sample(seed),
            port=port,
            evaluation_port=evaluation_port,
            domain=domain,
            gap=gap,
            ros=ros,
            seed=seed,
            log=sys.stderr,
            build=True,
            camera=camera,
        ) as cell,
    ):
        chosen = {
            "--robot": robot,
            "--ros": ros,
            "--scene": scene,
            "--perception": "camera" if camera else "",
        }
        words = "".join(f" {option} {value}" for option, value in chosen.items() if value)
        try:
            say(f"twin of {world.robot}, seed {seed}, in real time; Ctrl-C ends it")
            say(f"  bt-tasksim run {tree}{words} --seed {seed} --engines ros:127.0.0.1:{cell.port}")
            say(f"  evaluation channel at port {cell.evaluation_port}, first line {cell.secret}", flush=True)
            raise MachineError(cell.wait())
        except KeyboardInterrupt:  # SIGTERM and SIGHUP, too
            return
