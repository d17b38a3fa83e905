"""A fixture from outside: a pedestal of the table's height and half."""

from bt_tasksim.core.registry import register
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.fixtures import Fixture, FixturePlace

HEIGHT = 0.12

register("fixture", "pedestal")(
    Fixture(
        name="pedestal",
        pose=(0.5, 0.25, 0.0, 1.0, 0.0, 0.0, 0.0),
        boxes=(Box(pose=(0, 0, HEIGHT / 2, 1, 0, 0, 0), size=(0.2, 0.2, HEIGHT)),),
        places=(
            FixturePlace(
                name="pedestal_top",
                kind="spot",
                position=(0, 0, HEIGHT),
                extent=(0.2, 0.2),
                centre=(0, 0),
                height=1.0,
                access=(0, 0, -1),
                exit=(0, 0, 1),
                clearance=0.1,
            ),
        ),
    )
)
