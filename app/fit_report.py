"""From a cross-validated label table to its summary, its figures and its report."""

from collections.abc import Sequence

import numpy as np

from steerlab.analysis.figures import improvement_figure, label_figure, people_figure
from steerlab.analysis.fit_report import FitFigures, FitReport, LabelFacts
from steerlab.analysis.report import LabelsCaption, ladder_of
from steerlab.analysis.summary import SPLITS, SplitSummary, StyleSummary, Summary
from steerlab.learning.cross_validation import CrossValidation, Prediction
from steerlab.learning.label_table import LabelTable
from steerlab.sim.arrays import FloatArray
from steerlab.sim.files.provenance import versions
from steerlab.sim.vehicle import WHEEL_LIMIT


def summarise(
    result: CrossValidation, table: LabelTable, seed: int, seconds: dict[str, float]
) -> Summary:
    """The numbers of ``summary.json``; mean errors are in the file's units."""
    unit = 1.0 / table.scale.wheel_per_unit
    unknown = StyleSummary(probe_r2=None, spearman_new=None)  # a file does not tell true styles
    return Summary(
        verb="fit",
        seed=seed,
        noise="as recorded",
        versions=versions(),
        seconds=seconds,
        splits={split: SplitSummary.of(result.quality[split], unit) for split in SPLITS},
        left_out=result.left_out,
        style={"gain": unknown, "delay": unknown},
    )


def compose_report(
    result: CrossValidation,
    summary: Summary,
    facts: LabelFacts,
    command: str,
) -> FitReport:
    """The report of a fit."""
    ladder_ci95 = {
        name: {split: result.quality[split][name].ci95 for split in SPLITS}
        for name in result.quality["new"]
    }
    errors = {split: _people_errors(result.predictions, split, facts.limit) for split in SPLITS}
    caption, figure = _example(result.predictions, errors["new"], facts.limit)
    return FitReport(
        summary=summary,
        ladder_ci95=ladder_ci95,
        command=command,
        facts=facts,
        labels=caption,
        figures=FitFigures(
            labels=figure,
            ladder=improvement_figure(ladder_of(summary, ladder_ci95)),
            people=people_figure(
                {
                    split: (
                        np.array([before for before, _ in of.values()]),
                        np.array([after for _, after in of.values()]),
                    )
                    for split, of in errors.items()
                }
            ),
        ),
    )


def _people_errors(
    predictions: Sequence[Prediction], split: str, limit: float
) -> dict[str, tuple[float, float]]:
    """By person, the mean error before and after, in the file's units."""
    sums: dict[str, FloatArray] = {}
    for one in predictions:
        if one.split == split:
            series = one.series
            before = np.abs(series.label - series.truth)[series.valid]
            after = np.abs(one.mapped - series.truth)[series.valid]
            total = sums.setdefault(series.person, np.zeros(3))
            total += before.sum(), after.sum(), len(before)
    unit = limit / WHEEL_LIMIT
    return {
        person: (unit * before / labels, unit * after / labels)
        for person, (before, after, labels) in sorted(sums.items())
    }


def _example(
    predictions: Sequence[Prediction], errors: dict[str, tuple[float, float]], limit: float
):
    """Before and after for the new person whose improvement is the median one."""
    ranked = sorted(errors, key=lambda person: errors[person][1] / max(errors[person][0], 1e-12))
    person = ranked[len(ranked) // 2]
    shown = next(one for one in predictions if one.split == "new" and one.series.person == person)
    series, unit = shown.series, limit / WHEEL_LIMIT
    label, mapped, truth = (unit * v for v in (series.label, shown.mapped, series.truth))
    caption = LabelsCaption.of(
        teacher=person, split="new", rollout=series.rollout, raw=label, mapped=mapped, truth=truth
    )
    t_s = np.arange(series.steps) / series.rate_hz
    return caption, label_figure(t_s, label, mapped, truth, saturation=limit)
