"""The command ``bt-tasksim``.

Bad input ends with one sentence and exit code 2, a failing machine with 1, an interrupt with 130. Everything
heavy is imported by the command that needs it.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bt_tasksim.arguments import count as _count
from bt_tasksim.arguments import policy as _policy
from bt_tasksim.arguments import port as _port
from bt_tasksim.arguments import seed as _seed
from bt_tasksim.engines.remote.address import DEFAULT_PORT, LOOPBACK
from bt_tasksim.engines.ros.address import DEFAULT_PORT as ROS_PORT
from bt_tasksim.errors import BtTasksimError, InputError, MachineError, Terminated
from bt_tasksim.progress import progress

DEMO_LOG = ("demonstrations", "shelf_to_shelf", "00.h5")
DEMO_SEED = 7


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: Words of the command line; by default those of the process.

    Returns:
        The exit code.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        return int(options.command(options) or 0)
    except KeyboardInterrupt as stop:
        ended = isinstance(stop, Terminated)
        word = "terminated" if ended else "interrupted"
        print(f"{word}{f'; {stop}' if str(stop) else ''}", file=sys.stderr)
        return 143 if ended else 130
    except InputError as error:
        print(f"bt-tasksim: {error}", file=sys.stderr)
        return 2
    except BtTasksimError as error:
        print(f"bt-tasksim: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except OSError as error:
        where = f" '{error.filename}'" if error.filename else ""
        print(f"bt-tasksim: {error.strerror or error}{where}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="bt-tasksim",
        description="Behaviour trees of robot tasks: from demonstrations or by hand, simulated, judged.",
    )
    parser.set_defaults(command=lambda options: parser.print_help())
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    def add(name: str, run: Callable[[argparse.Namespace], Any], text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(command=run)
        return command

    demo = add("demo", _demo, "A shipped demonstration becomes a tree, and the tree runs with rendering.")
    demo.add_argument("--out", type=Path, default=Path("runs/demo"), help="folder for the results")

    decompose = add("decompose", _decompose, "Turn a demonstration log into tasks, a graph and a tree.")
    decompose.add_argument("log", metavar="LOG", help="an HDF5 log, a ManiSkill trajectory, or a run's log")
    decompose.add_argument("--episode", metavar="K", help="one demonstration of the log, by number or name")
    decompose.add_argument("--json", type=Path, metavar="F", help="write tasks and graph as JSON")
    decompose.add_argument("--xml", type=Path, metavar="F", help="write the tree")
    decompose.add_argument("--picture", type=Path, metavar="F.svg", help="write the graph as a picture")

    show = add("show", _show, "Print a tree; or write its picture.")
    _tree_arguments(show, seed=False)
    show.add_argument("--picture", type=Path, metavar="F.svg", help="write a picture")
    show.add_argument("--xml", type=Path, metavar="F", help="write the tree as XML")

    run = add("run", _run, "Run a tree once.")
    _tree_arguments(run)
    _engine_arguments(run)
    run.add_argument("--out", type=Path, metavar="DIR", help="folder for result, log, pictures and report")
    run.add_argument("--video", action="store_true", help="draw the run: run.mp4, and in the report")
    run.add_argument("--real-time", action="store_true", help="a simulation, too, keeps the control rate")

    policies = add("policies", _policies, "List the learned policies, or choose which one leaves take.")
    policies.add_argument("--folder", type=Path, metavar="DIR", help="list those of another folder, too")
    policies.add_argument("--json", type=Path, metavar="F", help="write the list as JSON")
    choice = policies.add_mutually_exclusive_group()
    choice.add_argument("--pin", metavar="NAME", help="have leaves take it that name no policy")
    choice.add_argument("--unpin", nargs=2, metavar=("CONCEPT", "ROBOT"), help="undo that")

    train = add("train", _train, "Learn what the Train nodes of a tree mark.")
    _tree_arguments(train, seed=False)
    train.add_argument("--steps", type=_count, metavar="N", help="decisions for each node, default 1000000")
    train.add_argument("--out", type=Path, metavar="DIR", help="the policy's folder, default runs/train-...")
    train.add_argument("--workers", type=_count, metavar="W", help="processes, default one for each core")
    train.add_argument("--seed", type=_seed, metavar="S", help="seed, default 0")
    train.add_argument("--settings", type=Path, metavar="F", help="settings of the learning, .json or .yaml")
    train.add_argument("--resume", action="store_true", help="go on from the last checkpoint")
    train.add_argument("--backward", action="store_true", help="then fine-tune them, the last one first")

    check = add("check", _check, "See what is wrong with a concept of one's own.")
    check.add_argument("file", metavar="FILE", help="the Python file that defines it")
    check.add_argument(
        "--tree", metavar="TREE", help="where it is at work, default FILE's own, train_FILE's, or a scenario"
    )

    new = add("new", _new, "Begin something of one's own: a concept with its training tree and test.")
    new.add_argument("kind", choices=("concept",), metavar="concept", help="what")
    new.add_argument("name", metavar="NAME", help="its name, such as push or wipe_table")
    new.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder, default here")

    replay = add("replay", _replay, "Run a logged run again and compare, state by state.")
    replay.add_argument("run", metavar="RUN", type=Path, help="a run's folder or its run.h5")

    evaluate = add("evaluate", _evaluate, "Run a tree on many seeded draws and count.")
    _tree_arguments(evaluate)
    _engine_arguments(evaluate)
    evaluate.add_argument("--episodes", type=_count, default=100, metavar="N", help="default 100")
    evaluate.add_argument("--workers", type=_count, default=1, metavar="W", help="processes, default 1")
    evaluate.add_argument("--json", type=Path, metavar="F", help="write everything as JSON")

    serve = add("serve-engine", _serve_engine, "Serve an engine of the pipeline to another process.")
    serve.add_argument("role", metavar="ROLE", help="kinematics, physics, rendering or postprocess")
    serve.add_argument("name", metavar="NAME", help="pinocchio; sapien or mujoco; sapien; state or camera")
    serve.add_argument("--robot", default="panda", metavar="R", help="default panda")
    serve.add_argument("--port", type=_port, default=DEFAULT_PORT, metavar="P", help="0: a free one")
    serve.add_argument("--address", default=LOOPBACK, metavar="A", help="any but this machine's own: --key")
    serve.add_argument(
        "--key", type=Path, metavar="FILE", help="the server's key: encrypt, admit its clients"
    )
    serve.add_argument("--objects", type=Path, metavar="DIR", help="mesh files, besides the bundled ones")

    twin = add(
        "twin", _twin, "Start a twin of a robot's cell: ROS 2 topics behind rosbridge, MuJoCo behind them."
    )
    twin.add_argument("tree", nargs="?", default="shelf_to_shelf", metavar="TREE", help="whose scene it has")
    twin.add_argument("--scene", metavar="S", help="another scene, or a .yaml file")
    twin.add_argument("--robot", metavar="R", help="panda, ... or a .yaml file")
    twin.add_argument("--seed", type=_seed, default=0, metavar="S", help="of the world, default 0")
    twin.add_argument("--port", type=_port, default=ROS_PORT, metavar="P", help="of rosbridge, default 9090")
    twin.add_argument("--ros", default="", metavar="FILE", help="topics, by default the robot's bundled ones")
    twin.add_argument("--gap", default="", metavar="FILE", help="how it differs from the simulation")
    twin.add_argument("--evaluation-port", type=_port, default=0, metavar="P", help="default: a free one")
    twin.add_argument("--camera", action="store_true", help="publish pictures, too, for --perception camera")
    twin.add_argument("--domain", type=_domain, default=42, metavar="D", help="ROS domain, default 42")

    new_key = add("new-key", _new_key, "Make the key files of an engine's server and its clients.")
    new_key.add_argument(
        "file", type=Path, metavar="FILE", help="the server's; the clients' is put beside it"
    )

    bench = add("bench", _bench, "Measure speed, as ratios to peers in one run.")
    bench.add_argument("--json", type=Path, metavar="F", help="write the numbers as JSON")
    bench.add_argument("--quick", action="store_true", help="fewer repetitions")
    return parser


def _tree_arguments(parser: argparse.ArgumentParser, seed: bool = True) -> None:
    parser.add_argument("tree", metavar="TREE", help="a scenario, a .py file with build(), or an .xml file")
    parser.add_argument(
        "--scene", metavar="S", help="a scenario's scene or a .yaml file, if not the tree's own"
    )
    parser.add_argument(
        "--nodes",
        metavar="F.py",
        help="a Python file with concepts and conditions of one's own, for an XML tree",
    )
    parser.add_argument("--robot", metavar="R", help="panda, xarm7_ability, ... or a .yaml file")
    if seed:
        parser.add_argument("--seed", type=_seed, default=0, metavar="S", help="(first) seed, default 0")


def _engine_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--engines",
        default="sapien",
        metavar="E",
        help="physics: sapien (default), mujoco, remote:HOST:PORT, or a robot: ros:HOST:PORT",
    )
    parser.add_argument(
        "--perception", default="state", metavar="P", help="state (default), camera, or remote:HOST:PORT"
    )
    parser.add_argument(
        "--kinematics", default="pinocchio", metavar="K", help="pinocchio (default), or remote:HOST:PORT"
    )
    parser.add_argument(
        "--rendering", default="sapien", metavar="R", help="sapien (default), or remote:HOST:PORT"
    )
    parser.add_argument("--key", default="", metavar="FILE", help="the client's key, for remote engines")
    parser.add_argument(
        "--ros", default="", metavar="FILE", help="a robot's topics, by default the bundled ones"
    )
    parser.add_argument(
        "--timeout", type=float, default=2.0, metavar="S", help="seconds a remote step may take, default 2"
    )
    parser.add_argument(
        "--connect-timeout", type=float, default=5.0, metavar="S", help="and a connection, default 5"
    )
    parser.add_argument(
        "--noise", default="fine", metavar="N", help="estimate's error: fine (default), none, original, hard"
    )
    parser.add_argument(
        "--safety", action="store_true", help="a simulation, too, runs behind the robot's safety limits"
    )
    parser.add_argument(
        "--policy",
        action="append",
        default=[],
        type=_policy,
        metavar="CONCEPT=P",
        help="every leaf of a concept takes this policy, whatever the tree says: programmed, or a policy's "
        "name or folder; repeatable",
    )


def _options(options: argparse.Namespace, rendering: bool = False) -> Any:
    from bt_tasksim.engines.registry import EngineOptions

    return EngineOptions(
        engines=options.engines,
        perception=options.perception,
        noise=options.noise,
        rendering=rendering,
        safety=options.safety,
        real_time=getattr(options, "real_time", False),
        kinematics=options.kinematics,
        renderer=options.rendering,
        key=options.key,
        ros=options.ros,
        timeout=options.timeout,
        connect_timeout=options.connect_timeout,
    )


# ---- commands ---------------------------------------------------------------------------------------------


def _demo(options: argparse.Namespace) -> int:
    from bt_tasksim.engines.registry import EngineOptions
    from bt_tasksim.report.tree_picture import tree_text
    from bt_tasksim.resources import asset
    from demos_decomp import decompose_log, open_log, text_table
    from trees.from_graph import tree_from_graph

    log = asset(*DEMO_LOG)
    print(f"1. a demonstration (synthetic): {'/'.join(DEMO_LOG)}")
    found = decompose_log(open_log(log), None)
    print(text_table(found.tasks))
    tree = tree_from_graph(found.graph, "shelf to shelf")
    print("\n2. the tree it became")
    print(tree_text(tree))
    print("\n3. the tree runs on the Panda in SAPIEN")
    from trees.load import load_source

    scene = load_source("shelf_to_shelf").scene
    result, files = _run_tree(tree, scene, DEMO_SEED, EngineOptions(rendering=True), options.out, scene.name)
    print(f"{_summary(result)}; results: {_shown(files)}")
    return 0 if result.success else 1


def _decompose(options: argparse.Namespace) -> int:
    from bt_tasksim.files import write_text
    from demos_decomp import decompose_log, graph_to_json, open_log, text_table, write_picture
    from trees.from_graph import tree_from_graph
    from trees.xml_writer import save_tree

    logged = Path(options.log) / "run.h5"
    log = open_log(logged if logged.is_file() else options.log)
    with progress("decomposing", None):
        found = decompose_log(log, options.episode)
    print(text_table(found.tasks))
    wrote = []
    if options.json:
        content = {"tasks": [t.to_json() for t in found.tasks], "graph": graph_to_json(found.graph)}
        write_text(options.json, json.dumps(content, indent=2) + "\n")
        wrote.append(options.json)
    if options.xml:
        tree = tree_from_graph(found.graph, _scene_of_log(log) or Path(options.log).stem)
        save_tree(tree, options.xml, scene=_scene_of_log(log))
        wrote.append(options.xml)
    if options.picture:
        write_picture(found.graph, options.picture)
        wrote.append(options.picture)
    if wrote:
        print("wrote " + ", ".join(str(p) for p in wrote))
    return 0


def _scene_of_log(log: Any) -> str | None:
    """The scenario whose name the demonstrations carry as their task, if there is one."""
    from trees.load import scenarios

    tasks = {d.task for d in log.demonstrations}
    name = next(iter(tasks)) if len(tasks) == 1 else ""
    return name if name in scenarios() else None


def _show(options: argparse.Namespace) -> int:
    from bt_tasksim.files import write_text
    from bt_tasksim.report.tree_picture import tree_svg, tree_text
    from trees.load import load_source, scenarios
    from trees.xml_writer import save_tree

    source = load_source(options.tree, options.robot, options.scene, options.nodes)
    tree = source.build()
    print(tree_text(tree))
    if options.picture:
        write_text(options.picture, tree_svg(tree))
        print(f"wrote {options.picture}")
    if options.xml:
        named = options.scene or (source.scene.name if source.scene.name in scenarios() else None)
        save_tree(tree, options.xml, scene=named)
        print(f"wrote {options.xml}")
    return 0


def _run(options: argparse.Namespace) -> int:
    from trees.load import load_source

    source = load_source(options.tree, options.robot, options.scene, options.nodes, options.policy)
    engines = _options(options, rendering=options.video)
    parts = [source.name, Path(source.scene.robot).stem, str(options.seed)]
    if options.perception != "state":
        parts.insert(2, options.perception.partition(":")[0])
    folder = options.out or Path("runs") / "-".join(parts)
    result, files = _run_tree(source.build(), source.scene, options.seed, engines, folder, source.name)
    print(f"{_summary(result)}; results: {_shown(files)}")
    if result.timing is not None:
        print(result.timing)
    return 0 if result.success else 1


def _run_tree(tree: Any, scene: Any, seed: int, engines: Any, folder: Path, name: str) -> tuple[Any, Any]:
    from bt_tasksim.report.report import NO_VIDEO
    from bt_tasksim.report.write import filming_runner, write_run
    from bt_tasksim.runner import Runner

    why = ""
    if engines.rendering:
        runner, why = filming_runner(tree, scene, engines)
        if why:
            print(f"(without video: {why})", file=sys.stderr)
    else:
        runner = Runner(tree, scene, engines)
    assert runner.pipeline is not None
    try:
        with progress("running", None):
            result, files = write_run(folder, runner, seed, scenario=name, no_video=why or NO_VIDEO)
    finally:
        runner.pipeline.close()
    for remark in files.remarks:
        print(remark)
    return result, files


def _policies(options: argparse.Namespace) -> int:
    from bt_tasksim.concept import ConceptModel
    from bt_tasksim.files import write_text
    from bt_tasksim.policy import concept_name
    from bt_tasksim.policy_library import describe, list_policies, pin, unpin
    from concept_nodes import catalogue

    concepts = {concept_name(c): c for c in catalogue().values() if issubclass(c, ConceptModel)}
    if options.pin:
        card = pin(options.pin, concepts)
        print(f"pinned {options.pin}@{card.hash} for '{card.concept}' on '{card.robot}'")
    if options.unpin:
        concept, robot = options.unpin
        print(f"'{unpin(concept, robot)}' is no longer pinned for '{concept}' on '{robot}'")
    found = list_policies(None, concepts)
    if options.folder:
        found += list_policies(options.folder, concepts)
    print("\n".join(describe(entry) for entry in found) or "there is no learned policy")
    if options.json:
        write_text(options.json, json.dumps([entry.to_json() for entry in found], indent=2) + "\n")
        print(f"wrote {options.json}")
    return 0


def _train(options: argparse.Namespace) -> int:
    from bt_tasksim.training import command

    asked = {k: v for k, v in vars(options).items() if k != "command"}
    print(command.run(command.Request(**asked)))
    return 0


def _check(options: argparse.Namespace) -> int:
    from bt_tasksim.checking.command import check

    with progress("checking", None):
        report = check(options.file, options.tree)
    print("\n".join(report.lines()))
    return 2 if report.errors else 0


def _new(options: argparse.Namespace) -> int:
    from bt_tasksim.new_concept import write_concept

    print(write_concept(options.name, options.out))
    return 0


def _replay(options: argparse.Namespace) -> int:
    from bt_tasksim.replay import replay

    with progress("replaying", None):
        found = replay(options.run)
    print(found.why)
    return 0 if found.identical else 1


def _evaluate(options: argparse.Namespace) -> int:
    from bt_tasksim.files import write_text
    from bt_tasksim.training.evaluation import Job, evaluate

    engines, policies = _options(options), tuple(options.policy)
    job = Job(options.tree, options.scene, options.robot, engines, options.nodes, policies)
    seeds = range(options.seed, options.seed + options.episodes)
    with progress("episodes", options.episodes) as advance:
        found = evaluate(job, seeds, options.workers, lambda outcome: advance(outcome.success))
    content = found.to_json()
    if options.json:
        write_text(options.json, json.dumps(content, indent=2) + "\n")
    low, high = content["confidence_interval"]
    print(
        f"{found.scenario} on {found.robot} ({found.engines}, {found.perception}): "
        f"{found.successes} of {content['episodes']} ({100 * content['success_rate']:.1f} %, "
        f"95 % interval {100 * low:.1f} to {100 * high:.1f}), "
        f"{content['control_steps'] / max(found.seconds, 1e-9):.0f} control steps/s"
    )
    if any(o.success and math.isnan(o.position_error) for o in found.outcomes):
        print("  (the scene has no goal: success is the tree's own word, nothing was judged)")
    for reason, count in content["failures"].items():
        worst = next(o for o in found.outcomes if o.reason == reason)
        print(f"  {count:4d} x {reason}, such as seed {worst.seed}: {worst.why}")
    if options.json:
        print(f"wrote {options.json}")
    return 0


def _serve_engine(options: argparse.Namespace) -> int:
    from bt_tasksim.engines.remote.command import serve

    serve(
        options.role,
        options.name,
        options.robot,
        options.address,
        options.port,
        key=options.key,
        objects=options.objects,
        say=lambda line: print(line, flush=True),
        complain=lambda line: print(f"bt-tasksim: {line}", file=sys.stderr, flush=True),
    )
    return 0


def _twin(options: argparse.Namespace) -> int:
    from bt_tasksim.interrupts import terminable
    from bt_tasksim.robot import load_robot
    from bt_tasksim.twin.launch import Twin
    from trees.load import load_source

    scene = load_source(options.tree, options.robot, options.scene).scene
    with (
        terminable(),
        Twin(
            load_robot(scene.robot),
            scene.sample(options.seed),
            port=options.port,
            evaluation_port=options.evaluation_port,
            domain=options.domain,
            gap=options.gap,
            ros=options.ros,
            seed=options.seed,
            log=sys.stderr,
            build=True,
            camera=options.camera,
        ) as twin,
    ):
        chosen = f" --robot {options.robot}" if options.robot else ""
        chosen += f" --ros {options.ros}" if options.ros else ""
        chosen += f" --scene {options.scene}" if options.scene else ""
        chosen += " --perception camera" if options.camera else ""
        where = f"--seed {options.seed} --engines ros:127.0.0.1:{twin.port}"
        try:
            print(f"twin of {scene.robot}, seed {options.seed}, in real time; Ctrl-C ends it")
            print(f"  bt-tasksim run {options.tree}{chosen} {where}")
            print(f"  evaluation channel at port {twin.evaluation_port}", flush=True)
            raise MachineError(twin.wait())
        except KeyboardInterrupt:  # SIGTERM and SIGHUP, too
            return 0


def _domain(text: str) -> int:
    value = _count(text) if text != "0" else 0
    if value > 101:
        raise argparse.ArgumentTypeError("a ROS domain is a number from 0 to 101")
    return value


def _new_key(options: argparse.Namespace) -> int:
    from bt_tasksim.engines.remote.keys import make_keys

    server, client = make_keys(options.file)
    print(f"wrote {server} for the server, and {client} for its clients; copy that to them, keep both secret")
    return 0


def _bench(options: argparse.Namespace) -> int:
    try:
        measure = importlib.import_module("benchmarks.speed").main
    except ImportError as error:
        raise InputError(f"the benchmarks stand beside the packages in a checkout: {error}") from None
    return int(measure(quick=options.quick, json_path=options.json))


# ---- what commands share ----------------------------------------------------------------------------------


def _summary(result: Any) -> str:
    word = "SUCCESS" if result.success else f"FAILURE ({result.reason})"
    return f"{word}: {result.why} ({result.sim_time:.1f} s simulated, {result.wall_time:.1f} s)"


def _shown(files: Any) -> str:
    return str(Path(files.folder) / "report.html")


if __name__ == "__main__":
    sys.exit(main())
