"""What a concept is going to do with its target, for the concepts before it."""

from __future__ import annotations

from typing import NamedTuple

from bt_tasksim.core.poses import Array


class Aim(NamedTuple):
    """Where a concept brings its target, in one world.

    Attributes:
        poses: Poses ``(k, 7)`` of the target of which one has to be possible, the preferred ones first.
        words: What is done there, as in "be put down on the shelf".
        supports: Names of what the target touches there.
        on_the_way: It is only passed there, so an arm of few joints may lean it.
        aside: Other ones ``(m, 7)`` that will do where none of these is possible.
        onwards: Poses ``(k, n, 7)`` through which the target goes on from each of ``poses``, as it is turned;
            none where it stays there.
        along: All of them have to be possible, one after the other, from where the target is taken: it goes
            that way.
        carried: Names of what goes along with it.
    """

    poses: Array
    words: str
    supports: frozenset[str] = frozenset()
    on_the_way: bool = False
    aside: Array | None = None
    onwards: Array | None = None
    along: bool = False
    carried: frozenset[str] = frozenset()
