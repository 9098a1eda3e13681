"""``steerlab fit``: train, cross-validate and report on any label table."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from matplotlib.figure import Figure

from steerlab.analysis.figures import improvement_figure, label_figure, people_figure
from steerlab.analysis.mapper_report import (
    FitReport,
    LabelFacts,
    LabelsCaption,
    ladder_of,
    render_fit_report,
)
from steerlab.analysis.summary import SPLITS, SplitSummary, StyleSummary, Summary
from steerlab.app.population_run import Ladder
from steerlab.learning import certainty
from steerlab.learning.checkpoint import save_mapper
from steerlab.learning.cross_validation import CrossValidation, Prediction, cross_validate
from steerlab.learning.label_file import read_label_columns
from steerlab.learning.label_table import LabelScale, LabelTable, label_table
from steerlab.learning.presets import preset
from steerlab.learning.splits import FoldPlan, plan_folds
from steerlab.learning.training_budget import fit_within_budget
from steerlab.learning.windows import WindowConfig
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.output_folder import output_folder
from steerlab.sim.files.provenance import versions
from steerlab.sim.progress import Progress
from steerlab.sim.vehicle import WHEEL_LIMIT

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """How a label table is read, held out and learned."""

    folds: int = 4
    preset: str = "lab"
    ladder: Ladder = "full"
    seed: int = 0
    limit: float = WHEEL_LIMIT
    rate_hz: float | None = None
    gain: float | None = None

    def __post_init__(self) -> None:
        for name, least in (("folds", 2), ("seed", 0)):
            if getattr(self, name) < least:
                raise InvalidConfig(
                    f"{name} is {getattr(self, name)}; it must be at least {least}."
                )
        preset(self.preset)
        if self.ladder not in get_args(Ladder):
            raise InvalidConfig(
                f"ladder is {self.ladder!r}; choose one of {', '.join(get_args(Ladder))}."
            )
        self.scale  # noqa: B018  checks limit, rate and gain

    @property
    def scale(self) -> LabelScale:
        """Range and rate of the labels; gain of what was tracked."""
        return LabelScale(limit=self.limit, rate_hz=self.rate_hz, gain=self.gain)


def fit(
    labels: Path, config: FitConfig, out: Path, *, force: bool, command: str, progress: Progress
) -> Summary:
    """Learn from the file ``labels`` and write ``out``.

    Layout: ``mapped.parquet`` (each held-out label as mapped), ``models/mind_meld.safetensors``,
    ``report/index.html``, ``summary.json``.

    People unlike the others are named in the report, not in warnings: folds would repeat them.

    Args:
        command: the command line, for the report.

    Raises:
        SteerlabError: bad input or no place to write; nothing is left behind.
    """
    started = perf_counter()
    with output_folder(out, force=force) as folder, _without_warnings(certainty.log):
        progress("reading labels", 0.0)
        table = label_table(read_label_columns(labels), config.scale)
        progress("reading labels", 1.0)
        plan = plan_folds(table, config.folds, config.seed)
        too_short = _too_short(plan, preset(config.preset).window)
        read_s = perf_counter() - started
        result = cross_validate(
            plan,
            preset(config.preset),
            seed=config.seed,
            progress=progress,
            full=config.ladder == "full",
        )
        final_started = perf_counter()
        mapper = result.mapper
        if plan.fit is not None:
            mapper = fit_within_budget(
                plan.fit,
                preset(config.preset),
                seed=config.seed,
                what="final model",
                progress=progress,
            )
        seconds = {
            "read": read_s,
            **result.seconds,
            "final_fit": perf_counter() - final_started,
        }
        for name in ("models", "report"):
            (folder / name).mkdir()
        save_mapper(mapper, folder / "models" / "mind_meld.safetensors")
        pq.write_table(mapped_table(table, result), folder / "mapped.parquet", compression="zstd")
        progress("writing the report", 0.0)
        seconds["before_report"] = perf_counter() - started
        summary = summarise(result, table, config.seed, seconds)
        facts = _facts(labels.name, table, plan, result, config, too_short)
        page = render_fit_report(compose_report(result, summary, facts, command))
        (folder / "report" / "index.html").write_text(page, encoding="utf-8")
        (folder / "summary.json").write_text(summary.to_json(), encoding="utf-8")
        progress("writing the report", 1.0)
    for notice in too_short:  # after the progress bar, above the headline
        _log.warning("%s", notice)
    return summary


def mapped_table(table: LabelTable, result: CrossValidation) -> pa.Table:
    """A row for each row of the file, by person, rollout and step; in the file's units.

    ``mapped`` is null where the label was never held out or the file has none; ``fold`` counts from
    1, and is null likewise, as is ``scored_as`` (``seen`` or ``new``).
    """
    known = {(p.series.person, p.series.rollout): p for p in result.predictions}
    predictions = [known.get((given.series.person, given.series.rollout)) for given in table.given]
    lengths = np.array([len(given.steps) for given in table.given])
    unit = 1.0 / table.scale.wheel_per_unit

    def column(values: Sequence[FloatArray]) -> pa.Array:
        return pa.array(np.concatenate(values), from_pandas=True)  # NaN becomes null

    def by_series(values: Sequence[str | int | None], kind: pa.DataType) -> pa.Array:
        rows = pa.array(np.repeat(np.arange(len(values)), lengths))
        return pa.array(values, type=kind).take(rows)

    def names(values: Sequence[str]) -> pa.DictionaryArray:
        code = {name: index for index, name in enumerate(dict.fromkeys(values))}
        rows = np.repeat(np.array([code[value] for value in values], dtype=np.int32), lengths)
        return pa.DictionaryArray.from_arrays(pa.array(rows), pa.array(list(code), pa.string()))

    return pa.table(
        {
            "person": names([given.series.person for given in table.given]),
            "rollout": names([given.series.rollout for given in table.given]),
            "step": pa.array(np.concatenate([given.steps for given in table.given])),
            "label": column([unit * given.series.label[given.rows] for given in table.given]),
            "truth": column([unit * given.series.truth[given.rows] for given in table.given]),
            "mapped": column(
                [
                    unit * prediction.mapped[given.rows]
                    if prediction
                    else np.full(len(given.steps), np.nan)
                    for given, prediction in zip(table.given, predictions, strict=True)
                ]
            ),
            "scored_as": by_series([p and p.split for p in predictions], pa.string()),
            "fold": by_series([p and p.fold for p in predictions], pa.int32()),
        }
    )


def _too_short(plan: FoldPlan, window: WindowConfig) -> list[str]:
    """A sentence if rollouts that are scored have fewer valid labels than a window has room for."""
    scored = [one for fold in plan.folds for one in (*fold.held_out_seen, *fold.held_out_new)]
    short = [one for one in scored if one.valid.sum() < 2.0 * window.reach_steps(one.rate_hz)]
    if not short:
        return []
    fewest = min(short, key=lambda one: int(one.valid.sum()))
    return [
        f"{len(short)} of {len(scored)} held-out rollouts have fewer valid labels than MIND MELD's "
        f"window of {window.span} has room for ({fewest.rollout!r} of {fewest.person!r}: "
        f"{int(fewest.valid.sum())} at {fewest.rate_hz:g} Hz). What was removed there says little; "
        f"record longer rollouts."
    ]


def _facts(
    file: str,
    table: LabelTable,
    plan: FoldPlan,
    result: CrossValidation,
    config: FitConfig,
    too_short: list[str],
) -> LabelFacts:
    series = [given.series for given in table.given]
    rates = [s.rate_hz for s in series]
    return LabelFacts(
        file=file,
        people=len({s.person for s in series}),
        rollouts=len(series),
        labels=sum(int(s.valid.sum()) for s in series),
        rates_hz=(min(rates), max(rates)),
        limit=config.limit,
        folds=None if table.has_split else len(plan.folds),
        preset=config.preset,
        notices=(*table.notices, *plan.notices, *too_short, *result.notices),
    )


@contextmanager
def _without_warnings(log: logging.Logger) -> Iterator[None]:
    before = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(before)


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
    result: CrossValidation, summary: Summary, facts: LabelFacts, command: str
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
        figures={
            "labels": figure,
            "ladder": improvement_figure(ladder_of(summary, ladder_ci95)),
            "people": people_figure(
                {
                    split: tuple(np.array(list(people.values())).T)
                    for split, people in errors.items()
                }
            ),
        },
    )


def _people_errors(
    predictions: Sequence[Prediction], split: str, limit: float
) -> dict[str, tuple[float, float]]:
    """By person, the mean error before and after, in the file's units."""
    sums: dict[str, FloatArray] = {}
    for prediction in predictions:
        if prediction.split == split:
            series = prediction.series
            before = np.abs(series.label - series.truth)[series.valid]
            after = np.abs(prediction.mapped - series.truth)[series.valid]
            total = sums.setdefault(series.person, np.zeros(3))
            total += before.sum(), after.sum(), len(before)
    unit = limit / WHEEL_LIMIT
    return {
        person: (unit * before / labels, unit * after / labels)
        for person, (before, after, labels) in sorted(sums.items())
    }


def _example(
    predictions: Sequence[Prediction], errors: dict[str, tuple[float, float]], limit: float
) -> tuple[LabelsCaption, Figure]:
    """Labels before and after of the new person whose improvement is the median one."""
    ranked = sorted(errors, key=lambda person: errors[person][1] / max(errors[person][0], 1e-12))
    person = ranked[len(ranked) // 2]
    shown = next(p for p in predictions if p.split == "new" and p.series.person == person)
    series, unit = shown.series, limit / WHEEL_LIMIT
    label, mapped, truth = (unit * values for values in (series.label, shown.mapped, series.truth))
    caption = LabelsCaption.of(
        teacher=person, split="new", rollout=series.rollout, raw=label, mapped=mapped, truth=truth
    )
    t_s = np.arange(series.steps) / series.rate_hz
    return caption, label_figure(t_s, label, mapped, truth, saturation=limit)
