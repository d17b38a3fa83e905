"""What the header of a GLB file announces, looked at before anything of it is loaded.

The form is that of the glTF 2.0 specification of the Khronos Group, sections 3 and 4.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.json_text import parse_json_object
from bt_tasksim.core.plain import Plain, shown

_COMPONENT = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Bytes of a number, by its code."""
_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Numbers of an entry, by its type."""
_JSON = 0x4E4F534A
_MOST_TIMES = 1000
"""How often one node may be placed."""
_OFTEN = 4
"""Times its own size that a file may announce: several views may show the same bytes."""


def check_glb(content: bytes, most_triangles: int) -> None:
    """Refuse a file that announces more than it holds, or that is not all in one file.

    Args:
        content: The file's bytes.
        most_triangles: How many it may have, each as often as it is placed.

    Raises:
        InputError: Loading it would take far more memory than its size, or open another file; the sentence
            says only what is wrong.
    """
    header = _header(content)
    for k, buffer in enumerate(_listed(header, "buffers")):
        uri = buffer.get("uri")
        if uri is not None and not (isinstance(uri, str) and uri.startswith("data:")):
            raise InputError(
                f"keeps its data in another file, '{shown(str(uri))}' of buffer {k}: save it as one file"
            )
    counts = [_entries(k, entry, len(content)) for k, entry in enumerate(_listed(header, "accessors"))]
    views = sum(
        _count(view, "byteLength", "bufferViews", k) for k, view in enumerate(_listed(header, "bufferViews"))
    )
    if max(views, sum(size for _, size in counts)) > _OFTEN * len(content):
        raise InputError(f"announces more data than its {len(content)} bytes hold")
    triangles = _placed(header, [count for count, _ in counts])
    if triangles > most_triangles:
        raise InputError(
            f"has more than {most_triangles} triangles: save it with fewer, "
            f"such as with Blender's modifier Decimate"
        )


def _header(content: bytes) -> dict[str, Plain]:
    if len(content) < 20 or content[:4] != b"glTF":
        raise InputError("is no GLB file")
    length, kind = struct.unpack_from("<II", content, 12)
    if kind != _JSON or length > len(content) - 20:
        raise InputError("is no GLB file: its header is cut off")
    return parse_json_object(content[20 : 20 + length], "its header")


def _listed(header: Mapping[str, Plain], name: str) -> list[Mapping[str, Plain]]:
    found = header.get(name, [])
    if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
        raise InputError(f"has a header whose '{name}' are no list")
    return [entry for entry in found if isinstance(entry, dict)]


def _count(entry: Mapping[str, Plain], name: str, what: str, k: int) -> int:
    found = entry.get(name)
    if isinstance(found, bool) or not isinstance(found, int) or found < 0:
        raise InputError(f"has a header whose {what}[{k}].{name} is no number of things")
    return found


def _entries(k: int, accessor: Mapping[str, Plain], most: int) -> tuple[int, int]:
    """How many entries an accessor has, and their bytes."""
    count = _count(accessor, "count", "accessors", k)
    code, kind = accessor.get("componentType"), accessor.get("type")
    if (
        not isinstance(code, int)
        or code not in _COMPONENT
        or not isinstance(kind, str)
        or kind not in _NUMBERS
    ):
        raise InputError(f"has a header whose accessors[{k}] has no known type")
    if "bufferView" not in accessor:
        raise InputError(
            f"announces {count} entries without data (accessors[{k}]), as compressed files do: "
            f"save it without compression"
        )
    size = count * _COMPONENT[code] * _NUMBERS[kind]
    if size > most:
        raise InputError(f"announces {size} bytes in accessors[{k}], and has {most} in all")
    return count, size


def _placed(header: Mapping[str, Plain], counts: Sequence[int]) -> int:
    """Triangles of all nodes, each as often as the tree of nodes places it.

    Raises:
        InputError: The nodes go round in a circle, or name what is not there.
    """
    of_mesh = [
        sum(_triangles(part, counts) for part in _listed(mesh, "primitives"))
        for mesh in _listed(header, "meshes")
    ]
    nodes = _listed(header, "nodes")
    children = [_numbers(node.get("children", []), len(nodes)) for node in nodes]
    own = [
        sum(of_mesh[i] for i in _numbers([node["mesh"]], len(of_mesh))) if "mesh" in node else 0
        for node in nodes
    ]
    above = [0] * len(nodes)
    for below in children:
        for child in below:
            above[child] += 1
    ready = [i for i, n in enumerate(above) if n == 0]
    times = [1 if n == 0 else 0 for n in above]
    total = done = 0
    while ready:
        node = ready.pop()
        done += 1
        total += times[node] * own[node]
        for child in children[node]:
            times[child] += times[node]
            above[child] -= 1
            if above[child] == 0:
                ready.append(child)
    if done < len(nodes):
        raise InputError("has nodes that go round in a circle")
    if max(times, default=0) > _MOST_TIMES:
        raise InputError(f"places a node more than {_MOST_TIMES} times")
    return total


def _triangles(part: Mapping[str, Plain], counts: Sequence[int]) -> int:
    attributes = part.get("attributes")
    named = part.get("indices", attributes.get("POSITION") if isinstance(attributes, dict) else None)
    return 0 if named is None else sum(counts[i] for i in _numbers([named], len(counts))) // 3


def _numbers(found: Plain, most: int) -> list[int]:
    numbers = [i for i in found if isinstance(i, int) and 0 <= i < most] if isinstance(found, list) else []
    if not isinstance(found, list) or len(numbers) < len(found):
        raise InputError("has a header that names what is not there")
    return numbers
