"""The report of a power analysis: curves, sample sizes, and every assumption behind them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from matplotlib.figure import Figure

from steerlab.analysis.figures.power import power_figure
from steerlab.analysis.page import render_page
from steerlab.analysis.power_study.curves import PowerCurve
from steerlab.analysis.power_study.design import PowerDesign
from steerlab.analysis.study_tables.reading import Reader


@dataclass(frozen=True, kw_only=True)
class PowerReport:
    """All that the page shows; ``taught`` says where people's outcomes were drawn from, if so."""

    design: PowerDesign
    curves: Sequence[PowerCurve]
    taught: str
    versions: Mapping[str, str]
    seconds: Mapping[str, float]
    command: str


@dataclass(frozen=True, kw_only=True)
class _Figures:
    power: Figure


def render_power(report: PowerReport) -> str:
    """The page; equal reports give equal text."""
    values: list[dict[str, Any]] = [curve.values() for curve in report.curves]
    return render_page(
        "power.html.j2",
        values={"curves": values},
        figures=_Figures(power=power_figure(report.curves)),
        report=report,
        design=report.design,
        curves=values,
        read=Reader(),
        summary=SimpleNamespace(
            seed=report.design.seed, versions=report.versions, seconds=report.seconds
        ),
    )


def needed_text(cell: Mapping[str, Any]) -> str:
    """A sample size with its Monte-Carlo range; ``cell`` has one."""
    if cell["at_most"]:
        return f"≤ {cell['people']}"
    if cell["high"] is None:
        return f"{cell['people']} (from {cell['low']})"
    return f"{cell['people']} ({cell['low']}–{cell['high']})"
