"""The paper's Tables 1 and 2, and its comparison of women and men.

Table 1: what people scored on each scale, and how consistent its items are. Table 2: whether w is
associated with what people are like and how they correct.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from steerlab.analysis.statistics.corrections import benjamini_hochberg, holm
from steerlab.analysis.statistics.correlation import PaperCorrelation, paper_correlation
from steerlab.analysis.statistics.multiple_correlation import (
    PERMUTATIONS,
    RULE,
    first_component,
    multiple_correlation,
    several_embeddings,
)
from steerlab.analysis.statistics.outcome import FEWEST, NotComputable
from steerlab.analysis.statistics.two_groups import hotelling_t2, welch_t
from steerlab.analysis.study_data.records import Embeddings, Person, StudyData
from steerlab.analysis.study_tables.constructs import Construct, asked_of, main_scales
from steerlab.analysis.study_tables.plain import empty, is_empty, plain
from steerlab.analysis.study_tables.sizes import ALPHA, CORRELATIONS, mark
from steerlab.sim.arrays import FloatArray
from steerlab.sim.seeds import rng_for
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.reliability import cronbach_alpha
from steerlab.study.surveys.scoring import keyed_table

NO_SURVEYS = "nobody was asked a questionnaire with a scale"
NO_W = "there is no embedding: no network was trained"
GROUPS = ("woman", "man")


def table1(data: StudyData) -> list[dict[str, Any]]:
    """A row a scale and role: people, mean, SD, range, alpha with Feldt's interval."""
    rows: list[dict[str, Any]] = []
    for role in ("training", "test"):
        people = data.of_role(role)
        if not people:
            continue
        for questionnaire in asked_of(data):
            asked = [person for person in people if questionnaire.key in person.answers]
            if asked:
                rows += [
                    {"role": role, **_scale_row(questionnaire, scale.key, asked)}
                    for scale in questionnaire.scales
                ]
    return rows


def describe_people(people: Sequence[Person]) -> dict[str, Any]:
    """Age and gender, of those who gave them."""
    answers: list[Mapping[str, Any]] = [p.answers.get("demographics", {}) for p in people]
    ages = np.array([float(given["age"]) for given in answers if "age" in given])
    genders = [str(given["gender"]) for given in answers if "gender" in given]
    return {
        "people": len(people),
        "ages_told": len(ages),
        "age_mean": plain(ages.mean()) if len(ages) else empty("nobody told their age"),
        "age_sd": plain(ages.std(ddof=1)) if len(ages) > 1 else empty(_few(len(ages), "ages")),
        "genders": {gender: genders.count(gender) for gender in sorted(set(genders))},
        "share_women": plain(genders.count("woman") / len(genders))
        if genders
        else empty("nobody told their gender"),
    }


def _scale_row(
    questionnaire: Questionnaire, scale: str, people: Sequence[Person]
) -> dict[str, Any]:
    asked = questionnaire.scale(scale)
    answers = keyed_table(
        questionnaire, scale, [person.answers[questionnaire.key] for person in people]
    )
    complete = answers[~np.isnan(answers).any(axis=1)]
    scores = complete.mean(axis=1) if asked.how == "mean" else complete.sum(axis=1)
    low, high = questionnaire.score_range(scale)
    alpha = cronbach_alpha(answers)
    n = len(scores)
    mean = plain(scores.mean()) if n else empty("nobody answered all its items")
    return {
        "questionnaire": questionnaire.key,
        "scale": scale,
        "title": asked.title,
        "people": n,
        "left_out": len(people) - n,
        "mean": mean,
        "sd": plain(scores.std(ddof=1)) if n > 1 else empty(_few(n, "scores")),
        "low": low,
        "high": high,
        "mean_rescaled": plain((scores.mean() - low) / (high - low)) if n else mean,
        "items": len(asked.items),
        "alpha": empty(alpha.reason) if alpha.alpha is None else plain(alpha.alpha),
        "alpha_ci95": empty(alpha.reason)
        if alpha.low is None or alpha.high is None
        else [plain(alpha.low), plain(alpha.high)],
        "alpha_too_few": mark(n, ALPHA),
        "sub_scale": scale not in main_scales(questionnaire),
        "unvalidated": questionnaire.unvalidated,
    }


def _few(count: int, what: str) -> str:
    return f"{what}: {count}; at least 2 are needed"


def table2(
    data: StudyData,
    constructs: Sequence[Construct],
    *,
    seed: int,
    permutations: int = PERMUTATIONS,
) -> dict[str, Any]:
    """Each construct and w of the training participants.

    ``rows``: the primary test (multiple R of w, Holm and BH over the family), all networks together,
    each dimension by the paper's switch, and the first component. A score goes with the first
    network's w; a style metric with that of the first network that was not fitted on the drives it
    was measured on.
    """
    if not data.embeddings:
        return {"rows": [], "gender": empty(NO_W), "networks": [], "why_empty": NO_W}
    rows = [_construct_row(data, construct, seed, permutations) for construct in constructs]
    _correct([row for row in rows if row["family"]])
    first = data.embeddings[0]
    return {
        "networks": [
            {
                "seed": embeddings.seed,
                "source": embeddings.source,
                "people": len(embeddings.people),
                "dimensions": embeddings.w.shape[1],
                "held_out": list(embeddings.held_out),
            }
            for embeddings in data.embeddings
        ],
        "combination": RULE,
        "rows": rows,
        "gender": gender(data, first, seed=seed, permutations=permutations),
    }


def matched(embeddings: Embeddings, construct: Construct) -> tuple[tuple[str, ...], FloatArray]:
    """The people who have both w and a value, and their values (n,)."""
    known = set(embeddings.people)
    keep = [row for row, person in enumerate(construct.people) if person in known]
    return tuple(construct.people[row] for row in keep), construct.values[keep]


def _construct_row(
    data: StudyData, construct: Construct, seed: int, permutations: int
) -> dict[str, Any]:
    networks = construct.networks(data)
    first = networks[0] if networks else data.embeddings[0]
    people, values = matched(first, construct)
    rng = rng_for(seed, construct.key)
    missing = _why_missing(construct, len(people)) if len(people) < FEWEST else None
    row: dict[str, Any] = {
        "key": construct.key,
        "title": construct.title,
        "topic": construct.topic,
        "family": construct.family,
        "people": len(people),
        "left_out": len(first.people) - len(people),
        "network": data.embeddings.index(first),
        "rollouts": list(construct.rollouts),
        "too_few": mark(len(people), CORRELATIONS),
    }
    if missing:
        nothing = empty(missing)
        return row | dict.fromkeys(
            ("primary", "networks", "paper_compatible", "first_component", "holm", "bh"), nothing
        )
    w = first.of(people)
    primary = multiple_correlation(w, values, rng=rng, permutations=permutations)
    several = [e.of(people) for e in networks if set(people) <= set(e.people)]
    return row | {
        "primary": plain(primary),
        "networks": plain(several_embeddings(several, values, rng=rng, permutations=permutations)),
        "paper_compatible": [
            {"dimension": number, **_paper(paper_correlation(column, values))}
            for number, column in enumerate(w.T, start=1)
        ],
        "first_component": _first_component(w, values),
        "holm": plain(primary) if isinstance(primary, NotComputable) else None,
        "bh": plain(primary) if isinstance(primary, NotComputable) else None,
    }


def _paper(result: PaperCorrelation | NotComputable) -> dict[str, Any]:
    if isinstance(result, NotComputable):
        return {"label": "paper-compatible", **dict.fromkeys(("r", "p", "holm"), plain(result))}
    return {
        "label": result.label,
        "method": result.correlation.method,
        "r": plain(result.correlation.r),
        "p": plain(result.correlation.p),
        "ci95": plain(result.correlation.interval),
        "why": list(result.why),
        "holm": None,
    }


def _first_component(w: FloatArray, values: FloatArray) -> dict[str, Any]:
    component = first_component(w)
    if isinstance(component, NotComputable):
        return plain(component)
    correlation = paper_correlation(component.scores, values)
    return {"explained": plain(component.explained), **_paper(correlation)}


def _correct(rows: Sequence[dict[str, Any]]) -> None:
    """Fill in Holm and BH over the family's primary tests, and Holm over each row's dimensions."""
    tested = [row for row in rows if not is_empty(row["primary"])]
    p = np.array([row["primary"]["p"] for row in tested])
    for row, by_holm, by_bh in zip(
        tested, holm(p).tolist(), benjamini_hochberg(p).tolist(), strict=True
    ):
        row["holm"], row["bh"] = plain(by_holm), plain(by_bh)
    for row in tested:
        known = [cell for cell in row["paper_compatible"] if not is_empty(cell["p"])]
        adjusted = holm(np.array([cell["p"] for cell in known])).tolist()
        for cell, value in zip(known, adjusted, strict=True):
            cell["holm"] = plain(value)


def _why_missing(construct: Construct, people: int) -> str:
    if construct.none:
        return construct.none
    reasons: Mapping[str, int] = {
        why: list(construct.missing.values()).count(why) for why in construct.missing.values()
    }
    counted = "; ".join(f"{count} {why}" for why, count in reasons.items())
    have = f"people with w and a value: {people}; at least {FEWEST} are needed"
    return f"{have}{f' ({counted})' if counted else ''}"


def gender(data: StudyData, embeddings: Embeddings, *, seed: int, permutations: int) -> Any:
    """Permutation Hotelling T² (primary), and Welch's t of each dimension, Holm over dimensions.

    Other answers than woman and man are too few to compare; they are counted.
    """
    genders = {
        person.id: str(person.answers["demographics"]["gender"])
        for person in data.people
        if "gender" in person.answers.get("demographics", {})
    }
    people = tuple(person for person in embeddings.people if genders.get(person) in GROUPS)
    known = [genders[person] for person in embeddings.people if person in genders]
    if not people:
        return empty("nobody who has w told their gender as woman or man")
    w = embeddings.of(people)
    women = np.array([genders[person] == GROUPS[0] for person in people])
    rng = rng_for(seed, "gender")
    each = [welch_t(column[women], column[~women]) for column in w.T]
    p = [test.p for test in each if not isinstance(test, NotComputable)]
    adjusted = iter(holm(np.array(p)).tolist())
    return {
        "groups": list(GROUPS),
        "counts": {gender: known.count(gender) for gender in sorted(set(known))},
        "not_told": len(embeddings.people) - len(known),
        "too_few": mark(len(people), CORRELATIONS),
        "primary": plain(hotelling_t2(w, women, rng=rng, permutations=permutations)),
        "welch": [
            {
                "dimension": number,
                "test": plain(test),
                "holm": plain(test if isinstance(test, NotComputable) else next(adjusted)),
            }
            for number, test in enumerate(each, start=1)
        ],
    }
