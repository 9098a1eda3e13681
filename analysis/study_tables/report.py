"""The report of an analysis: one page that needs no other file and no network."""

from collections.abc import Mapping
from dataclasses import dataclass, make_dataclass
from math import sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from steerlab.analysis.figures.associations import (
    Association,
    Prediction,
    association_figure,
    plane_over,
    prediction_figure,
)
from steerlab.analysis.figures.study import error_figure, learning_curves_figure, style_figure
from steerlab.analysis.page import render_page
from steerlab.analysis.study_tables.deviations import deviations
from steerlab.analysis.study_tables.label_quality import person_errors
from steerlab.analysis.study_tables.methods_text import methods_text
from steerlab.analysis.study_tables.plain import is_empty
from steerlab.analysis.study_tables.reading import Reader, headline
from steerlab.analysis.study_tables.table2 import matched
from steerlab.analysis.study_tables.tables import Analysis


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
    figures = _figures(analysis)
    holder = make_dataclass("Figures", [(name, Figure) for name in figures])(**figures)
    return render_page(
        "analysis.html.j2",
        values=tables,
        figures=holder,
        report=report,
        data=data,
        tables=tables,
        plan=data.plan,
        headline=headline(tables),
        deviations=deviations(data, tables["hypotheses"]),
        methods=methods_text(analysis, report.versions),
        read=Reader(data.questionnaires),
        summary=SimpleNamespace(
            seed=analysis.config.seed, versions=report.versions, seconds=report.seconds
        ),
    )


def _figures(analysis: Analysis) -> dict[str, Figure]:
    """Those that the data allow."""
    found: dict[str, Figure] = {}
    rows = [row for row in analysis.tables["table2"]["rows"] if not is_empty(row["primary"])]
    if rows:
        found["associations"] = association_figure(
            [_association(row, _alpha(analysis)) for row in rows if row["family"]],
            by_chance=sqrt(np.mean([_chance(row) for row in rows])),
        )
    if panels := _predictions(analysis):
        found["predictions"] = prediction_figure(panels)
    if styles := _styles(analysis):
        found["style"] = style_figure(styles)
    errors = {one.role: person_errors(one) for one in reversed(analysis.data.held_out)}
    if any(len(before) for before, _ in errors.values()):
        ordered = {role: errors[role] for role in ("training", "test") if role in errors}
        found["errors"] = error_figure(ordered)
    metrics = analysis.tables["conditions"]["metrics"]
    if any(any(one["curves"].values()) for one in metrics.values()):
        found["curves"] = learning_curves_figure(metrics)
    return found


def _alpha(analysis: Analysis) -> float:
    return analysis.data.plan.alpha if analysis.data.plan else 0.05


def _association(row: Mapping[str, Any], alpha: float) -> Association:
    low, high = row["primary"]["interval"]
    return Association(
        title=row["title"], r=row["primary"]["r"], low=low, high=high, found=row["holm"] < alpha
    )


def _chance(row: Mapping[str, Any]) -> float:
    """R² that the embedding explains of nothing, on average: d / (n - 1)."""
    return row["primary"]["dimensions"] / (row["primary"]["n"] - 1)


def _predictions(analysis: Analysis) -> list[Prediction]:
    found: list[Prediction] = []
    rows = {row["key"]: row for row in analysis.tables["table2"]["rows"]}
    for one in analysis.constructs:
        wanted = one.family and one.topic in ("amplitude", "timing") and one.key in rows
        if not wanted or is_empty(rows[one.key]["primary"]):
            continue
        first = analysis.data.embeddings[0]
        people, values = matched(first, one)
        found.append(
            Prediction(
                title=one.title.split(" (")[0],
                metric=values,
                by_w=plane_over(first.of(people), values),
                r=rows[one.key]["primary"]["r"],
            )
        )
    return found


def _styles(analysis: Analysis) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for role in ("training", "test"):
        rows = [row for row in analysis.tables["style"]["rows"] if row["role"] == role]
        both = [
            row for row in rows if not is_empty(row["amplitude"]) and not is_empty(row["lag_s"])
        ]
        if both:
            found[role] = (
                np.array([row["amplitude"] for row in both]),
                np.array([row["lag_s"] for row in both]),
            )
    return found
