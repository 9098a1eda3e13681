"""The error of everything that concerns the study database."""

from steerlab.sim.errors import SteerlabError


class StoreError(SteerlabError):
    """The study database cannot be opened, read or written, or an act would break its record."""
