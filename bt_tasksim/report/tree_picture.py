"""A behaviour tree as one self-contained SVG picture.

Every node is a group with the id ``node-<k>``, numbered in preorder, and an attribute ``data-status``: a
report's script recolours a node by changing that attribute.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.markup import escaped, wrapped
from bt_tasksim.report.tree_labels import Label, label_of, tree_text
from bt_tasksim.trees.walk import preorder

__all__ = ["node_ids", "tree_svg", "tree_text"]

TITLE_SIZE, DETAIL_SIZE, LINE = 14, 11.5, 16
PAD, GAP, LEVEL, MARGIN = 11, 18, 40, 16
SYMBOL = 34
"""Width of the compartment that holds a symbol."""
WRAP = 30
"""Characters after which a line is wrapped."""

# Widths of the characters from space to ~ in DejaVu Sans Bold, in hundredths of the font size: the widest of
# the usual sans-serif fonts, so that a label fits its box in any of them.
WIDTHS = (
    35, 46, 52, 84, 70, 100, 87, 31, 46, 46, 52, 84, 38, 42, 38, 37, 70, 70, 70, 70, 70, 70, 70, 70, 70, 70,
    40, 40, 84, 84, 84, 58, 100, 77, 76, 73, 83, 68, 68, 82, 84, 37, 37, 77, 64, 100, 84, 85, 73, 85, 77, 72,
    68, 81, 77, 110, 77, 72, 73, 46, 37, 46, 84, 50, 50, 67, 72, 59, 72, 68, 44, 72, 71, 34, 34, 67, 34, 104,
    71, 69, 72, 72, 49, 60, 48, 71, 65, 92, 65, 65, 58, 71, 37, 71, 84,
)  # fmt: skip

STYLE = """
.bt-tree{font-family:"DejaVu Sans",Verdana,Arial,sans-serif}
.bt-tree .edge{fill:none;stroke:#8b97a5;stroke-width:1.5}
.bt-tree .shape{fill:#fff;stroke:#4a5866;stroke-width:1.5}
.bt-tree .mark{fill:#eef1f5;stroke:none}
.bt-tree .inner{fill:none;stroke:#4a5866;stroke-width:1}
.bt-tree .concept .shape{stroke-width:2;stroke:#2b3a4a}
.bt-tree .condition .shape{stroke:#6b5b95}
.bt-tree .decorator .shape{stroke-dasharray:5 3}
.bt-tree .other .shape{stroke:#98a3ae}
.bt-tree text{fill:#1c2733;text-anchor:middle}
.bt-tree .title{font-size:14px;font-weight:600}
.bt-tree .detail{font-size:11.5px;fill:#465463}
.bt-tree .symbol{font-size:17px;font-weight:700}
.bt-tree [data-status=RUNNING]>.shape{fill:#fff0c2;stroke:#b67a00;stroke-width:2.5}
.bt-tree [data-status=SUCCESS]>.shape{fill:#d5f0df;stroke:#1f7a46;stroke-width:2.5}
.bt-tree [data-status=FAILURE]>.shape{fill:#fbd9d7;stroke:#b3261e;stroke-width:2.5}
.bt-tree [data-status=RUNNING]>.mark{fill:#f4cf6a}
.bt-tree [data-status=SUCCESS]>.mark{fill:#9fdab6}
.bt-tree [data-status=FAILURE]>.mark{fill:#f0a5a0}
"""


def node_ids(root: Behaviour) -> dict[str, Behaviour]:
    """The nodes by the ids that they have in the picture, in preorder.

    Args:
        root: The tree's root.
    """
    return {f"node-{index}": node for index, (_, node) in enumerate(preorder(root))}


def tree_svg(root: Behaviour, statuses: Mapping[str, Status | str] | None = None) -> str:
    """A picture of a tree.

    Args:
        root: The tree's root.
        statuses: Statuses by `node_ids`, to colour the nodes with.

    Returns:
        An ``svg`` element with its own style sheet, to be saved as a file or put into a page.

    Raises:
        InputError: A status is unknown, or its node.
    """
    colours = {key: _status_name(status) for key, status in (statuses or {}).items()}
    top, count = _boxes(root)
    unknown = set(colours) - {f"node-{index}" for index in range(count)}
    if unknown:
        raise InputError(f"the tree has no node '{min(unknown)}': it has node-0 to node-{count - 1}")
    boxes = _arranged(top)
    width = max(box.x + box.width / 2 for box in boxes) + MARGIN
    height = max(box.y + box.height for box in boxes) + MARGIN
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="bt-tree" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" role="img" aria-label="{escaped(root.name)}">',
        f"<style>{STYLE}</style>",
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#fff"/>',
        *(_edge(box, child) for box in boxes for child in box.children),
        *(_group(box, colours.get(box.id, "INVALID")) for box in boxes),
        "</svg>",
    ]
    return "\n".join(parts)


@dataclass
class _Box:
    """A node's place: ``x`` is its middle, ``y`` its upper edge."""

    id: str
    label: Label
    hint: str
    title: list[str]
    details: list[str]
    width: float
    height: float
    depth: int
    children: list[_Box] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0


def _boxes(root: Behaviour) -> tuple[_Box, int]:
    path: list[_Box] = []
    top: _Box | None = None
    count = 0
    for depth, node in preorder(root):
        box = _box(f"node-{count}", node, depth)
        count += 1
        del path[depth:]
        if path:
            path[-1].children.append(box)
        else:
            top = box
        path.append(box)
    assert top is not None
    return top, count


def _box(name: str, node: Behaviour, depth: int) -> _Box:
    label = label_of(node)
    title = wrapped(label.title, WRAP)
    details = [line for detail in label.details for line in wrapped(detail, WRAP)]
    text = max(
        max(_width(line, TITLE_SIZE) for line in title),
        max((_width(line, DETAIL_SIZE) for line in details), default=0.0),
    )
    width, height = text + 2 * PAD, (len(title) + len(details)) * LINE + 1.4 * PAD
    if label.symbol:
        width += SYMBOL
    if label.shape == "condition":  # an ellipse around the rectangle of its text
        width, height = width * 1.3, height * 1.35
    if label.shape == "subtree":
        width += 12
    hint = f"{type(node).__name__}: {node.name}"
    return _Box(name, label, hint, title, details, max(width, 48.0), max(height, 34.0), depth)


def _arranged(top: _Box) -> list[_Box]:
    """All boxes, put in their places: levels below one another, subtrees as close as their outlines allow."""
    order: list[_Box] = []
    stack = [top]
    while stack:
        box = stack.pop()
        order.append(box)
        stack.extend(reversed(box.children))
    outlines: dict[str, list[tuple[float, float]]] = {}
    shifts: dict[str, float] = {}
    for box in reversed(order):
        outlines[box.id] = _packed(box, outlines, shifts)
    offset = MARGIN - min(left for left, _ in outlines[top.id])
    heights = [0.0] * (1 + max(box.depth for box in order))
    for box in order:
        heights[box.depth] = max(heights[box.depth], box.height)
    places = {top.id: offset}
    for box in order:
        box.x = places[box.id]
        box.y = MARGIN + sum(heights[: box.depth]) + LEVEL * box.depth + (heights[box.depth] - box.height) / 2
        for child in box.children:
            places[child.id] = box.x + shifts[child.id]
    return order


def _packed(
    box: _Box, outlines: dict[str, list[tuple[float, float]]], shifts: dict[str, float]
) -> list[tuple[float, float]]:
    """The outline (left and right by level) around a subtree's root; sets the shifts of its children."""
    merged: list[tuple[float, float]] = []
    for child in box.children:
        outline = outlines.pop(child.id)
        shared = zip(merged, outline, strict=False)
        shift = max((right - left + GAP for (_, right), (left, _) in shared), default=0.0)
        shifts[child.id] = shift
        moved = [(left + shift, right + shift) for left, right in outline]
        both = [(a[0], b[1]) for a, b in zip(merged, moved, strict=False)]
        merged = both + merged[len(both) :] + moved[len(both) :]
    middle = (shifts[box.children[0].id] + shifts[box.children[-1].id]) / 2 if box.children else 0.0
    for child in box.children:
        shifts[child.id] -= middle
    return [(-box.width / 2, box.width / 2), *((left - middle, right - middle) for left, right in merged)]


def _edge(box: _Box, child: _Box) -> str:
    y0, y1 = box.y + box.height, child.y
    bend = (y1 - y0) / 2
    return (
        f'<path class="edge" d="M{box.x:.1f} {y0:.1f} C{box.x:.1f} {y0 + bend:.1f} '
        f'{child.x:.1f} {y1 - bend:.1f} {child.x:.1f} {y1:.1f}"/>'
    )


def _group(box: _Box, status: str) -> str:
    left, shape = box.x - box.width / 2, box.label.shape
    parts = [
        f'<g id="{box.id}" class="{shape}" data-status="{status}">',
        f"<title>{escaped(box.hint)}</title>",
    ]
    parts.append(_outline(box, left))
    middle = box.x
    if box.label.symbol:
        middle += SYMBOL / 2
        radius = 4 if shape == "control" else 15
        parts.append(
            f'<path class="mark" d="M{left + SYMBOL:.1f} {box.y + 1.5:.1f}v{box.height - 3:.1f}'
            f"H{left + radius:.1f}q{1.5 - radius} 0 {1.5 - radius} {1.5 - radius}V{box.y + radius:.1f}"
            f'q0 {1.5 - radius} {radius - 1.5} {1.5 - radius}z"/>'
        )
        y = box.y + box.height / 2 + 6
        parts.append(
            f'<text class="symbol" x="{left + SYMBOL / 2:.1f}" y="{y:.1f}">{box.label.symbol}</text>'
        )
    lines = [("title", line) for line in box.title] + [("detail", line) for line in box.details]
    y = box.y + box.height / 2 - (len(lines) - 1) * LINE / 2 + 4.5
    for kind, line in lines:
        parts.append(f'<text class="{kind}" x="{middle:.1f}" y="{y:.1f}">{escaped(line)}</text>')
        y += LINE
    return "".join([*parts, "</g>"])


def _outline(box: _Box, left: float) -> str:
    if box.label.shape == "condition":
        rx, ry = box.width / 2, box.height / 2
        return f'<ellipse class="shape" cx="{box.x:.1f}" cy="{box.y + ry:.1f}" rx="{rx:.1f}" ry="{ry:.1f}"/>'
    radius = {"control": 4, "decorator": 15, "concept": 8}.get(box.label.shape, 2)
    outer = (
        f'<rect class="shape" x="{left:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" '
        f'height="{box.height:.1f}" rx="{radius}"/>'
    )
    if box.label.shape != "subtree":
        return outer
    return outer + (
        f'<rect class="inner" x="{left + 4:.1f}" y="{box.y + 4:.1f}" width="{box.width - 8:.1f}" '
        f'height="{box.height - 8:.1f}"/>'
    )


def _width(text: str, size: float) -> float:
    """Width of a line in the widest usual font."""
    total = 0
    for character in text:
        code = ord(character)
        if 32 <= code < 127:
            total += WIDTHS[code - 32]
        elif not unicodedata.combining(character):
            total += 110 if unicodedata.east_asian_width(character) in "WF" else 85
    return total * size / 100


def _status_name(status: Status | str) -> str:
    name = status.name if isinstance(status, Status) else str(status)
    if name not in Status.__members__:
        raise InputError(f"unknown status '{name}'; known: {', '.join(Status.__members__)}")
    return name
