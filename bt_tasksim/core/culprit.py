"""Where in a user's own code an exception comes from."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from types import FrameType

from bt_tasksim.core.own_code import is_installed, is_own
from bt_tasksim.core.plugins import loaded


def users_place(error: BaseException) -> str:
    """The line of a user's file that an exception comes from.

    A file is a user's that is neither ours nor installed, or that was loaded as a plugin. Where something of
    ours has asked a part for an attribute that it lacks, it is the line of the part's class.

    Returns:
        ``my_concept.py:12``, or ``cell In[3]:12`` of a notebook, the innermost such line; empty where there
        is none.
    """
    found, trace = "", error.__traceback__
    while trace is not None:
        if _is_the_users(trace.tb_frame):
            found = f"{_file_name(trace.tb_frame.f_code.co_filename)}:{trace.tb_lineno}"
        trace = trace.tb_next
    return found or (_class_without(error) if isinstance(error, AttributeError) else "")


def with_place(error: BaseException) -> str:
    """An error's sentence, behind the line of a user's file that it comes from where it does not name it."""
    place = users_place(error)
    return f"{place}: {error}" if place and place.rpartition(":")[0] not in str(error) else str(error)


def place_of(definition: object) -> str:
    """``my_concept.py:12``, where a class or a function is defined; empty where that is not known."""
    try:
        file, line = inspect.getsourcefile(definition), inspect.getsourcelines(definition)[1]  # type: ignore[arg-type]
    except (OSError, TypeError):
        return ""
    return f"{_file_name(file)}:{line}" if file is not None else ""


def _file_name(file: str) -> str:
    """A file's name; of a cell of a notebook what its reader sees beside it, not the file behind it."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    named = getattr(getattr(shell, "compile", None), "format_code_name", lambda file: None)(file)
    return Path(file).name if named is None else " ".join(named).lower().replace("in[", "In[")


def _class_without(error: AttributeError) -> str:
    owner = error.obj if inspect.isclass(error.obj) else type(error.obj)
    module = sys.modules.get(owner.__module__)
    file = getattr(module, "__file__", None) or ""
    return place_of(owner) if file and _is_a_users(owner.__module__, file) else ""


def _is_the_users(frame: FrameType) -> bool:
    return _is_a_users(str(frame.f_globals.get("__name__", "")), frame.f_code.co_filename)


def _is_a_users(module: str, file: str) -> bool:
    if is_own(module, file):
        return True
    return is_installed(file) and bool({module, str(Path(file).resolve())} & set(loaded()))
