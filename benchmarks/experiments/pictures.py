"""Plots of results, as small SVG files: bars with intervals, curves, shares over time, successes by size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams.update(
    {
        "svg.hashsalt": "bt-tasksim",  # the same picture from the same numbers, byte for byte
        "svg.fonttype": "none",
        "font.family": "sans-serif",
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": 10,
        "legend.frameon": False,
        "figure.facecolor": "white",
    }
)

COLOURS = ("#1f6feb", "#d1782d", "#2b8a3e", "#8250df", "#6e7781", "#bf3989")
Point = tuple[float, float]


def bars(path: Path, title: str, series: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> None:
    """Groups of bars: for each name, by label, counts with ``successes``, ``draws`` and ``interval``."""
    labels = list(dict.fromkeys(label for rows in series.values() for label in rows))
    figure, axes = _figure(max(4.5, 0.9 + 0.33 * len(labels) * (len(series) + 1)), 3.0)
    width = 0.8 / max(len(series), 1)
    for k, (name, rows) in enumerate(series.items()):
        at = [i + (k - (len(series) - 1) / 2) * width for i, label in enumerate(labels) if label in rows]
        found = [rows[label] for label in labels if label in rows]
        share = [100 * row["successes"] / max(row["draws"], 1) for row in found]
        low = [max(s - 100 * row["interval"][0], 0.0) for s, row in zip(share, found, strict=True)]
        high = [max(100 * row["interval"][1] - s, 0.0) for s, row in zip(share, found, strict=True)]
        axes.bar(at, share, 0.92 * width, yerr=[low, high], color=COLOURS[k % 6], label=name, ecolor="#444")
    axes.set_xticks(range(len(labels)), labels)
    axes.set_ylim(0, 101)
    axes.set_ylabel("succeeded, %")
    _legend(axes, title, min(len(series), 2))
    _save(figure, path)


def curves(
    path: Path,
    title: str,
    series: Mapping[str, Sequence[Point]],
    lines: Mapping[str, float] | None = None,
    groups: Sequence[str] = (),
    marks: Sequence[tuple[float, str]] = (),
) -> None:
    """Shares over decisions.

    Args:
        path: The file.
        title: Its title.
        series: Points by name.
        lines: Levels that do not change, by name.
        groups: Beginnings of names that share a colour, and one entry in the legend.
        marks: Where something changed, and what.
    """
    figure, axes = _figure(6.4, 3.2)
    named: set[str] = set()
    for k, (name, points) in enumerate(series.items()):
        group = next((g for g in groups if name.startswith(g)), name)
        colour = COLOURS[(groups.index(group) if group in groups else k) % 6]
        label = None if group in named else group
        named.add(group)
        x, y = [p[0] / 1000 for p in points], [100 * p[1] for p in points]
        axes.plot(x, y, color=colour, label=label, linewidth=1.4, marker="." if len(x) < 60 else "")
    for k, (name, level) in enumerate((lines or {}).items()):
        axes.axhline(100 * level, color="#444", linestyle=("--", ":")[k % 2], linewidth=1.0, label=name)
    for k, (x, text) in enumerate(marks):
        axes.axvline(x / 1000, color="#bbb", linewidth=0.8)
        axes.text(x / 1000, 2 + 5 * (len(marks) - 1 - k), f" {text}", fontsize=7, color="#666")
    axes.set_ylim(0, 101)
    axes.set_xlim(left=0)
    axes.set_xlabel("decisions, thousands")
    axes.set_ylabel("succeeded, %")
    _legend(axes, title, 3)
    _save(figure, path)


def stacked(path: Path, title: str, x: Sequence[float], kinds: Mapping[str, Sequence[float]]) -> None:
    """Shares of all episodes by kind of end, stacked, over decisions."""
    figure, axes = _figure(6.4, 3.2)
    shown = [[100 * v for v in values] for values in kinds.values()]
    axes.stackplot([v / 1000 for v in x], shown, labels=list(kinds), colors=_ends(kinds), linewidth=0)
    axes.set_ylim(0, 100)
    axes.set_xlim(0, max(x) / 1000 if x else 1)
    axes.set_xlabel("decisions, thousands")
    axes.set_ylabel("episodes, %")
    _legend(axes, title, 4)
    _save(figure, path)


def sizes(path: Path, title: str, panels: Mapping[str, Sequence[tuple[float, float, bool]]]) -> None:
    """Success by size: a dot for each draw at its width and height in mm, failures on top."""
    figure, every = _figure(3.3 * len(panels), 3.2, len(panels))
    for axes, (name, rows) in zip(every, panels.items(), strict=True):
        for good, colour, marker, size in ((True, "#9ec5f8", "o", 7), (False, "#c92a2a", "x", 22)):
            mine = [(w, h) for w, h, success in rows if success == good]
            label = f"{'succeeded' if good else 'failed'}: {len(mine)}"
            axes.scatter(
                [w for w, _ in mine],
                [h for _, h in mine],
                size,
                colour,
                marker=marker,
                linewidths=1.0,
                label=label,
            )
        axes.set_xlabel("width, mm")
        axes.set_ylabel("height, mm")
        _legend(axes, name, 2)
    figure.suptitle(title, fontsize=10)
    _save(figure, path)


def _ends(kinds: Mapping[str, Any]) -> list[str]:
    known = {"success": "#2b8a3e", "follower failed": "#d1782d", "violated": "#c92a2a", "timeout": "#6e7781"}
    rest = iter(("#8250df", "#bf3989", "#1f6feb", "#bbb") * 4)
    return [known.get(kind) or next(rest) for kind in kinds]


def _figure(width: float, height: float, panels: int = 0) -> tuple[Any, Any]:
    import matplotlib.pyplot as plt

    if not panels:
        return plt.subplots(figsize=(width, height), layout="constrained")
    figure, axes = plt.subplots(1, panels, figsize=(width, height), layout="constrained", squeeze=False)
    return figure, list(axes[0])


def _legend(axes: Any, title: str, columns: int) -> None:
    axes.set_title(title, loc="left", pad=26)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=columns, fontsize=7, borderpad=0.1)


def _save(figure: Any, path: Path) -> None:
    import matplotlib.pyplot as plt

    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None, "Creator": None})
    plt.close(figure)
