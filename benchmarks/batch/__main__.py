"""``python -m benchmarks.batch [SECTION ...] [--quick] [--json FILE]``: measures worlds in batches.

A section is a module of this package with ``options(parser)``, which adds what it takes, and
``measure(options)``, which prints its table and returns its numbers. Without a name all are measured.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.batch import (
    begins,
    device,
    episodes,
    executor,
    kinematics,
    laws,
    physics,
    same_bits,
    same_ticks,
)
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import write_text
from bt_tasksim.execution.runner import LONGEST

SECTIONS = {
    "executor": executor,
    "kinematics": kinematics,
    "laws": laws,
    "physics": physics,
    "episodes": episodes,
    "begins": begins,
    "device": device,
    "same-ticks": same_ticks,
    "same-bits": same_bits,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure sections; 1 where one of them found that something is not as it should be."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.batch", description=__doc__.splitlines()[0])
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(SECTIONS))
    parser.add_argument("--quick", action="store_true", help="less of everything")
    parser.add_argument(
        "--device",
        default="cpu",
        metavar="D",
        help="what torch (sections executor, laws) and MuJoCo Warp (device) run on: cpu, cuda, cuda:N",
    )
    parser.add_argument(
        "--worlds", type=_positive, metavar="N", help="so many alone, instead of a section's own series"
    )
    parser.add_argument(
        "--longest",
        type=float,
        default=LONGEST,
        metavar="S",
        help="simulated seconds after which episodes are stopped (laws, episodes, device, same-bits)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there")
    for section in SECTIONS.values():
        section.options(parser)
    options = parser.parse_args(argv)
    unknown = [name for name in options.sections if name not in SECTIONS]
    if unknown:
        parser.error(f"there is no section '{unknown[0]}': there are {', '.join(SECTIONS)}")
    found = {}
    try:
        for name in options.sections or SECTIONS:
            found[name] = SECTIONS[name].measure(options)
    except InputError as error:
        parser.error(str(error))
    except MachineError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 1
    if options.json is not None:
        write_text(options.json, json.dumps(found, indent=2) + "\n")
        print(f"wrote {options.json}")
    return int(any("differs" in numbers for numbers in found.values()))


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"should be a positive whole number, found {text}")
    return value


if __name__ == "__main__":
    sys.exit(main())
