"""Evaluations on a Ray cluster of which a node is killed at a random moment, compared with one process.

Starts the nodes of a cluster on this machine, each with ``ray start`` and a token of its own;
evaluates; kills all processes of the second node at a random moment, as a power cut would; and starts it
again for the next time. Every result must be whole and equal to that of one process, bit by bit.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import os
import random
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from bt_tasksim.core.errors import BtTasksimWarning, MachineError
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome

QUIET = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_AUTH_MODE": "token", "RAY_worker_niceness": "0"}
HEAD = "127.0.0.2"
"""Where the head is: Ray does not take 127.0.0.1 for an address that other nodes can have."""
START = 60.0
"""Seconds for a node to begin."""


class LocalNode:
    """A node of a cluster on this machine.

    Args:
        folder: Ray's folder.
        port: The head's port.
        head: It is the head.
        processors: How many actors it takes.
        variables: More of its environment.
    """

    def __init__(
        self,
        folder: Path,
        port: int,
        head: bool,
        processors: int = 1,
        variables: dict[str, str] | None = None,
    ) -> None:
        where = [f"--address={HEAD}:{port}", "--node-ip-address=127.0.0.3"]
        if head:
            where = ["--head", f"--port={port}", f"--temp-dir={folder}", f"--node-ip-address={HEAD}"]
            where += ["--include-dashboard=false"]
        self.log = tempfile.TemporaryFile()  # noqa: SIM115  # until `kill`
        self.process = subprocess.Popen(
            [
                sys.executable, "-m", "ray.scripts.scripts", "start", *where, f"--num-cpus={processors}",
                "--num-gpus=0", "--object-store-memory=80000000", "--disable-usage-stats", "--block",
            ],
            stdin=subprocess.DEVNULL,
            stdout=self.log,
            stderr=self.log,
            env={**os.environ, **(variables or {})},
            start_new_session=True,
        )  # fmt: skip

    def processes(self) -> list[int]:
        """Ids of all processes of the node."""
        found = []
        for place in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError, ValueError):
                fields = place.read_text().rpartition(")")[2].split()
                if int(fields[3]) == self.process.pid and fields[0] != "Z":
                    found.append(int(place.parent.name))
        return found

    def said(self) -> str:
        """What it has said."""
        self.log.seek(0)
        return self.log.read().decode(errors="replace")

    def kill(self) -> None:
        """Kill all of them at once."""
        while left := self.processes():
            for process in left:
                with contextlib.suppress(OSError):
                    os.kill(process, signal.SIGKILL)
            time.sleep(0.02)
        self.process.wait()
        self.log.close()


class LocalCluster:
    """A cluster on this machine: a head with one processor, and nodes that come and go.

    Args:
        folder: An empty folder with a short name, for Ray.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with socket.socket() as probe:
            probe.bind((HEAD, 0))
            self.port = probe.getsockname()[1]
        self.address = f"{HEAD}:{self.port}"
        self.nodes: list[LocalNode] = []

    def start(self, processors: int = 1, variables: dict[str, str] | None = None) -> LocalNode:
        """Start a node, the head first, and wait until it is there."""
        head = not self.nodes
        node = LocalNode(self.folder, self.port, head, processors, variables)
        self.nodes.append(node)
        until = time.monotonic() + START
        while not self._is_there(node, head):
            if time.monotonic() > until or node.process.poll() is not None:
                raise MachineError(f"a node of the cluster did not start: {node.said()[-1000:]}")
            time.sleep(0.2)
        return node

    def close(self) -> None:
        """End all nodes."""
        for node in reversed(self.nodes):
            node.kill()

    def _is_there(self, node: LocalNode, head: bool) -> bool:
        if head:
            with contextlib.suppress(OSError), socket.create_connection((HEAD, self.port), 1.0):
                return len(node.processes()) > 4
            return False
        return len(node.processes()) > 3


@contextlib.contextmanager
def local_cluster(*processors: int) -> Iterator[LocalCluster]:
    """A cluster of nodes with so many processors; this process and its children have its token."""
    variables = {**QUIET, "RAY_AUTH_TOKEN": secrets.token_hex(32)}
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        with tempfile.TemporaryDirectory(prefix="bt-ray-", ignore_cleanup_errors=True) as folder:
            cluster = LocalCluster(Path(folder))
            try:
                for count in processors:
                    cluster.start(count)
                yield cluster
            finally:
                cluster.close()
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def timeless(outcomes: tuple[EpisodeOutcome, ...]) -> list[dict[str, Any]]:
    """All of the outcomes but the time that they took."""
    return [dataclasses.replace(outcome, wall_time=0.0).to_data() for outcome in outcomes]


def _note(ended: list[int], outcome: EpisodeOutcome) -> None:
    ended.append(outcome.seed)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and say whether every result was whole and equal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=10, help="how often a node is killed")
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--tree", default="pick_and_place")
    parser.add_argument("--seed", type=int, default=0, help="of the moments and of the first episode")
    options = parser.parse_args(arguments)
    job, seeds = Job(options.tree), range(options.seed, options.seed + options.episodes)
    alone = timeless(evaluate(job, seeds).outcomes)
    moments = random.Random(options.seed)
    good = 0
    with local_cluster(1, 1) as cluster:
        began = time.monotonic()
        whole = timeless(evaluate(job, seeds, cluster=cluster.address).outcomes)
        took = time.monotonic() - began
        print(
            f"two nodes, none killed: {took:.1f} s, {'equal' if whole == alone else 'NOT EQUAL'}", flush=True
        )
        for k in range(options.times):
            # from before the actors begin to shortly before the end
            moment = moments.uniform(0.0, 0.9 * took)
            ended: list[int] = []
            killer = threading.Timer(moment, cluster.nodes[-1].kill)
            killer.start()
            began = time.monotonic()
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always", BtTasksimWarning)
                found = evaluate(job, seeds, cluster=cluster.address, progress=partial(_note, ended))
            seconds = time.monotonic() - began
            killer.join()
            same = timeless(found.outcomes) == alone and sorted(ended) == list(seeds)
            good += same
            lost = sum(issubclass(warning.category, BtTasksimWarning) for warning in said)
            words = f"killed after {moment:.1f} s, ended after {seconds:.1f} s, {lost} actors made up for"
            print(f"{k + 1}: {words}: {'whole and equal' if same else 'NOT EQUAL'}", flush=True)
            if k + 1 < options.times:
                cluster.nodes.pop()
                cluster.start()
    print(f"{good} of {options.times} results whole and equal")
    return 0 if good == options.times and whole == alone else 1


if __name__ == "__main__":
    sys.exit(main())
