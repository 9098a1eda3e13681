"""Table 1: what people scored on each scale, and how consistent its items are."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from steerlab.analysis.study_data.records import Person, StudyData
from steerlab.analysis.study_tables.constructs import asked_of, main_scales
from steerlab.analysis.study_tables.plain import empty, plain
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.reliability import cronbach_alpha
from steerlab.study.surveys.scoring import keyed_table

NO_SURVEYS = "nobody was asked a questionnaire with a scale"


def table1(data: StudyData) -> list[dict[str, Any]]:
    """A row a scale and role: people, mean, SD, range, alpha with Feldt's interval."""
    rows: list[dict[str, Any]] = []
    for role in ("training", "test"):
        people = data.of_role(role)
        if not people:
            continue
        for questionnaire in asked_of(data):
            asked = [one for one in people if questionnaire.key in one.answers]
            if asked:
                rows += [
                    {"role": role, **_row(questionnaire, scale.key, asked)}
                    for scale in questionnaire.scales
                ]
    return rows


def describe_people(people: Sequence[Person]) -> dict[str, Any]:
    """Age and gender, as far as they were told."""
    told: list[Mapping[str, Any]] = [one.answers.get("demographics", {}) for one in people]
    ages = np.array([float(one["age"]) for one in told if "age" in one])
    genders = [str(one["gender"]) for one in told if "gender" in one]
    return {
        "people": len(people),
        "ages_told": len(ages),
        "age_mean": plain(ages.mean()) if len(ages) else empty("nobody told their age"),
        "age_sd": plain(ages.std(ddof=1)) if len(ages) > 1 else empty(_few(len(ages), "ages")),
        "genders": {one: genders.count(one) for one in sorted(set(genders))},
        "share_women": plain(genders.count("woman") / len(genders))
        if genders
        else empty("nobody told their gender"),
    }


def _row(questionnaire: Questionnaire, scale: str, people: Sequence[Person]) -> dict[str, Any]:
    found = questionnaire.scale(scale)
    answers = keyed_table(
        questionnaire, scale, [person.answers[questionnaire.key] for person in people]
    )
    complete = answers[~np.isnan(answers).any(axis=1)]
    scores = complete.mean(axis=1) if found.how == "mean" else complete.sum(axis=1)
    low, high = questionnaire.score_range(scale)
    alpha = cronbach_alpha(answers)
    n = len(scores)
    mean = plain(scores.mean()) if n else empty("nobody answered all its items")
    return {
        "questionnaire": questionnaire.key,
        "scale": scale,
        "title": found.title,
        "people": n,
        "left_out": len(people) - n,
        "mean": mean,
        "sd": plain(scores.std(ddof=1)) if n > 1 else empty(_few(n, "scores")),
        "low": low,
        "high": high,
        "mean_rescaled": plain((scores.mean() - low) / (high - low)) if n else mean,
        "items": len(found.items),
        "alpha": empty(alpha.reason) if alpha.alpha is None else plain(alpha.alpha),
        "alpha_ci95": empty(alpha.reason)
        if alpha.low is None or alpha.high is None
        else [plain(alpha.low), plain(alpha.high)],
        "sub_scale": scale not in main_scales(questionnaire),
        "unvalidated": questionnaire.unvalidated,
    }


def _few(count: int, what: str) -> str:
    return f"{what}: {count}; at least 2 are needed"
