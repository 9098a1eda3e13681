"""The reports of ``steerlab simulate`` and ``steerlab fit``: what a mapper makes of people's labels."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from matplotlib.figure import Figure

from steerlab.analysis.figures.labels import Interval
from steerlab.analysis.page import render_page
from steerlab.analysis.summary import MAPPER, SPLITS, InvalidSummary, Summary
from steerlab.analysis.wording import comparison, headline, left_out_reasons
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


@dataclass(frozen=True, kw_only=True)
class DriveCaption:
    """What the drive's figure shows: a rollout, the oracle's paths at some moments, a frame.

    Attributes:
        camera_t_s: when the frame was; None without one, which the page then says.
    """

    rollout: str
    world: str
    duration_s: float
    outcome: str
    oracle_moments_s: tuple[float, ...]
    camera_t_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class LabelsCaption:
    """Whose labels the before/after figure shows, and their mean errors in the labels' unit."""

    teacher: str
    split: str
    rollout: str
    mae_before: float
    mae_after: float

    @classmethod
    def of(
        cls,
        *,
        teacher: str,
        split: str,
        rollout: str,
        raw: FloatArray,
        mapped: FloatArray,
        truth: FloatArray,
    ) -> Self:
        """The caption for the arrays given to ``label_figure``, over steps that have all three.

        Raises:
            InvalidSummary: no step has all three labels.
        """
        known = np.isfinite(raw) & np.isfinite(mapped) & np.isfinite(truth)
        if not known.any():
            raise InvalidSummary(f"No step of {rollout!r} has a raw, a mapped and a true label.")
        return cls(
            teacher=teacher,
            split=split,
            rollout=rollout,
            mae_before=float(np.abs(raw - truth)[known].mean()),
            mae_after=float(np.abs(mapped - truth)[known].mean()),
        )


@dataclass(frozen=True, kw_only=True)
class LabelFacts:
    """What a fit read and how it was used.

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
class _MapperReport:
    """What the pages of a simulated study and of a fit share.

    Attributes:
        summary: its mean errors are in the labels' unit.
        ladder_ci95: by method and then split, the 95 % interval of its improvement.
        command: the command line that gives the same results again.
        figures: by the name under which the template shows them.

    Raises:
        InvalidSummary: a method of the summary has no interval.
    """

    summary: Summary
    ladder_ci95: Mapping[str, Mapping[str, tuple[float, float]]]
    command: str
    labels: LabelsCaption
    figures: Mapping[str, Figure]

    def __post_init__(self) -> None:
        ladder_of(self.summary, self.ladder_ci95)


@dataclass(frozen=True, kw_only=True)
class SimulationReport(_MapperReport):
    """Of a simulated study; figures: ``drive``, ``labels``, ``ladder``, ``people``, ``embeddings``."""

    drive: DriveCaption


@dataclass(frozen=True, kw_only=True)
class FitReport(_MapperReport):
    """Of a fit; figures: ``labels``, ``ladder`` and ``people``."""

    facts: LabelFacts


def ladder_of(
    summary: Summary, ladder_ci95: Mapping[str, Mapping[str, tuple[float, float]]]
) -> dict[str, dict[str, Interval]]:
    """Improvements with their intervals, as ``improvement_figure`` takes them.

    MIND MELD's own intervals are those of the summary.

    Raises:
        InvalidSummary: a method has no interval.
    """
    ladder: dict[str, dict[str, Interval]] = {}
    for method in summary.splits["new"].improvement:
        ladder[method] = {}
        for split in SPLITS:
            result = summary.splits[split]
            limits = ladder_ci95.get(method, {}).get(split)
            if method == MAPPER:
                limits = result.ci95
            if limits is None:
                raise InvalidSummary(f"{method!r} has no interval for {split} people; give one.")
            ladder[method][split] = (result.improvement[method], *limits)
    return ladder


def render_report(report: SimulationReport) -> str:
    """The page of a simulated study; equal reports give equal text."""
    splits = report.summary.splits
    return _render("simulation.html.j2", report, new=splits["new"], seen=splits["seen"])


def render_fit_report(report: FitReport) -> str:
    """The page of a fit; equal reports give equal text."""
    return _render("fit.html.j2", report, facts=report.facts)


def _render(template: str, report: _MapperReport, **names: Any) -> str:
    summary = report.summary
    ladder = ladder_of(summary, report.ladder_ci95)
    return render_page(
        template,
        values=summary.to_dict(),
        figures=report.figures,
        report=report,
        summary=summary,
        headline=headline(summary),
        comparison=comparison(summary),
        left_out=left_out_reasons(summary.left_out),
        ladder=sorted(ladder.items(), key=lambda item: -item[1]["new"][0]),
        **names,
    )
