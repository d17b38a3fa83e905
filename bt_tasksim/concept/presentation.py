"""How a concept is drawn and spoken of."""

from __future__ import annotations

from dataclasses import dataclass

GREY = "#5f6b78"


@dataclass(frozen=True)
class Presentation:
    """What pictures, listings and narration say of a concept.

    Attributes:
        colour: Colour of its tasks in pictures of decompositions, as CSS writes it.
        symbol: A sign in pictures and listings of trees; empty for none.
        spoken: Regular expression of what people say in English when they do it, in lower case; empty where
            nothing is known.
        sayings: Whole sentences that people say; ``{}`` stands for the target, or for the destination. The
            synthetic demonstrations say them.
        says_destination: ``{}`` stands for the destination.
    """

    colour: str = GREY
    symbol: str = ""
    spoken: str = ""
    sayings: tuple[str, ...] = ()
    says_destination: bool = False
