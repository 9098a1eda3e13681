"""What the experimenter sees."""

import secrets
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import segno
from markupsafe import Markup
from starlette.responses import Response

from steerlab.app.console import texts
from steerlab.app.console.config import is_loopback
from steerlab.app.console.guard import csrf_token
from steerlab.app.console.next_steps import next_step, state_of, step_of
from steerlab.app.console.rendering import page
from steerlab.app.console.short_links import ShortLinks
from steerlab.app.console.sign_in import BrowserSession, LoginThrottle
from steerlab.app.console.study_thread import StudyCheckResults
from steerlab.app.console.wheel_run import RunView, WheelRuns
from steerlab.study.contract import ParticipantView, PhaseState, Standing, StudyAccess
from steerlab.study.design import Recruited


@dataclass(frozen=True, kw_only=True, slots=True)
class ExperimenterContext:
    """What the experimenter's pages are made from.

    Attributes:
        throttle: is told of new links.
        home: the path of the experimenter's pages.
        origin: what participants' links begin with.
        kiosk: as of ``ParticipantContext``.
        version: of the study, as open pages know it.
    """

    study: StudyAccess
    runs: WheelRuns
    session: BrowserSession
    throttle: LoginThrottle
    short_links: ShortLinks
    home: str
    origin: str
    kiosk: bool
    version: str


def people_page(context: ExperimenterContext) -> Response:
    """Who is under way, with progress and what to do next; then who has finished or left."""
    run, views = context.runs.view(), context.study.participants()
    people = [
        {"view": view, "step": step_of(view), "next": next_step(view, context.runs)}
        for view in views
    ]
    over = [person for person in people if _is_over(person["view"])]
    design = context.study.design()
    return page(
        "people.html.j2",
        **_frame(context, texts.PEOPLE),
        people=[person for person in people if person not in over],
        over=over,
        run=run,
        ended=next((ended_words(run, view) for view in views if _is_of(run, view)), ""),
        recruited=[words for one in design.recruited if (words := _recruited(one))],
        design=design,
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
    short = f"{context.origin}/go/{context.short_links.make(view.id, kept)}" if kept else ""
    return page(
        "person.html.j2",
        status=status,
        **_frame(context, texts.PERSON_TITLE.format(id=view.id)),
        view=view,
        run=run,
        ended=ended_words(run, view) if _is_of(run, view) else "",
        next=next_step(view, context.runs),
        current=view.next_phase,
        is_in=view.next_phase is not None,
        step=step_of(view),
        link=f"{context.origin}/p/{kept}" if kept else "",
        short=short,
        qr=_qr(short),
        kiosk=context.kiosk,
        drives={
            phase.id: context.study.drives(view.id, phase.id)
            for phase, state in view.phases
            if phase.rollouts and state is PhaseState.DONE
        },
        reach=_reach(context, view.id),
        busy_with=_who_else_drives(run, view.id),
        notes=context.study.notes(participant),
        findings=context.study.findings(participant),
        blind=context.study.design().blind,
        wrong=wrong,
        can_leave=view.standing in (Standing.ENROLLED, Standing.RUNNING, Standing.FINISHED),
        can_erase=view.standing is not Standing.WITHDRAWN_ERASED,
    )


def _recruited(one: Recruited) -> str:
    """Such as ``Training: 5 of 12 recruited, 3 of them finished``."""
    if not (one.wanted or one.staying or one.left):
        return ""
    words = texts.RECRUITED_OF if one.wanted else texts.RECRUITED
    return words.format(
        role=texts.ROLE_NAME[one.role.value],
        staying=one.staying,
        wanted=one.wanted,
        finished=one.finished,
        left=one.left,
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


def ended_words(run: RunView | None, view: ParticipantView) -> str:
    """What became of a participant's run; empty while it goes on."""
    if run is None or run.goes_on:
        return ""
    said = {"title": run.title, "participant": run.participant}
    if run.code and not run.stopping:
        return texts.RUN_FAILED.format(**said, code=run.code)
    state = state_of(view, run.phase)
    if not run.phase or (state is not None and state.over):
        return texts.RUN_DONE.format(**said)
    if view.progress:
        return texts.RUN_STOPPED_AFTER.format(**said, progress=view.progress)
    return texts.RUN_STOPPED.format(**said)


def _is_of(run: RunView | None, view: ParticipantView) -> bool:
    return run is not None and run.participant == view.id


def _who_else_drives(run: RunView | None, participant: str) -> str:
    if run is None or not run.goes_on or run.participant == participant:
        return ""
    return run.participant


def _qr(address: str) -> Markup:
    """An address as a QR code; empty if it is that of this computer alone, or none."""
    if not address or is_loopback(urlsplit(address).hostname or ""):
        return Markup()
    return Markup(
        segno.make(address, micro=False).svg_inline(border=2, light="#ffffff", omitsize=True)
    )


def _reach(context: ExperimenterContext, participant: str) -> list[str]:
    """What erasing the participant touches of others, in words."""
    reach = context.study.erasing_reaches(participant)
    if not reach.network:
        return [texts.REACH_NONE]
    then = texts.REACH_TRAINED if reach.left >= reach.needed else texts.REACH_TOO_FEW
    removed = texts.REACH_NETWORK.format(
        participant=participant, needed=reach.needed, left=reach.left, then=then
    )
    words = [removed]
    for text, who in ((texts.REACH_TESTS, reach.embeddings), (texts.REACH_TAUGHT, reach.taught)):
        if who:
            words.append(text.format(count=len(who), who=", ".join(who)))
    return words


def _frame(context: ExperimenterContext, title: str) -> dict[str, Any]:
    return {
        "study": context.study.title,
        "title": title,
        "home": context.home,
        "csrf": csrf_token(context.session.secret),
        "once": secrets.token_urlsafe(16),
        "version": context.version,
    }
