"""What the console begins by itself as soon as it is due: the steps that need nobody at the wheel."""

import logging

from steerlab.app.console.next_steps import AtWheel, at_wheel
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.study.contract import PhaseKind, StudyAccess, StudyError

_LOG = logging.getLogger(__name__)


class OwnSteps:
    """Starts the computer's own steps, each once; to be called after every change of the study.

    One that fails is not tried again: the experimenter is shown what it said, and resumes it.
    """

    def __init__(self, runs: WheelRuns) -> None:
        self._runs = runs

    def __call__(self, study: StudyAccess) -> None:
        """Begin the first step that is due, unless something runs."""
        views = study.participants()
        due = [(view, phase) for view in views if (phase := view.next_phase) is not None]
        self._runs.next_are({(view.id, phase.id) for view, phase in due})
        run = self._runs.view()
        if run is not None and run.goes_on:
            return
        try:
            if self._runs.to_erase:
                self._runs.erase_waiting()
                return
            for view, phase in due:
                alone = phase.kind is PhaseKind.CALIBRATE_W
                if alone and at_wheel(view, phase, self._runs) is AtWheel.READY:
                    self._runs.start(view.id, phase)
                    return
        except StudyError as error:  # the experimenter's page says that it has stopped
            _LOG.warning("%s", error)
