"""Names of things are refused where a log, a topic or a terminal could not hold them."""

import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.names import check_name
from bt_tasksim.scene import Fixture, Scene, SpotSpec

BAD = ["", " ", " cup", "a/b", "../x", "a.b", ".", "a\0b", "a\nb", "a\x1b[2J", "a\u202eb", "x" * 65]


@pytest.mark.parametrize("name", BAD)
def test_bad_names_are_refused_wherever_they_are_given(name):
    with pytest.raises(InputError) as error:
        check_name(name, "the name of a thing")
    assert str(error.value).isprintable()
    for make in (
        lambda: Scene(objects={name: "cup on table"}),
        lambda: Scene(spots=[SpotSpec(name, "table", (0, 0), (0, 0))]),
        lambda: Fixture.from_data({"name": name, "boxes": [], "places": []}),
        lambda: Fixture(name, (0, 0, 0, 1, 0, 0, 0), (), ()),
    ):
        with pytest.raises(InputError):
            make()


@pytest.mark.parametrize("name", ["cup", "red cup", "cup_2", "Tasse", "カップ", "a-b", "1"])
def test_good_names_are_kept(name):
    assert check_name(name, "a name") == name
    assert list(Scene(objects={name: "cup on table"}).objects) == [name]


def test_a_name_is_a_text():
    with pytest.raises(InputError, match="found 3"):
        check_name(3, "the name")
