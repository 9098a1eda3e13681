"""``steerlab fit``: train, cross-validate and report on any label table."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from steerlab.analysis.figures import improvement_figure, label_figure, people_figure
from steerlab.analysis.fit_report import FitFigures, FitReport, LabelFacts, render_fit_report
from steerlab.analysis.report import LabelsCaption, ladder_of
from steerlab.analysis.summary import SPLITS, SplitSummary, StyleSummary, Summary
from steerlab.learning.checkpoint import save_mapper
from steerlab.learning.cross_validation import (
    CrossValidation,
    Prediction,
    Progress,
    cross_validate,
    fit_within_budget,
)
from steerlab.learning.folds import FoldPlan, plan_folds
from steerlab.learning.label_file import read_label_columns
from steerlab.learning.label_table import LabelScale, LabelTable, label_table
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.presets import preset
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.output_folder import output_folder
from steerlab.teleop.provenance import versions


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """How a label table is read, held out and learned."""

    folds: int = 4
    preset: str = "lab"
    seed: int = 0
    limit: float = WHEEL_LIMIT
    rate_hz: float | None = None

    def __post_init__(self) -> None:
        for name, least in (("folds", 2), ("seed", 0)):
            if getattr(self, name) < least:
                raise InvalidConfig(
                    f"{name} is {getattr(self, name)}; it must be at least {least}."
                )
        preset(self.preset)
        self.scale  # noqa: B018  checks limit and rate

    @property
    def scale(self) -> LabelScale:
        """Range and rate of the labels."""
        return LabelScale(limit=self.limit, rate_hz=self.rate_hz)


def fit(
    labels: Path, config: FitConfig, out: Path, *, force: bool, command: str, progress: Progress
) -> Summary:
    """Learn from the file ``labels`` and write ``out``.

    Layout: ``mapped.parquet`` (each held-out label as mapped), ``models/mind_meld.safetensors``,
    ``report/index.html``, ``summary.json``.

    Args:
        command: the command line, for the report.

    Raises:
        SteerlabError: bad input or no place to write; nothing is left behind.
    """
    started = perf_counter()
    with output_folder(out, force=force) as folder:
        progress("reading labels", 0.0)
        table = label_table(read_label_columns(labels), config.scale)
        progress("reading labels", 1.0)
        plan = plan_folds(table, config.folds, config.seed)
        read_s = perf_counter() - started
        settings = preset(config.preset)
        result = cross_validate(plan, settings, seed=config.seed, progress=progress)
        final_started = perf_counter()
        mapper = _final(plan, config, progress)
        seconds = {
            "read": read_s,
            **result.seconds,
            "final_fit": perf_counter() - final_started,
        }
        for part in ("models", "report"):
            (folder / part).mkdir()
        save_mapper(mapper, folder / "models" / "mind_meld.safetensors")
        pq.write_table(mapped_table(table, result), folder / "mapped.parquet", compression="zstd")
        progress("writing the report", 0.0)
        seconds["before_report"] = perf_counter() - started
        summary = _summary(result, table, config, seconds)
        page = render_fit_report(_report(labels, table, plan, result, summary, config, command))
        (folder / "report" / "index.html").write_text(page)
        (folder / "summary.json").write_text(summary.to_json())
        progress("writing the report", 1.0)
    return summary


def mapped_table(table: LabelTable, result: CrossValidation) -> pa.Table:
    """A row for each of the file's, by person, rollout and step; in the file's units.

    ``mapped`` is null where the label was never held out or the file has none; ``fold`` counts from
    1, and is null likewise, as is ``scored_as`` (``seen`` or ``new``).
    """
    known = {(one.series.person, one.series.rollout): one for one in result.predictions}
    found = [known.get((one.series.person, one.series.rollout)) for one in table.given]
    lengths = np.array([len(one.steps) for one in table.given])
    unit = 1.0 / table.scale.wheel_per_unit

    def column(values: Sequence[FloatArray]) -> pa.Array:
        return pa.array(np.concatenate(values), from_pandas=True)  # NaN becomes null

    def by_series(values: Sequence[str | int | None], kind: pa.DataType) -> pa.Array:
        rows = pa.array(np.repeat(np.arange(len(values)), lengths))
        return pa.array(values, type=kind).take(rows)

    text = pa.dictionary(pa.int32(), pa.string())
    return pa.table(
        {
            "person": by_series([one.series.person for one in table.given], pa.string()).cast(text),
            "rollout": by_series([one.series.rollout for one in table.given], pa.string()).cast(
                text
            ),
            "step": pa.array(np.concatenate([one.steps for one in table.given])),
            "label": column([unit * one.series.label[one.rows] for one in table.given]),
            "truth": column([unit * one.series.truth[one.rows] for one in table.given]),
            "mapped": column(
                [
                    unit * prediction.mapped[one.rows]
                    if prediction
                    else np.full(len(one.steps), np.nan)
                    for one, prediction in zip(table.given, found, strict=True)
                ]
            ),
            "scored_as": by_series([one and one.split for one in found], pa.string()),
            "fold": by_series([one and one.fold for one in found], pa.int32()),
        }
    )


def _final(plan: FoldPlan, config: FitConfig, progress: Progress) -> MindMeldMapper:
    mapper, _ = fit_within_budget(
        plan.fit, preset(config.preset), seed=config.seed, what="final model", progress=progress
    )
    if plan.calibrate:
        mapper.calibrate(plan.calibrate)
    return mapper


def _summary(
    result: CrossValidation, table: LabelTable, config: FitConfig, seconds: dict[str, float]
) -> Summary:
    unit = 1.0 / table.scale.wheel_per_unit
    splits: dict[str, SplitSummary] = {}
    for split in SPLITS:
        best = result.quality[split]["mind_meld"]
        splits[split] = SplitSummary(
            people=best.people,
            labels=best.labels,
            mae_before=unit * best.mae_before,
            mae_after=unit * best.mae_after,
            improvement={name: one.improvement for name, one in result.quality[split].items()},
            ci95=best.ci95,
            person_median=best.person_median,
            people_improved=best.people_improved,
            labels_worsened=best.labels_worsened,
            per_sample_percent=best.per_sample_percent,
        )
    unknown = StyleSummary(probe_r2=None, spearman_new=None)  # a file does not tell true styles
    return Summary(
        verb="fit",
        seed=config.seed,
        noise="as recorded",
        versions=versions(),
        seconds=seconds,
        splits=splits,
        style={"gain": unknown, "delay": unknown},
    )


def _report(
    labels: Path,
    table: LabelTable,
    plan: FoldPlan,
    result: CrossValidation,
    summary: Summary,
    config: FitConfig,
    command: str,
) -> FitReport:
    ladder_ci95 = {
        name: {split: result.quality[split][name].ci95 for split in SPLITS}
        for name in result.quality["new"]
    }
    errors = {split: _people_errors(result.predictions, split, config.limit) for split in SPLITS}
    caption, figure = _example(result.predictions, errors["new"], config.limit)
    rates = [one.series.rate_hz for one in table.given]
    return FitReport(
        summary=summary,
        ladder_ci95=ladder_ci95,
        command=command,
        facts=LabelFacts(
            file=labels.name,
            people=len({one.series.person for one in table.given}),
            rollouts=len(table.given),
            labels=sum(int(one.series.valid.sum()) for one in table.given),
            rates_hz=(min(rates), max(rates)),
            limit=config.limit,
            folds=None if table.has_split else len(plan.folds),
            preset=config.preset,
            notices=(*table.notices, *plan.notices, *result.notices),
        ),
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
