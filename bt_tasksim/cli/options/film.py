"""Whether a run is filmed, and how."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from bt_tasksim.core.errors import InputError

if TYPE_CHECKING:
    from bt_tasksim.report.video import Film


@dataclass(frozen=True)
class FilmFlags:
    """The words of the command line from which a `Film` is made; the defaults are the same."""

    video: Annotated[bool, typer.Option("--video", help="Record a video: run.mp4, and in the report.")] = (
        False
    )
    video_camera: Annotated[str, typer.Option(metavar="NAME", help="The camera that films.")] = "overview"
    video_size: Annotated[
        str, typer.Option(metavar="WxH", show_default=False, help="Its pixels; by default the camera's own.")
    ] = ""
    video_fps: Annotated[float, typer.Option(metavar="N", help="Frames a second, at most 20.")] = 10.0

    def film(self) -> Film:
        """How to film.

        Raises:
            InputError: Size or rate make no sense.
        """
        from bt_tasksim.report.video import Film

        return Film(self.video_camera, _size(self.video_size), self.video_fps)


def _size(text: str) -> tuple[int, int] | None:
    if not text:
        return None
    width, _, height = text.lower().partition("x")
    if not (width.isascii() and width.isdigit() and height.isascii() and height.isdigit()):
        raise InputError(f"--video-size should be like 1280x720, found '{text[:40]}'")
    return int(width[:9]), int(height[:9])
