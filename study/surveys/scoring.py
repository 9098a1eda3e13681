"""Scores of the scales of a questionnaire; a missing answer leaves a score empty, with a reason."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.study.surveys.answer_format import Value
from steerlab.study.surveys.questionnaire import Questionnaire


@dataclass(frozen=True, kw_only=True, slots=True)
class ScaleScore:
    """One person's score on one scale.

    Attributes:
        scale: the scale's key.
        score: None if it cannot be computed.
        answered: items answered, of ``asked``.
        low, high: the lowest and the highest score there can be.
        reason: why there is no score; empty if there is one.
    """

    scale: str
    score: float | None
    answered: int
    asked: int
    low: int
    high: int
    reason: str = ""

    @property
    def rescaled(self) -> float | None:
        """(score - low) / (high - low), from 0 to 1, comparable between response formats."""
        return None if self.score is None else (self.score - self.low) / (self.high - self.low)


def score(questionnaire: Questionnaire, answers: Mapping[str, Value]) -> dict[str, ScaleScore]:
    """The scores of all scales, by the scale's key.

    Nothing is imputed: a scale with a missing answer has no score. An item that was not shown has
    no answer.

    Raises:
        InvalidAnswer: an answer is to no item of the questionnaire, or is not allowed.
    """
    for item, value in answers.items():
        questionnaire.check(item, value)
    shown = {item.id for item in questionnaire.shown(answers)}
    scores: dict[str, ScaleScore] = {}
    for scale in questionnaire.scales:
        row = keyed(questionnaire, scale.key, answers)
        missing = [item for item, value in zip(scale.items, row, strict=True) if value is None]
        given = [value for value in row if value is not None]
        total = float(sum(given)) / (len(scale.items) if scale.how == "mean" else 1)
        low, high = questionnaire.score_range(scale.key)
        scores[scale.key] = ScaleScore(
            scale=scale.key,
            score=None if missing else total,
            answered=len(given),
            asked=len(scale.items),
            low=low,
            high=high,
            reason=_why_missing(missing, shown),
        )
    return scores


def keyed(
    questionnaire: Questionnaire, scale: str, answers: Mapping[str, Value]
) -> tuple[int | None, ...]:
    """The answers to a scale's items, in its order: low + high - answer where it is reversed.

    None where there is no answer.

    Raises:
        InvalidAnswer: an answer is not allowed.
        InvalidValue: there is no such scale.
    """
    keying, answers = questionnaire.scale(scale), questionnaire.counted(answers)
    low, high = questionnaire.item_range(scale)
    row: list[int | None] = []
    for item in keying.items:
        if item not in answers:
            row.append(None)
            continue
        value = int(questionnaire.check(item, answers[item]))
        row.append(low + high - value if item in keying.reversed else value)
    return tuple(row)


def _why_missing(missing: Sequence[str], shown: Collection[str]) -> str:
    """Why there is no score; empty if nothing is missing."""
    unseen = [item for item in missing if item not in shown]
    unanswered = [item for item in missing if item in shown]
    reasons = [f"no answer to {', '.join(unanswered)}"] if unanswered else []
    return "; ".join([*reasons, *([f"not shown: {', '.join(unseen)}"] if unseen else [])])


def keyed_table(
    questionnaire: Questionnaire, scale: str, people: Sequence[Mapping[str, Value]]
) -> FloatArray:
    """The keyed answers of several people, (people, items); NaN where there is none."""
    rows = [keyed(questionnaire, scale, answers) for answers in people]
    items = len(questionnaire.scale(scale).items)
    filled = [[np.nan if value is None else float(value) for value in row] for row in rows]
    return np.array(filled, dtype=np.float64).reshape(len(rows), items)
