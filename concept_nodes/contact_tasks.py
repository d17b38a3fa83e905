"""Which tasks break, keep or make which contact state: those of the registered concepts, and the paper's.

What a task does to a contact state is what its concept declares (`ConceptModel.contact`); none is listed
here. The paper's tasks are data: they say what there should be, and stand for themselves where no concept
does it yet.

After Sasabuchi et al., "Task-sequencing simulator: integrated machine learning to execution simulation for
robot manipulation", arXiv 2301.01382, 2023.
"""

from __future__ import annotations

from dataclasses import dataclass

from bt_tasksim.concept.contact import Change as Change
from bt_tasksim.concept.contact import ContactChange, ContactState, Freedom
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.registry import parts


@dataclass(frozen=True)
class ContactTask:
    """A task as a change of contact state.

    Attributes:
        name: Name of the task; of a concept's, its own in lower case.
        motion: Whether the contact state is that of translation or of rotation.
        before: Class of contact state before the task.
        after: Class of contact state after the task.
        node: Name of the concept that does it; empty for a task of the paper that none does.
    """

    name: str
    motion: Freedom
    before: ContactState
    after: ContactState
    node: str = ""

    @property
    def change(self) -> Change:
        """Whether the task breaks, keeps or makes the contact state."""
        return ContactChange(self.before, self.after, self.motion).change

    @property
    def state(self) -> ContactState:
        """The class that it breaks, keeps or makes."""
        return self.after if self.change is Change.MAKES else self.before

    @property
    def what(self) -> tuple[Freedom, ContactState, ContactState]:
        """Motion, and the classes before and after."""
        return self.motion, self.before, self.after


_NC, _PC, _TR, _OT, _PR, _OP, _FT = ContactState
PAPER: tuple[ContactTask, ...] = (
    ContactTask("pick", "translation", _PC, _NC),
    ContactTask("bring", "translation", _NC, _NC),
    ContactTask("place", "translation", _NC, _PC),
    ContactTask("unblock", "translation", _OT, _TR),
    ContactTask("slide", "translation", _TR, _TR),
    ContactTask("block", "translation", _TR, _OT),
    ContactTask("open_drawer", "translation", _OP, _PR),
    ContactTask("adjust_drawer", "translation", _PR, _PR),
    ContactTask("close_drawer", "translation", _PR, _OP),
    ContactTask("hold", "translation", _FT, _FT),
    ContactTask("tip_up", "rotation", _PC, _NC),
    ContactTask("turn", "rotation", _NC, _NC),
    ContactTask("lay_down", "rotation", _NC, _PC),
    ContactTask("turn_off_stop", "rotation", _OT, _TR),
    ContactTask("spin", "rotation", _TR, _TR),
    ContactTask("turn_onto_stop", "rotation", _TR, _OT),
    ContactTask("open_door", "rotation", _OP, _PR),
    ContactTask("adjust_door", "rotation", _PR, _PR),
    ContactTask("close_door", "rotation", _PR, _OP),
    ContactTask("hold_turn", "rotation", _FT, _FT),
)
"""The paper's tasks, each with its time reverse; one that keeps a state is its own."""


def tasks() -> tuple[ContactTask, ...]:
    """All tasks: those of the registered concepts, and the paper's for which there is none, the freest first.

    A concept's task is a change of the target's contact with the environment; what grasping and releasing
    change is the contact with the hand.
    """
    found = []
    for concept in parts("concept").values():
        contact = concept.contact if issubclass(concept, ConceptModel) else None
        if contact is not None and contact.to == "environment":
            name = concept.__name__
            found.append(ContactTask(name.lower(), contact.motion, contact.before, contact.after, name))
    done = {each.what for each in found}
    found += [each for each in PAPER if each.what not in done]
    order = list(ContactState)
    changes = [Change.BREAKS, Change.KEEPS, Change.MAKES]
    return tuple(
        sorted(
            found,
            key=lambda t: (
                t.motion == "rotation",
                order.index(t.state),
                changes.index(t.change),
                order.index(t.before),
                t.name,
            ),
        )
    )


def tasks_between(
    before: ContactState, after: ContactState, motion: Freedom = "translation"
) -> tuple[ContactTask, ...]:
    """Tasks that lead from one contact state to another.

    Args:
        before: Class before the task.
        after: Class after the task.
        motion: Which kind of motion the classes speak of.

    Returns:
        The tasks, none where there is no single task for the change.
    """
    return tuple(each for each in tasks() if each.what == (motion, before, after))


def task(name: str) -> ContactTask:
    """The task of this name: a concept's, or one of the paper's.

    Raises:
        InputError: There is none.
    """
    every = {each.name: each for each in (*PAPER, *tasks())}
    if name not in every:
        raise InputError(f"the taxonomy has no task '{name}'{nearest(name, every)}")
    return every[name]


def time_reverses(forward: ContactTask) -> tuple[ContactTask, ...]:
    """The tasks that one may see when another one is watched backwards: pick and place, open and close."""
    return tasks_between(forward.after, forward.before, forward.motion)
