"""Errors a user can mend; the command line prints them in one sentence and exits with code 2."""


class SteerlabError(Exception):
    """Base of every error that names a value, its cause and its mend."""


class InvalidConfig(SteerlabError, ValueError):
    """A setting, or a file that holds settings, is outside what it may be."""


class InvalidWorld(SteerlabError, ValueError):
    """A world breaks its own rules: a ball inside a block, a start outside the ground, ..."""


class MissingPackage(SteerlabError, ImportError):
    """An optional package, which this part of steerlab needs, is not installed."""


class NoPath(SteerlabError):
    """No forward-drivable path leads from a pose to the ball.

    ``reason`` is one of ``pose_in_collision``, ``no_connection``, ``goal_blocked``.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class NoRenderer(SteerlabError):
    """No OpenGL back end on this machine can draw a frame."""


class StateMismatch(SteerlabError, ValueError):
    """A stored state vector does not belong to the model it is restored into."""
