"""Former names of fields and arguments still work, in calls and in files."""

import dataclasses

import pytest

from bt_tasksim import CurriculumStage, InputError, Lesson, ObjectSpec, Scene, TrainConfig
from bt_tasksim.core.document import Document
from bt_tasksim.core.renamed import with_present_names
from bt_tasksim.core.typed_file import validate
from bt_tasksim.engines.remote.plain import from_plain, to_plain
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene_schema import SceneFile


def test_calls_take_a_former_keyword():
    assert Lesson is CurriculumStage
    stages = (Lesson("first"), Lesson("last"))
    scene = Scene(objects={"cup": "on table"}, lessons=stages, knock="cup")
    assert (scene.stages, scene.disturbed) == (stages, "cup")
    assert (scene.lessons, scene.knock) == (stages, "cup")
    assert scene.sample(1, lesson=1).stage == scene.sample(1, stage=1).stage == "last"
    assert ObjectSpec(("box",), on="table", strips="odd").split == "odd"


def test_replace_takes_a_former_keyword():
    scene = dataclasses.replace(Scene(stages=(CurriculumStage("one"),)), lessons=())
    assert scene.stages == ()


def test_settings_are_read_by_former_names():
    former = {
        "lanes": 4,
        "lane_steps": 32,
        "log_deviation": -1.0,
        "final_log_deviation": -2.0,
        "lesson_share": 0.5,
    }
    present = {"n_envs": 4, "n_steps": 32, "log_std": -1.0, "final_log_std": -2.0, "stage_share": 0.5}
    assert TrainConfig.from_dict(former) == TrainConfig.from_dict(present) == TrainConfig(**former)
    with pytest.raises(InputError, match="former name"):
        TrainConfig.from_dict({"lanes": 4, "n_envs": 4})


def test_files_are_read_by_former_names():
    scene = validate(SceneFile, Document("scene", {"objects": {"cup": "on table"}, "knock": "cup"}))
    assert scene.disturbed == "cup"
    world = Scene(objects={"cup": "on table"}).sample(1)
    data = to_plain(world)
    data["lesson"] = data.pop("stage")
    assert to_plain(from_plain(ActorConfiguration, data)) == to_plain(world)


def test_both_names_at_once_are_refused():
    with pytest.raises(InputError, match="former name"):
        with_present_names({"knock": "cup", "disturbed": "can"}, {"knock": "disturbed"})
