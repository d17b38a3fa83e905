"""How often a grasp holds: the learned policy beside the programmed and the untrained one, held-apart draws.

    python -m benchmarks.grasp --robot panda --policy grasp-panda --block B0000
    python -m benchmarks.grasp --robot panda --policy grasp-panda --draws 200    # a look, development seeds

Runs ``grasp_then_pick``: kinds of objects that no stage draws by name; 42 to 45 % of the draws lie inside
strips of sizes that stages draw from, on each axis. Counts successes of all draws and of those that
`benchmarks.oracle` found graspable, by kind of shape; failures by kind; and how far a grasp's completion
signal can be trusted: of the grasps that said "done", how many outlived the pick.

Writes ``grasp-<robot>-<noise>-<learned|untrained|programmed>.json``: of a block (`benchmarks.sealed`) to its
folder in ``benchmarks/results``, of other seeds to ``runs/benchmarks``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import oracle, sealed
from benchmarks.success import RESULTS
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.grasp import CLOSED_ON_NOTHING
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.outcomes import CANNOT_START, GOAL_LOST, LIMIT_VIOLATED, OUT_OF_REACH, TIMED_OUT
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.files import PolicyCard, save_policy
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import PROGRAMMED
from bt_tasksim.robot.description import load_robot
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation, wilson
from bt_tasksim.trees.scenarios import grasp_then_pick

NOISES = ("original", "hard")
WHO = ("learned", "untrained", "programmed")
LEAF, AFTER = "grasp target", "pick target"
VERDICTS = {"penetration": "overlap", "not_lifted": "dropped"}


def failure(outcome: EpisodeOutcome) -> str:
    """A countable kind of failure; empty for a success."""
    if outcome.success:
        return ""
    if outcome.outcome.is_a(OUT_OF_REACH) or outcome.status == "INVALID":
        return outcome.reason
    if outcome.status == "SUCCESS":
        return VERDICTS.get(outcome.reason, outcome.reason)
    if outcome.leaf == LEAF:
        if outcome.outcome.is_a(LIMIT_VIOLATED):
            return (
                "closed on nothing"
                if outcome.outcome.is_a(CLOSED_ON_NOTHING)
                else "pressed against something"
            )
        return "not done in time" if outcome.outcome.is_a(TIMED_OUT) else "could not start"
    if outcome.outcome.is_a(CANNOT_START):
        return "not held when done"
    return "lost in the pick" if outcome.outcome.is_a(GOAL_LOST) else "pick broken off"


def was_done(outcome: EpisodeOutcome) -> bool:
    """The grasp's completion signal was given: its leaf ended SUCCESS."""
    return outcome.status == "SUCCESS" or outcome.leaf == AFTER


def summary(found: Evaluation, kinds: Mapping[int, str], graspable: Mapping[int, bool]) -> dict[str, Any]:
    """What is written about one evaluation.

    Args:
        found: Its outcomes.
        kinds: Kind of the object, by seed.
        graspable: What the oracle says, by seed; empty where it was not asked.
    """
    outcomes = found.outcomes
    content = {k: v for k, v in found.to_json().items() if k not in ("outcomes", "seconds")}
    done = [o for o in outcomes if was_done(o)]
    content |= {
        "first_seed": outcomes[0].seed,
        "failures": dict(Counter(failure(o) for o in outcomes if not o.success).most_common()),
        "kinds": {
            kind: counts([o for o in outcomes if kind in (kinds[o.seed], "all")], graspable)
            for kind in (*sorted(set(kinds.values())), "all")
        },
        "completion": {
            "done": len(done),
            "right": sum(o.success for o in done),
            "interval": interval(sum(o.success for o in done), len(done)),
        },
    }
    return content


def counts(outcomes: list[EpisodeOutcome], graspable: Mapping[int, bool]) -> dict[str, Any]:
    """Draws and successes with their interval, and the same of graspable draws."""
    wins = sum(o.success for o in outcomes)
    out: dict[str, Any] = {
        "draws": len(outcomes),
        "successes": wins,
        "interval": interval(wins, len(outcomes)),
    }
    if graspable:
        possible = [o for o in outcomes if graspable[o.seed]]
        wins = sum(o.success for o in possible)
        out["graspable"] = {
            "draws": len(possible),
            "successes": wins,
            "interval": interval(wins, len(possible)),
        }
    return out


def interval(wins: int, n: int) -> list[float]:
    """Wilson's interval; none of none is anything."""
    return [round(v, 4) for v in wilson(wins, n)] if n else [0.0, 1.0]


def paired(learned: Mapping[str, Any], programmed: Mapping[str, Any]) -> dict[str, Any]:
    """Both on the same draws: failures of each, of one alone, and their ratio."""
    a, b = (set(found["failed_seeds"]) for found in (learned, programmed))
    return {
        "learned_fails": len(a),
        "programmed_fails": len(b),
        "only_learned_fails": len(a - b),
        "only_programmed_fails": len(b - a),
        "failures_ratio": len(a) / len(b) if b else None,
    }


def share(found: Mapping[str, Any]) -> str:
    """``963 of 1000, 96.3 % (94.9 to 97.3)``."""
    n, wins = found["draws"], found["successes"]
    low, high = found["interval"]
    return f"{wins} of {n}, {100 * wins / max(n, 1):.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def text(found: Mapping[str, Any], who: str) -> str:
    """The tables of one evaluation."""
    lines = [f"{found['robot']}, {found['perception']}, {who}: {found['policies'][LEAF]}"]
    for kind, row in found["kinds"].items():
        possible = f"   of graspable {share(row['graspable'])}" if "graspable" in row else ""
        lines.append(f"  {kind:16}{share(row):38}{possible}")
    failed = ", ".join(f"{n} x {kind}" for kind, n in found["failures"].items()) or "none"
    done = found["completion"]
    said = {"draws": done["done"], "successes": done["right"], "interval": done["interval"]}
    lines += [f"  failures: {failed}", f"  called done and right: {share(said)}"]
    return "\n".join(lines)


def untrained(robot: str) -> Network:
    """The middle of a learned action, careful and slow; done when the hand is still and as firm as it gets.

    It is as large as a policy that is learned, so that it takes as long.
    """
    description = load_robot(robot)
    layout = Grasp.layout(description)
    ends = dict(zip(layout, np.cumsum(list(layout.values())).tolist(), strict=True))
    n, joints = ends[next(reversed(layout))], len(description.hand_joints)
    first, second, last = np.zeros((64, n)), np.zeros((64, 64)), np.zeros((Grasp.actions + 1, 64))
    biases = np.zeros(64), np.zeros(64), np.zeros(Grasp.actions + 1)
    first[0, ends["time"] - 1] = 0.9  # ticks of a still hand; 1 after three
    # The closure that is commanded: what the hand has, and how much the command is beyond it.
    moved = np.diag(description.hand_closed - description.hand_open) + description.hand_open
    first[1, ends["hand joints"] - joints : ends["hand joints"]] = [description.closure(q) for q in moved]
    first[1, ends["squeeze"] - 1] = 0.2
    first[1], biases[0][1] = 400.0 * first[1], -400.0 * 0.985
    second[0, :2], biases[1][0] = (20.0, 10.0), -20.0 * 0.63 - 10.0  # both: 1.7, else below -1.8
    last[-1, 0] = 1.0
    return Network(np.zeros(n), np.ones(n), list(zip((first, second, last), biases, strict=True)))


def measure(robot: str, noise: str, policy: str | None, seeds: range, workers: int) -> Evaluation:
    """One evaluation; ``policy``: what the grasp leaf takes, None for the pinned one."""
    policies = (("grasp", policy),) if policy else ()
    job = Job("grasp_then_pick", robot=robot, options=EngineOptions(noise=noise), policies=policies)
    return evaluate(job, seeds, workers)


def main(arguments: list[str] | None = None) -> int:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description="Success of the grasp, learned beside programmed.")
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--policy", metavar="P", help="the learned policy; by default the pinned one")
    parser.add_argument("--noise", nargs="+", default=list(NOISES), choices=NOISES)
    parser.add_argument("--only", nargs="+", choices=WHO, help="whom to measure; by default all")
    parser.add_argument("--draws", type=int, default=oracle.DRAWS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=sealed.OUT, help="where results go without a block")
    sealed.add_arguments(parser)
    options = parser.parse_args(arguments)
    try:
        return _measure_all(options)
    except BtTasksimError as error:
        print(f"grasp: {error}", file=sys.stderr)
        return 2


def _measure_all(options: argparse.Namespace) -> int:
    names = {
        (noise, who): f"grasp/grasp-{options.robot}-{noise}-{who}"
        for noise in options.noise
        for who in options.only or WHO
    }
    for name in names.values():  # what cannot be measured is refused before anything is
        seeds = sealed.choose(options.block, options.seed, name, options.draws)
    scene = grasp_then_pick.scene(options.robot)
    kinds = {seed: scene.sample(seed).objects[0].kind for seed in seeds}
    try:
        draws = oracle.load(options.robot, RESULTS / (options.block or ""))
        graspable = {seed: bool(draws[seed]["graspable"]) for seed in seeds}
    except (BtTasksimError, KeyError) as error:
        print(f"without the oracle: {error}", file=sys.stderr)
        graspable = {}
    for noise in options.noise:
        both: dict[str, dict[str, Any]] = {}
        for who in options.only or WHO:
            with tempfile.TemporaryDirectory() as folder:
                policy = {"learned": options.policy, "programmed": PROGRAMMED, "untrained": folder}[who]
                if who == "untrained":
                    policy = f"{folder}/grasp-untrained"
                    layout = tuple(Grasp.layout(load_robot(options.robot)).items())
                    card = PolicyCard("grasp", options.robot, layout, Grasp.actions, "none")
                    save_policy(policy, untrained(options.robot), card)
                found = measure(options.robot, noise, policy, seeds, options.workers)
            if who == "learned" and found.policies[LEAF] == PROGRAMMED:
                print("no learned policy is named or pinned: only the programmed one is measured")
                continue
            both[who] = summary(found, kinds, graspable)
            sealed.keep(options.block, names[noise, who], both[who], options.out)
            print(text(both[who], who), flush=True)
        if {"learned", "programmed"} <= set(both):
            n = paired(both["learned"], both["programmed"])
            ratio = n["failures_ratio"]
            print(
                f"  on the same draws: learned fails {n['learned_fails']} times, programmed "
                f"{n['programmed_fails']}{'' if ratio is None else f', ratio {ratio:.2f}'}; alone "
                f"{n['only_learned_fails']} and {n['only_programmed_fails']}\n",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
