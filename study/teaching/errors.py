"""What can go wrong while a robot is taught, apart from devices, displays and the disk."""

from steerlab.sim.errors import SteerlabError


class TeachingError(SteerlabError):
    """A robot cannot be taught as asked; says why, and what is kept."""
