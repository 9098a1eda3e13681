"""The synthetic experiment in numbers and as a page, beside what the paper reports."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import degrees
from typing import Any

from matplotlib.figure import Figure

from steerlab.analysis.page import render_page
from steerlab.analysis.summary import (
    MAPPER,
    SUMMARY_SCHEMA,
    InvalidSummary,
    SplitSummary,
    StyleSummary,
    rounded,
    summary_json,
)
from steerlab.analysis.wording import left_out_reasons, percent, percent_range, teachers

SYNTHETIC_SPLITS = ("calibration", "unseen", "new")
PAPER_PERCENT: Mapping[str, int] = {"calibration": 61, "unseen": 55}
"""Section Synthetic Experiment, Results: means of per-sample percentages, as far as it says."""

_WORDS = {
    "calibration": "calibration tasks",
    "unseen": "unseen tasks",
    "new": "unseen tasks, new people",
}


@dataclass(frozen=True, kw_only=True, slots=True)
class SyntheticSummary:
    """One synthetic experiment in numbers; ``seconds`` and ``versions`` differ between equal runs.

    Raises:
        InvalidSummary: a split is missing.
    """

    seed: int
    versions: Mapping[str, str]
    seconds: Mapping[str, float]
    splits: Mapping[str, SplitSummary]
    style: Mapping[str, StyleSummary]
    left_out: Mapping[str, str]

    def __post_init__(self) -> None:
        if set(self.splits) != set(SYNTHETIC_SPLITS):
            raise InvalidSummary(
                f"splits has {sorted(self.splits)}; give {sorted(SYNTHETIC_SPLITS)}."
            )

    def to_dict(self) -> dict[str, Any]:
        """Plain values in a fixed order, floats rounded to ``DIGITS``."""
        return rounded(
            {
                "schema": SUMMARY_SCHEMA,
                "verb": "synthetic",
                "seed": self.seed,
                "versions": dict(sorted(self.versions.items())),
                "seconds": dict(sorted(self.seconds.items())),
                "paper_percent": dict(PAPER_PERCENT),
                "splits": {name: asdict(self.splits[name]) for name in SYNTHETIC_SPLITS},
                "left_out": dict(sorted(self.left_out.items())),
                "style": {name: asdict(style) for name, style in sorted(self.style.items())},
            }
        )

    def to_json(self) -> str:
        """The summary as JSON: equal summaries give equal text."""
        return summary_json(self.to_dict())


@dataclass(frozen=True, kw_only=True)
class SyntheticReport:
    """All that the page shows.

    Attributes:
        interval: by split and then method, the 95 % interval of its improvement.
        wheel_per_rad: how labels were scaled to be learned.
        drive: name of the drive whose labels are shown.
        figure2: as ``synthetic_figure`` makes it.
    """

    summary: SyntheticSummary
    interval: Mapping[str, Mapping[str, tuple[float, float]]]
    command: str
    wheel_per_rad: float
    shift_s: float
    magnitude: tuple[float, float]
    drive: str
    figure2: Figure


def headline(summary: SyntheticSummary) -> str:
    """The main finding in one sentence."""
    new = summary.splits["new"]
    return (
        f"MIND MELD removed {percent(new.improvement[MAPPER])} of the label error of "
        f"{teachers(new.people)} it had never seen, on tasks it had never seen "
        f"(95\u202f% CI {percent_range(new.ci95)})"
    )


def comparison_lines(summary: SyntheticSummary) -> list[str]:
    """A small table for the terminal: both definitions beside the paper's figures."""
    lines = [f"{'improvement':<26}{'ratio of sums':>15}{'per-sample mean':>17}{'paper':>9}"]
    for split in SYNTHETIC_SPLITS:
        result = summary.splits[split]
        paper = f"{PAPER_PERCENT[split]} %" if split in PAPER_PERCENT else "-"
        lines.append(
            f"{_WORDS[split]:<26}{100.0 * result.improvement[MAPPER]:>13.1f} %"
            f"{result.per_sample_percent:>15.1f} %{paper:>9}"
        )
    return lines


def render_synthetic_report(report: SyntheticReport) -> str:
    """The page; equal reports give equal text."""
    summary = report.summary
    methods = sorted(
        summary.splits["new"].improvement,
        key=lambda method: -summary.splits["new"].improvement[method],
    )
    return render_page(
        "synthetic.html.j2",
        values=summary.to_dict(),
        figures={"figure2": report.figure2},
        report=report,
        summary=summary,
        splits=SYNTHETIC_SPLITS,
        methods=methods,
        left_out=left_out_reasons(summary.left_out),
        paper=PAPER_PERCENT,
        headline=headline(summary),
        degrees_per_unit=f"{degrees(1.0 / report.wheel_per_rad):.4g}",
    )
