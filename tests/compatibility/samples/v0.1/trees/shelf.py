from bt_tasksim import Goal, Scene, run
from concept_nodes import Bring, Grasp, Pick, Place, Release
from trees import sequence


def scene(robot="panda"):
    objects = {"cup": "on upper_board"}
    return Scene(robot, fixtures=["shelf"], objects=objects, goal=Goal("cup", "lower_board"))


def build():
    return sequence(
        "shelf to shelf",
        Grasp("cup"),
        Pick("cup", distance=0.08),
        Bring("cup", to="lower_board"),
        Place("cup", on="lower_board"),
        Release("cup"),
    )


if __name__ == "__main__":
    result = run(build(), scene(), seed=7)
    print(result.status, result.why)  # Status.SUCCESS cup stands on lower_board, 2 mm and 0.0 degrees off
