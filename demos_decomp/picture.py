"""The decomposition graph as a picture (SVG): when each task was shown, and what was understood of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np

from bt_tasksim.concept.presentation import GREY
from bt_tasksim.concept.task import plain
from bt_tasksim.core.files import write_text
from bt_tasksim.core.markup import escaped, wrapped
from bt_tasksim.demos_decomp.concepts import concept_of, quantity_of
from bt_tasksim.demos_decomp.graph import in_order

INK, FAINT, LINE = "#1d232b", "#5b6672", "#cfd6dd"

CARD, GAP_X, GAP_Y, ROW = 330, 36, 34, 17
MARGIN, LANE, MOST_LANES = 24, 22, 12
_LETTER = {11: 6.7, 12: 7.3, 13: 7.9, 15: 9.1, 18: 10.9}
"""Pixels that a letter takes at most, on average over a line, by font size."""


def picture(graph: nx.DiGraph[str], title: str = "") -> str:
    """Draws the graph.

    Args:
        graph: From `demos_decomp.graph`.
        title: Heading, such as the log's name.

    Returns:
        An SVG document: at the top a lane per demonstration with its tasks over time, below a card per task
        with its seconds, confidence and parameters, and arrows for their order.
    """
    layers = _layers(graph)
    widest = max((len(layer) for layer in layers), default=1)
    width = max(2 * MARGIN + widest * CARD + (widest - 1) * GAP_X, 720)
    parts: list[str] = []
    heading = title or "Decomposition graph"
    size = 18 if len(heading) * _LETTER[18] < width - 2 * MARGIN else 11
    lines = _lines(heading, width - 2 * MARGIN, size)
    parts += [_text(MARGIN, 36 + ROW * i, line, size, INK, bold=True) for i, line in enumerate(lines)]
    top = _lanes(graph, parts, 54 + ROW * (len(lines) - 1), width)
    y = top + 30
    boxes: dict[str, tuple[float, float, float]] = {}
    for layer in layers:
        total = len(layer) * CARD + (len(layer) - 1) * GAP_X
        x = (width - total) / 2
        tallest = 0.0
        for name in layer:
            height = _card(graph, name, parts, x, y)
            boxes[name] = (x, y, height)
            tallest = max(tallest, height)
            x += CARD + GAP_X
        y += tallest + GAP_Y
    parts[1:1] = _arrows(graph, boxes)
    y = max(y, top + 60)
    if not boxes:
        parts.append(_text(MARGIN, top + 30, "No task was recognised.", 13, FAINT))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{y:.0f}" '
        f'viewBox="0 0 {width:.0f} {y:.0f}" font-family="Helvetica, Arial, sans-serif">\n'
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n{chr(10).join(parts)}\n</svg>\n'
    )


def write_picture(graph: nx.DiGraph[str], path: str | Path, title: str = "") -> None:
    """Writes the picture of a graph, whole or not at all.

    Args:
        graph: From `demos_decomp.graph`.
        path: An SVG file.
        title: Heading of the picture.

    Raises:
        InputError: The folder does not exist.
        MachineError: The disk is full or not writable.
    """
    write_text(path, picture(graph, title))


def _layers(graph: nx.DiGraph[str]) -> list[list[str]]:
    """Nodes by the length of the longest path to them; those that exclude each other side by side."""
    depth: dict[str, int] = {}
    for name in in_order(graph):
        depth[name] = max((depth[earlier] + 1 for earlier in graph.predecessors(name)), default=0)
    layers: list[list[str]] = [[] for _ in range(max(depth.values(), default=-1) + 1)]
    for name, level in depth.items():
        layers[level].append(name)
    return layers


def _lanes(graph: nx.DiGraph[str], parts: list[str], y: float, width: float) -> float:
    """Draws the time lanes; returns where they end."""
    lanes: dict[str, list[tuple[float, float, str]]] = {
        name: [] for name in graph.graph.get("demonstrations", [])
    }
    for name in graph:
        node = graph.nodes[name]
        for piece in node["evidence"]:
            # The lane's name may carry the log's path, where several logs were merged.
            lane = next(
                (
                    k
                    for k in lanes
                    if k == piece["demonstration"] or k == f"{piece['log']}: {piece['demonstration']}"
                ),
                piece["demonstration"],
            )
            lanes.setdefault(lane, []).append((piece["start"], piece["end"], node["concept"]))
    if not lanes:
        return y
    shown = list(lanes)[:MOST_LANES]
    longest = max((end for lane in lanes.values() for _, end, _ in lane), default=1.0)
    left = MARGIN + 96
    scale = (width - left - MARGIN - 20) / max(longest, 1e-6)
    step = next((s for s in (0.5, 1, 2, 5, 10, 20, 60, 120, 600) if longest / s <= 12), 3600)
    bottom = y + LANE * len(shown)
    for second in np.arange(0, longest + 1e-9, step):
        x = left + second * scale
        parts.append(_line(x, y, x, bottom + 4))
        parts.append(_text(x, bottom + 18, f"{second:g} s", 11, FAINT, anchor="middle"))
    for row, name in enumerate(shown):
        at = y + row * LANE
        parts.append(_titled(name, _text(MARGIN, at + 15, _lane_label(name), 12, FAINT)))
        for start, end, concept in sorted(lanes[name]):
            span = max((end - start) * scale, 1.5)
            x = left + start * scale
            colour = _colour(concept)
            bar = _box(x, at + 3, span - 1, LANE - 6, colour, radius=2, stroke=None)
            parts.append(_titled(f"{concept}, {start:.1f} - {end:.1f} s", bar))
            if span > len(concept) * _LETTER[11] + 6:
                parts.append(_text(x + span / 2, at + 15, concept, 11, "#ffffff", anchor="middle"))
    bottom += 22
    if len(lanes) > len(shown):
        more = _text(MARGIN, bottom + 12, f"and {len(lanes) - len(shown)} more", 11, FAINT)
        parts.append(_titled(", ".join(list(lanes)[MOST_LANES:]), more))
        bottom += 16
    return bottom


def _lane_label(name: str) -> str:
    """A demonstration's name; where logs were merged the file's name, and its own after the first."""
    path, _, own = name.rpartition(": ")
    label = f"{Path(path).stem} {own}".replace(" 000", "") if path else own
    return label if len(label) <= 13 else f"…{label[-12:]}"


def _card(graph: nx.DiGraph[str], name: str, parts: list[str], x: float, y: float) -> float:
    """Draws one task; returns the card's height."""
    node = graph.nodes[name]
    colour = _colour(node["concept"])
    lines = [
        (18 if i == 0 and line.strip() == line else 36, part)
        for line in _parameter_lines(node["concept"], node["parameters"], node["uncertainty"])
        for i, part in enumerate(_lines(line.strip(), CARD - 48, 12))
    ]
    named = _lines(name, CARD - 18 - 94, 15)
    under = y + ROW * (len(named) - 1)
    height = 62 + ROW * (len(lines) + len(named) - 1)
    parts.append(_box(x, y, CARD, height, "#fbfcfd"))
    parts.append(_box(x, y, 6, height, colour, radius=2, stroke=None))
    parts += [_text(x + 18, y + 23 + ROW * i, line, 15, INK, bold=True) for i, line in enumerate(named)]
    confidence = float(node["confidence"])
    parts.append(_text(x + CARD - 12, y + 22, f"{confidence:.2f}", 13, INK, anchor="end"))
    parts.append(_box(x + CARD - 82, y + 14, 40, 7, "#e4e9ee", radius=3, stroke=None))
    parts.append(_box(x + CARD - 82, y + 14, 40 * min(confidence, 1.0), 7, colour, radius=3, stroke=None))
    evidence = node["evidence"]
    start, end = (float(np.mean([piece[key] for piece in evidence])) for key in ("start", "end"))
    seen, whole = len(evidence), len(graph.graph.get("demonstrations", [])) or len(evidence)
    often = f"seen in {seen} of {whole}" if whole > 1 else ""
    when = f"{start:.1f} - {end:.1f} s" + (f" on average, {often}" if often else "")
    parts.append(_text(x + 18, under + 43, when, 12, FAINT))
    for row, (indent, line) in enumerate(lines):
        parts.append(_text(x + indent, under + 62 + ROW * row, line, 12, INK))
    return height


def _colour(concept: str) -> str:
    known = concept_of(concept)
    return GREY if known is None else known.presentation.colour


def _parameter_lines(
    concept: str, parameters: Mapping[str, Any], uncertainty: Mapping[str, Any]
) -> list[str]:
    lines = []
    for name, value in parameters.items():
        if name == "target":
            continue
        quantity = quantity_of(concept, name)
        unit = "" if quantity is None or quantity.unit == "1" else quantity.unit
        spread = plain(uncertainty.get(name))
        value = plain(value)
        if quantity is not None and quantity.kind == "points":
            lines.append(f"{name}: {'straight' if not value else ''}".rstrip())
            for i, point in enumerate(value):
                around = spread[i] if isinstance(spread, list) and i < len(spread) else None
                lines.append(f"   {_number(point, around, unit)}")
        elif isinstance(value, str):
            often = f" ({spread[value]:.0%})" if isinstance(spread, Mapping) and value in spread else ""
            lines.append(f"{name}: {value}{often}")
        else:
            lines.append(f"{name}: {_number(value, spread, unit)}")
    return lines


def _number(value: Any, spread: Any, unit: str) -> str:
    """A number or vector with its standard deviation, of a vector the largest component's."""
    text = (
        f"{value:.3f}"
        if isinstance(value, float)
        else f"({', '.join(f'{round(v, 2) + 0.0:.2f}' for v in value)})"
    )
    if spread is not None:
        text += f" ± {float(np.max(spread)):.3f}"
    return f"{text} {unit}".rstrip()


def _arrows(graph: nx.DiGraph[str], boxes: Mapping[str, tuple[float, float, float]]) -> list[str]:
    arrows = []
    for a, b in graph.edges:
        (xa, ya, height), (xb, yb, _) = boxes[a], boxes[b]
        x1, y1, x2, y2 = xa + CARD / 2, ya + height, xb + CARD / 2, yb - 2
        middle = (y1 + y2) / 2
        curve = f"M{x1:.1f},{y1:.1f} C{x1:.1f},{middle:.1f} {x2:.1f},{middle:.1f} {x2:.1f},{y2 - 6:.1f}"
        arrows.append(
            f'<path d="{curve}" fill="none" stroke="{FAINT}" stroke-width="1.5"/>'
            f'<path d="M{x2:.1f},{y2:.1f} l-5,-9 h10 z" fill="{FAINT}"/>'
        )
    return arrows


def _lines(text: str, width: float, size: int) -> list[str]:
    """A text over as many lines as it needs at this width in pixels: nothing is cut."""
    return wrapped(text, int(width / _LETTER[size]))


def _titled(whole: str, shape: str) -> str:
    """A shape that says its whole text when pointed at."""
    return f"<g><title>{escaped(whole)}</title>{shape}</g>"


def _text(
    x: float, y: float, text: str, size: int, colour: str, anchor: str = "start", bold: bool = False
) -> str:
    weight = ' font-weight="600"' if bold else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{colour}" text-anchor="{anchor}"{weight}>'
        f"{escaped(text)}</text>"
    )


def _box(
    x: float,
    y: float,
    width: float,
    height: float,
    fill: str,
    radius: float = 5,
    stroke: str | None = LINE,
) -> str:
    edge = f' stroke="{stroke}"' if stroke else ""
    return (
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="{radius}" '
        f'fill="{fill}"{edge}/>'
    )


def _line(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{LINE}"/>'
