"""Everyone's place in the study, worked out anew only after something has changed."""

from steerlab.study.opened import OpenStudy
from steerlab.study.progress import ParticipantProgress, everybody, progress_of


class ProgressCache:
    """What ``progress`` works out, kept while the audit's newest entry stays the same.

    Every change that a place depends on has its entry, by whichever program, and an entry's hash
    seals all before it: so it stands for the state of the whole study. Edits outside steerlab go
    unseen here; ``verify``, which looks for those, does not ask this.
    """

    def __init__(self, study: OpenStudy) -> None:
        self._study = study
        self._seal: list[tuple[int, str | None]] = []
        self._kept: dict[str, ParticipantProgress] = {}
        self._all: list[ParticipantProgress] | None = None

    def of(self, participant: str) -> ParticipantProgress:
        """A participant's place.

        Raises:
            StudyError: nobody is enrolled under that name.
        """
        self._forget_what_is_old()
        if participant not in self._kept:
            self._kept[participant] = progress_of(self._study, participant)
        return self._kept[participant]

    def all(self) -> list[ParticipantProgress]:
        """Everyone's place, in the order in which they were enrolled."""
        self._forget_what_is_old()
        if self._all is None:
            self._all = everybody(self._study)
            self._kept = {place.view.id: place for place in self._all}
        return self._all

    def _forget_what_is_old(self) -> None:
        newest = "SELECT id, sha256 FROM audit ORDER BY id DESC LIMIT 1"
        seal = self._study.store.connection.read(newest)
        if seal != self._seal:
            self._seal, self._kept, self._all = seal, {}, None
