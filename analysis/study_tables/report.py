"""The report of an analysis: one page that needs no other file and no network."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from steerlab.analysis.figures.study import (
    METRIC_WORDS,
    Association,
    Prediction,
    association_figure,
    error_figure,
    learning_curves_figure,
    plane_over,
    prediction_figure,
    style_figure,
)
from steerlab.analysis.page import render_page
from steerlab.analysis.study_tables.constructs import STYLES
from steerlab.analysis.study_tables.deviations import deviations, not_testable
from steerlab.analysis.study_tables.label_quality import person_errors
from steerlab.analysis.study_tables.methods import methods_text, reproducibility
from steerlab.analysis.study_tables.paper_tables import matched
from steerlab.analysis.study_tables.plain import EMPTY, is_empty
from steerlab.analysis.study_tables.reading import Reader, headline
from steerlab.analysis.study_tables.sizes import ALPHA, BANDS, CORRELATIONS
from steerlab.analysis.study_tables.tables import Analysis

_JUDGED = {"seen": "training participants", "new": "people new to the network"}
_UNITS = {
    "amplitude_total": "wheel units, summed along the path",
    "amplitude": "wheel units",
    **dict.fromkeys(("lag_plain_s", "lag_s", "voted_lag_s"), "s"),
}


@dataclass(frozen=True, kw_only=True)
class AnalysisReport:
    """All that the page shows.

    Attributes:
        files: names of the CSV files beside it.
    """

    analysis: Analysis
    versions: Mapping[str, str]
    seconds: Mapping[str, float]
    command: str
    files: tuple[str, ...]


def render_analysis(report: AnalysisReport) -> str:
    """The page; equal reports give equal text."""
    analysis = report.analysis
    tables, data = analysis.tables, analysis.data
    return render_page(
        "analysis.html.j2",
        values=tables,
        figures=_figures(analysis),
        report=report,
        data=data,
        tables=tables,
        plan=data.plan,
        headline=headline(tables),
        deviations=deviations(data, tables["hypotheses"], reasons=False),
        untested=not_testable(tables["hypotheses"]),
        methods=methods_text(analysis),
        reproducibility=reproducibility(analysis, report.versions),
        read=Reader(data.questionnaires),
        alpha=_alpha(analysis),
        fewest=SimpleNamespace(correlations=CORRELATIONS, alpha=ALPHA, bands=BANDS),
        surveys=_surveys(tables["table1"]),
        by_chance=_by_chance(tables["table2"]["rows"]),
        styles=STYLES,
        present=[role for role, people in tables["exclusions"]["analysed"].items() if people],
        quality=tables["label_quality"],
        judged=[(s, who) for s, who in _JUDGED.items() if not is_empty(tables["label_quality"][s])],
        not_judged=_not_judged(tables["label_quality"]),
        style_reasons=_style_reasons(tables["style"]["rows"]),
        banded=_banded(tables["conditions"]["metrics"]),
        **_comparison(tables["conditions"]["metrics"], Reader(data.questionnaires)),
        summary=SimpleNamespace(
            seed=analysis.config.seed, versions=report.versions, seconds=report.seconds
        ),
    )


def _figures(analysis: Analysis) -> dict[str, Figure]:
    """The figures that the data allow, by the name under which the template shows them."""
    figures: dict[str, Figure] = {}
    rows = _shown(analysis.tables["table2"]["rows"])
    chance = _by_chance(rows)
    if chance is not None and any(row["family"] for row in rows):
        figures["associations"] = association_figure(
            [_association(row, _alpha(analysis)) for row in rows if row["family"]],
            by_chance=chance,
        )
    if panels := _predictions(analysis):
        figures["predictions"] = prediction_figure(panels)
    if styles := _styles(analysis):
        figures["style"] = style_figure(styles)
    errors = {held.role: person_errors(held) for held in reversed(analysis.data.held_out)}
    if any(len(before) for before, _ in errors.values()):
        ordered = {role: errors[role] for role in ("training", "test") if role in errors}
        figures["errors"] = error_figure(ordered)
    metrics = analysis.tables["conditions"]["metrics"]
    if any(any(metric["curves"].values()) for metric in metrics.values()):
        figures["curves"] = learning_curves_figure(metrics)
    return figures


def _alpha(analysis: Analysis) -> float:
    return analysis.data.plan.alpha if analysis.data.plan else 0.05


def _association(row: Mapping[str, Any], alpha: float) -> Association:
    low, high = row["primary"]["interval"]
    return Association(
        title=row["title"],
        r=row["primary"]["r"],
        low=low,
        high=high,
        significant=row["holm"] < alpha,
    )


def _shown(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those of Table 2 that have a value from enough people."""
    return [row for row in rows if not is_empty(row["primary"]) and row["too_few"] is None]


def _by_chance(rows: Sequence[dict[str, Any]]) -> float | None:
    """R of an embedding with unrelated quantities: the root of the mean R², d / (n - 1)."""
    primary = [row["primary"] for row in _shown(rows)]
    chance = [found["dimensions"] / (found["n"] - 1) for found in primary]
    return sqrt(np.mean(chance)) if chance else None


def _not_judged(quality: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Why labels were not judged, each reason once, with whose."""
    reasons: dict[str, list[str]] = {}
    for split, who in _JUDGED.items():
        if is_empty(quality[split]):
            reasons.setdefault(quality[split][EMPTY], []).append(who)
    return list(reasons.items())


def _style_reasons(rows: Sequence[Mapping[str, Any]]) -> str:
    cells = [row[key] for row in rows for key in ("amplitude", "lag_s")]
    return "; ".join(dict.fromkeys(cell[EMPTY] for cell in cells if is_empty(cell)))


def _banded(metrics: Mapping[str, Any]) -> bool:
    """Whether a point of any curve comes from enough people for an interval."""
    curves = [curve for metric in metrics.values() for curve in metric["curves"].values()]
    return any(point["too_few"] is None for curve in curves for point in curve)


def _comparison(metrics: Mapping[str, Any], read: Reader) -> dict[str, Any]:
    """What is said once of several outcomes of conditions."""
    when: dict[str, dict[str, None]] = {}
    untested: dict[str, list[str]] = {}
    left_out: dict[str, list[str]] = {}
    for key, found in metrics.items():
        name = read.metric(key).lower() if key in METRIC_WORDS else "questionnaires"
        when.setdefault(found["tested"], {})[name] = None
        if why := read.untested(found):
            untested.setdefault(why, []).append(key)
        for one in found["left_out"]:
            who = f"{one['person']} is left out of all tests but the mixed model: {one['why']}"
            left_out.setdefault(who, []).append(read.metric(key).lower())
    if len(when) == 1:
        timing = f"{next(iter(when)).capitalize()}."
    else:
        timing = "; ".join(f"{', '.join(keys)}: {what}" for what, keys in when.items()) + "."
    return {
        "condition_names": list(dict.fromkeys(n for m in metrics.values() for n in m["means"])),
        "tested_when": timing[:1].upper() + timing[1:],
        "untested_metrics": untested,
        "left_out_of_tests": [f"{who} ({', '.join(keys)})." for who, keys in left_out.items()],
    }


def _surveys(table1: Any) -> list[dict[str, Any]]:
    """A row a scale, with ``training`` and ``test`` as in Table 1 where the role was asked."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for row in () if is_empty(table1) else table1:
        both = rows.setdefault((row["questionnaire"], row["scale"]), {"scale": row})
        both[row["role"]] = row
    return list(rows.values())


def _predictions(analysis: Analysis) -> list[Prediction]:
    panels: list[Prediction] = []
    rows = {row["key"]: row for row in analysis.tables["table2"]["rows"]}
    for construct in analysis.constructs:
        planned_style = construct.family and construct.topic in ("amplitude", "timing")
        row = rows.get(construct.key)
        if not planned_style or row is None or not _shown([row]):
            continue
        first = construct.networks(analysis.data)[0]
        people, values = matched(first, construct)
        panels.append(
            Prediction(
                title=construct.title.split(" (")[0],
                unit=_UNITS[construct.key],
                metric=values,
                by_w=plane_over(first.of(people), values),
                r=row["primary"]["r"],
            )
        )
    return panels


def _styles(analysis: Analysis) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    styles: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for role in ("training", "test"):
        rows = [row for row in analysis.tables["style"]["rows"] if row["role"] == role]
        both = [
            row for row in rows if not is_empty(row["amplitude"]) and not is_empty(row["lag_s"])
        ]
        if both:
            styles[role] = (
                np.array([row["amplitude"] for row in both]),
                np.array([row["lag_s"] for row in both]),
            )
    return styles
