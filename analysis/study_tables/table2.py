"""Table 2: does w go together with what people are like and how they correct?"""

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
from steerlab.analysis.study_data.records import Embeddings, StudyData
from steerlab.analysis.study_tables.constructs import Construct
from steerlab.analysis.study_tables.gender import gender
from steerlab.analysis.study_tables.plain import empty, is_empty, plain
from steerlab.sim.arrays import FloatArray
from steerlab.sim.seeds import rng_for


def table2(
    data: StudyData,
    constructs: Sequence[Construct],
    *,
    seed: int,
    permutations: int = PERMUTATIONS,
) -> dict[str, Any]:
    """Each construct and w of the training participants.

    ``rows``: the primary test (multiple R of the first network's w, Holm and BH over the family),
    all networks together, each dimension by the paper's switch, and the first component.
    """
    if not data.embeddings:
        return {"rows": [], "gender": empty(NO_W), "networks": [], "why_empty": NO_W}
    rows = [_row(data, one, seed, permutations) for one in constructs]
    _correct([row for row in rows if row["family"]])
    first = data.embeddings[0]
    return {
        "networks": [_network(one) for one in data.embeddings],
        "combination": RULE,
        "rows": rows,
        "gender": gender(data, first, seed=seed, permutations=permutations),
    }


NO_W = "there is no embedding: no network was trained"


def matched(embeddings: Embeddings, construct: Construct) -> tuple[tuple[str, ...], FloatArray]:
    """Who has both w and a value, and the values (n,)."""
    known = set(embeddings.people)
    keep = [row for row, person in enumerate(construct.people) if person in known]
    return tuple(construct.people[row] for row in keep), construct.values[keep]


def _row(data: StudyData, construct: Construct, seed: int, permutations: int) -> dict[str, Any]:
    first = data.embeddings[0]
    people, values = matched(first, construct)
    rng = rng_for(seed, construct.key)
    missing = _why_missing(construct) if len(people) < FEWEST else None
    row: dict[str, Any] = {
        "key": construct.key,
        "title": construct.title,
        "topic": construct.topic,
        "family": construct.family,
        "people": len(people),
        "left_out": len(first.people) - len(people),
    }
    if missing:
        nothing = empty(missing)
        return row | dict.fromkeys(
            ("primary", "networks", "paper_compatible", "first_component", "holm", "bh"), nothing
        )
    w = first.of(people)
    primary = multiple_correlation(w, values, rng=rng, permutations=permutations)
    several = [one.of(people) for one in data.embeddings if set(people) <= set(one.people)]
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


def _paper(found: PaperCorrelation | NotComputable) -> dict[str, Any]:
    if isinstance(found, NotComputable):
        return {
            "label": "paper-compatible",
            "r": plain(found),
            "p": plain(found),
            "holm": plain(found),
        }
    return {
        "label": found.label,
        "method": found.correlation.method,
        "r": plain(found.correlation.r),
        "p": plain(found.correlation.p),
        "ci95": plain(found.correlation.interval),
        "why": list(found.why),
        "holm": None,
    }


def _first_component(w: FloatArray, values: FloatArray) -> dict[str, Any]:
    found = first_component(w)
    if isinstance(found, NotComputable):
        return plain(found)
    return {"explained": plain(found.explained), **_paper(paper_correlation(found.scores, values))}


def _correct(rows: Sequence[dict[str, Any]]) -> None:
    """Fill in Holm and BH over the family's primary tests, and Holm over each row's dimensions."""
    tested = [row for row in rows if not is_empty(row["primary"])]
    p = np.array([row["primary"]["p"] for row in tested])
    for row, by_holm, by_bh in zip(
        tested, holm(p).tolist(), benjamini_hochberg(p).tolist(), strict=True
    ):
        row["holm"], row["bh"] = plain(by_holm), plain(by_bh)
    for row in tested:
        known = [one for one in row["paper_compatible"] if not is_empty(one["p"])]
        adjusted = holm(np.array([one["p"] for one in known])).tolist()
        for one, value in zip(known, adjusted, strict=True):
            one["holm"] = plain(value)


def _network(one: Embeddings) -> dict[str, Any]:
    return {
        "seed": one.seed,
        "source": one.source,
        "people": len(one.people),
        "dimensions": one.w.shape[1],
    }


def _why_missing(construct: Construct) -> str:
    reasons: Mapping[str, int] = {
        why: list(construct.missing.values()).count(why) for why in construct.missing.values()
    }
    told = "; ".join(f"{count} {why}" for why, count in reasons.items())
    have = f"people with w and a value: {len(construct.people)}; at least {FEWEST} are needed"
    return f"{have}{f' ({told})' if told else ''}"
