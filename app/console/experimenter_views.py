"""What the experimenter sees."""

import secrets
from dataclasses import dataclass
from typing import Any

from starlette.responses import Response

from steerlab.app.console import texts
from steerlab.app.console.guard import csrf_token
from steerlab.app.console.next_steps import next_step, step_of
from steerlab.app.console.rendering import page
from steerlab.app.console.sign_in import BrowserSession, LoginThrottle
from steerlab.app.console.study_thread import StudyCheckResults
from steerlab.app.console.wheel_run import WheelRuns
from steerlab.study.contract import ParticipantView, Standing, StudyAccess


@dataclass(frozen=True, kw_only=True, slots=True)
class ExperimenterContext:
    """What the experimenter's pages are made from.

    Attributes:
        throttle: is told of new links.
        home: the path of the experimenter's pages.
        origin: what participants' links begin with.
        version: of the study, as open pages know it.
    """

    study: StudyAccess
    runs: WheelRuns
    session: BrowserSession
    throttle: LoginThrottle
    home: str
    origin: str
    version: str


def people_page(context: ExperimenterContext) -> Response:
    """Who is under way, with progress and what to do next; then who has finished or left."""
    run = context.runs.view()
    people = [
        {"view": view, "step": step_of(view), "next": next_step(view, run)}
        for view in context.study.participants()
    ]
    over = [person for person in people if _is_over(person["view"])]
    return page(
        "people.html.j2",
        **_frame(context, texts.PEOPLE),
        people=[person for person in people if person not in over],
        over=over,
        run=run,
    )


def person_page(
    context: ExperimenterContext,
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
    view = context.study.participant(participant)
    run = context.runs.view()
    kept = context.session.links.pop(link_key, None)
    return page(
        "person.html.j2",
        status=status,
        **_frame(context, texts.PERSON_TITLE.format(id=view.id)),
        view=view,
        run=run,
        next=next_step(view, run),
        current=view.next_phase,
        is_in=view.next_phase is not None,
        step=step_of(view),
        link=f"{context.origin}/p/{kept}" if kept else "",
        notes=[(_minute(when), text) for when, text in context.study.notes(participant)],
        findings=context.study.findings(participant),
        wrong=wrong,
        can_leave=view.standing in (Standing.ENROLLED, Standing.RUNNING, Standing.FINISHED),
        can_erase=view.standing is not Standing.WITHDRAWN_ERASED,
    )


def checks_page(context: ExperimenterContext, checks: StudyCheckResults) -> Response:
    """Integrity and completeness of the whole study."""
    return page(
        "checks.html.j2",
        **_frame(context, texts.CHECKS_TITLE),
        checks=checks,
        findings=sorted(checks.findings, key=lambda check: (check.ok, not check.notice)),
        bad=sum(not finding.ok for finding in checks.findings),
    )


def keep_link(context: ExperimenterContext, token: str) -> str:
    """Keep a new link for the one page that shows it, and return the key of that page."""
    key = secrets.token_urlsafe(16)
    context.session.links.clear()  # one that was never looked at is not kept
    context.session.links[key] = token
    return key


def _is_over(view: ParticipantView) -> bool:
    return view.next_phase is None and view.standing is not Standing.ERASING


def _minute(at_utc: str) -> str:
    """``2026-03-02T10:15:04.123Z`` as day and minute."""
    return texts.AT_UTC.format(day=at_utc[:10], minute=at_utc[11:16])


def _frame(context: ExperimenterContext, title: str) -> dict[str, Any]:
    return {
        "study": context.study.title,
        "title": title,
        "home": context.home,
        "csrf": csrf_token(context.session.secret),
        "version": context.version,
    }
