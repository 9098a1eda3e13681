"""What the experimenter does; each act ends on the page that shows its outcome."""

from collections.abc import Callable, Mapping

from starlette.responses import RedirectResponse, Response

from steerlab.app.console import texts
from steerlab.app.console.experimenter_views import ExperimenterContext, keep_link, person_page
from steerlab.app.console.next_steps import PAGES
from steerlab.study.contract import Role, StudyError

Posted = Mapping[str, str]

LONGEST_NOTE = 5000  # characters


def enrol(bench: ExperimenterContext, posted: Posted) -> Response:
    """The next participant, in a role."""
    if posted.get("role") not in tuple(Role):
        role = posted.get("role", "")[:80]
        raise StudyError(texts.WRONG_ROLE.format(role=role, roles=" or ".join(Role)))
    view = bench.study.enrol(Role(posted["role"]))
    return _to(view.id)


def new_link(participant: str, bench: ExperimenterContext, posted: Posted) -> Response:
    """A fresh link for the participant; shown once."""
    view = bench.study.participant(participant)
    key = keep_link(bench, bench.study.new_link(view.id))
    return RedirectResponse(f"/participants/{view.id}?link={key}", 303)


def start(participant: str, bench: ExperimenterContext, posted: Posted) -> Response:
    """Begin or resume the wheel phase that comes next; the form only says which it thought it was.

    Raises:
        StudyError: another one is next, or one is running.
    """
    view = bench.study.participant(participant)
    phase = view.next_phase
    if phase is None or phase.kind in PAGES or phase.id != posted.get("phase"):
        title = posted.get("phase", "")[:80]
        raise StudyError(texts.RUN_NOT_NEXT.format(title=title, participant=view.id))
    bench.runs.start(view.id, phase)
    return _to(view.id)


def redo(participant: str, bench: ExperimenterContext, posted: Posted) -> Response:
    """Open a finished phase again.

    Raises:
        StudyError: it is not finished, or the participant is at the wheel.
    """
    view = bench.study.participant(participant)
    phase = next((one for one, _ in view.phases if one.id == posted.get("phase")), None)
    if phase is None:
        raise StudyError(
            texts.RUN_NOT_NEXT.format(title=posted.get("phase", "")[:80], participant=view.id)
        )
    _refuse_while_driving(bench, view.id)
    bench.study.redo(view.id, phase.id)
    return _to(view.id)


def note(participant: str, bench: ExperimenterContext, posted: Posted) -> Response:
    """Keep a remark."""
    view = bench.study.participant(participant)
    text = posted.get("text", "").replace("\r\n", "\n").strip()
    if len(text) > LONGEST_NOTE:
        raise StudyError(texts.NOTE_LONG.format(count=len(text), longest=LONGEST_NOTE))
    if text:
        bench.study.note(view.id, text)
    return _to(view.id)


def withdraw(participant: str, bench: ExperimenterContext, posted: Posted) -> Response:
    """Let a participant leave, once the outcome is chosen and the id is typed."""
    view = bench.study.participant(participant)
    outcome = posted.get("outcome")
    if outcome not in ("keep", "erase"):
        return person_page(bench, view.id, status=422, wrong=texts.WITHDRAW_CHOOSE)
    if posted.get("typed", "").strip() != view.id:
        mistyped = texts.WITHDRAW_MISTYPED.format(id=view.id)
        return person_page(bench, view.id, status=422, wrong=mistyped)
    _refuse_while_driving(bench, view.id)
    if outcome == "erase":
        bench.runs.erase(view.id)
    else:
        bench.study.withdraw(view.id, erase=False)
    return _to(view.id)


ACTS: Mapping[str, Callable[[str, ExperimenterContext, Posted], Response]] = {
    "link": new_link,
    "start": start,
    "redo": redo,
    "note": note,
    "withdraw": withdraw,
}


def _refuse_while_driving(bench: ExperimenterContext, participant: str) -> None:
    run = bench.runs.view()
    if run is not None and run.goes_on and run.participant == participant:
        raise StudyError(
            texts.RUN_BUSY.format(title=run.title, participant=run.participant, pid=run.pid)
        )


def _to(participant: str) -> RedirectResponse:
    return RedirectResponse(f"/participants/{participant}", 303)
