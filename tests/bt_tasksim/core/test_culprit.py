"""An exception out of a user's own code names the file and the line, in a notebook the cell."""

from __future__ import annotations

import pytest

from bt_tasksim import Scene, Session
from bt_tasksim.core.culprit import users_place, with_place
from bt_tasksim.core.errors import InputError, LeafError
from bt_tasksim.core.fleet import sendable
from trees import sequence

CELL = """
import py_trees


class Broken(py_trees.behaviour.Behaviour):
    def update(self):
        raise ValueError("too large")
"""


@pytest.fixture
def shell():
    """A notebook's interpreter."""
    interactiveshell = pytest.importorskip("IPython.core.interactiveshell")
    made = interactiveshell.InteractiveShell.instance()
    yield made
    made.history_manager.end_session()
    interactiveshell.InteractiveShell.clear_instance()


def test_a_behaviour_in_a_cell_of_a_notebook_is_named_by_the_cell(shell):
    shell.run_cell("x = 1", store_history=True)
    shell.run_cell(CELL, store_history=True)
    tree = sequence("s", shell.user_ns["Broken"]("mine"))
    with Session(tree, Scene()) as session, pytest.raises(LeafError) as raised:
        session.step()
    assert str(raised.value) == "leaf 'mine' raised ValueError in cell In[2]:6: too large"


def test_a_sentence_names_the_line_once():
    def mine():
        Scene(objects={"bx": "on table"})

    with pytest.raises(InputError) as raised:
        mine()
    place = f"test_culprit.py:{mine.__code__.co_firstlineno + 1}"
    assert users_place(raised.value) == place
    assert with_place(raised.value) == f"{place}: {raised.value}"
    assert with_place(InputError("in test_culprit.py: x")) == "in test_culprit.py: x"


def test_the_line_comes_through_a_pipe():
    try:
        Scene(objects={"bx": "on table"})
    except InputError as error:
        sent = sendable(InputError("bad").with_traceback(error.__traceback__))
    assert type(sent) is InputError and str(sent).startswith("test_culprit.py:")
