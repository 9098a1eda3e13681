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

from steerlab.analysis.fit_report import LabelFacts, render_fit_report
from steerlab.analysis.summary import Summary
from steerlab.app.fit_report import compose_report, summarise
from steerlab.app.population_run import Ladder
from steerlab.learning import certainty
from steerlab.learning.checkpoint import save_mapper
from steerlab.learning.cross_validation import CrossValidation, cross_validate
from steerlab.learning.folds import FoldPlan, plan_folds
from steerlab.learning.label_file import read_label_columns
from steerlab.learning.label_table import LabelScale, LabelTable, label_table
from steerlab.learning.presets import preset
from steerlab.learning.training_budget import Progress, fit_within_budget
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.output_folder import output_folder
from steerlab.sim.vehicle import WHEEL_LIMIT


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """How a label table is read, held out and learned."""

    folds: int = 4
    preset: str = "lab"
    ladder: Ladder = "full"
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
        if self.ladder not in get_args(Ladder):
            raise InvalidConfig(
                f"ladder is {self.ladder!r}; choose one of {', '.join(get_args(Ladder))}."
            )
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
        for part in ("models", "report"):
            (folder / part).mkdir()
        save_mapper(mapper, folder / "models" / "mind_meld.safetensors")
        pq.write_table(mapped_table(table, result), folder / "mapped.parquet", compression="zstd")
        progress("writing the report", 0.0)
        seconds["before_report"] = perf_counter() - started
        summary = summarise(result, table, config.seed, seconds)
        facts = _facts(labels.name, table, plan, result, config)
        page = render_fit_report(compose_report(result, summary, facts, command))
        (folder / "report" / "index.html").write_text(page, encoding="utf-8")
        (folder / "summary.json").write_text(summary.to_json(), encoding="utf-8")
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

    def names(values: Sequence[str]) -> pa.DictionaryArray:
        code = {name: index for index, name in enumerate(dict.fromkeys(values))}
        rows = np.repeat(np.array([code[value] for value in values], dtype=np.int32), lengths)
        return pa.DictionaryArray.from_arrays(pa.array(rows), pa.array(list(code), pa.string()))

    return pa.table(
        {
            "person": names([one.series.person for one in table.given]),
            "rollout": names([one.series.rollout for one in table.given]),
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


def _facts(
    file: str, table: LabelTable, plan: FoldPlan, result: CrossValidation, config: FitConfig
) -> LabelFacts:
    rates = [one.series.rate_hz for one in table.given]
    return LabelFacts(
        file=file,
        people=len({one.series.person for one in table.given}),
        rollouts=len(table.given),
        labels=sum(int(one.series.valid.sum()) for one in table.given),
        rates_hz=(min(rates), max(rates)),
        limit=config.limit,
        folds=None if table.has_split else len(plan.folds),
        preset=config.preset,
        notices=(*table.notices, *plan.notices, *result.notices),
    )


@contextmanager
def _without_warnings(log: logging.Logger) -> Iterator[None]:
    before = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(before)
