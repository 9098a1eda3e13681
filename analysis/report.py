"""The report of a simulated study: one HTML page that needs no other file and no network."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from matplotlib.figure import Figure

from steerlab.analysis.figures.ladder import Interval
from steerlab.analysis.page import render_page
from steerlab.analysis.summary import MAPPER, SPLITS, InvalidSummary, Summary
from steerlab.analysis.wording import comparison, headline, left_out_reasons
from steerlab.sim.arrays import FloatArray


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
    """Whose labels the before/after figure shows, and their mean errors in wheel units."""

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
class ReportFigures:
    """The five figures, as the functions of ``steerlab.analysis.figures`` make them."""

    drive: Figure
    labels: Figure
    ladder: Figure
    people: Figure
    embeddings: Figure


@dataclass(frozen=True, kw_only=True)
class SimulationReport:
    """All that the page shows.

    Attributes:
        ladder_ci95: by method and then split, the 95 % interval of its improvement.
        command: the command line that made the study, for whoever wants to make it again.

    Raises:
        InvalidSummary: a method of the summary has no interval.
    """

    summary: Summary
    ladder_ci95: Mapping[str, Mapping[str, tuple[float, float]]]
    command: str
    drive: DriveCaption
    labels: LabelsCaption
    figures: ReportFigures

    def __post_init__(self) -> None:
        ladder_of(self.summary, self.ladder_ci95)


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
    """The page; equal reports give equal text."""
    summary = report.summary
    ladder = ladder_of(summary, report.ladder_ci95)
    return render_page(
        "simulation.html.j2",
        values=summary.to_dict(),
        figures=report.figures,
        report=report,
        summary=summary,
        new=summary.splits["new"],
        seen=summary.splits["seen"],
        headline=headline(summary),
        comparison=comparison(summary),
        left_out=left_out_reasons(summary.left_out),
        ladder=sorted(ladder.items(), key=lambda item: -item[1]["new"][0]),
    )
