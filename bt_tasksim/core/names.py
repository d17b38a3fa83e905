"""Names of objects, places, fixtures and scenes, as they may be given."""

from __future__ import annotations

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import shown

LONGEST = 64
TOOL = "tool"
"""What the robot's own tool is called among paths and poses: no object of a scene has this name."""


def name_fault(name: object) -> str:
    """What is wrong with a name; empty where nothing is.

    Names stand in paths of log files, topics and topics' frames, and on terminals: so they hold no slash, no
    point and nothing that cannot be printed.
    """
    if not isinstance(name, str):
        return f"should be a name, found {shown(repr(name))}"
    if not name or name != name.strip():
        return f"should be a name without spaces around it, found '{shown(name)}'"
    if len(name) > LONGEST:
        return f"should have at most {LONGEST} characters, found {len(name)}"
    bad = next((c for c in name if c in "/." or not c.isprintable()), None)
    if bad is not None:
        return f"should hold no '/', no '.' and only characters that can be printed, found '{shown(name)}'"
    return ""


def check_name(name: object, what: str) -> str:
    """The name, if it is one.

    Args:
        name: The name.
        what: What it names, for the error, such as ``the name of an object``.

    Raises:
        InputError: See `name_fault`.
    """
    if fault := name_fault(name):
        raise InputError(f"{what} {fault}")
    return str(name)
