"""What the experimenter sees."""

import secrets
from dataclasses import dataclass
from typing import Any

from starlette.responses import Response

from steerlab.app.console import texts
from steerlab.app.console.forms import csrf_token
from steerlab.app.console.next_steps import next_step, step_of
from steerlab.app.console.rendering import page
from steerlab.app.console.sign_in import BrowserSession
from steerlab.app.console.study_check_job import CheckupView
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.study.contract import ParticipantView, Standing, StudyAccess


@dataclass(frozen=True, kw_only=True, slots=True)
class ExperimenterContext:
    """What a request of the experimenter's has at hand.

    Attributes:
        origin: what participants' links begin with.
        version: of the study, as open pages know it.
    """

    study: StudyAccess
    runs: WheelRuns
    session: BrowserSession
    origin: str
    version: str


def people_page(bench: ExperimenterContext) -> Response:
    """Who is under way, with progress and what to do next; then who has finished or left."""
    run = bench.runs.view()
    people = [
        {"view": view, "step": step_of(view), "next": next_step(view, run)}
        for view in bench.study.participants()
    ]
    over = [one for one in people if _is_over(one["view"])]
    return page(
        "people.html.j2",
        **_frame(bench, texts.PEOPLE),
        people=[one for one in people if one not in over],
        over=over,
        run=run,
    )


def person_page(
    bench: ExperimenterContext,
    participant: str,
    *,
    link_key: str = "",
    status: int = 200,
    wrong: str = "",
) -> Response:
    """One participant.

    Args:
        link_key: names a new link that this page, and no other, shows.
        wrong: why a withdrawal was not done.
    """
    view = bench.study.participant(participant)
    run = bench.runs.view()
    kept = bench.session.links.pop(link_key, None)
    return page(
        "person.html.j2",
        status=status,
        **_frame(bench, texts.PERSON_TITLE.format(id=view.id)),
        view=view,
        run=run,
        next=next_step(view, run),
        current=view.next_phase,
        is_in=view.next_phase is not None,
        step=step_of(view),
        link=f"{bench.origin}/p/{kept}" if kept else "",
        notes=[(_minute(when), text) for when, text in bench.study.notes(participant)],
        findings=bench.study.findings(participant),
        wrong=wrong,
        can_leave=view.standing in (Standing.ENROLLED, Standing.RUNNING, Standing.FINISHED),
        can_erase=view.standing is not Standing.WITHDRAWN_ERASED,
    )


def checks_page(bench: ExperimenterContext, checks: CheckupView) -> Response:
    """Integrity and completeness of the whole study."""
    return page(
        "checks.html.j2",
        **_frame(bench, texts.CHECKS_TITLE),
        checks=checks,
        findings=sorted(checks.findings, key=lambda one: (one.ok, not one.notice)),
        bad=sum(not finding.ok for finding in checks.findings),
    )


def keep_link(bench: ExperimenterContext, token: str) -> str:
    """Put a new link aside for the one page that shows it; the name it is asked for by."""
    key = secrets.token_urlsafe(16)
    bench.session.links.clear()  # one that was never looked at is not kept
    bench.session.links[key] = token
    return key


def _is_over(view: ParticipantView) -> bool:
    return view.next_phase is None and view.standing is not Standing.ERASING


def _minute(at_utc: str) -> str:
    """``2026-03-02T10:15:04.123Z`` as people read it."""
    return texts.AT_UTC.format(day=at_utc[:10], minute=at_utc[11:16])


def _frame(bench: ExperimenterContext, title: str) -> dict[str, Any]:
    return {
        "study": bench.study.title,
        "title": title,
        "csrf": csrf_token(bench.session.secret),
        "version": bench.version,
    }
