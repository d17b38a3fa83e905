"""What words of the command line may be: argparse turns a wrong one into its own sentence."""

from __future__ import annotations

import argparse


def policy(text: str) -> tuple[str, str]:
    """A concept's name and a policy, as in ``grasp=programmed``."""
    concept, _, policy = text.partition("=")
    if not concept or not policy:
        raise argparse.ArgumentTypeError(
            f"should be CONCEPT=POLICY, such as grasp=programmed, found '{text}'"
        )
    return concept, policy


def count(text: str) -> int:
    """A positive whole number."""
    value = whole(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"should be a positive whole number, found '{text}'")
    return value


def seed(text: str) -> int:
    """Zero or a positive whole number."""
    value = whole(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"should be zero or a positive whole number, found '{text}'")
    return value


def port(text: str) -> int:
    """A TCP port; 0 for a free one."""
    value = whole(text)
    if not 0 <= value <= 65535:
        raise argparse.ArgumentTypeError(f"should be a port from 0 to 65535, found '{text}'")
    return value


def whole(text: str) -> int:
    """A whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"should be a whole number, found '{text}'") from None
