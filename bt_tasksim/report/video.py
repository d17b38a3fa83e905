"""The video of a run: H.264 in an MP4 file, as browsers play it, written whole or not at all."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import whole_file
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.cameras import check_size
from bt_tasksim.execution.runner import Step
from bt_tasksim.scene.configuration import ActorConfiguration

LEAST_FPS, MOST_FPS = 0.1, 1000.0


@dataclass(frozen=True)
class Film:
    """How a run is filmed.

    Attributes:
        camera: Name of the camera.
        size: Width and height in pixels; None for the camera's own.
        fps: Frames a second; at most one a tick is drawn, 20 a second.

    Raises:
        InputError: A number makes no sense.
    """

    camera: str = "overview"
    size: tuple[int, int] | None = None
    fps: float = 10.0

    def __post_init__(self) -> None:
        if self.size is not None:
            check_size(self.size, "a video")
        if not LEAST_FPS <= self.fps <= MOST_FPS:
            raise InputError(
                f"a video of {self.fps:g} frames a second; from {LEAST_FPS:g} to {MOST_FPS:g} are possible"
            )

    @property
    def every(self) -> int:
        """Draw every so many ticks."""
        return max(1, round(ActorConfiguration.control_frequency / self.fps))


class VideoRecorder:
    """Draws the ticks of a run; give it to `Runner.run` as ``record``, inside a ``with`` block.

    The video plays in real time: a frame is shown for as long as the ticks that it stands for took.

    Args:
        path: The file to write, ``.mp4``.
        camera: Name of the camera.
        size: Width and height of the pictures in pixels; None for the camera's own.
        every: Draw every so many ticks; 2 takes half the time.
        fps: Frames a second, if not in real time.
        quality: Constant rate factor of H.264: 0 is without loss, 51 the coarsest.

    Raises:
        InputError: The path does not end in ``.mp4``, or a number makes no sense.
        MachineError: The encoder is not installed.
    """

    def __init__(
        self,
        path: str | Path,
        camera: str = "overview",
        *,
        size: tuple[int, int] | None = None,
        every: int = 1,
        fps: float | None = None,
        quality: int = 23,
    ) -> None:
        self.path = Path(path)
        if self.path.suffix.lower() != ".mp4":
            raise InputError(f"cannot write a video '{path}': its name should end in .mp4")
        if every < 1 or (fps is not None and not 0 < fps <= 1000) or not 0 <= quality <= 51:
            raise InputError(
                f"a video of every {every} ticks, {fps} frames a second and quality {quality} cannot be made"
            )
        self.camera, self.size, self.every, self.fps, self.quality = camera, size, every, fps, quality
        self.frames = 0
        self._executable = _encoder()
        self._files = contextlib.ExitStack()
        self._ticks = 0
        self._first: tuple[float, Array] | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._complaints: IO[bytes] | None = None
        self._unfinished: Path | None = None

    def __enter__(self) -> VideoRecorder:
        """Begin the file."""
        self._unfinished = self._files.enter_context(whole_file(self.path))
        self._complaints = self._files.enter_context(tempfile.TemporaryFile())
        return self

    def __call__(self, step: Step) -> None:
        """Draw one tick, if it is its turn.

        Raises:
            MachineError: The encoder has stopped, as on a full disk.
            RuntimeError: The pipeline has no rendering engine, or there is no ``with`` block.
        """
        if self._unfinished is None:
            raise RuntimeError("a VideoRecorder records inside a 'with' block")
        self._ticks += 1
        if (self._ticks - 1) % self.every:
            return
        frame = step.pipeline.render(self.camera, size=self.size).colour
        time = float(step.observation.time)
        if self._process is None:
            if self._first is None:  # the second frame tells how long the first one is shown
                self._first = (time, frame)
                self.frames = 1
                return
            period = time - self._first[0]
            self.fps = self.fps or (1.0 / period if period > 0 else 20.0)
            self._begin(self._first[1])
        self._write(frame)
        self.frames += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the file; after an error there is none.

        Raises:
            MachineError: The encoder failed, or nothing was drawn.
        """
        try:
            if error is None:
                if self._process is None and self._first is not None:
                    self.fps = self.fps or 20.0
                    self._begin(self._first[1])
                self._finish()
        except BaseException as own:
            self._stop()
            self._files.__exit__(type(own), own, own.__traceback__)
            raise
        self._stop()
        self._files.__exit__(kind, error, trace)

    def _begin(self, frame: Array) -> None:
        height, width = frame.shape[:2]
        rate = f"{self.fps:.6g}"
        command = [
            self._executable, "-y", "-loglevel", "error",
            "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", rate, "-i", "-",
            "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2",  # yuv420p has even sizes only
            "-c:v", "libx264", "-preset", "veryfast", "-crf", str(self.quality), "-pix_fmt", "yuv420p",
            "-g", "10",  # a key frame often enough to seek by
            "-movflags", "+faststart", "-f", "mp4", str(self._unfinished),
        ]  # fmt: skip
        # A session of its own: Ctrl-C reaches this process alone, which then ends the encoder.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._complaints,
            start_new_session=True,
        )
        self._write(frame)

    def _write(self, frame: Array) -> None:
        assert self._process is not None and self._process.stdin is not None
        try:
            self._process.stdin.write(frame.tobytes())
        except OSError:
            self._fail()

    def _finish(self) -> None:
        if self._process is None:
            raise MachineError(f"no video '{self.path}': nothing was drawn")
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        if self._process.wait() != 0:
            self._fail()

    def _fail(self) -> None:
        assert self._process is not None and self._complaints is not None
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()
        code = self._process.wait()
        self._complaints.seek(0)
        said = self._complaints.read().decode("utf-8", "replace").strip().splitlines()
        reason = said[-1] if said else f"the encoder ended with code {code}"
        raise MachineError(f"cannot write the video '{self.path}': {reason}; nothing was written")

    def _stop(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        if self._process is not None and self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()


def _encoder() -> str:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MachineError(
            "a video needs the encoder of imageio-ffmpeg: install bt-tasksim with its extra 'report'"
        ) from None
    try:
        executable: Any = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise MachineError(f"no video can be encoded: {error}") from error
    return str(executable)
