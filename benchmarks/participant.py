"""What a study asks of its participants: ``python -m benchmarks.participant [STUDY]``, no limits.

Presses and seconds at the wheel are counted in a finished study, by phase, the median over people;
without one, two scripted people go through the shipped template first. Reading and answering are
estimated: silent reading at 238 words a minute (Brysbaert, Journal of Memory and Language 109,
2019, 104047) and, assumed, 2 s to choose an answer.
"""

import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import pyarrow as pa

from steerlab.study.contract import PAGES, Phase, PhaseKind, Role, Standing
from steerlab.study.practice_record import practised
from steerlab.study.progress import ParticipantProgress, everybody
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.store.records import AttemptStatus
from steerlab.study.study import Study
from steerlab.study.study_folder import OpenStudy, new_study
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.teaching.contract import all_teachings

WORDS_A_MINUTE = 238.0
CHOOSING_S = 2.0
RATE_HZ = 20.0
_QUICKER = (  # what the network and the robots are worth changes little of how long people drive
    ('preset = "lab"', 'preset = "lab"\nepochs = 20'),
    ("minimum_people = 8 ", "minimum_people = 2 "),
)


@dataclass(frozen=True, kw_only=True, slots=True)
class Asked:
    """What one phase asks of a person: presses, words to read, answers, seconds at the wheel."""

    presses: int = 0
    words: int = 0
    answers: int = 0
    wheel_s: float = 0.0

    @property
    def minutes(self) -> float:
        """By the assumptions above."""
        read = self.words / WORDS_A_MINUTE
        return read + (CHOOSING_S * self.answers + self.wheel_s) / 60.0


def main(given: Sequence[str]) -> None:
    """Print the table as Markdown."""
    if given:
        print(table(Path(given[0])))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "study"
        new_study(folder, "mind-meld")
        text = (folder / "study.toml").read_text(encoding="utf-8")
        for before, after in _QUICKER:
            assert before in text, before
            text = text.replace(before, after)
        (folder / "study.toml").write_text(text, encoding="utf-8")
        with Study.open(folder) as study:
            for seed, role in enumerate((Role.TRAINING, Role.TRAINING, Role.TEST)):
                script = ScriptedParticipant(kind="human", seed=seed)
                config = RunConfig(
                    device=script.device, pages=script, recordings=False, teachings=all_teachings()
                )
                study.run(study.enrol(role).id, config)
        print(table(folder))


def table(folder: Path) -> str:
    """Rows of phases for either role, in Markdown: medians over those who finished."""
    study = OpenStudy.open(folder, read_only=True)
    try:
        steps = _steps(study)
        finished = [one for one in everybody(study) if one.view.standing is Standing.FINISHED]
        lines = [
            "| | phase | presses | words | at the wheel | in all |",
            "|---|---|---|---|---|---|",
        ]
        for role in Role:
            by_phase: dict[str, list[Asked]] = defaultdict(list)
            for person in (one for one in finished if one.view.role is role):
                for phase, _ in person.view.phases:
                    by_phase[phase.title].append(_asked(study, person, phase, steps))
            rows = [(title, _median(asked)) for title, asked in by_phase.items()]
            rows.append(("together", Asked(**{name: sum(getattr(a, name) for _, a in rows)
                                              for name in Asked.__dataclass_fields__})))  # fmt: skip
            lines += [
                f"| {role.value} | {title} | {asked.presses} | {asked.words} | "
                f"{asked.wheel_s / 60.0:.1f} min | {asked.minutes:.1f} min |"
                for title, asked in rows
            ]
        return "\n".join(lines)
    finally:
        study.store.close()


def _steps(study: OpenStudy) -> dict[tuple[str, str], list[int]]:
    """Steps of each finished attempt, by person and drive."""
    labels: pa.Table = study.store.read_labels()
    counted = labels.group_by(["participant", "rollout", "attempt"]).aggregate([("step", "count")])
    found: dict[tuple[str, str], list[int]] = defaultdict(list)
    finished = {one.key for one in study.store.attempts(AttemptStatus.FINISHED)}
    for row in counted.to_pylist():
        if (row["participant"], row["rollout"], row["attempt"]) in finished:
            found[row["participant"], row["rollout"]].append(row["step_count"])
    return found


def _asked(
    study: OpenStudy,
    person: ParticipantProgress,
    phase: Phase,
    steps: dict[tuple[str, str], list[int]],
) -> Asked:
    countdown_s = person.protocol.display.countdown_s
    if phase.kind in PAGES:
        words = sum(len(paragraph.split()) for paragraph in phase.text)
        if phase.kind is PhaseKind.CONSENT:
            words = sum(len(paragraph.split()) for paragraph in person.protocol.consent.text)
        pages = [study.questionnaires[key] for key in phase.questionnaires]
        answers = sum(len(page.items) for page in pages)
        words += sum(sum(_words(page)) for page in pages)
        return Asked(presses=answers + max(1, len(pages)), words=words, answers=answers)
    if phase.kind is PhaseKind.PRACTICE:
        reached = practised(person, phase.id)
        drives = reached.balls + reached.blocks_hit
        return Asked(presses=1, wheel_s=reached.driven_s + drives * countdown_s)
    drives = [
        count
        for (who, rollout), counts in steps.items()
        if who == person.view.id
        and (rollout in phase.rollouts or rollout.startswith(f"{phase.id}-"))
        for count in counts
    ]
    wheel_s = sum(drives) / RATE_HZ + len(drives) * countdown_s
    return Asked(presses=len(drives), wheel_s=wheel_s)


def _words(page: Questionnaire) -> Iterator[int]:
    yield len(page.instructions.split())
    for item in page.items:
        yield len(item.text.split())


def _median(asked: Sequence[Asked]) -> Asked:
    return Asked(
        presses=round(median(one.presses for one in asked)),
        words=round(median(one.words for one in asked)),
        answers=round(median(one.answers for one in asked)),
        wheel_s=median(one.wheel_s for one in asked),
    )


if __name__ == "__main__":
    main(sys.argv[1:])
