"""The concepts that a demonstration may show, as they announce themselves."""

from __future__ import annotations

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Quantity
from bt_tasksim.concept.task import Task
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.registry import parts
from bt_tasksim.policy.policy import concept_name

GRASPS = ContactChange(ContactState.NC, ContactState.FT, to="hand")
RELEASES = ContactChange(ContactState.FT, ContactState.NC, to="hand")
LIFTS = ContactChange(ContactState.PC, ContactState.NC)
CARRIES = ContactChange(ContactState.NC, ContactState.NC)
LANDS = ContactChange(ContactState.NC, ContactState.PC)


def concepts() -> dict[str, type[ConceptModel]]:
    """The concepts by the names that tasks have."""
    leaves = parts("concept").values()
    return {concept_name(leaf): leaf for leaf in leaves if issubclass(leaf, ConceptModel)}


def concept_of(name: str) -> type[ConceptModel] | None:
    """The concept that a task names; None where there is none."""
    return concepts().get(name)


def name_of(change: ContactChange) -> str:
    """Name of the concept that breaks, keeps or makes a contact state in this way.

    Raises:
        MachineError: No concept does.
    """
    for name, concept in concepts().items():
        if concept.contact == change:
            return name
    raise MachineError(
        f"no concept takes the contact with the {change.to} from {change.before.name} to {change.after.name}"
    )


def quantity_of(name: str, parameter: str) -> Quantity | None:
    """What a parameter of a concept measures; None where there is no such concept or parameter."""
    concept = concept_of(name)
    declared = concept.parameters().get(parameter) if concept is not None else None
    return None if declared is None else declared.quantity


def goes_to(task: Task) -> dict[str, str]:
    """Those parameters of a task that name places: in these two tasks must agree to be the same one."""
    concept = concept_of(task.concept)
    declared = {} if concept is None else concept.parameters()
    places = [name for name, parameter in declared.items() if parameter.quantity.kind == "place"]
    return {name: task.parameters[name] for name in places if name in task.parameters}
