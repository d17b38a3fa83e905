"""Pauses of Python's garbage collector, which a loop in real time cannot afford.

Now and then the collector looks at every object that there is, and nothing else goes on meanwhile: 80 to 120
ms with the 130,000 objects of a runner that has planned a few tasks, as long as a robot's command lasts. Of
objects that are set aside it looks at none.
"""

from __future__ import annotations

import gc


def set_aside() -> None:
    """Collect what is garbage now, and set the other objects aside: later collections pass them over."""
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def take_back() -> None:
    """Let collections look at every object again."""
    gc.unfreeze()
