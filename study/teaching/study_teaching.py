"""What the study's runner gets: a ``Teaching`` for every condition, light until somebody teaches."""

from steerlab.study.teaching.conditions import TAUGHT
from steerlab.study.teaching.request import TeachingResult, Teachings, TeachRequest


class StudyTeaching:
    """Teaches any condition of ``conditions``; what is slow to import waits until then."""

    def teach(self, request: TeachRequest) -> TeachingResult:
        """Teach; see ``run_teaching``.

        Raises:
            TeachingError: policies cannot be kept or read, or a drive cannot be learnt from.
            BallNeverReached: the first demonstration never got there.
            SteerlabError: device, display or study cannot be used; what is finished stays.
        """
        from steerlab.study.teaching.run_teaching import teach  # torch, MuJoCo: seconds to import

        finished, detail = teach(request)
        return TeachingResult(finished=finished, detail=detail)


def all_teachings() -> Teachings:
    """For everything that a protocol may name."""
    return dict.fromkeys(TAUGHT, StudyTeaching())
