"""Twenty-one meshes of everyday forms from a seed: ``python -m benchmarks.any_tree.meshes FOLDER --seed 3``.

Each is one closed solid in metres that stands on a flat base at z = 0, is 4 to 14 cm long, and has a place
that a gripper of 7 cm opening can hold. They are what a tree that knows nothing of them is tried on: hollow
and convex ones, with handles, arms and holes.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

Rng = np.random.Generator
Solid = Any
"""A solid of manifold3d."""
SEGMENTS = 48


def _block(x: float, y: float, z: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Solid:
    """A box of this full size, the middle of its bottom at ``at``."""
    from manifold3d import Manifold

    return Manifold.cube((x, y, z), True).translate((at[0], at[1], at[2] + z / 2))


def _rod(radius: float, height: float, top: float | None = None, segments: int = SEGMENTS) -> Solid:
    """An upright cylinder or cone on z = 0."""
    from manifold3d import Manifold

    return Manifold.cylinder(height, radius, radius if top is None else top, segments)


def _turned(outline: list[tuple[float, float]], segments: int = SEGMENTS) -> Solid:
    """A body of revolution with this outline of radii and heights, counter-clockwise."""
    from manifold3d import CrossSection

    return CrossSection([np.array(outline)]).revolve(segments)


def _raised(outline: list[tuple[float, float]], height: float) -> Solid:
    """An upright prism on z = 0."""
    from manifold3d import CrossSection

    return CrossSection([np.array(outline)]).extrude(height)


def _bar(start: tuple[float, float], end: tuple[float, float], wide: float, thick: float) -> Solid:
    """A bar in the plane y = 0 from one point (x, z) to another, thick across."""
    from manifold3d import Manifold

    (x0, z0), (x1, z1) = start, end
    length, lean = math.hypot(x1 - x0, z1 - z0), math.degrees(math.atan2(z1 - z0, x1 - x0))
    bar = Manifold.cube((length, wide, thick), True).rotate((0.0, -lean, 0.0))
    return bar.translate(((x0 + x1) / 2, 0.0, (z0 + z1) / 2))


def mug(rng: Rng) -> Solid:
    """A mug with a handle at +x."""
    radius, height = rng.uniform(0.034, 0.042), rng.uniform(0.075, 0.1)
    wall, floor = rng.uniform(0.003, 0.005), 0.006
    return mug_of(radius, height, wall, floor)


def mug_of(radius: float, height: float, wall: float, floor: float) -> Solid:
    """A mug of this outer radius, height, wall and floor, metres, its handle at +x."""
    from manifold3d import CrossSection

    large, small = 0.3 * height, 0.3 * height - 0.009
    ring = CrossSection.circle(large, SEGMENTS) - CrossSection.circle(small, SEGMENTS)
    handle = ring.extrude(0.012).translate((0.0, 0.0, -0.006)).rotate((90.0, 0.0, 0.0))
    handle = handle.scale((0.85, 1.0, 1.0)).translate((radius + 0.1 * large, 0.0, height / 2))
    hollow = _rod(radius - wall, height).translate((0.0, 0.0, floor))
    return _rod(radius, height) + handle - hollow


def bowl(rng: Rng) -> Solid:
    """A round bowl with a foot."""
    radius, height, wall = rng.uniform(0.05, 0.06), rng.uniform(0.045, 0.055), rng.uniform(0.004, 0.006)
    foot = 0.5 * radius
    angle = np.linspace(0.0, math.pi / 2, 10)
    outer = [(foot + (radius - foot) * math.sin(a), height * (1 - math.cos(a))) for a in angle]
    inner = [(r - wall, wall + (height - wall) * h / height) for r, h in reversed(outer)]
    return _turned([(0.0, 0.0), *outer, *inner, (0.0, wall)])


def corner(rng: Rng) -> Solid:
    """An L that stands on its longer arm."""
    return corner_of(rng.uniform(0.08, 0.11), rng.uniform(0.06, 0.09), *rng.uniform(0.02, 0.03, 2).tolist())


def corner_of(length: float, height: float, wide: float, thick: float) -> Solid:
    """An L of this length, height, width and thickness of both arms, metres; the upright arm is at -x."""
    upright = _block(thick, wide, height, ((thick - length) / 2, 0.0, 0.0))
    return _block(length, wide, thick) + upright


def tee(rng: Rng) -> Solid:
    """A T upside down: a foot with a post on its middle."""
    thick, wide = rng.uniform(0.018, 0.026, 2).tolist()
    post = _block(thick, wide, rng.uniform(0.07, 0.1))
    return _block(rng.uniform(0.08, 0.11), wide + 0.01, thick) + post


def bracket(rng: Rng) -> Solid:
    """A U, open at the top."""
    length, height = rng.uniform(0.08, 0.1), rng.uniform(0.06, 0.08)
    wide, thick = rng.uniform(0.025, 0.035), rng.uniform(0.012, 0.018)
    return _block(length, wide, height) - _block(length - 2 * thick, 2 * wide, height, (0.0, 0.0, thick))


def plus(rng: Rng) -> Solid:
    """A cross that lies flat."""
    arm, wide, height = rng.uniform(0.08, 0.11), rng.uniform(0.02, 0.03), rng.uniform(0.03, 0.05)
    return _block(arm, wide, height) + _block(wide, arm, height)


def bottle(rng: Rng) -> Solid:
    """A bottle with a neck."""
    radius, neck = rng.uniform(0.026, 0.032), rng.uniform(0.01, 0.013)
    body, height = rng.uniform(0.07, 0.085), rng.uniform(0.12, 0.135)
    shoulder = body + (radius - neck)
    return _turned(
        [(0.0, 0.0), (radius, 0.0), (radius, body), (neck, shoulder), (neck, height), (0.0, height)]
    )


def jar(rng: Rng) -> Solid:
    """An open jar with a belly and a lip."""
    radius, height, wall = rng.uniform(0.03, 0.034), rng.uniform(0.08, 0.1), 0.004
    level = np.linspace(0.0, 1.0, 9)
    outer = [(radius * (0.75 + 0.25 * math.sin(math.pi * (0.15 + 0.75 * s))), s * height) for s in level]
    inner = [(r - wall, max(h, 0.006)) for r, h in reversed(outer)]
    return _turned([(0.0, 0.0), *outer, *inner, (0.0, 0.006)])


def ring(rng: Rng) -> Solid:
    """A flat ring."""
    radius, height = rng.uniform(0.04, 0.055), rng.uniform(0.02, 0.03)
    return _rod(radius, height) - _rod(radius - rng.uniform(0.012, 0.018), 3 * height).translate(
        (0, 0, -height)
    )


def hammer(rng: Rng) -> Solid:
    """A hammer that lies on its side."""
    length, thick = rng.uniform(0.11, 0.135), rng.uniform(0.02, 0.026)
    handle = _block(length, 0.018, thick)
    return handle + _block(0.028, rng.uniform(0.06, 0.075), thick, (length / 2 - 0.014, 0.0, 0.0))


def ladle(rng: Rng) -> Solid:
    """A small bowl with a flat base and a handle that rises aside."""
    from manifold3d import Manifold

    radius = rng.uniform(0.024, 0.03)
    outside = Manifold.sphere(radius, SEGMENTS) ^ _block(
        1.0, 1.0, 1.7 * radius - 0.008, (0.0, 0.0, -0.7 * radius)
    )
    inside = Manifold.sphere(radius - 0.004, SEGMENTS)
    end = (radius + rng.uniform(0.04, 0.05), 0.35 * radius + 0.035)
    handle = _bar((0.9 * radius - 0.004, 0.1 * radius), end, 0.012, 0.008)
    return (outside + handle - inside).translate((0.0, 0.0, 0.7 * radius))


def wedge(rng: Rng) -> Solid:
    """A ramp."""
    length, wide, height = rng.uniform(0.07, 0.1), rng.uniform(0.04, 0.055), rng.uniform(0.035, 0.05)
    side = _raised([(-length / 2, 0.0), (length / 2, 0.0), (length / 2, height), (-length / 2, 0.008)], wide)
    return side.rotate((90.0, 0.0, 0.0)).translate((0.0, wide / 2, 0.0))


def stairs(rng: Rng) -> Solid:
    """Three steps."""
    run, rise, wide = rng.uniform(0.022, 0.03), rng.uniform(0.015, 0.02), rng.uniform(0.04, 0.055)
    steps = [_block((3 - k) * run, wide, (k + 1) * rise, (k * run / 2, 0.0, 0.0)) for k in range(3)]
    return steps[0] + steps[1] + steps[2]


def nut(rng: Rng) -> Solid:
    """A hexagonal nut."""
    radius, height = rng.uniform(0.025, 0.034), rng.uniform(0.025, 0.035)
    return _rod(radius, height, segments=6) - _rod(0.5 * radius, 3 * height).translate((0.0, 0.0, -height))


def star(rng: Rng) -> Solid:
    """A prism on a star of five points."""
    large, height = rng.uniform(0.035, 0.045), rng.uniform(0.04, 0.06)
    radii = [large, 0.55 * large] * 5
    angle = [math.pi * k / 5 for k in range(10)]
    return _raised([(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angle, strict=True)], height)


def basket(rng: Rng) -> Solid:
    """A block with a bail over its top."""
    x, y, z = rng.uniform(0.06, 0.085), rng.uniform(0.045, 0.06), rng.uniform(0.035, 0.045)
    bail = _block(0.85 * x, 0.014, 0.05) - _block(0.85 * x - 0.022, 0.03, 0.039)
    return _block(x, y, z) + bail.translate((0.0, 0.0, z - 0.001))


def dumbbell(rng: Rng) -> Solid:
    """Two blocks with a bar between them, lying."""
    length, thick, wide = rng.uniform(0.1, 0.13), rng.uniform(0.035, 0.045), rng.uniform(0.02, 0.028)
    ends = [_block(0.03, thick, thick, (s * (length - 0.03) / 2, 0.0, 0.0)) for s in (-1, 1)]
    return ends[0] + ends[1] + _block(length - 0.03, wide, wide, (0.0, 0.0, (thick - wide) / 2))


def frustum(rng: Rng) -> Solid:
    """A cone without its tip."""
    return _rod(rng.uniform(0.032, 0.04), rng.uniform(0.06, 0.09), top=rng.uniform(0.02, 0.026))


def book(rng: Rng) -> Solid:
    """A book that lies."""
    return _block(rng.uniform(0.1, 0.13), rng.uniform(0.05, 0.064), rng.uniform(0.02, 0.03))


def tube(rng: Rng) -> Solid:
    """An upright tube, open at both ends."""
    radius, height = rng.uniform(0.022, 0.03), rng.uniform(0.07, 0.11)
    return _rod(radius, height) - _rod(radius - 0.005, 3 * height).translate((0.0, 0.0, -height))


def egg(rng: Rng) -> Solid:
    """An egg on a flat end."""
    from manifold3d import Manifold

    radius, long = rng.uniform(0.024, 0.03), rng.uniform(1.25, 1.5)
    body = Manifold.sphere(radius, SEGMENTS).scale((1.0, 1.0, long))
    cut = 0.85 * radius * long
    return (body ^ _block(1.0, 1.0, 1.0, (0.0, 0.0, -cut))).translate((0.0, 0.0, cut))


FORMS: Mapping[str, Callable[[Rng], Solid]] = {
    form.__name__: form
    for form in (
        mug, bowl, corner, tee, bracket, plus, bottle, jar, ring, hammer, ladle, wedge, stairs, nut, star,
        basket, dumbbell, frustum, book, tube, egg,
    )
}  # fmt: skip
"""What is made, by name."""


def made(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices ``(n, 3)`` in metres and triangles ``(m, 3)`` of a form; the same seed makes the same."""
    rng = np.random.default_rng([seed, *name.encode()])
    return triangles(FORMS[name](rng))


def triangles(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Vertices ``(n, 3)`` and triangles ``(m, 3)`` of a solid."""
    mesh = solid.to_mesh()
    return np.array(mesh.vert_properties, float)[:, :3], np.array(mesh.tri_verts, int)


def obj_text(vertices: np.ndarray, faces: np.ndarray, about: str) -> str:
    """An OBJ file's text, coordinates to a hundredth of a millimetre."""
    lines = [f"# {about}"]
    lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices + 0.0]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    return "\n".join(lines) + "\n"


def write(folder: Path, seed: int) -> dict[str, Path]:
    """Write every form of this seed into a folder, and give the files by name."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {}
    for name in FORMS:
        files[name] = folder / f"{name}.obj"
        files[name].write_text(obj_text(*made(name, seed), f"{name}, seed {seed}, metres"), encoding="utf-8")
    return files


def main() -> None:
    """Write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for name, file in write(options.folder, options.seed).items():
        print(f"{name:10} {file}")


if __name__ == "__main__":
    main()
