"""How long work tells how far it is."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Told what is being done, and which share of it is done, 0 to 1."""

ShareProgress = Callable[[float], None]
"""Told which share of one piece of work is done, 0 to 1."""


def no_progress(share: float) -> None:
    """Nobody wants to know."""
