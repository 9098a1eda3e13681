"""What can be wrong with what is to be analysed."""

from steerlab.sim.errors import SteerlabError


class NotAStudy(SteerlabError):
    """A folder or a file holds nothing that can be analysed."""
