"""All tables of one analysis: ``tables.json``."""

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
    style_rollouts,
    survey_constructs,
)
from steerlab.analysis.study_tables.hypotheses import hypotheses
from steerlab.analysis.study_tables.label_quality import label_quality
from steerlab.analysis.study_tables.paper_tables import (
    NO_SURVEYS,
    describe_people,
    matched,
    table1,
    table2,
)
from steerlab.analysis.study_tables.plain import empty, plain
from steerlab.analysis.style.person_style import PersonStyle, people_styles
from steerlab.learning.series import LabelSeries
from steerlab.sim.files.run_folder import finite_json
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
STYLE_METRICS = (  # by key of ``PersonStyle``
    "amplitude",
    "amplitude_total",
    "wrong_direction",
    "lag_s",
    "lag_plain_s",
    "vote",
    "voted_lag_s",
)
FASTDTW_METRICS = ("amplitude_total", "lag_plain_s", "vote", "voted_lag_s")
"""Those that fastdtw gives too; the scaled lag always comes from the exact path."""


@dataclass(frozen=True, kw_only=True)
class AnalysisConfig:
    """Settings of an analysis.

    Attributes:
        seed: of permutations and resamples.
        fastdtw: also compute the style metrics by fastdtw, which takes minutes.
    """

    seed: int = 0
    permutations: int = PERMUTATIONS
    fastdtw: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Analysis:
    """The tables, and what the figures need besides.

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
        return finite_json(self.tables, "tables.json") + "\n"


def analyse(data: StudyData, config: AnalysisConfig) -> Analysis:
    """Compute every table; what cannot be computed says why in its cell."""
    people = data.of_role("training")
    styles = exact_styles(data)
    primary, rollouts = planned_styles(data), style_rollouts(data)
    constructs = (
        *survey_constructs(data, people),
        *style_constructs(exact_styles(data, rollouts=rollouts), people, primary, rollouts),
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
    rollouts = style_rollouts(data)
    styles = exact_styles(data, rollouts=rollouts, unflagged=True)
    cells: dict[str, Any] = {"attempts_left_out": len(data.flagged)}
    for construct in style_constructs(styles, people, primary, rollouts):
        if not construct.family:
            continue
        networks = construct.networks(data)
        if construct.none or not networks:
            cells[construct.key] = empty(construct.none)
            continue
        first = networks[0]
        who, values = matched(first, construct)
        if len(who) < FEWEST:
            why = f"people with unflagged attempts: {len(who)}; {FEWEST} are needed"
            cells[construct.key] = empty(why)
            continue
        rng = rng_for(config.seed, construct.key)
        correlation = multiple_correlation(
            first.of(who), values, rng=rng, permutations=config.permutations
        )
        cells[construct.key] = plain(correlation)
    return cells


def _without_values(constructs: Sequence[Construct]) -> list[dict[str, str]]:
    """A row for everyone who counts and lacks a score or a style metric."""
    lacking: dict[str, list[str]] = {}
    for construct in constructs:
        for person, why in construct.missing.items():
            lacking.setdefault(person, []).append(f"{construct.title} ({why})")
    return [
        {"what": "values", "who": who, "why": f"counts, but has no value of {', '.join(titles)}"}
        for who, titles in lacking.items()
    ]


def _exclusions(data: StudyData, constructs: Sequence[Construct]) -> dict[str, Any]:
    return {
        "enrolled": data.enrolled,
        "analysed": {role: len(data.of_role(role)) for role in ("training", "test")},
        "training": describe_people(data.of_role("training")),
        "test": describe_people(data.of_role("test")),
        "rows": [
            *({"what": e.what, "who": e.who, "why": e.why} for e in data.exclusions),
            *_without_values(constructs),
        ],
        "flagged_attempts": [list(attempt) for attempt in sorted(data.flagged)],
        "scripted": {
            role: sum(person.scripted for person in data.of_role(role))
            for role in ("training", "test")
        },
    }


def exact_styles(
    data: StudyData, *, rollouts: Sequence[str] | None = None, unflagged: bool = False
) -> list[PersonStyle]:
    """Styles by exact DTW.

    Args:
        rollouts: only of these; None is all.
        unflagged: without attempts that broke a limit of timing.
    """
    series: Sequence[LabelSeries] = data.series
    if rollouts is not None:
        series = [s for s in series if s.rollout in rollouts]
    if unflagged:
        series = [s for s in series if (s.person, s.rollout) not in data.flagged]
    return people_styles(series, latency_s=_latencies(data))


def style_table(data: StudyData, styles: Sequence[PersonStyle], *, fastdtw: bool) -> dict[str, Any]:
    """A row a person; ``fastdtw`` adds columns by that method, radius 10, which takes minutes."""
    roles = {person.id: person.role for person in data.people}
    latency_s = _latencies(data)
    fast: dict[str, PersonStyle] = {}
    if fastdtw:
        by_fastdtw = people_styles(data.series, method="fastdtw", latency_s=latency_s)
        fast = {style.person: style for style in by_fastdtw}
    rows: list[dict[str, Any]] = []
    for style in styles:
        row: dict[str, Any] = {
            "person": style.person,
            "role": roles[style.person],
            "rollouts": len(style.rollouts),
            "latency_subtracted": style.person in latency_s,
            **{name: plain(getattr(style, name)) for name in STYLE_METRICS},
        }
        if style.person in fast:
            row |= {
                f"{name}_fastdtw": plain(getattr(fast[style.person], name))
                for name in FASTDTW_METRICS
            }
        rows.append(row)
    return {
        "method": "exact DTW" + (", and fastdtw with radius 10" if fastdtw else ""),
        "fastdtw": "computed" if fastdtw else "not computed; add --fastdtw",
        "rows": rows,
    }


def _latencies(data: StudyData) -> dict[str, float]:
    return {p.id: p.latency_s for p in data.people if p.latency_s is not None}
