"""The report of an analysis: one page that needs no other file and no network."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from steerlab.analysis.figures.study import (
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
from steerlab.analysis.study_tables.label_quality import person_errors
from steerlab.analysis.study_tables.methods import deviations, methods_text
from steerlab.analysis.study_tables.paper_tables import matched
from steerlab.analysis.study_tables.plain import is_empty
from steerlab.analysis.study_tables.reading import Reader, headline
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
    return render_page(
        "analysis.html.j2",
        values=tables,
        figures=_figures(analysis),
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
    """The figures that the data allow, by the name under which the template shows them."""
    figures: dict[str, Figure] = {}
    rows = [row for row in analysis.tables["table2"]["rows"] if not is_empty(row["primary"])]
    if rows:
        figures["associations"] = association_figure(
            [_association(row, _alpha(analysis)) for row in rows if row["family"]],
            by_chance=sqrt(np.mean([_chance(row) for row in rows])),
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


def _chance(row: Mapping[str, Any]) -> float:
    """Mean R² of an embedding with a quantity unrelated to it: d / (n - 1)."""
    return row["primary"]["dimensions"] / (row["primary"]["n"] - 1)


def _predictions(analysis: Analysis) -> list[Prediction]:
    panels: list[Prediction] = []
    rows = {row["key"]: row for row in analysis.tables["table2"]["rows"]}
    for construct in analysis.constructs:
        planned_style = construct.family and construct.topic in ("amplitude", "timing")
        row = rows.get(construct.key)
        if not planned_style or row is None or is_empty(row["primary"]):
            continue
        first = analysis.data.embeddings[0]
        people, values = matched(first, construct)
        panels.append(
            Prediction(
                title=construct.title.split(" (")[0],
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
