"""Against: the object touches a wall of a place's fixture, or the side of another object.

It may touch from any side; what is below it is no wall. In the hand it may still be.
"""

from __future__ import annotations

from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.outlines import Slab, fixture_slabs
from bt_tasksim.scene.relations.base import FinalState, GoalRelation, Placement, lean
from bt_tasksim.scene.specs import Goal
from bt_tasksim.scene.walls import CLOSE, nearest_wall

IS_AGAINST = register_reason("is_against", "{object} is against {place}, {gap} apart", gap=METRES)
NOT_AGAINST = register_reason("not_against", "{object} is {gap} from the walls of {place}", gap=METRES)
NO_WALL = register_reason("no_wall", "{place} has nothing that {object} could be against")


@register("goal relation", "against")
class IsAgainst(GoalRelation):
    """See the file."""

    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """See `GoalRelation.evaluate`."""
        names = {"object": goal.object, "place": goal.place}
        found = gap_to_walls(goal, final)
        angle = lean(final.pose(goal.object)[3:], final.model(goal.object))
        if found is None:
            return Placement(False, NO_WALL(**names), 10.0, angle)
        reached = found <= CLOSE
        outcome = (IS_AGAINST if reached else NOT_AGAINST)(**names, gap=max(found, 0.0))
        return Placement(reached, outcome, max(found, 0.0), angle)


def gap_to_walls(goal: Goal, final: FinalState) -> float | None:
    """Metres from a goal's object to the nearest wall of its place; None where that has none."""
    found = nearest_wall(final.parts(goal.object), _walls(goal, final))
    return None if found is None else found.gap


def _walls(goal: Goal, final: FinalState) -> tuple[Slab, ...]:
    """What is around: the other object, or the boxes of the fixture to which the place belongs."""
    if final.is_object(goal.place):
        return final.parts(goal.place)
    name = final.place(goal.place).fixture
    return tuple(
        slab
        for fixture in final.configuration.fixtures
        if fixture.name == name
        for slab in fixture_slabs(fixture)
    )
