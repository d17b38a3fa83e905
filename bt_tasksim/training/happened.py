"""What is new in a world of a training."""

from __future__ import annotations

from typing import NamedTuple

from bt_tasksim.concept.status import STATUSES
from bt_tasksim.core.errors import BtTasksimError, InputError, NoDrawError
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.training.endings import Ending


class Happened(NamedTuple):
    """What is new in a world: a decision is waited for, or its episode is over, or there is none.

    Attributes:
        row: The world.
        features: What the leaf sees ``(n,)``; after an end what it saw at its last decision.
        paid: What the decision before paid, by part; None at an episode's first decision.
        ending: How the episode ended; None where it goes on.
        draw: The seed of the world.
        redrawn: How many draws before it had no activation of the subtree.
        error: Why there is no episode; None otherwise.
    """

    row: int
    features: Array
    paid: dict[str, float] | None
    ending: Ending | None
    draw: int
    redrawn: int
    error: BtTasksimError | None = None


def not_reached(train: str, tree: BatchTree, row: int, redrawn: int, draw: int) -> InputError:
    """Says that a Train node was never active in a world.

    Args:
        train: Its name.
        tree: The tree, at the end of the last draw.
        row: The world.
        redrawn: In how many draws.
        draw: The last one.
    """
    speaker = tree.reasons.speaker(0, row)
    said = None if speaker is None else tree.reasons.said_by(speaker, row)
    status, why = STATUSES[int(tree.status[row, 0])].name, "" if said is None else said.sentence
    return InputError(
        f"'{train}' was not reached in {redrawn} draws; the last one (seed {draw}) ended with {status}: {why}"
    )


def not_drawn(train: str, redrawn: int, last: NoDrawError) -> InputError:
    """Says that a Train node was never active, and that the last draw had no world.

    Args:
        train: Its name.
        redrawn: In how many draws.
        last: Why there was none.
    """
    return InputError(f"'{train}' was not reached in {redrawn} draws; the last one had no world: {last}")
