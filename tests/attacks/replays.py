"""Logs of runs: replayed. The run is short, so that a case takes a fraction of a second."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bt_tasksim.demos_decomp.log_file import read_log, write_log
from bt_tasksim.execution.replay import replay
from bt_tasksim.execution.run_log import RunRecorder, read_text
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees.scenarios import pick_and_place
from tests.attacks.mutations import Bait, Rng, damaged_bytes, damaged_data, damaged_hdf5, odd_values, one_of


def begin(folder: Path, bait: Bait) -> Callable[[Rng], Callable[[], object]]:
    """See `tests.attacks.__main__.KINDS`."""
    whole = folder / "whole.h5"
    tree = pick_and_place.build()
    runner = Runner(tree, pick_and_place.scene(), longest=0.6)
    recorder = RunRecorder(runner)
    recorder.write(whole, runner.run(1, record=recorder))
    log, content = read_log(whole), whole.read_bytes()
    (run,) = log.demonstrations
    texts = {name: read_text(run.extra[f"run/{name}"]) for name in ("about", "configuration", "policies")}
    xml = read_text(run.extra["run/tree"])
    path = folder / "run.h5"

    def make(rng: Rng) -> Callable[[], object]:
        kind = rng.random()
        if kind < 0.25:
            path.write_bytes(damaged_hdf5(content, rng, bait))
        elif kind < 0.3:
            path.write_bytes(damaged_bytes(content, rng))
        else:
            name = one_of(rng, [*texts, "configuration", "tree"])
            text = damaged_tree(xml, rng, bait) if name == "tree" else damaged_json(texts[name], rng, bait)
            extra = {**run.extra, f"run/{name}": np.array(text.encode("utf-8", "replace") or b" ")}
            write_log(path, dataclasses.replace(log, demonstrations=(dataclasses.replace(run, extra=extra),)))
        return lambda: replay(path)

    return make


def damaged_json(text: str, rng: Rng, bait: Bait) -> str:
    """JSON with one entry changed."""
    return json.dumps(damaged_data(json.loads(text), rng, bait, times=1)).replace("\0", "")


def damaged_tree(xml: str, rng: Rng, bait: Bait) -> str:
    """A tree in XML with one of its words changed, or another one added."""
    words = xml.split(" ")
    at = int(rng.integers(1, len(words)))
    new = str(one_of(rng, [v for v in odd_values(bait) if isinstance(v, str | int | float)]))
    match int(rng.integers(4)):
        case 0:
            words[at] = new
        case 1:
            words.insert(at, f'policy="{new}"')
        case 2:
            key, separator, _ = words[at].partition("=")
            words[at] = f'{key}="{new}"' if separator else new
        case _:
            del words[at]
    return " ".join(words).replace("\0", "")
