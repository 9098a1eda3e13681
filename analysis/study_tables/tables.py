"""All tables of one analysis: ``tables.json``."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from steerlab.analysis.statistics.multiple_correlation import PERMUTATIONS, multiple_correlation
from steerlab.analysis.statistics.outcome import FEWEST
from steerlab.analysis.study_data.records import Person, StudyData
from steerlab.analysis.study_tables.conditions import conditions
from steerlab.analysis.study_tables.constructs import (
    Construct,
    planned_styles,
    style_constructs,
    survey_constructs,
)
from steerlab.analysis.study_tables.hypotheses import hypotheses
from steerlab.analysis.study_tables.label_quality import label_quality
from steerlab.analysis.study_tables.plain import empty, plain
from steerlab.analysis.study_tables.style_table import exact_styles, style_table
from steerlab.analysis.study_tables.table1 import NO_SURVEYS, describe_people, table1
from steerlab.analysis.study_tables.table2 import matched, table2
from steerlab.sim.seeds import rng_for

KEYS = (
    "table1",
    "table2",
    "hypotheses",
    "style",
    "label_quality",
    "conditions",
    "exclusions",
)


@dataclass(frozen=True, kw_only=True)
class AnalysisConfig:
    """What an analysis may choose.

    Attributes:
        seed: of permutations and resamples.
        fastdtw: also compute the style metrics by fastdtw, which takes minutes.
    """

    seed: int = 0
    permutations: int = PERMUTATIONS
    fastdtw: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Analysis:
    """The tables, and what figures need besides.

    Attributes:
        tables: plain values under ``KEYS``.
        constructs: of the training participants.
    """

    data: StudyData
    config: AnalysisConfig
    tables: dict[str, Any]
    constructs: tuple[Construct, ...]

    def to_json(self) -> str:
        """``tables.json``: equal analyses give equal text."""
        return json.dumps(self.tables, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def analyse(data: StudyData, config: AnalysisConfig) -> Analysis:
    """Compute every table; what cannot be computed says why in its cell."""
    people = data.of_role("training")
    styles = exact_styles(data)
    primary = planned_styles(data)
    constructs = (
        *survey_constructs(data, people),
        *style_constructs(styles, people, primary),
    )
    of_w = table2(data, constructs, seed=config.seed, permutations=config.permutations)
    compared = conditions(data, seed=config.seed)
    rows = table1(data)
    style = style_table(data, styles, fastdtw=config.fastdtw)
    style["without_flagged_attempts"] = _without_flagged(data, people, primary, config)
    tables = {
        "table1": rows if rows else empty(NO_SURVEYS),
        "table2": of_w,
        "hypotheses": hypotheses(data, of_w, compared, primary),
        "style": style,
        "label_quality": label_quality(data, seed=config.seed),
        "conditions": compared,
        "exclusions": _exclusions(data, constructs),
    }
    return Analysis(data=data, config=config, tables=tables, constructs=constructs)


def _without_flagged(
    data: StudyData, people: Sequence[Person], primary: dict[str, str], config: AnalysisConfig
) -> Any:
    """H3a and H3b once more without attempts that broke a limit of timing."""
    if not data.flagged:
        return empty("no attempt that counts was flagged")
    if not data.embeddings:
        return empty("there is no embedding: no network was trained")
    kept = exact_styles(data, unflagged=True)
    found: dict[str, Any] = {"attempts_left_out": len(data.flagged)}
    for one in style_constructs(kept, people, primary):
        if one.family:
            who, values = matched(data.embeddings[0], one)
            found[one.key] = (
                plain(
                    multiple_correlation(
                        data.embeddings[0].of(who),
                        values,
                        rng=rng_for(config.seed, one.key),
                        permutations=config.permutations,
                    )
                )
                if len(who) >= FEWEST
                else empty(f"people with unflagged attempts: {len(who)}; {FEWEST} are needed")
            )
    return found


def _without_values(constructs: Sequence[Construct]) -> list[dict[str, str]]:
    """A row for everyone who counts and lacks a score or a style metric."""
    lacking: dict[str, list[str]] = {}
    for one in constructs:
        for person, why in one.missing.items():
            lacking.setdefault(person, []).append(f"{one.title} ({why})")
    return [
        {
            "what": "values",
            "who": person,
            "why": f"counts, but has no value of {', '.join(several)}",
        }
        for person, several in lacking.items()
    ]


def _exclusions(data: StudyData, constructs: Sequence[Construct]) -> dict[str, Any]:
    return {
        "enrolled": data.enrolled,
        "analysed": {role: len(data.of_role(role)) for role in ("training", "test")},
        "training": describe_people(data.of_role("training")),
        "test": describe_people(data.of_role("test")),
        "rows": [
            *({"what": one.what, "who": one.who, "why": one.why} for one in data.exclusions),
            *_without_values(constructs),
        ],
        "flagged_attempts": [list(one) for one in sorted(data.flagged)],
    }
