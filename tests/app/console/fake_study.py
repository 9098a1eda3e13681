"""A study in memory, for tests of the console alone."""

import secrets
from dataclasses import replace
from hashlib import sha256

from steerlab.study.consent import NO_ENTRIES, ConsentRecord, ConsentText
from steerlab.study.contract import (
    ParticipantView,
    Phase,
    PhaseKind,
    PhaseState,
    Role,
    Standing,
    StudyCheck,
    StudyError,
)
from steerlab.study.design import DesignPlan, design_of
from steerlab.study.erasing_reach import Reach
from steerlab.study.surveys.answer_format import Choice, Likert, Number, Option
from steerlab.study.surveys.branching import ShownIf
from steerlab.study.surveys.questionnaire import Item, Questionnaire
from steerlab.study.surveys.questionnaire_file import shipped_questionnaires

WAY = (
    Phase(id="consent", kind=PhaseKind.CONSENT, title="Information and consent"),
    Phase(
        id="pre",
        kind=PhaseKind.QUESTIONNAIRES,
        title="About you",
        questionnaires=("demographics", "mini_ipip_5", "trust"),
    ),
    Phase(
        id="how",
        kind=PhaseKind.INSTRUCTIONS,
        title="How the drives work",
        text=(
            "You will sit at the steering wheel and watch twelve short drives of a car that "
            "steers by itself.",
            "Turn the wheel as you think the car should have steered. The car does not react "
            "to you: what matters is what you would have done.",
        ),
    ),
    Phase(id="practice", kind=PhaseKind.PRACTICE, title="Practice drive"),
    Phase(id="calibration", kind=PhaseKind.CALIBRATION, title="Twelve drives"),
    Phase(
        id="post",
        kind=PhaseKind.QUESTIONNAIRES,
        title="How it was",
        questionnaires=("raw_tlx", "experience_driving"),
    ),
    Phase(
        id="debrief",
        kind=PhaseKind.DEBRIEF,
        title="What this study is about",
        text=("We study how people correct a robot that drives. You were a great help.",),
    ),
)
CONSENT = (
    "You are invited to take part in a study of how people teach robots to drive. It takes "
    "about 60 minutes.",
    "We record how you turn the steering wheel and what you answer. Your name is not kept with "
    "it: the study knows you by a number only.",
    "There are no known risks beyond those of an ordinary driving game.",
)
YES_NO = Choice(options=(Option(value="yes", text="Yes"), Option(value="no", text="No")))
AGREE = Likert(low=1, high=5, anchors=((1, "Not at all"), (5, "Entirely")))
BRANCHED = Questionnaire(
    key="branched",
    title="Branched",
    version=1,
    instructions="Some questions follow from others.",
    citation="Made up.",
    licence_note="Made up.",
    unvalidated=True,
    items=(
        Item(id="played", text="Have you ever played a racing game?", format=YES_NO),
        Item(
            id="hours",
            text="How many hours a week?",
            format=Number(minimum=0, maximum=100, unit="hours"),
            shown_if=ShownIf(item="played", answers=("yes",)),
        ),
        Item(
            id="fast",
            text="Did you like the speed?",
            format=AGREE,
            required=False,
            shown_if=ShownIf(item="hours", answers=(3,)),
        ),
        Item(id="calm", text="I drive calmly.", format=AGREE),
        Item(id="check", text="Please choose 4 here.", format=AGREE, attention=4),
    ),
)
BRANCHED_WAY = (
    WAY[0],
    Phase(id="pre", kind=PhaseKind.QUESTIONNAIRES, title="About you", questionnaires=("branched",)),
    WAY[-1],
)
ASKING = {
    "ticks": (
        "I have read the information above and could ask questions.",
        "I agree that my answers and how I steer are kept under a number and analysed.",
    ),
    "minimum_age": 18,
    "signature": True,
}
"""What a ``ConsentText`` can ask for."""
AT_UTC = "2026-03-02T10:15:04.123Z"


class FakeStudy:
    """Does what ``StudyAccess`` promises, but for durability."""

    def __init__(self, way=WAY):
        self.title = "Teaching a robot to drive"
        self.way = way
        self.views = {}
        self.kept = {}
        self.saves = []
        self.links = {}
        self.remarks = []
        self.changes = 0
        self.forms = {}
        self.consent_version = 1
        self.asking = {}
        self.paragraphs = CONSENT
        self.decisions = {}
        self.orders = {}
        self.design_plan = DesignPlan()
        self.redone = []
        self.flags = {}
        self.reach = Reach()
        self.found = [
            StudyCheck(what="Audit log", found="chain of 214 entries is whole", ok=True),
            StudyCheck(what="P02", found="not finished yet: 3 left", ok=True, notice=True),
            StudyCheck(
                what="Disk", found="1.2 GB free", ok=False, mend="Free 2 GB before the next drive."
            ),
        ]

    def participants(self):
        return list(self.views.values())

    def design(self):
        return design_of(self.participants(), self.design_plan)

    def participant(self, participant):
        if participant not in self.views:
            raise StudyError(f"There is no participant {participant!r}.")
        return self.views[participant]

    def enrol(self, role, *, form=None):
        if form in self.forms:
            return self.participant(self.forms[form])
        number = len(self.views) + 1
        view = ParticipantView(
            id=f"P{number:02d}",
            role=role,
            standing=Standing.ENROLLED,
            order=("bc", "dagger", "mind-meld") if role is Role.TEST else (),
            phases=tuple((phase, PhaseState.WAITING) for phase in self.way),
        )
        self._put(view)
        self._take(form, view.id)
        return view

    def new_link(self, participant):
        token = secrets.token_urlsafe(24)
        self.links = {key: who for key, who in self.links.items() if who != participant}
        self.links[sha256(token.encode()).hexdigest()] = participant
        self.changes += 1
        return token

    def participant_of(self, token):
        return self.links.get(sha256(token.encode()).hexdigest())

    def questionnaire(self, key):
        return BRANCHED if key == "branched" else shipped_questionnaires()[key]

    def item_order(self, participant, phase, questionnaire):
        items = [item.id for item in self.questionnaire(questionnaire).items]
        return self.orders.get(questionnaire, items)

    def answers(self, participant, phase, questionnaire):
        return dict(self.kept.get((participant, phase, questionnaire), {}))

    def save_answer(self, participant, phase, questionnaire, item, value):
        if self.state(participant, phase) is PhaseState.DONE:
            raise StudyError(f"{phase!r} is done already.")
        answers = self.kept.setdefault((participant, phase, questionnaire), {})
        if value is None:
            answers.pop(item, None)
        else:
            answers[item] = self.questionnaire(questionnaire).check(item, value)
        self.saves.append((participant, phase, questionnaire, item, value))
        self.set_state(participant, phase, PhaseState.STARTED)

    def submit(self, participant, phase):
        if self.state(participant, phase) is PhaseState.DONE:
            return {}
        view = self.participant(participant)
        if view.next_phase is None or view.next_phase.id != phase:
            raise StudyError(f"{phase!r} is not the next phase of {participant}.")
        missing = {}
        for key in view.next_phase.questionnaires:
            lacking = self.questionnaire(key).missing(self.answers(participant, phase, key))
            if lacking:
                missing[key] = lacking
        if not missing:
            self.set_state(participant, phase, PhaseState.DONE)
        return missing

    def consent(self, participant, *, given, shown=None, entries=NO_ENTRIES):
        assert shown in (None, self.consent_version)
        text = self.consent_text(participant)
        assert not (given and text.lacking(entries))
        self.decisions[participant] = ConsentRecord(
            text=text, given=given, at_utc=AT_UTC, entries=entries
        )
        if given:
            self.set_state(participant, "consent", PhaseState.DONE)
        else:
            self._put(replace(self.participant(participant), standing=Standing.DECLINED))

    def consent_text(self, participant):
        self.participant(participant)
        return ConsentText(version=self.consent_version, text=self.paragraphs, **self.asking)

    def consent_record(self, participant):
        return self.decisions.get(participant)

    def note(self, participant, text, *, form=None):
        if form in self.forms:
            return
        self._take(form, "")
        self.remarks.append((participant, AT_UTC, text))
        self.changes += 1

    def notes(self, participant):
        return [(when, text) for who, when, text in self.remarks if who == participant]

    def redo(self, participant, phase, *, rollouts=(), form=None):
        if form in self.forms:
            return
        self._take(form, "")
        self.redone.append((participant, phase, tuple(rollouts)))
        self.set_state(participant, phase, PhaseState.WAITING)

    def drives(self, participant, phase):
        return self.flags

    def erasing_reaches(self, participant):
        return self.reach

    def withdraw(self, participant, *, erase):
        self.leave(participant, Standing.WITHDRAWN_ERASED if erase else Standing.WITHDRAWN_KEPT)

    def leave(self, participant, standing):
        self._put(replace(self.participant(participant), standing=standing))

    def findings(self, participant):
        return list(self.found)

    def change_count(self):
        return self.changes

    # For tests

    def ask_everything(self):
        """The consent text asks for all that it can."""
        self.asking = ASKING

    def branch(self):
        """From now on a page asks questions that depend on each other."""
        self.way = BRANCHED_WAY

    def state(self, participant, phase):
        return next(s for one, s in self.participant(participant).phases if one.id == phase)

    def set_state(self, participant, phase, state):
        view = self.participant(participant)
        phases = tuple((one, state if one.id == phase else old) for one, old in view.phases)
        done = all(one is PhaseState.DONE for _, one in phases)
        standing = Standing.FINISHED if done else Standing.RUNNING
        self._put(replace(view, phases=phases, standing=standing))

    def bring_to(self, participant, phase):
        """Everything before ``phase`` is done."""
        for one in self.way:
            if one.id == phase:
                return
            self.set_state(participant, one.id, PhaseState.DONE)

    def _take(self, form, result):
        if form is not None:
            self.forms[form] = result

    def _put(self, view):
        self.views[view.id] = view
        self.changes += 1
