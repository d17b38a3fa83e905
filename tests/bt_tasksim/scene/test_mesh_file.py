import copy
import json
import struct

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.scene import mesh_file
from bt_tasksim.scene.geometry import ShapeSize
from bt_tasksim.scene.mesh_file import mesh_extent
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.shapes import shape

CORNERS = 0.05 * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]],
    np.uint32,
)  # fmt: skip
FLAT = "v 0 0 0\nv .05 0 0\nv 0 .05 0\nv 0 0 .05\nf 1 2 3\nf 1 3 2\nf 1 2 4\nf 1 4 2\n"
DATA = CORNERS.tobytes() + FACES.tobytes()
HEADER = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": 96},
        {"buffer": 0, "byteOffset": 96, "byteLength": 144},
    ],
    "buffers": [{"byteLength": 240}],
}


def glb(path, change=lambda header: None):
    header = copy.deepcopy(HEADER)
    change(header)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(DATA), 0x004E4942) + DATA
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)
    return str(path)


def without_data(header):
    del header["accessors"][0]["bufferView"]
    header["accessors"][0]["count"] = 20_000_000


def many_views(header):
    header["bufferViews"] *= 10_000
    for view in header["bufferViews"]:
        view["byteLength"] = 10**9


def elsewhere(header):
    header["buffers"] = [{"uri": "/etc/passwd", "byteLength": 240}]


def in_a_circle(header):
    header["nodes"] = [{"mesh": 0, "children": [0]}]


def doubled(header):
    header["nodes"] = [*({"children": [i + 1, i + 1]} for i in range(40)), {"mesh": 0}]


def by_thousands(header):
    header["nodes"] = [{"children": list(range(1, 60_000))}, *[{"mesh": 0}] * 59_999]


def test_a_mesh_in_a_glb_file(tmp_path):
    assert mesh_extent(glb(tmp_path / "a.glb")) == pytest.approx((0.05,) * 3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (without_data, "announces 20000000 entries without data"),
        (many_views, "announces more data than"),
        (lambda header: header["accessors"][0].update(count=10**9), "announces 12000000000 bytes"),
        (lambda header: header["accessors"][0].update(count="x"), "no number of things"),
        (lambda header: header["accessors"][0].update(type="VEC9"), "no known type"),
        (lambda header: header.update(accessors=5), "are no list"),
        (lambda header: header["nodes"][0].update(mesh=7), "names what is not there"),
        (elsewhere, "in another file, '/etc/passwd'"),
        (in_a_circle, "round in a circle"),
        (doubled, "more than 1000 times"),
        (by_thousands, "more than 500000 triangles"),
    ],
)
def test_a_glb_file_that_announces_more_than_it_holds(change, words, tmp_path, monkeypatch):
    path = glb(tmp_path / "a.glb", change)
    monkeypatch.setattr("trimesh.load", lambda *_, **__: pytest.fail("it was loaded"))
    with pytest.raises(InputError, match=words) as error:
        mesh_extent(path)
    assert str(error.value).startswith(f"mesh '{path}' ")


@pytest.mark.parametrize("content", [b"glTF", b"glTF" + bytes(40), b"x" * 40])
def test_what_is_no_glb_file(content, tmp_path):
    (tmp_path / "a.glb").write_bytes(content)
    with pytest.raises(InputError, match="is no GLB file"):
        mesh_extent(str(tmp_path / "a.glb"))


@pytest.mark.parametrize("entry", ["{mesh: z.obj, on: table}", "{object: z.yaml, on: table}"])
def test_a_mesh_without_volume_is_said_to_be_flat(entry, tmp_path):
    (tmp_path / "z.obj").write_text(FLAT)
    (tmp_path / "z.yaml").write_text("mesh: z.obj\n")
    (tmp_path / "s.yaml").write_text(f"objects:\n  it: {entry}\n")
    with pytest.raises(InputError, match=r"z.obj' is flat: it encloses no volume"):
        mesh_extent(str(tmp_path / "z.obj"))
    with pytest.raises(InputError, match=r"z.obj' is flat: it encloses no volume"):
        load_scene(tmp_path / "s.yaml")


def test_more_triangles_than_can_be_looked_at(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_file, "MOST_TRIANGLES", 11)
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {a} {b} {c}" for a, b, c in FACES + 1]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    with pytest.raises(InputError, match="has 12 triangles, more than 11: save it with fewer"):
        mesh_extent(str(tmp_path / "a.obj"))


def test_what_is_drawn_and_means_nothing_to_a_mesh_makes_no_other_shape(tmp_path):
    path = glb(tmp_path / "a.glb")
    one, other = (shape("mesh", ShapeSize((0.05,) * 3, (e, e), path)) for e in (0.3, 0.7))
    assert one is other
