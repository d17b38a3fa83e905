"""The report of a run: one HTML page that needs nothing else, no network either.

It shows the tree with its statuses over time, the video in step with the timeline, curves, and what the nodes
said. `page.html`, `page.css` and `page.js` beside this file are the page's parts.
"""

from __future__ import annotations

import base64
import json
from html import escape
from importlib import resources
from pathlib import Path

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import write_text
from bt_tasksim.demos_decomp.log import Demonstration
from bt_tasksim.report.curves import report_data
from bt_tasksim.report.tree_picture import tree_svg

NO_VIDEO = "This run was not filmed."


def report_page(
    run: Demonstration, tree: Behaviour, video: bytes | None = None, no_video: str = NO_VIDEO
) -> str:
    """The page.

    Args:
        run: A recorded run, of `RunRecorder.demonstration` or read from its log.
        tree: Its tree.
        video: The run's video (MP4).
        no_video: One sentence: why there is none.
    """
    data = report_data(run)
    data["noVideo"] = no_video
    about = data["about"]
    texts = {
        "TITLE": escape(f"{about['scenario']}, seed {about['seed']}"),
        "STYLE": _part("page.css"),
        "SCRIPT": _part("page.js"),
        "TREE": tree_svg(tree),
        # Inside a script element nothing may look like the element's end.
        "DATA": json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
        "VIDEO": base64.b64encode(video).decode() if video else "",
    }
    parts = _part("page.html").split("%%")
    return "".join(texts[part] if i % 2 else part for i, part in enumerate(parts))


def write_report(
    path: str | Path,
    run: Demonstration,
    tree: Behaviour,
    video: str | Path | None = None,
    no_video: str = NO_VIDEO,
) -> None:
    """Write the report.

    Args:
        path: The HTML file.
        run: A recorded run.
        tree: Its tree.
        video: The run's video, which becomes a part of the page.
        no_video: One sentence: why there is none.

    Raises:
        InputError: The video is missing, or the folder.
        MachineError: The disk is full or not writable, or the video cannot be read.
    """
    film = None
    if video is not None:
        try:
            film = Path(video).read_bytes()
        except FileNotFoundError:
            raise InputError(f"there is no video '{video}'") from None
        except OSError as error:
            raise MachineError(f"cannot read '{video}': {error.strerror or error}") from error
    write_text(path, report_page(run, tree, film, no_video))


def _part(name: str) -> str:
    return resources.files("bt_tasksim.report").joinpath(name).read_text(encoding="utf-8")
