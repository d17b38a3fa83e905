"""The text table and the picture of the graph."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from defusedxml import ElementTree

from bt_tasksim.concept.demonstrated import nearest_way
from bt_tasksim.concept.task import Task
from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.decompose import Decomposition, decompose_log
from bt_tasksim.demos_decomp.graph import build_graph
from bt_tasksim.demos_decomp.log import Log
from bt_tasksim.demos_decomp.picture import picture, write_picture
from bt_tasksim.demos_decomp.remarks import Remark, RemarkKind
from bt_tasksim.demos_decomp.synthetic import make
from bt_tasksim.demos_decomp.table import HEADS, described, task_rows, text_table

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def found():
    return decompose_log(
        Log("synthetic", tuple(make("shelf_to_shelf", i, name=f"{i:03d}")[0] for i in range(3)))
    )


def texts_inside(svg):
    """All texts, after a check that each lies inside the picture, as wide as a wide font would set it."""
    root = ElementTree.fromstring(svg)
    width, height = float(root.get("width")), float(root.get("height"))
    found = []
    for text in root.iter(f"{SVG}text"):
        size, x, y = float(text.get("font-size")), float(text.get("x")), float(text.get("y"))
        long = 0.6 * size * len(text.text or "")
        left = {"start": x, "middle": x - long / 2, "end": x - long}[text.get("text-anchor")]
        assert left >= -1, text.text
        assert left + long <= width + 1, text.text
        assert size <= y <= height, text.text
        found.append(text.text)
    return found


def test_one_line_a_task(found):
    lines = text_table(found.tasks).splitlines()
    assert len(lines) == 5
    assert len({len(line) for line in lines}) == 1
    assert "grasp    cup  from the front" in lines[0]
    assert "up 0.0" in lines[1]
    assert "off upper_board" in lines[1]
    assert "to lower_board" in lines[2]
    assert "onto lower_board" in lines[3]
    assert text_table([]) == ""
    for line, row in zip(lines, task_rows(found.tasks), strict=True):
        assert all(cell in line for cell in row)


def test_directions_in_words():
    assert nearest_way([0.1, 0, 0.9]) == "up"
    assert nearest_way([-1, 0.1, 0]) == "back"
    assert described("grasp", {"approach": [0, 0, -1]}) == "from above"
    assert (
        described("bring", {"position": [0.1, -0.001, 0.3], "via": []}) == "to (0.10, 0.00, 0.30) m, straight"
    )
    assert described("bring", {"to": "tray", "via": [[0, 0, 0]]}) == "to tray, 1 via-point"
    assert described("release", {"into": "bin"}) == "into bin"


def test_a_picture_shows_every_task_and_clips_no_label(found):
    texts = texts_inside(picture(found.graph, "shelf"))
    for name in found.graph:
        assert name in texts
    assert "to: lower_board" in texts
    assert any("seen in 3 of 3" in text for text in texts)
    assert any("±" in text for text in texts)


def test_long_names_markup_and_many_demonstrations_are_drawn():
    name = "a <very> & long name " * 8
    task = Task("wipe", 0.0, 4000.0, 0.5, {"target": name, "on": name, "press": np.float64(3)})
    graph = build_graph({f"{name} {i}": [task, dataclasses.replace(task, concept="dry")] for i in range(30)})
    texts = texts_inside(picture(graph, name * 4))
    assert "and 18 more" in texts


def test_a_long_name_and_a_long_value_stand_whole_in_the_picture():
    name, place = " ".join(f"cup{i}" for i in range(30)), "board_" * 20 + "end"
    graph = build_graph({"a": [Task("bring", 0.0, 1.0, 1.0, {"target": name, "to": place})]})
    svg = picture(graph, "heading " * 60 + "last")
    texts = texts_inside(svg)
    assert "…" not in "".join(texts)
    assert {f"cup{i}" for i in range(30)} <= set(" ".join(texts).split())
    assert place in "".join(texts) and any(text.endswith("last") for text in texts)


def test_what_has_no_room_is_said_when_pointed_at():
    names = [f"a demonstration with a long name, number {i}" for i in range(30)]
    graph = build_graph({name: [Task("grasp", 0.0, 1.0, 1.0, {"target": "cup"})] for name in names})
    said = " ".join(title.text for title in ElementTree.fromstring(picture(graph)).iter(f"{SVG}title"))
    assert all(name in said for name in names)


def test_what_cannot_be_printed_leaves_the_picture_readable():
    graph = build_graph({"a\x01": [Task("grasp", 0.0, 1.0, 1.0, {"target": "cup\x07"})]})
    texts_inside(picture(graph, "log\x1b"))


def test_in_a_notebook_a_decomposition_is_its_table_and_its_picture(found):
    head, *rows = tables(found)[0]
    assert len(head) == len(HEADS) + 1
    assert [tuple(row[:-1]) for row in rows] == task_rows(found.tasks)
    assert {row[-1] for row in rows} == {"3 of 3"}
    assert picture(found.graph) in found._repr_html_()


def test_in_a_notebook_names_are_escaped_and_remarks_are_told():
    task = Task("grasp", 0.0, 1.0, 1.0, {"target": "<b>&\x01"})
    remark = Remark(RemarkKind.MOTION, "<i> was moved")
    one = Decomposition((task,), build_graph({"<u>": [task]}), {"<u>": (task,)}, {"<u>": (remark,)})
    tasks, remarks = tables(one)
    assert tasks[1][2] == "<b>& "
    assert remarks[1] == ["<u>", "motion", "<i> was moved"]
    none = Decomposition((), build_graph({"a": []}), {"a": ()}, {"a": ()})
    assert tables(none) == []


def tables(found):
    """The texts of the cells, by table and row, of HTML that parses as XML too."""
    root = ElementTree.fromstring(f"<div>{found._repr_html_()}</div>")
    return [[[cell.text or "" for cell in row] for row in table.iter("tr")] for table in root.iter("table")]


def test_unordered_tasks_stand_side_by_side():
    cup, plate = (Task("grasp", 0.0, 1.0, 1.0, {"target": name}) for name in ("cup", "plate"))
    graph = build_graph({"a": [cup, plate], "b": [plate, cup]})
    assert {"grasp cup", "grasp plate"} <= set(texts_inside(picture(graph)))


def test_an_empty_graph_says_so():
    assert "No task was recognised." in texts_inside(picture(build_graph({"a": []})))


def test_written_whole(found, tmp_path):
    write_picture(found.graph, tmp_path / "a.svg", "title")
    ElementTree.parse(tmp_path / "a.svg")
    with pytest.raises(InputError, match="does not exist"):
        write_picture(found.graph, tmp_path / "none" / "a.svg")
