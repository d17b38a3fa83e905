"""Videos are whole, in real time, and as browsers play them."""

import resource
import subprocess
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.report.video import Film, VideoRecorder


class Painter:
    """A pipeline that draws pictures, each with a stripe further to the right."""

    def __init__(self, size=(64, 48), noise=0):
        self.size, self.noise, self.drawn = size, noise, 0
        self.random = np.random.default_rng(0)

    def render(self, camera, *, size=None):
        assert camera == "overview"
        width, height = size or self.size
        colour = np.full((height, width, 3), 40, np.uint8)
        colour[:, : self.drawn + 1] = (220, 60, 30)
        if self.noise:
            colour = self.random.integers(0, 255, colour.shape, dtype=np.uint8)
        self.drawn += 1
        return SimpleNamespace(colour=colour)


def step(time, pipeline):
    return SimpleNamespace(observation=SimpleNamespace(time=time), pipeline=pipeline)


def film(path, ticks, pipeline=None, **options):
    pipeline = pipeline or Painter()
    with VideoRecorder(path, **options) as record:
        for k in range(ticks):
            record(step(0.05 * k, pipeline))
    return record


def frames(path):
    capture, found = cv2.VideoCapture(str(path)), []
    while True:
        more, frame = capture.read()
        if not more:
            return found, capture.get(cv2.CAP_PROP_FPS)
        found.append(frame[..., ::-1])


@pytest.mark.parametrize(("every", "count", "fps"), [(1, 20, 20), (2, 10, 10), (3, 7, 20 / 3)])
def test_plays_in_real_time(tmp_path, every, count, fps):
    record = film(tmp_path / "a.mp4", 20, every=every)
    assert record.frames == count and record.fps == pytest.approx(fps)
    found, rate = frames(tmp_path / "a.mp4")
    assert len(found) == count and rate == pytest.approx(fps, rel=1e-3)
    assert found[0].shape == (48, 64, 3)
    red = found[-1][24, :, 0].astype(int)
    assert (red[: count - 3] > 150).all() and (red[count + 3 :] < 100).all()


def test_the_format_that_browsers_play(tmp_path):
    record = film(tmp_path / "a.mp4", 3, Painter((63, 47)))
    said = subprocess.run(
        [record._executable, "-i", tmp_path / "a.mp4"], capture_output=True, text=True
    ).stderr
    assert "h264" in said and "yuv420p" in said and "64x48" in said
    content = (tmp_path / "a.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


def test_one_frame_is_a_video(tmp_path):
    film(tmp_path / "a.mp4", 1)
    assert len(frames(tmp_path / "a.mp4")[0]) == 1


def test_fps_of_ones_own(tmp_path):
    film(tmp_path / "a.mp4", 4, fps=5)
    assert frames(tmp_path / "a.mp4")[1] == pytest.approx(5)


def test_size_of_ones_own(tmp_path):
    film(tmp_path / "a.mp4", 3, size=(96, 32))
    assert frames(tmp_path / "a.mp4")[0][0].shape == (32, 96, 3)


@pytest.mark.parametrize(("fps", "every"), [(20, 1), (100, 1), (10, 2), (5, 4), (0.1, 200)])
def test_frames_a_second_are_those_of_ticks(fps, every):
    assert Film(fps=fps).every == every


@pytest.mark.parametrize(
    "wrong", [{"fps": 0.0}, {"fps": float("nan")}, {"size": (0, 5)}, {"size": (9000, 5)}]
)
def test_a_film_that_cannot_be_made(wrong):
    with pytest.raises(InputError, match="possible"):
        Film(**wrong)


def test_nothing_is_left_of_an_interrupted_video(tmp_path):
    (tmp_path / "a.mp4").write_text("old")
    with pytest.raises(KeyboardInterrupt), VideoRecorder(tmp_path / "a.mp4") as record:
        for k in range(5):
            record(step(0.05 * k, Painter()))
        raise KeyboardInterrupt
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_text() == "old"
    assert record._process.poll() is not None


def test_full_disk(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    pipeline = Painter((320, 240), noise=1)

    def record_all(record):
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
        for k in range(60):
            record(step(0.05 * k, pipeline))

    try:
        with pytest.raises(MachineError, match="cannot write the video") as caught:  # noqa: SIM117
            with VideoRecorder(tmp_path / "a.mp4") as record:
                record_all(record)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "nothing was written" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_bad_input(tmp_path):
    with pytest.raises(InputError, match=r"should end in \.mp4"):
        VideoRecorder(tmp_path / "a.avi")
    with pytest.raises(InputError, match="does not exist"), VideoRecorder(tmp_path / "no" / "a.mp4"):
        pass
    with pytest.raises(InputError, match="cannot be made"):
        VideoRecorder(tmp_path / "a.mp4", every=0)
    with pytest.raises(MachineError, match="nothing was drawn"), VideoRecorder(tmp_path / "a.mp4"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_needs_its_block(tmp_path):
    with pytest.raises(RuntimeError, match="'with' block"):
        VideoRecorder(tmp_path / "a.mp4")(step(0.0, Painter()))
