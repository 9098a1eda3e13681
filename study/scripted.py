"""A scripted participant: goes through the same phases, loop and records as a person."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from steerlab.sim.errors import shown
from steerlab.sim.populations import LONGEST_SEED, PopulationKind, sample_population
from steerlab.sim.rollout import Outcome
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.study.contract import Phase, PhaseKind, StudyError
from steerlab.study.pages import consent, consent_text, save_answer, submit
from steerlab.study.planted_effects import PlantedEffect, check_effects
from steerlab.study.progress import ParticipantProgress
from steerlab.study.protocol import StudyProtocol
from steerlab.study.scripted_answers import AnswerModel, ScriptedRespondent
from steerlab.study.store.teaching import read_taught
from steerlab.study.study_folder import OpenStudy
from steerlab.teleop.devices.scripted import ScriptedDevice


@dataclass(frozen=True, kw_only=True)
class ScriptedParticipant:
    """A simulated person: answers the pages, and has a device that steers.

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
        """From ``scripted:KIND:SEED``, and one ``QUESTIONNAIRE.SCALE:STYLE:R`` for each effect.

        Raises:
            StudyError: a text has another form.
            InvalidConfig: an effect is of an unknown style, or its R is no correlation.
        """
        kinds = get_args(PopulationKind)
        fields = spec.split(":")
        if len(fields) != 3 or fields[0] != "scripted" or fields[1] not in kinds:
            raise StudyError(
                f"No scripted teacher {shown(spec)}; give scripted:KIND:SEED with a KIND of "
                f"{', '.join(kinds)}, such as scripted:human:3."
            )
        kind, seed = fields[1:]
        if not (seed.isascii() and seed.isdecimal() and len(seed) <= LONGEST_SEED):
            raise StudyError(
                f"The seed of {shown(spec)} is {shown(seed)}; give a number from 0, of at most "
                f"{LONGEST_SEED} digits."
            )
        return cls(
            kind=kinds[kinds.index(kind)],
            seed=int(seed),
            effects=tuple(_effect(plant) for plant in plants),
        )

    @property
    def teacher(self) -> ScriptedTeacher:
        """The teacher that steers, with the style that ``scripted:KIND:SEED`` has elsewhere too."""
        (drawn,) = sample_population(self.kind, 1, self.seed, prefix="scripted")
        return ScriptedTeacher(f"scripted-{self.kind}-{self.seed}", drawn.style, self.seed)

    @property
    def device(self) -> ScriptedDevice:
        """A device that gives the teacher's labels."""
        return ScriptedDevice(self.teacher)

    def check(self, protocol: StudyProtocol, study: OpenStudy) -> None:
        """Refuse an effect on what the protocol does not ask.

        Raises:
            InvalidConfig: there is one.
        """
        check_effects(
            self.effects, {key: study.questionnaires[key] for key in protocol.questionnaires}
        )

    def fill(self, study: OpenStudy, progress: ParticipantProgress, phase: Phase) -> None:
        """Finish a page, answer by answer, as the console does.

        Raises:
            InvalidConfig: an effect is planted on what the study does not ask.
            StudyError: an answer is still missing: the questionnaire asks what no script answers.
        """
        participant = progress.view.id
        if phase.kind is PhaseKind.CONSENT:
            agreed = consent_text(study, participant).agreed
            consent(study, participant, given=True, entries=agreed)
            return
        asked = {key: study.questionnaires[key] for key in progress.protocol.questionnaires}
        check_effects(self.effects, asked)
        respondent = ScriptedRespondent(
            participant,
            self.teacher.style,
            self.seed,
            AnswerModel(population=self.kind, effects=self.effects),
        )
        success = _success(study, progress, phase)
        for key in phase.questionnaires:
            given = respondent.answers(asked[key], phase=phase.id, success=success)
            for item, value in given.items():
                save_answer(study, participant, phase.id, key, item, value)
        if missing := submit(study, participant, phase.id):
            raise StudyError(f"No script answers {dict(missing)} of {phase.id!r}.")


def _success(study: OpenStudy, progress: ParticipantProgress, phase: Phase) -> float | None:
    """Share of the phase's condition's drives that reached the ball; None if there are none."""
    outcomes = [
        taught.outcome
        for other, _ in progress.view.phases
        if other.kind is PhaseKind.TEACH and other.condition == phase.condition
        for taught in read_taught(study.store.connection, progress.view.id, other.id)
    ]
    if not outcomes:
        return None
    return outcomes.count(Outcome.BALL_REACHED) / len(outcomes)


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
