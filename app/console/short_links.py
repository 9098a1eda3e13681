"""Short links for tablets: a code that leads, once, to a participant's page."""

import secrets
from collections.abc import Callable
from time import monotonic

from steerlab.app.console.sign_in import CODE_LETTERS, plain_code

LENGTH = 8  # of 31 letters: 40 bits, one guess in 10^11 in the minutes that it lives
LIVES_S = 15 * 60.0
MOST = 16


class ShortLinks:
    """Codes and the links they stand for, in memory alone: they end with the console.

    A code is far easier to guess than a link. It works once, a quarter of an hour long, and whoever
    guesses has the limit on wrong links against them.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._links: dict[str, tuple[str, str, float]] = {}  # code: participant, token, end

    def make(self, participant: str, token: str) -> str:
        """A code for the participant's newest link; older codes of theirs end."""
        self._links = {
            code: kept
            for code, kept in self._links.items()
            if kept[0] != participant and kept[2] > self._clock()
        }
        while len(self._links) >= MOST:
            del self._links[next(iter(self._links))]
        code = "".join(secrets.choice(CODE_LETTERS) for _ in range(LENGTH))
        self._links[code] = (participant, token, self._clock() + LIVES_S)
        return f"{code[:4]}-{code[4:]}"

    def take(self, typed: str) -> str | None:
        """The link's token, once; None if the code is wrong, used, or has ended."""
        kept = self._links.pop(plain_code(typed), None)
        return kept[1] if kept is not None and kept[2] > self._clock() else None
