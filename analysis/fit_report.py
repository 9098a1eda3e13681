"""The report of ``steerlab fit``: what a mapper makes of someone's own labels."""

from collections.abc import Mapping
from dataclasses import dataclass

from matplotlib.figure import Figure

from steerlab.analysis.page import render_page
from steerlab.analysis.report import LabelsCaption, ladder_of
from steerlab.analysis.summary import Summary
from steerlab.analysis.wording import comparison, headline, left_out_reasons
from steerlab.sim.vehicle import WHEEL_LIMIT


@dataclass(frozen=True, kw_only=True)
class LabelFacts:
    """What was read and how it was used.

    Attributes:
        file: the label file's name, without its folder.
        labels: rows with both label and truth.
        rates_hz: lowest and highest rate of the rollouts.
        limit: labels are within ± this, in the file's units.
        folds: how often the mapper was fitted on a part; None: the file's own split was used.
        notices: what was left out or masked, in sentences.
    """

    file: str
    people: int
    rollouts: int
    labels: int
    rates_hz: tuple[float, float]
    limit: float
    folds: int | None
    preset: str
    notices: tuple[str, ...]

    @property
    def rate(self) -> str:
        """The rate in words: one number, or a range."""
        low, high = (f"{rate:g}" for rate in self.rates_hz)
        return f"{low} Hz" if low == high else f"{low} to {high} Hz"

    @property
    def scaled(self) -> bool:
        """Whether the labels had to be scaled to be learned from."""
        return self.limit != WHEEL_LIMIT


@dataclass(frozen=True, kw_only=True)
class FitFigures:
    """The figures, as the functions of ``steerlab.analysis.figures`` make them."""

    labels: Figure
    ladder: Figure
    people: Figure


@dataclass(frozen=True, kw_only=True)
class FitReport:
    """All that the page shows.

    Attributes:
        summary: its mean errors are in the file's units.
        ladder_ci95: by method and then split, the 95 % interval of its improvement.
        labels: whose labels are shown, in the file's units.

    Raises:
        InvalidSummary: a method of the summary has no interval.
    """

    summary: Summary
    ladder_ci95: Mapping[str, Mapping[str, tuple[float, float]]]
    command: str
    facts: LabelFacts
    labels: LabelsCaption
    figures: FitFigures

    def __post_init__(self) -> None:
        ladder_of(self.summary, self.ladder_ci95)


def render_fit_report(report: FitReport) -> str:
    """The page; equal reports give equal text."""
    summary = report.summary
    ladder = ladder_of(summary, report.ladder_ci95)
    return render_page(
        "fit.html.j2",
        values=summary.to_dict(),
        figures=report.figures,
        report=report,
        facts=report.facts,
        summary=summary,
        headline=headline(summary),
        comparison=comparison(summary),
        left_out=left_out_reasons(summary.left_out),
        ladder=sorted(ladder.items(), key=lambda item: -item[1]["new"][0]),
    )
