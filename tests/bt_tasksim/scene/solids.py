"""Solids of the built-in kinds in any size, for tests of shapes and of grips."""

from hypothesis import strategies as st

from bt_tasksim.scene.shapes import KINDS, ShapeSize

MADE = sorted(set(KINDS) - {"mesh", "ball", "bowl", "jug"})


@st.composite
def solids(draw, kinds=tuple(MADE), exponents=(0.2, 1.0)):
    """A kind and a size of it."""
    kind = draw(st.sampled_from(kinds))
    low, high = KINDS[kind].size_range
    size = [draw(st.floats(a, b)) if a < b else a for a, b in zip(low, high, strict=True)]
    if KINDS[kind].round:
        size[1] = size[0]
    if KINDS[kind].cubic:
        size = [size[0]] * 3
    return kind, ShapeSize(tuple(size), (draw(st.floats(*exponents)), draw(st.floats(*exponents))))
