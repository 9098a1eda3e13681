"""Errors of the learning layer; each names a value, the cause and the remedy."""

from steerlab.sim.errors import SteerlabError


class InvalidLabels(SteerlabError, ValueError):
    """A label series or table breaks its own rules: gaps, wrong shapes, nothing to learn from."""


class UnknownPerson(SteerlabError, KeyError):
    """A mapper was asked to map labels of someone it never saw."""

    def __str__(self) -> str:
        return str(self.args[0])  # KeyError would print the message quoted


class NotFitted(SteerlabError, RuntimeError):
    """A mapper was used before ``fit``."""


class InvalidCheckpoint(SteerlabError, ValueError):
    """A model file is missing, damaged, or not one of ours."""
