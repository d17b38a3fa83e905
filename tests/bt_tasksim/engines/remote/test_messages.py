"""Messages: what was sent comes back bit for bit, and nothing else gets through."""

import dataclasses
from typing import Optional

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Hidden, JointTarget, Observation, PlaceModel, WorldState
from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.remote import plain, schema
from bt_tasksim.engines.remote.bundles import arrays_of, bundle_of
from bt_tasksim.engines.remote.messages import BadMessageError, Message, decode, encode
from bt_tasksim.engines.remote.plain import LARGEST
from bt_tasksim.engines.remote.schema import (
    LARGEST_HEADER,
    PROTOCOL,
    REQUESTS,
    SCHEMA,
    ArraySpec,
    MessageSpec,
    layout_digest,
)
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.configuration import ActorConfiguration, Disturbance, ObjectActor
from bt_tasksim.scene.fixtures import Fixture, FixturePlace
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal

SIZES = {"joints": 9, "arm": 7, "hand": 2, "tips": 2, "closures": 1, "objects": 2, "bodies": 4}
NUMBERS = {"finite": st.floats(-LARGEST, LARGEST), "not NaN": st.floats(allow_nan=False), "any": st.floats()}


def filled(spec, draw):
    shape = tuple(SIZES[n] if isinstance(n, str) else n for n in spec.shape)
    elements = st.booleans() if spec.dtype == "|b1" else NUMBERS[spec.values]
    return draw(arrays(spec.dtype, shape, elements=elements))


@st.composite
def messages(draw):
    """Any message without images or a drawn world, as the schema allows."""
    kind = draw(st.sampled_from([k for k, s in SCHEMA.items() if not s.images and k != "reset"]))
    spec = SCHEMA[kind]
    plain = {
        str: st.text("abc é'", max_size=20),
        bool: st.booleans(),
        int: st.integers(-(1 << 63), (1 << 64) - 1),
        float: NUMBERS["finite"],
        dict[str, str]: st.dictionaries(st.text("ab"), st.text("xy"), max_size=3),
        tuple[str, ...]: st.lists(st.text("ab"), max_size=3).map(tuple),
    }
    fields = {name: draw(plain[t]) for name, t in spec.fields.items()}
    found = {
        name: filled(array, draw)
        for name, array in spec.arrays.items()
        if not (array.optional and draw(st.booleans()))
    }
    return Message(draw(st.integers(0, 2**53 - 1)), kind, fields, found)


def same(a, b):
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


@given(messages())
@settings(max_examples=150, deadline=None)
def test_what_was_sent_comes_back_bit_for_bit(message):
    back = decode(encode(message, SIZES), [message.kind], SIZES)
    assert (back.number, back.kind, back.fields) == (message.number, message.kind, message.fields)
    assert back.arrays.keys() == message.arrays.keys()
    assert all(same(back.arrays[name], value) for name, value in message.arrays.items())
    assert all(not a.shape or (a.flags.aligned and a.flags.writeable) for a in back.arrays.values())


@given(messages(), st.data())
@settings(max_examples=100, deadline=None)
def test_one_number_that_is_not_finite_is_refused_on_either_side(message, data):
    names = [n for n, s in SCHEMA[message.kind].arrays.items() if s.values == "finite" and s.dtype == "<f8"]
    names = [n for n in names if n in message.arrays]
    if not names:
        return
    name = data.draw(st.sampled_from(names))
    bad = message.arrays[name].copy()
    place = data.draw(st.integers(0, bad.size - 1))
    frames = encode(message, SIZES)
    bad.reshape(-1)[place] = data.draw(st.sampled_from([np.nan, np.inf, -np.inf, 2 * LARGEST]))
    frames[1 + list(message.arrays).index(name)] = bad.tobytes()
    with pytest.raises(BadMessageError, match=f"array '{name}' has a number in it that is not finite"):
        decode(frames, [message.kind], SIZES)
    with pytest.raises(InputError, match=f"array '{name}' has a number"):
        encode(dataclasses.replace(message, arrays={**message.arrays, name: bad}), SIZES)


def test_images_travel_with_their_cameras_and_without_a_copy(image, state):
    camera = dataclasses.replace(image.camera, name="other")
    flat = dataclasses.replace(image, depth=None, camera=camera, taken=1.25)
    message = Message(1, "observe", arrays=arrays_of(state), images=(image, flat))
    sizes = SIZES | {"objects": 2}
    frames = encode(message, sizes)
    assert isinstance(frames[-2], memoryview) and frames[-2].obj is not None
    back = decode(frames, ["observe"], sizes)
    assert [i.camera.name for i in back.images] == ["scene", "other"]
    for a, b in zip(back.images, (image, flat), strict=True):
        assert same(a.colour, b.colour) and (a.camera.width, a.camera.height) == (320, 240)
        assert (a.depth is None and b.depth is None) or same(a.depth, b.depth)
        assert same(a.camera.matrix, b.camera.matrix) and same(a.camera.pose, b.camera.pose)
        assert a.taken == b.taken
    assert np.shares_memory(back.images[0].colour, np.frombuffer(frames[-4], np.uint8))
    wrong = dataclasses.replace(image, camera=dataclasses.replace(image.camera, width=319))
    with pytest.raises(BadMessageError, match="is not what its camera 'scene' gives"):
        decode(encode(Message(1, "image", images=(wrong,)), {}), ["image"], {})


@pytest.mark.parametrize("kind", [WorldState, Hidden, Observation, JointTarget])
def test_every_field_of_a_bundle_is_in_the_schema(kind):
    """A new field must not be left behind on the road; when a target expires concerns real robots only."""
    message = {WorldState: "state", Hidden: "truth", Observation: "observation", JointTarget: "target"}[kind]
    assert set(SCHEMA[message].arrays) == {f.name for f in dataclasses.fields(kind)} - {"validity"}


def test_bundles_are_what_they_were(state):
    back = bundle_of(WorldState, arrays_of(dataclasses.replace(state, objects=None, velocities=None)))
    assert back.objects is None and back.velocities is None
    assert all(
        getattr(back, f.name) is getattr(state, f.name)
        for f in dataclasses.fields(state)
        if f.name not in ("objects", "velocities")
    )


# ---- laid out alike ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "kind",
    [ActorConfiguration, ObjectActor, Disturbance, Goal, Fixture, Box, FixturePlace, PlaceModel, CameraModel],
)
@pytest.mark.parametrize("change", [{"more": int}, {"name": tuple[str, ...], "pose": str, "object": int}])
def test_a_changed_field_is_another_layout(monkeypatch, kind, change):
    """Also far down in what a message holds: two versions in development have the same number."""
    before, hints = layout_digest(), plain._hints
    changed = {**hints(kind), **change}
    monkeypatch.setattr(plain, "_hints", lambda k: changed if k is kind else hints(k))
    assert layout_digest() != before
    monkeypatch.undo()
    assert layout_digest() == before


@pytest.mark.parametrize("name", plain.SHAPES)
def test_a_changed_shape_is_another_layout(monkeypatch, name):
    before = layout_digest()
    monkeypatch.setattr(plain, "SHAPES", {**plain.SHAPES, name: (9,)})
    assert layout_digest() != before


def test_a_changed_array_is_another_layout(monkeypatch):
    digests = {layout_digest()}
    for kind, array in (("step", ArraySpec((3,))), ("truth", ArraySpec(("joints",), "<f4"))):
        monkeypatch.setitem(SCHEMA, kind, MessageSpec(arrays={"time": array}))
        digests.add(layout_digest())
    wide = ArraySpec(("height", "width"), "<f8", optional=True)
    monkeypatch.setitem(schema.IMAGE, "depth", wide)
    digests.add(layout_digest())
    monkeypatch.setattr(schema, "PROTOCOL", 2)
    assert len(digests | {layout_digest()}) == 5


def test_optional_is_spelled_alike_however_it_is_written():
    assert plain.spelled(Optional[int]) == plain.spelled(int | None) != plain.spelled(int)  # noqa: UP045


# ---- refused ----------------------------------------------------------------------------------------------


def step(**changes):
    position = np.linspace(0.0, 1.0, 9)
    frames = encode(Message(4, "step", arrays={"position": position, "velocity": position}), SIZES)
    header = dict(
        zip(("protocol", "number", "kind", "fields", "layout"), msgpack.unpackb(frames[0]), strict=True)
    )
    header |= {k: v for k, v in changes.items() if k in header}
    return [msgpack.packb(list(header.values())), *changes.get("frames", frames[1:])]


LAYOUT = [["position", "<f8", [9]], ["velocity", "<f8", [9]]]


@pytest.mark.parametrize(
    ("frames", "sentence"),
    [
        ([], "1 to 48 frames, found 0"),
        ([b""] * 49, "1 to 48 frames, found 49"),
        ([b""], "not msgpack"),
        ([b"\xc1"], "not msgpack"),
        ([b"\x91" * 100_000], "not msgpack"),
        ([b"\xdd\xff\xff\xff\xff"], "not msgpack"),
        ([b"\xc7\x01\x00\x00"], "not msgpack"),
        ([b"\0" * (LARGEST_HEADER + 1)], "too large: 1048577 bytes"),
        ([msgpack.packb({"a": 1})], "not a list"),
        ([msgpack.packb([PROTOCOL])], "a list of 5, found 1"),
        (step(protocol=PROTOCOL + 1), f"speaks protocol {PROTOCOL + 1}, and this one {PROTOCOL}"),
        (step(protocol="1"), "speaks protocol '1'"),
        (step(number=-1), "a whole number, found -1"),
        (step(number=1.5), "a whole number, found 1.5"),
        (step(kind="reset"), "'reset' does not belong here"),
        (step(kind="x" * 999), "kind 'x+'... does not belong|kind 'xxxx"),
        (step(kind=3), "a kind and a list of arrays"),
        (step(fields=[]), r"should have the fields \[\]"),
        (step(fields={"more": 1}), r"should have the fields \[\]"),
        (step(layout={}), "a kind and a list of arrays"),
        (step(layout=[]), "announces 0 arrays and has 2"),
        (step(layout=[[], []]), "by name, dtype and shape"),
        (step(layout=[LAYOUT[0], LAYOUT[0]]), "second array 'position'"),
        (step(layout=[LAYOUT[0], ["other", "<f8", [9]]]), "unknown or second array 'other'"),
        (step(layout=[LAYOUT[0], ["velocity", "<f4", [9]]]), "'velocity' should be <f8, found '<f4'"),
        (step(layout=[LAYOUT[0], ["velocity", "|O", [9]]]), "'velocity' should be <f8, found '|O'"),
        (step(layout=[LAYOUT[0], ["velocity", "<f8", 9]]), "'velocity' has no shape"),
        (step(layout=[LAYOUT[0], ["velocity", "<f8", [8.5]]]), "1 dimensions, found a list of 1"),
        (step(layout=[LAYOUT[0], ["velocity", "<f8", ["9"]]]), "1 dimensions, found a list of 1"),
        (step(layout=[LAYOUT[0], ["velocity", "<f8", [3, 3]]]), "1 dimensions, found a list of 2"),
        (step(layout=[LAYOUT[0], ["velocity", "<f8", [8]]]), r"the shape \(9,\), found \(8,\)"),
        (step(layout=[LAYOUT[0], ["velocity", "<f8", [-9]]]), r"the shape \(9,\), found \(-9,\)"),
        (step(frames=[b"\0" * 72, b"\0" * 71]), "should have 72 bytes, found 71"),
        (step(frames=[b"\0" * 72]), "announces 2 arrays and has 1"),
        (step(layout=LAYOUT[:1], frames=[b"\0" * 72]), "lacks the array 'velocity'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(frames, sentence):
    with pytest.raises(BadMessageError, match=sentence) as error:
        decode(frames, ["step"], SIZES)
    assert len(str(error.value)) < 300 and str(error.value).isprintable()


def test_huge_arrays_are_refused_before_anything_is_made_of_them(image):
    frames = encode(Message(1, "image", images=(image,)), {})
    header = msgpack.unpackb(frames[0])
    for shape in ([1 << 62, 1 << 62, 3], [8193, 1, 3], [0, 8193, 3], [-1, 1, 3]):
        header[4][0][2] = shape
        with pytest.raises(BadMessageError, match=r"cannot be|bytes"):
            decode([msgpack.packb(header), *frames[1:]], ["image"], {})


def test_truth_values_are_0_and_1():
    array = np.array([[2, 0, 1, 1], [0, 0, 0, 0]], np.uint8)
    truth = {
        name: np.zeros(tuple(SIZES[n] if isinstance(n, str) else n for n in spec.shape), spec.dtype)
        for name, spec in SCHEMA["truth"].arrays.items()
    }
    frames = encode(Message(1, "truth", arrays=truth), SIZES)
    frames[1 + list(truth).index("support")] = array.tobytes()
    with pytest.raises(BadMessageError, match="something else than true and false"):
        decode(frames, ["truth"], SIZES)


def test_a_world_that_is_too_large_to_send_is_refused():
    world = Scene(objects={"cup": "on table"}).sample(0)
    big = dataclasses.replace(world, fixtures=world.fixtures * 4000)
    with pytest.raises(InputError, match="bytes of plain data"):
        encode(Message(1, "reset", {"configuration": big}), SIZES)


def test_ten_thousand_malformed_messages(state, world, image):
    """Random bytes, damaged headers, cut, doubled and lost frames: an error of its own kind, or a message."""
    rng = np.random.default_rng(11)
    sent = [
        Message(1, "step", arrays={"position": np.zeros(9), "velocity": np.zeros(9)}),
        Message(2, "solve", arrays={**arrays_of(state), "tool": state.tool_pose}),
        Message(3, "observe", arrays=arrays_of(state), images=(image,)),
        Message(4, "reset", {"configuration": world}),
        Message(5, "cameras", {"first": True}),
        Message(6, "hidden"),
    ]
    originals = [[bytes(f) for f in encode(m, SIZES)] for m in sent]
    refused = 0
    for k in range(10_000):
        frames = damaged(rng, list(originals[k % len(originals)]))
        try:
            message = decode(frames, REQUESTS, SIZES)
        except BadMessageError as error:
            refused += 1
            assert str(error).isprintable() and len(str(error)) < 400
        else:  # the damage may have left a good message: then it is one in all its parts
            assert all(np.isfinite(a).all() for a in message.arrays.values())
            assert message.kind in REQUESTS
            encode(message, SIZES)
    assert refused > 8000


def damaged(rng, frames):
    """Some frames with something wrong in them."""
    which = int(rng.integers(len(frames)))
    match int(rng.integers(8)):
        case 0:
            return [rng.bytes(int(rng.integers(200))) for _ in range(int(rng.integers(12)))]
        case 1:
            frames[0] = rng.bytes(int(rng.integers(1, 400)))
        case 2:
            hit = np.frombuffer(frames[0], np.uint8).copy()
            hit[rng.integers(hit.size, size=int(rng.integers(1, 4)))] = rng.integers(256)
            frames[0] = hit.tobytes()
        case 3:
            frames[which] = frames[which][: int(rng.integers(len(frames[which]) + 1))]
        case 4:
            frames[which] = frames[which] + rng.bytes(int(rng.integers(1, 64)))
        case 5:
            frames.insert(which, frames[int(rng.integers(len(frames)))])
        case 6:
            del frames[which]
        case _:
            header = msgpack.unpackb(frames[0])
            place = int(rng.integers(len(header)))
            header[place] = ODD[int(rng.integers(len(ODD)))]
            frames[0] = msgpack.packb(header)
    return frames


ODD = (
    None,
    True,
    -1,
    2**63,
    1e308,
    float("nan"),
    "",
    "step",
    "\x1b[2J",
    [],
    [[]],
    [["time", "<f8", []]],
    {},
    b"x",
)
