"""Errors about recordings."""

from steerlab.sim.errors import SteerlabError


class RecordingUnavailable(SteerlabError):
    """A recording cannot be chosen, written, opened or drawn."""
