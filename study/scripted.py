"""A scripted participant: the same phases, the same loop and the same record, without anybody."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.rollout import Outcome
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.study.contract import Phase, PhaseKind, StudyError
from steerlab.study.opened import OpenStudy
from steerlab.study.pages import consent, save_answer, submit
from steerlab.study.planted_effects import PlantedEffect, check_effects
from steerlab.study.progress import ParticipantProgress
from steerlab.study.scripted_answers import AnswerModel, ScriptedRespondent
from steerlab.study.store.teaching import read_taught
from steerlab.teleop.devices.scripted import ScriptedDevice


@dataclass(frozen=True, kw_only=True)
class ScriptedParticipant:
    """Who a scripted participant is; fills pages, and holds the device that corrects.

    Attributes:
        kind: the population that the style is drawn from.
        seed: of style, noise and answers.
        effects: planted correlations between style and answers.
    """

    kind: PopulationKind
    seed: int
    effects: tuple[PlantedEffect, ...] = ()

    @classmethod
    def parse(cls, spec: str, plants: Sequence[str] = ()) -> "ScriptedParticipant":
        """From ``scripted:KIND:SEED`` and ``QUESTIONNAIRE.SCALE:STYLE:R`` each.

        Raises:
            StudyError: a text is none of these.
            InvalidConfig: an effect is of an unknown style, or no correlation.
        """
        parts = spec.split(":")
        kinds = get_args(PopulationKind)
        if len(parts) != 3 or parts[0] != "scripted" or parts[1] not in kinds:
            raise StudyError(
                f"No scripted teacher {spec!r}; give scripted:KIND:SEED with a KIND of "
                f"{', '.join(kinds)}, such as scripted:human:3."
            )
        if not (parts[2].isascii() and parts[2].isdecimal()):
            raise StudyError(f"The seed of {spec!r} is {parts[2]!r}; give a number from 0.")
        return cls(
            kind=kinds[kinds.index(parts[1])],
            seed=int(parts[2]),
            effects=tuple(_effect(plant) for plant in plants),
        )

    @property
    def teacher(self) -> ScriptedTeacher:
        """Who corrects; the style is that of ``scripted:KIND:SEED`` elsewhere."""
        (drawn,) = sample_population(self.kind, 1, self.seed, prefix="scripted")
        return ScriptedTeacher(f"scripted-{self.kind}-{self.seed}", drawn.style, self.seed)

    @property
    def device(self) -> ScriptedDevice:
        """Steers as the teacher labels."""
        return ScriptedDevice(self.teacher)

    def fill(self, study: OpenStudy, place: ParticipantProgress, phase: Phase) -> None:
        """Do a page, answer by answer, as the console does.

        Raises:
            InvalidConfig: an effect is planted on what the study does not ask.
            StudyError: an answer is still missing: the questionnaire asks what no script answers.
        """
        participant = place.view.id
        if phase.kind is PhaseKind.CONSENT:
            consent(study, participant, given=True)
            return
        asked = {key: study.questionnaires[key] for key in place.protocol.questionnaires}
        check_effects(self.effects, asked)
        respondent = ScriptedRespondent(
            participant,
            self.teacher.style,
            self.seed,
            AnswerModel(population=self.kind, effects=self.effects),
        )
        success = _success(study, place, phase)
        for key in phase.questionnaires:
            given = respondent.answers(asked[key], occasion=phase.id, success=success)
            for item, value in given.items():
                save_answer(study, participant, phase.id, key, item, value)
        if missing := submit(study, participant, phase.id):
            raise StudyError(f"No script answers {dict(missing)} of {phase.id!r}.")


def _success(study: OpenStudy, place: ParticipantProgress, phase: Phase) -> float | None:
    """Share of the drives they watched that reached the ball; None if ``phase`` is about none."""
    outcomes = [
        taught.outcome
        for one, _ in place.view.phases
        if one.kind is PhaseKind.TEACH and one.condition == phase.condition
        for taught in read_taught(study.store.connection, place.view.id, one.id)
    ]
    if not outcomes:
        return None
    return sum(one is Outcome.BALL_REACHED for one in outcomes) / len(outcomes)


def _effect(plant: str) -> PlantedEffect:
    scale, _, rest = plant.partition(":")
    style, _, number = rest.partition(":")
    try:
        correlation = float(number)
    except ValueError:
        raise StudyError(
            f"No planted effect {plant!r}; give QUESTIONNAIRE.SCALE:STYLE:R, such as "
            f"mini_ipip_5.extraversion:gain:0.5."
        ) from None
    return PlantedEffect(scale=scale, style=style, correlation=correlation)  # pyright: ignore[reportArgumentType]
